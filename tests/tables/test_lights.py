"""Light sampling: incpt/tables/lights.py and environment.py, functions of cl/scene/light.cl."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import (
    SIGNIFICANCE,
    call,
    chi_square,
    direction,
    direction_p_value,
    struct_rows,
    uniforms,
)
from support.small_scenes import mixed_scene

from incpt.core import layout
from incpt.device.device import Device
from incpt.render.session import Session
from incpt.scene.image import Image
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.tables import environment, lights
from incpt.tables.geometry_pool import GeometryPool
from incpt.tables.scene_tables import SceneTables, tables_of

COUNT = 1 << 17
Array = npt.NDArray[np.floating]
_EMITTERS = """Params params = p[0]; Emitters e; e.lights = lights; e.environment_image = image;
    e.marginal = marginal; e.conditional = conditional; e.texel_pdf = texel_pdf; """


def _light_call(
    body: str, outputs: tuple[str, ...], count: int, params: dict[str, object], features: tuple[str, ...],
    planes: Array | None = None, image: Image | None = None, **inputs: npt.NDArray[np.generic],
) -> list[npt.NDArray[np.float32]]:  # fmt: skip
    nothing = np.zeros(1, np.float32)
    table = None if image is None else environment.image_density(image)
    return call(
        "light", _EMITTERS + body, count, outputs, features, p=struct_rows(layout.PARAMS, [params]),
        lights=nothing if planes is None else planes, image=nothing if image is None else image.pixels,
        marginal=nothing if table is None else table.marginal,
        conditional=nothing if table is None else table.conditional,
        texel_pdf=nothing if table is None else table.texel_pdf, **inputs,
    )  # fmt: skip


# Triangles


def _triangle(*corners: tuple[float, float, float]) -> Mesh:
    return Mesh(np.array(corners, np.float32), np.array([[0, 1, 2]], np.int32))


def _light_scene() -> Scene:
    """Four triangles around the origin: one turned away, one double-sided, one that has no area, and one
    mirrored so that it looks at the origin."""
    facing = _triangle((-1, 2, -1), (1, 2, -1), (0, 2, 1))  # looks down: counter-clockwise from below
    away = _triangle((0, -2, 1), (-1, -2, -1), (1, -2, -1))
    flat = _triangle((3, 0, 0), (4, 0, 0), (5, 0, 0))
    side = _triangle((3, -1, 0), (3, 1, -1), (3, 1, 1))
    return Scene(
        materials={
            "a": Material(emission=(1, 2, 3)), "b": Material(emission=(5, 5, 5)),
            "c": Material(emission=(4, 1, 1), double_sided=True), "dark": Material(),
            "d": Material(emission=(0.5, 0.25, 8)),
        },
        objects=(
            Object("facing", facing, "a"), Object("away", away, "b"), Object("flat", flat, "b"),
            Object("double", side, "c", position=(0.5, 0, 0)), Object("dark", facing, "dark"),
            Object("hidden", facing, "a", visible=False),
            Object("mirrored", facing, "d", position=(0, 0, -3), rotation=(90, 0, 0), scale=(-1, 2, 0.5)),
        ),
    )  # fmt: skip


def _corners(scene: Scene) -> npt.NDArray[np.float64]:
    """(N, 3, 3) of the lights with an area, in order."""
    names = ("facing", "away", "double", "mirrored")
    return np.stack([_world_corners(scene.object(name)) for name in names])


def _world_corners(obj: Object) -> npt.NDArray[np.float64]:
    matrix = obj.world_from_object
    return obj.mesh.vertices[obj.mesh.faces[0]] @ matrix[:, :3].T + matrix[:, 3]


def _area(corners: Array) -> Array:
    return np.asarray(
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    )


def solid_angle(corners: Array) -> float:
    """Of a triangle (3, 3) seen from the origin. Van Oosterom and Strackee 1983."""
    a, b, c = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    return float(2 * abs(np.arctan2(a @ np.cross(b, c), 1 + a @ b + b @ c + c @ a)))


def _sample_triangles(scene: Scene, share: float = 1.0) -> tuple[Array, Array, Array, Array]:
    """Direction (3, N), distance, radiance (3, N) and pdf of samples from the origin."""
    table = lights.triangle_lights(scene, share)
    u, v, choice = uniforms(COUNT, 3, 31)
    body = """Uniform2 uv; uv.u = u[i]; uv.v = v[i];
        Vec3 o = vec3(0.0f, 0.0f, 0.0f);
        Starts starts = {o, o, o};
        LightSample s = sample_triangle_light(&params, 0, &e, &starts, uv, choice[i]);
        x[i] = s.direction.x; y[i] = s.direction.y; z[i] = s.direction.z; d[i] = s.distance;
        r[i] = s.radiance.x; g[i] = s.radiance.y; b[i] = s.radiance.z; pdf[i] = s.pdf;"""
    results = _light_call(
        body, ("x", "y", "z", "d", "r", "g", "b", "pdf"), COUNT, {"light_count": table.count},
        ("TRIANGLE_LIGHTS",), table.planes, u=u, v=v, choice=choice,
    )  # fmt: skip
    return np.stack(results[:3]), results[3], np.stack(results[4:7]), results[7]


def _which(scene: Scene, radiance: Array) -> npt.NDArray[np.intp]:
    emissions = np.array([scene.material(m).emission for m in "abcd"], np.float32)
    return np.argmax((radiance.T[:, None, :] == emissions).all(axis=2), axis=1)


def test_triangles_are_chosen_by_power_and_points_by_area() -> None:
    scene = _light_scene()
    wi, distance, radiance, _ = _sample_triangles(scene)
    light, corners = _which(scene, radiance), _corners(scene)
    weights = np.array([lights.radiant_weight(scene.material(m)) for m in "abcd"]) * _area(corners)
    expected = weights / weights.sum() * COUNT
    assert chi_square(np.bincount(light, minlength=4), expected) > SIGNIFICANCE
    for i in range(4):
        points = (wi * distance)[:, light == i].astype(np.float64)
        solved = np.linalg.lstsq(
            np.column_stack([corners[i, 1] - corners[i, 0], corners[i, 2] - corners[i, 0]]),
            points - corners[i, 0][:, None], rcond=None,
        )  # fmt: skip
        b1, b2 = solved[0]
        assert np.sqrt(solved[1]).max() < 1e-3 * np.sqrt(points.shape[1])  # in the plane of the triangle
        # Sub-triangles of equal area: by thirds of each edge.
        cell = np.stack([b1 * 3, b2 * 3, (1 - b1 - b2) * 3]).clip(0, 2.999999).astype(int)
        counts = np.unique(cell, axis=1, return_counts=True)[1]
        assert len(counts) == 9
        assert chi_square(counts, np.full(9, points.shape[1] / 9)) > SIGNIFICANCE


def test_density_of_a_triangle_per_solid_angle() -> None:
    scene = _light_scene()
    for share in (1.0, 0.25):
        wi, distance, radiance, pdf = _sample_triangles(scene, share)
        light, corners = _which(scene, radiance), _corners(scene)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        normal[3] *= -1  # mirrored: the outside stays outside
        cosine = -np.einsum("li,il->l", normal[light], wi.astype(np.float64))
        weight = np.array([lights.radiant_weight(scene.material(m)) for m in "abcd"])
        per_area = share * weight / (weight * _area(corners)).sum()
        shines = (cosine > 0) | (light == 2)
        assert (pdf[~shines] == 0).all()
        assert set(np.unique(light[shines])) == {0, 2, 3}
        np.testing.assert_allclose(
            pdf[shines], (per_area[light] * distance**2 / np.abs(cosine))[shines], rtol=1e-3
        )


def test_inverse_density_sums_up_to_the_solid_angle() -> None:
    scene = _light_scene()
    _, _, radiance, pdf = _sample_triangles(scene)
    light = _which(scene, radiance)
    for i, name in ((0, "facing"), (2, "double"), (3, "mirrored")):
        inverse = np.where((light == i) & (pdf > 0), 1 / np.where(pdf > 0, pdf, 1), 0).astype(np.float64)
        error = inverse.std() / np.sqrt(COUNT)
        assert abs(inverse.mean() - solid_angle(_world_corners(scene.object(name)))) < 4.5 * error


@pytest.mark.parametrize("count", [1, 2, 5, 1000])
def test_alias_table_gives_every_light_its_share(count: int) -> None:
    weights = np.random.default_rng(count).random(count) ** 4 + 1e-6
    probability, alias = lights.alias_table(weights)
    share = np.bincount(np.arange(count), probability, count) + np.bincount(alias, 1 - probability, count)
    np.testing.assert_allclose(share / count, weights / weights.sum(), rtol=1e-4, atol=1e-8)
    assert probability.min() >= 0 and probability.max() <= 1


def test_scene_without_emitters_has_no_triangles() -> None:
    table = lights.triangle_lights(
        Scene(materials={"m": Material()}, objects=(Object("o", shape("cube"), "m"),)), 1
    )
    assert table.count == 0 and not table.densities


def _speck(edge: float, emission: float, name: str = "speck") -> tuple[dict[str, Material], Object]:
    mesh = _triangle((0, 0, 0), (edge, 0, 0), (0, 0, edge))
    return {name: Material(emission=(emission,) * 3)}, Object(name, mesh, name, position=(0, 3, 0))


@pytest.mark.parametrize("edge", [1e-3, 1e-6, 1e-8, 1e-10, 1e-15, 1e-19, 1e-22])
@pytest.mark.parametrize("emission", [1e-310, 1e-40, 1e-30, 1.0, 1e9])
def test_densities_stay_finite_however_small_and_faint_the_only_light_is(
    device: Device, edge: float, emission: float
) -> None:
    materials, obj = _speck(edge, emission)
    with np.errstate(all="raise", under="ignore"), warnings.catch_warnings():
        warnings.simplefilter("error")
        tables = _tables(device, Scene(materials=materials, objects=(obj,)))
    is_light = edge > 1e-9 and emission > 1e-38
    assert tables.light_count == is_light and ("TRIANGLE_LIGHTS" in tables.features) == is_light
    planes, rows = _planes(tables), _material_rows(tables)
    assert np.isfinite(planes[layout.LightPlane.PDF_AREA]).all() and np.isfinite(rows["light_pdf"]).all()
    # A point that is not sampled has no density either, so that a ray that meets it brings all its light.
    np.testing.assert_allclose(rows["light_pdf"], 2 / edge**2 if is_light else 0, rtol=1e-6)


def test_what_is_too_small_to_be_a_light_has_no_density_beside_lights(device: Device) -> None:
    speck, small = _speck(1e-12, 1e9)
    faint, large = _speck(0.5, 1e-37, "faint")
    scene = Scene(materials={**speck, **faint}, objects=(small, large))
    with np.errstate(all="raise", under="ignore"):
        tables = _tables(device, scene)
    assert tables.light_count == 1
    assert _material_rows(tables)["light_pdf"].tolist() == [0, _planes(tables)[layout.LightPlane.PDF_AREA, 0]]


@pytest.mark.parametrize("edge", [1e-10, 1e-20])
def test_a_speck_changes_nothing_of_a_picture(device: Device, edge: float) -> None:
    speck, small = _speck(edge, 1e3)
    scene = mixed_scene()
    plain, with_speck = (
        Session(one, device=device)
        for one in (scene, replace(scene, materials={**scene.materials, **speck}).with_added(small))
    )
    for session in (plain, with_speck):
        assert session.step().nonfinite == 0
    np.testing.assert_array_equal(with_speck.image(), plain.image())


def _tables(device: Device, scene: Scene) -> SceneTables:
    return tables_of(GeometryPool(device), scene)


def _planes(tables: SceneTables) -> npt.NDArray[np.float32]:
    """(LightPlane.TEXTURE, N) as they are on the device."""
    planes = np.zeros((layout.LightPlane.TEXTURE, tables.light_count), np.float32)
    return tables.pool.device.read(tables.buffer("lights"), planes) if planes.size else planes


def _material_rows(tables: SceneTables) -> npt.NDArray[np.void]:
    """layout.MATERIAL of each material, as they are on the device."""
    rows = np.zeros(len(tables.scene.materials), layout.MATERIAL)
    return tables.pool.device.read(tables.buffer("materials"), rows)


# Environment images


def _image(height: int = 24, width: int = 48) -> Image:
    """Of high contrast, with a black part and a bright texel on the seam."""
    rng = np.random.default_rng(32)
    pixels = rng.random((height, width, 3)).astype(np.float32) ** 4
    pixels[:, 10:20] = 0
    pixels[15, 0] = [30, 20, 10]
    pixels[2, 40] = 10
    return Image(pixels)


def _params(image: Image, rotation_deg: float = 0.0, probability: float = 1.0) -> dict[str, object]:
    height, width = image.pixels.shape[:2]
    return {
        "environment_width": width, "environment_height": height, "environment_color": (1, 1, 1),
        "environment_rotation": rotation_deg / 360 % 1, "environment_probability": probability,
    }  # fmt: skip


def _eval_environment(image: Image, wi: Array, rotation_deg: float = 0.0) -> tuple[Array, Array]:
    """Radiance (3, N) and pdf (N,) along wi (3, N), world space."""
    x, y, z = np.asarray(wi, np.float32)
    body = """float pdf; Vec3 c = eval_environment(&params, &e, vec3(x[i], y[i], z[i]), &pdf);
        r[i] = c.x; g[i] = c.y; b[i] = c.z; q[i] = pdf;"""
    r, g, b, q = _light_call(
        body, ("r", "g", "b", "q"), len(x), _params(image, rotation_deg), ("ENVIRONMENT_IMAGE",), image=image,
        x=x, y=y, z=z,
    )  # fmt: skip
    return np.stack([r, g, b]), q


def _sample_environment(image: Image, rotation_deg: float) -> tuple[Array, Array, Array]:
    """Direction (3, N), radiance (3, N), pdf (N,)."""
    u, v = uniforms(COUNT, 2, 33)
    body = """Uniform2 uv; uv.u = u[i]; uv.v = v[i]; LightSample s = sample_environment(&params, &e, uv);
        x[i] = s.direction.x; y[i] = s.direction.y; z[i] = s.direction.z;
        r[i] = s.radiance.x; g[i] = s.radiance.y; b[i] = s.radiance.z; pdf[i] = s.pdf;"""
    results = _light_call(
        body, ("x", "y", "z", "r", "g", "b", "pdf"), COUNT, _params(image, rotation_deg),
        ("ENVIRONMENT_IMAGE",), image=image, u=u, v=v,
    )  # fmt: skip
    return np.stack(results[:3]), np.stack(results[3:6]), results[6]


def place_of(wi: Array, rotation_deg: float) -> tuple[Array, Array]:
    """Column and row in [0, 1] of a world direction, from the convention in words: centre +z, three quarters
    to the right -x, top +y; the rotation turns the image right-handed about +y."""
    angle = np.radians(rotation_deg)
    # Undo the rotation: world = R(angle) image, R(angle) takes +z to +x.
    x = np.cos(angle) * wi[0] - np.sin(angle) * wi[2]
    z = np.sin(angle) * wi[0] + np.cos(angle) * wi[2]
    u = 0.5 + np.arctan2(-x, z) / (2 * np.pi)
    return u % 1, np.arccos(np.clip(wi[1], -1, 1)) / np.pi


@pytest.mark.parametrize("rotation", [0.0, 30.0, 90.0, 250.0, -45.0])
def test_radiance_of_the_environment_is_bilinear(rotation: float) -> None:
    image = _image()
    height, width = image.pixels.shape[:2]
    z, phi = (a.astype(np.float64) for a in uniforms(20_000, 2, 34))
    wi = direction(np.arccos(2 * z - 1), 2 * np.pi * phi)
    u, v = place_of(wi, rotation)
    x, y = u * width - 0.5, np.clip(v * height - 0.5, 0, height - 1)
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    tx, ty = (x - x0)[:, None], (y - y0)[:, None]
    pixels, y1 = image.pixels.astype(np.float64), np.minimum(y0 + 1, height - 1)
    top = pixels[y0, x0 % width] * (1 - tx) + pixels[y0, (x0 + 1) % width] * tx
    bottom = pixels[y1, x0 % width] * (1 - tx) + pixels[y1, (x0 + 1) % width] * tx
    radiance, _ = _eval_environment(image, wi, rotation)
    np.testing.assert_allclose(radiance.T, top * (1 - ty) + bottom * ty, atol=3e-3)


def test_axes_of_the_environment() -> None:
    pixels = np.zeros((32, 64, 3), np.float32)
    pixels[14:18, 30:34] = [1, 0, 0]  # centre: +z
    pixels[14:18, 46:50] = [0, 1, 0]  # three quarters: -x
    pixels[:2] = [0, 0, 1]  # top: +y
    axes = np.array([[0, 0, 1], [-1, 0, 0], [0, 1, 0], [0, 0, -1], [1, 0, 0], [0, -1, 0]], np.float64).T
    radiance, _ = _eval_environment(Image(pixels), axes)
    np.testing.assert_allclose(radiance.T, [[1, 0, 0], [0, 1, 0], [0, 0, 1], *[[0, 0, 0]] * 3], atol=1e-5)
    # Right-handed about +y: what was seen along +z is seen along +x, what along -x along +z.
    turned, _ = _eval_environment(Image(pixels), axes, 90.0)
    np.testing.assert_allclose(
        turned.T, [[0, 1, 0], [0, 0, 0], [0, 0, 1], [0, 0, 0], [1, 0, 0], [0, 0, 0]], atol=1e-5
    )


@pytest.mark.slow
@pytest.mark.parametrize("rotation", [0.0, 77.0])
@pytest.mark.parametrize("size", [(24, 48), (7, 5), (1, 3), (5, 1)])
def test_environment_samples_follow_the_density(rotation: float, size: tuple[int, int]) -> None:
    image = (
        _image(*size) if size[0] > 20 else Image(np.random.default_rng(1).random((*size, 3), np.float32) ** 3)
    )
    wi, radiance, pdf = _sample_environment(image, rotation)
    np.testing.assert_allclose(np.linalg.norm(wi, axis=0), 1, atol=1e-6)

    # Polar axis along y for the bins, so that they follow the texels.
    def pdf_of(d: Array) -> Array:
        return _eval_environment(image, np.stack([d[1], d[2], d[0]]), rotation)[1]

    p_value, total = direction_p_value(np.stack([wi[2], wi[0], wi[1]]), pdf > 0, pdf_of, subdivision=36)
    assert total == pytest.approx(1, abs=0.01)
    assert p_value > SIGNIFICANCE
    again, density = _eval_environment(image, wi, rotation)
    np.testing.assert_allclose(density, pdf, rtol=1e-4)
    np.testing.assert_allclose(again, radiance, rtol=1e-4, atol=1e-6)


def test_environment_samples_estimate_its_light() -> None:
    image = _image()
    wi, radiance, pdf = _sample_environment(image, 0.0)
    estimate = np.where(wi[1] > 0, wi[1] * radiance / pdf, 0).astype(np.float64)  # irradiance from above
    theta, phi = (np.arange(400) + 0.5) * np.pi / 400, (np.arange(800) + 0.5) * np.pi / 400
    d = direction(theta[:, None], phi[None, :]).reshape(3, -1)
    seen, density = _eval_environment(image, np.stack([d[1], d[2], d[0]]))
    area = np.repeat(np.sin(theta), 800) * (np.pi / 400) ** 2
    exact = (seen * np.maximum(d[2], 0) * area).sum(axis=1)
    error = estimate.std(axis=1) / np.sqrt(COUNT)
    assert (np.abs(estimate.mean(axis=1) - exact) < 4.5 * error + 1e-3 * exact).all()
    assert error.max() < 0.01 * exact.max()
    # Wherever there is light, light sampling can find it.
    assert (density[seen.max(axis=0) > 0] > 0).all()


def test_black_image_has_no_table() -> None:
    assert environment.image_density(Image(np.zeros((4, 8, 3), np.float32))) is None


def test_lights_weigh_by_luminance_and_sides() -> None:
    one = lights.radiant_weight(Material(emission=(1, 2, 3)))
    assert one == pytest.approx(0.2126 + 2 * 0.7152 + 3 * 0.0722)
    assert lights.radiant_weight(Material(emission=(1, 2, 3), double_sided=True)) == pytest.approx(2 * one)
