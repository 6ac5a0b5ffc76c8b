"""Lights, domes and cameras of USD files: where they stand, and what they emit."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.usd_files import METRES, QUAD_MESH, load_usda, placed

from incpt.formats import images, lat_long
from incpt.formats.import_report import Fate, ImportReport
from incpt.scene.light import Light
from incpt.scene.model import Scene

pxr = pytest.importorskip("pxr")


def light_of(folder: Path, body: str, head: str = METRES) -> tuple[Light, ImportReport]:
    scene, report = load_usda(folder, f"{QUAD_MESH}\ndef {body}", head)
    (light,) = scene.lights
    return light, report


def test_intensity_exposure_and_colour(tmp_path: Path) -> None:
    """A radiance of colour · intensity · 2^exposure."""
    light, report = light_of(
        tmp_path,
        """SphereLight "lamp" { float inputs:intensity = 3
            float inputs:exposure = 2
            float inputs:radius = 0.5
            color3f inputs:color = (1, 0.5, 0.25) }""",
    )
    assert light.kind == "sphere" and light.half_size[0] == 0.5 and report.is_whole
    assert light.emitted == pytest.approx((12, 6, 3))


def test_normalized_lights_keep_their_power(tmp_path: Path) -> None:
    """In units of the stage: a rectangle of 4 x 2 cm that is scaled by 3 has 72 of them."""
    body = f"""RectLight "lamp" {{ float inputs:intensity = 72
        float inputs:width = 4
        float inputs:height = 2
        bool inputs:normalize = 1
        {placed("float3 scale = (3, 3, 3)")} }}"""
    light, _ = light_of(tmp_path, body, "metersPerUnit = 0.01")
    assert light.half_size == pytest.approx((0.06, 0.03)) and light.emitted == pytest.approx((1, 1, 1))


def test_temperature_is_that_of_usd(tmp_path: Path) -> None:
    from pxr import UsdLux

    light, _ = light_of(
        tmp_path,
        'DiskLight "lamp" { bool inputs:enableColorTemperature = 1\nfloat inputs:colorTemperature = 3000 }',
    )
    assert light.kind == "disk" and light.half_size == (0.5, 0.5)
    assert light.emitted == pytest.approx(tuple(UsdLux.BlackbodyTemperatureAsRgb(3000)), rel=1e-5)


def test_lights_shine_along_minus_z(tmp_path: Path) -> None:
    body = f"""RectLight "lamp" {{ {placed("double3 translate = (1, 2, 3)", "float rotateX = -90")} }}"""
    light, _ = light_of(tmp_path, body)
    np.testing.assert_allclose(light.position, (1, 2, 3))
    np.testing.assert_allclose(-light.axes[2], (0, -1, 0), atol=1e-12)
    turned, _ = light_of(tmp_path, body, f'{METRES}\nupAxis = "Z"')
    np.testing.assert_allclose(turned.position, (1, 3, -2))
    np.testing.assert_allclose(-turned.axes[2], (0, 0, 1), atol=1e-12)


@pytest.mark.parametrize(("normalize", "angle", "irradiance"), [
    (1, 10.0, 5.0), (0, 10.0, 5 * math.pi * math.sin(math.radians(5)) ** 2), (0, 0.0, 5.0), (1, 0.0, 5.0),
])  # fmt: skip
def test_distant_lights(tmp_path: Path, normalize: int, angle: float, irradiance: float) -> None:
    body = f"""DistantLight "sun" {{ float inputs:intensity = 5
        float inputs:angle = {angle}
        bool inputs:normalize = {normalize} }}"""
    light, _ = light_of(tmp_path, body)
    assert (light.kind, light.angle) == ("sun", angle)
    assert light.watts[0] == pytest.approx(irradiance, rel=1e-6)
    if angle and not normalize:
        assert light.emitted[0] == pytest.approx(5, rel=1e-4)


def test_points(tmp_path: Path) -> None:
    """Seen from afar as bright as the ball: its radiance times the disk that it shows."""
    lamp = (
        'SphereLight "lamp" { bool treatAsPoint = 1\nfloat inputs:intensity = 8\nfloat inputs:radius = 0.25'
    )
    point, _ = light_of(tmp_path, lamp + " }")
    ball, _ = light_of(tmp_path, lamp.replace("treatAsPoint = 1", "treatAsPoint = 0") + " }")
    assert point.kind == "point" and not point.has_size
    assert point.emitted[0] == pytest.approx(8 * math.pi * 0.25**2)
    np.testing.assert_allclose(point.watts, ball.watts, rtol=1e-6)
    point, _ = light_of(tmp_path, lamp + "\nbool inputs:normalize = 1 }")
    ball, _ = light_of(
        tmp_path, lamp.replace("treatAsPoint = 1", "treatAsPoint = 0") + "\nbool inputs:normalize = 1 }"
    )
    np.testing.assert_allclose(point.watts, ball.watts, rtol=1e-6)


def test_cones(tmp_path: Path) -> None:
    body = """SphereLight "lamp" (prepend apiSchemas = ["ShapingAPI"]) { float inputs:radius = 0.1
        float inputs:intensity = 7
        float inputs:shaping:cone:angle = 30
        float inputs:shaping:cone:softness = 0.5 }"""
    light, report = light_of(tmp_path, body)
    assert (light.kind, light.spot_angle, light.spot_blend) == ("spot", 60, 0.5) and report.is_whole
    assert light.emitted == pytest.approx((7, 7, 7))
    disk = body.replace("SphereLight", "DiskLight")
    assert "the cone of light" in light_of(tmp_path, disk)[1].of(Fate.LEFT_OUT)[0].text


def test_cylinders_are_meshes_that_shine(tmp_path: Path) -> None:
    """Of the same power whatever their size, where they are normalised."""
    body = f"""{QUAD_MESH}
    def CylinderLight "tube" {{ float inputs:radius = 0.1
        float inputs:length = 2
        float inputs:intensity = 4
        bool inputs:normalize = 1
        {placed("double3 translate = (0, 5, 0)")} }}"""
    scene, report = load_usda(tmp_path, body)
    tube = scene.object("a/tube")
    np.testing.assert_allclose(tube.world_bounds, [[-1, 4.9, -0.1], [1, 5.1, 0.1]], atol=1e-6)
    material = scene.materials[tube.material]
    assert material.emission[0] == pytest.approx(4 / (2 * math.pi * 0.1 * 2)) and material.is_emissive
    assert not any(scene.environment.color) and scene.environment.picture is None
    assert "is a cylinder, for which a mesh shines" in report.of(Fate.CHANGED)[0].text


def test_images_of_rectangles_are_their_mean(tmp_path: Path) -> None:
    images.write_exr(tmp_path / "panel.exr", {"RGB": np.array([[[1, 2, 0], [3, 0, 0]]], np.float32)})
    light, report = light_of(tmp_path, 'RectLight "lamp" { asset inputs:texture:file = @panel.exr@ }')
    assert light.emitted == pytest.approx((2, 1, 0))
    assert "the mean colour of its image" in report.of(Fate.CHANGED)[0].text


def test_shadows_and_visibility(tmp_path: Path) -> None:
    body = """SphereLight "lamp" (prepend apiSchemas = ["ShadowAPI"]) { bool inputs:shadow:enable = 0
        token visibility = "invisible" }"""
    light, _ = light_of(tmp_path, body)
    assert not light.casts_shadows and not light.visible


def test_what_lights_have_not_is_said(tmp_path: Path) -> None:
    body = f"""{QUAD_MESH}
    def GeometryLight "mesh" {{ }}
    def SphereLight "lamp" (prepend apiSchemas = ["ShapingAPI"]) {{ float inputs:specular = 0.5
        float inputs:shaping:focus = 3
        asset inputs:shaping:ies:file = @lamp.ies@ }}"""
    _, report = load_usda(tmp_path, body)
    said = " | ".join(one.text for one in report.of(Fate.LEFT_OUT))
    for text in (
        "lights of the type GeometryLight",
        "its IES profile of light 'lamp'",
        "shaping:focus",
        "specular",
    ):
        assert text in said


def seen(scene: Scene, direction: Any) -> Any:
    """What the environment shows along a direction of the world."""
    environment = scene.environment
    assert environment.image is not None
    angle = math.radians(environment.rotation_y)
    back = np.array(
        [[math.cos(angle), 0, -math.sin(angle)], [0, 1, 0], [math.sin(angle), 0, math.cos(angle)]]
    )
    ways = (back @ np.asarray(direction, np.float64))[:, None]
    return lat_long.seen_along(environment.image.pixels, ways)[0] * environment.radiance


WAYS = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "+z": (0, 0, 1), "-z": (0, 0, -1)}


def sky(folder: Path) -> None:
    """A panorama that is red along +x, green along +y, and blue along +z, more the nearer to these."""
    pixels = lat_long.drawn(64, 128, lambda ways: np.maximum(ways.T, 0).astype(np.float32))
    images.write_exr(folder / "sky.exr", {"RGB": pixels})


@pytest.mark.parametrize(
    ("kind", "more", "up", "axes"),
    [
        # What there is along x, y and z of the world: 0, 1, 2 of the image's own axes.
        ("DomeLight", "", "Y", {"+x": 0, "+y": 1, "+z": 2}),
        ("DomeLight", "float rotateY = 90", "Y", {"+x": 2, "-z": 0, "+y": 1}),
        ("DomeLight", "float rotateX = 90", "Z", {"+x": 0, "+y": 1, "+z": 2}),
        ("DomeLight_1", "", "Z", {"+x": 0, "+y": 1, "+z": 2}),
        ("DomeLight_1", "", "Y", {"+x": 0, "+y": 1, "+z": 2}),
    ],
)
def test_domes(tmp_path: Path, kind: str, more: str, up: str, axes: dict[str, int]) -> None:
    sky(tmp_path)
    body = f"""{QUAD_MESH}
    def {kind} "sky" {{ asset inputs:texture:file = @sky.exr@
        float inputs:intensity = 2
        {placed(more) if more else ""} }}"""
    scene, report = load_usda(tmp_path, body, f'{METRES}\nupAxis = "{up}"')
    assert report.is_whole and not scene.lights
    for way, axis in axes.items():
        expected = 2 * np.eye(3)[axis]
        np.testing.assert_allclose(seen(scene, WAYS[way]), expected, atol=0.1)


def test_a_plain_dome_and_a_second_one(tmp_path: Path) -> None:
    body = f"""{QUAD_MESH}
    def DomeLight "sky" {{ color3f inputs:color = (1, 2, 3) }}
    def DomeLight "more" {{ }}"""
    scene, report = load_usda(tmp_path, body)
    assert scene.environment.color == (1, 2, 3) and scene.environment.image is None
    assert "light 'more': a scene has one environment" in report.of(Fate.LEFT_OUT)[0].text


CAMERA = """Camera "eye" { float focalLength = 50
    float horizontalAperture = 36
    float verticalAperture = 24
    float horizontalApertureOffset = 3.6
    float fStop = 2
    float focusDistance = 500
    float2 clippingRange = (10, 1000000)
    double3 xformOp:translate = (0, 100, 700)
    uniform token[] xformOpOrder = ["xformOp:translate"] }"""


def test_cameras(tmp_path: Path) -> None:
    """Beside the frustum of USD's own camera; tenths of centimetres are millimetres."""
    from pxr import Usd, UsdGeom

    scene, report = load_usda(tmp_path, f"{QUAD_MESH}\ndef {CAMERA}", "metersPerUnit = 0.01")
    camera = scene.camera
    assert scene.camera_name == "eye" and report.is_whole
    assert camera.position == pytest.approx((0, 1, 7)) and camera.near == pytest.approx(0.1)
    assert (camera.focal_length, camera.f_stop) == pytest.approx((50, 2)) and camera.focus_distance == 5
    assert camera.lens_radius(1.5) == pytest.approx(0.0125)
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    frustum = UsdGeom.Camera(stage.GetPrimAtPath("/eye")).GetCamera(0).frustum
    point = np.array([[0.3, 1.2, 1.0]])
    inside = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
    expected = inside.Transform(tuple((100 * point[0]).tolist()))
    places, _ = camera.project(point, 1.5)
    np.testing.assert_allclose(places[0], ((expected[0] + 1) / 2, (1 - expected[1]) / 2), atol=1e-6)


def test_orthographic_cameras_and_far_planes(tmp_path: Path) -> None:
    body = CAMERA.replace("focalLength = 50", 'focalLength = 50\ntoken projection = "orthographic"')
    body = body.replace("(10, 1000000)", "(10, 600)")
    scene, report = load_usda(tmp_path, f"{QUAD_MESH}\ndef {body}", "metersPerUnit = 0.01")
    assert scene.camera.is_orthographic and scene.camera.ortho_height == pytest.approx(0.024)
    assert "the far plane of camera 'eye'" in report.of(Fate.LEFT_OUT)[0].text
