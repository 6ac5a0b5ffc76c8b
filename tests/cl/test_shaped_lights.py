"""Directions to lights that are objects of their own: samples against their density, and that against 1."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import SIGNIFICANCE, call, chi_square, direction_p_value, uniforms

from incpt.core import layout
from incpt.scene.light import Light
from incpt.tables.shaped_lights import shaped_planes

Array = npt.NDArray[np.floating]
SAMPLES = 50_000
"""So few that the density at the edges of a light is known well enough from a grid."""

LIGHTS = {
    "near rectangle": Light("l", "rectangle", (0.2, 0.4, 0.1), (-90, 0, 0), size=(3, 1.5)),
    "oblique rectangle": Light("l", "rectangle", (1.5, 0.6, 1.2), (-60, 40, 10), size=(2, 0.7)),
    "long rectangle": Light("l", "rectangle", (0, 1, 0), (-90, 0, 30), size=(9, 0.2)),
    "rectangle around its corner": Light("l", "rectangle", (2, 0.1, -1), (-90, 0, 0), size=(4, 4)),
    "rectangle from behind": Light("l", "rectangle", (0, 1, 0), (90, 0, 0), size=(2, 3), double_sided=True),
    "mirrored rectangle": Light("l", "rectangle", (0, 1, 0.3), (-90, 0, 0), (-2, 1, 1), size=(1, 2)),
    "disk": Light("l", "disk", (0.2, 1, 0.3), (-100, 0, 0), (1.2, 0.8, 1), radius=1.3),
    "ball": Light("l", "sphere", (1, 0.8, -0.4), radius=0.9),
    "near ball": Light("l", "point", (0, 1, 0), radius=0.999),
    "spot": Light("l", "spot", (0.5, 0.9, -0.4), (-90, 0, 0), radius=0.6, spot_angle=179),
    "sun": Light("l", "sun", rotation=(-40, 20, 0), angle=60),
}


def _inputs(light: Light) -> dict[str, npt.NDArray[Any]]:
    params = np.zeros(1, layout.PARAMS)
    params["shaped_count"], params["shaped_probability"] = 1, 1.0
    params["sun_count"] = light.is_far
    planes = shaped_planes([light], np.ones(1), np.zeros(1, np.bool_))
    return {"all_params": params, "planes": planes.ravel()}


_BEGIN = """
    const Params params = all_params[0];
    Emitters emitters;
    emitters.shaped_lights = planes;
    const Vec3 position = vec3(0.0f, 0.0f, 0.0f); // where lights are seen from
"""


def sampled(light: Light, u: Array, v: Array) -> tuple[Array, Array, Array]:
    """Directions (3, N), their densities and distances."""
    x, y, z, pdf, distance = call(
        "light",
        _BEGIN
        + """
    Uniform2 uv;
    uv.u = u[i];
    uv.v = v[i];
    const Starts starts = {position, vec3(0.0f, 0.0f, 0.0f), vec3(0.0f, 0.0f, 0.0f)};
    LightSample s = sample_light(&params, 0, &emitters, &starts, uv, 0.5f);
    x[i] = s.direction.x;
    y[i] = s.direction.y;
    z[i] = s.direction.z;
    pdf[i] = s.pdf;
    distance[i] = s.distance;""",
        len(u), ("x", "y", "z", "pdf", "distance"), ("SHAPED_LIGHTS",), **_inputs(light), u=u, v=v,
    )  # fmt: skip
    return np.stack([x, y, z]), pdf, distance


def met(light: Light, directions: Array) -> tuple[Array, Array]:
    """What rays along directions (3, N) meet of the light: the density of each, 0 where it does not meet it,
    and the distance, 1 for a sun."""
    x, y, z = directions
    pdf, distance = call(
        "light",
        _BEGIN
        + """
    Ray ray;
    ray.origin = position;
    ray.direction = vec3(dx[i], dy[i], dz[i]);
    const ShapedLight light = load_shaped_light(&params, &emitters, 0u);
    const Vec3 aside = subtract(ray.direction, light.z);
    const int in_sun = 0.5f * dot(aside, aside) <= light.cap;
    const float to_sun = in_sun ? 1.0f : INFINITY;
    distance[i] = params.sun_count ? to_sun : distance_to_shaped_light(&light, ray);
    const Vec3 to_center = subtract(light.center, position);
    const float d = shaped_light_pdf(&light, to_center, ray.direction, distance[i]);
    pdf[i] = distance[i] < INFINITY ? d : 0.0f;""",
        len(x), ("pdf", "distance"), ("SHAPED_LIGHTS",), **_inputs(light),
        dx=np.asarray(x, np.float32), dy=np.asarray(y, np.float32), dz=np.asarray(z, np.float32),
    )  # fmt: skip
    return pdf, distance


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in LIGHTS if "rectangle" in name])
def test_parts_of_rectangles_are_chosen_by_their_solid_angle(name: str) -> None:
    light = LIGHTS[name]
    u, v = uniforms(400_000, 2, seed=4)
    directions, pdf, _ = sampled(light, u, v)
    x, y, height = light.axes @ light.position
    (a, b), (rows, columns) = light.half_size, (16, 24)
    steps = height / (light.axes[2] @ directions)
    across, down = (light.axes[:2] @ directions) * steps
    edges_x, edges_y = np.linspace(x - a, x + a, columns + 1), np.linspace(y - b, y + b, rows + 1)
    counts, _, _ = np.histogram2d(down, across, (edges_y, edges_x))
    assert counts.sum() > 0.999 * len(u)

    way = np.sqrt(edges_x**2 + edges_y[:, None] ** 2 + height**2)
    corner = np.arctan(edges_x * edges_y[:, None] / (height * way))
    cells = np.abs(np.diff(np.diff(corner, axis=0), axis=1))
    np.testing.assert_allclose(1 / pdf, cells.sum(), rtol=1e-4)
    assert chi_square(counts, cells / cells.sum() * counts.sum()) > SIGNIFICANCE


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in LIGHTS if name != "long rectangle"])
def test_samples_follow_their_density(name: str) -> None:
    light = LIGHTS[name]
    u, v = uniforms(SAMPLES, 2, seed=3)
    directions, pdf, _ = sampled(light, u, v)
    assert (pdf > 0).all()
    np.testing.assert_allclose(np.linalg.norm(directions, axis=0), 1, atol=1e-5)
    p_value, total = direction_p_value(directions, pdf > 0, lambda grid: met(light, grid)[0], subdivision=64)
    assert total == pytest.approx(1, abs=4e-3)
    assert p_value > SIGNIFICANCE


@pytest.mark.parametrize("name", LIGHTS)
def test_rays_meet_what_was_sampled(name: str) -> None:
    """Where a sample says, and with the density that it says."""
    light = LIGHTS[name]
    u, v = uniforms(20_000, 2, seed=5)
    directions, pdf, distance = sampled(light, u, v)
    met_pdf, met_distance = met(light, directions)
    is_met = np.isfinite(met_distance)
    assert is_met.mean() > 0.998  # rounding loses some at the edge
    np.testing.assert_allclose(met_pdf[is_met], pdf[is_met], rtol=2e-3)
    if not light.is_far:
        ratio = distance[is_met] / met_distance[is_met]
        np.testing.assert_allclose(np.median(ratio), 1, rtol=1e-5)
        assert (np.abs(ratio - 1) < 1e-3).mean() > 0.99


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("name", ["oblique rectangle", "disk", "ball"])
def test_densities_of_any_size(name: str, scale: float) -> None:
    """A light that is larger or smaller is chosen alike from a place that is as far away in its own units."""
    light = LIGHTS[name]
    x, y, z = (scale * p for p in light.position)
    width, height = light.size
    large = replace(
        light, position=(x, y, z), size=(scale * width, scale * height), radius=scale * light.radius
    )
    u, v = uniforms(1000, 2, seed=7)
    a, b = (sampled(one, u, v) for one in (light, large))
    np.testing.assert_allclose(a[0], b[0], atol=2e-4)
    np.testing.assert_allclose(a[1], b[1], rtol=5e-3)


@pytest.mark.parametrize("size", [3e-4, 1e-2, 0.0624, 0.0634, 0.2])
def test_rectangles_under_a_small_angle(size: float) -> None:
    """By area or by angle, on both sides of the change from one to the other, and to what single precision
    holds."""
    light = Light("l", "rectangle", (0, 1, 0), (-90, 0, 0), size=(size, size))
    u, v = uniforms(50_000, 2, seed=9)
    directions, pdf, _ = sampled(light, u, v)
    solid_angle = float(np.mean(1 / pdf))
    half = size / 2
    exact = 4 * np.arcsin(half * half / (half * half + 1))
    assert solid_angle == pytest.approx(exact, rel=1e-3)
    # Their mean is the middle, and they fill the whole.
    np.testing.assert_allclose(directions[::2].mean(axis=1), 0, atol=0.01 * size)
    np.testing.assert_allclose(np.abs(directions[0]).max(), half / np.hypot(half, 1), rtol=0.02)


def test_arcsine() -> None:
    x = np.concatenate([np.linspace(-1, 1, 100_001), [0.4999999, 0.5, 0.5000001, 1 + 1e-6, -2]])
    (angle,) = call("scalar", "r[i] = arcsine(x[i]);", len(x), x=x.astype(np.float32))
    exact = np.arcsin(np.clip(x.astype(np.float32).astype(np.float64), -1, 1))
    assert np.abs(angle - exact).max() < 4e-7
