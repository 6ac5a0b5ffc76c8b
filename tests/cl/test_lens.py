"""cl/scene/lens.cl: where rays of a lens start and go, against the camera's own formulas."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.cameras import cameras
from support.kernels import SIGNIFICANCE, call, chi_square, uniforms

from incpt.core import layout
from incpt.core.settings import RenderSettings
from incpt.render.params import path_params
from incpt.scene.camera import Camera
from incpt.scene.model import Scene

SIZE = (48, 32)
Array = npt.NDArray[np.float64]
_RAY = """
    const Params own = params[0];
    Uniform2 at = {u[i], v[i]};
    Ray ray = lens_ray(&own, x[i], y[i], at);
    ox[i] = ray.origin.x; oy[i] = ray.origin.y; oz[i] = ray.origin.z;
    dx[i] = ray.direction.x; dy[i] = ray.direction.y; dz[i] = ray.direction.z;"""


def params_of(camera: Camera) -> npt.NDArray[np.void]:
    """(1,) layout.PARAMS."""
    tables = SimpleNamespace(scene=Scene(camera), has_trees=False)
    return path_params(tables, RenderSettings(size=SIZE)).reshape(1)  # type: ignore[arg-type]


def lens_rays(camera: Camera, pixels: Array, aperture: Array) -> tuple[Array, Array]:
    """Starts and directions (N, 3) of rays through pixels (N, 2) and points of the aperture (N, 2)."""
    names = ("ox", "oy", "oz", "dx", "dy", "dz")
    (x, y), (u, v) = pixels.T, aperture.T
    found = call(
        "lens", _RAY, len(x), names, ("LENS",), params=params_of(camera), x=x.astype(np.float32),
        y=y.astype(np.float32), u=u.astype(np.float32), v=v.astype(np.float32),
    )  # fmt: skip
    rays = np.array(found, np.float64).T
    return rays[:, :3], rays[:, 3:]


def test_names_of_the_struct_are_all_set() -> None:
    camera = Camera(f_stop=0.1, blades=5, blade_rotation=90, near=0.3, projection="orthographic")
    made = params_of(camera)[0]["camera"]
    assert all(np.any(made[name]) for name in layout.CAMERA.names or ())


@settings(max_examples=40, deadline=None)
@given(cameras(), st.floats(0, 2), st.integers(0, 2**31))
def test_rays_through_the_middle_of_the_lens_are_those_of_the_camera(
    camera: Camera, near: float, seed: int
) -> None:
    camera = replace(camera, near=near, f_stop=2.0)
    places = np.random.default_rng(seed).uniform(size=(64, 2))
    starts, directions = lens_rays(camera, places * SIZE, np.zeros((64, 2)))
    expected, towards = camera.rays(places, SIZE[0] / SIZE[1])
    np.testing.assert_allclose(starts, expected + near * towards, atol=2e-4, rtol=1e-5)
    unit = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    np.testing.assert_allclose(directions, unit, atol=2e-6)


@settings(max_examples=40, deadline=None)
@given(cameras(), st.floats(0.05, 20), st.integers(0, 2**31))
def test_rays_of_a_place_meet_where_it_is_sharp(camera: Camera, focus: float, seed: int) -> None:
    aspect = SIZE[0] / SIZE[1]
    camera = replace(camera, f_stop=0.5, focus_distance=focus)
    random = np.random.default_rng(seed)
    angle = random.uniform(0, 2 * np.pi, 64)
    starts, directions = lens_rays(
        camera,
        np.tile(random.uniform(size=2) * SIZE, (64, 1)),
        np.column_stack([np.cos(angle), np.sin(angle)]),
    )
    forward = camera.image_plane(aspect)[2]
    # All start on the rim, in the plane of the camera.
    middle = starts.mean(axis=0) if camera.is_orthographic else np.asarray(camera.position)
    reach = np.linalg.norm(starts - camera.position, axis=1)
    if not camera.is_orthographic:
        np.testing.assert_allclose(reach, camera.lens_radius(aspect), rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose((starts - middle) @ forward, 0, atol=2e-4)
    meeting = starts + directions * (focus / (directions @ forward))[:, None]
    spread = np.linalg.norm(meeting - meeting.mean(axis=0), axis=1).max()
    assert spread < 1e-4 + 1e-4 * focus + 2e-6 * np.abs(starts).max() * max(1, focus)


@pytest.mark.slow
@pytest.mark.parametrize("blades", [0, 3, 5, 6, 64])
def test_apertures_are_filled_evenly(blades: int) -> None:
    count = 1 << 17
    u, v = uniforms(count, 2, 7)
    turned = 20.0
    params = params_of(Camera(f_stop=1, blades=blades, blade_rotation=turned))
    body = """
    const Params own = params[0];
    Uniform2 uv = {u[i], v[i]};
    Uniform2 at = sample_aperture(&own, uv);
    x[i] = at.u; y[i] = at.v;"""
    x, y = call("lens", body, count, ("x", "y"), ("LENS",), params=params, u=u, v=v)
    grid = (np.arange(1024) + 0.5) / 512 - 1
    gx, gy = np.meshgrid(grid, grid)
    if blades:
        # Inside of all edges, which face the directions k / blades of a turn.
        ways = np.radians(turned) + 2 * np.pi * np.arange(blades) / blades
        inside = np.all([gx * np.cos(a) + gy * np.sin(a) <= np.cos(np.pi / blades) for a in ways], axis=0)
        area = blades * np.sin(2 * np.pi / blades) / 2
    else:
        inside, area = gx**2 + gy**2 <= 1, np.pi
    expected = inside.reshape(16, 64, 16, 64).mean(axis=(1, 3)) * (2 / 16) ** 2
    assert expected.sum() == pytest.approx(area, rel=1e-3)
    observed = np.histogram2d(y, x, bins=16, range=[[-1, 1], [-1, 1]])[0]
    assert observed.sum() == count  # none is outside of the circle around it
    # The midpoint rule knows the area of a bin on the edge to about a per mille.
    assert chi_square(observed, expected / expected.sum() * count) > SIGNIFICANCE
    if blades:
        distance = np.max([x * np.cos(a) + y * np.sin(a) for a in ways], axis=0)
        assert distance.max() <= np.cos(np.pi / blades) + 1e-5
