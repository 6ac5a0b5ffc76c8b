"""Sensors: where the rays of their pictures go, beside Mitsuba's projection."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from support.mitsuba_files import read, told

from incpt.formats.import_report import Fate

Array = npt.NDArray[np.float64]
PLACES = np.array([[0.5, 0.5], [0.0, 0.0], [0.9, 0.3]])
LOOK = '<transform name="to_world"><lookat origin="1 2 3" target="1 2 -5" up="0 1 0"/></transform>'


def sensor(kind: str, content: str, film: str = "", size: tuple[int, int] = (200, 100)) -> str:
    width, height = size
    return (
        f'<sensor type="{kind}">{content}<film type="hdrfilm"><integer name="width" value="{width}"/>'
        f'<integer name="height" value="{height}"/>{film}</film></sensor>'
    )


def number(name: str, value: float) -> str:
    return f'<float name="{name}" value="{value}"/>'


def whole(**values: int) -> str:
    return "".join(f'<integer name="{name}" value="{value}"/>' for name, value in values.items())


def expected_ways(
    tangent_x: float, places: Array, aspect: float, offset: tuple[float, float] = (0, 0)
) -> Array:
    """Directions, 1 along the view, of a camera that looks to -z with +x to the right: Mitsuba's film reaches
    a tangent along x to both sides."""
    x = (2 * (places[:, 0] + offset[0]) - 1) * tangent_x
    y = (1 - 2 * (places[:, 1] + offset[1])) * tangent_x / aspect
    return np.column_stack([x, y, -np.ones(len(places))])


AXES = {
    '<string name="fov_axis" value="x"/>': math.tan(math.radians(25)),
    "": math.tan(math.radians(25)),
    '<string name="fov_axis" value="y"/>': 2 * math.tan(math.radians(25)),
    '<string name="fov_axis" value="smaller"/>': 2 * math.tan(math.radians(25)),
    '<string name="fov_axis" value="larger"/>': math.tan(math.radians(25)),
    '<string name="fov_axis" value="diagonal"/>': math.tan(math.radians(25)) * 2 / math.sqrt(5),
}


@pytest.mark.parametrize("axis", AXES)
def test_fields_of_view(axis: str, tmp_path: Path) -> None:
    scene, report = read(tmp_path, sensor("perspective", number("fov", 50) + axis + LOOK))
    assert scene.settings.size == (200, 100) and report.is_whole
    origins, ways = scene.camera.rays(PLACES, 2.0)
    np.testing.assert_allclose(origins, [[1, 2, 3]] * 3)
    np.testing.assert_allclose(ways, expected_ways(AXES[axis], PLACES, 2.0), atol=1e-9)


def test_a_focal_length_is_that_of_a_full_frame(tmp_path: Path) -> None:
    scene, _ = read(
        tmp_path, sensor("perspective", '<string name="focal_length" value="35mm"/>', size=(36, 24))
    )
    # The film is 36 x 24 mm then.
    assert scene.camera.fov_y_at(1.5) == pytest.approx(math.degrees(2 * math.atan(12 / 35)))


def test_a_part_of_the_film_is_a_picture_of_its_own(tmp_path: Path) -> None:
    crop = whole(crop_width=50, crop_height=40, crop_offset_x=10, crop_offset_y=55)
    moved = number("principal_point_offset_x", 0.1) + number("principal_point_offset_y", -0.2)
    scene, _ = read(tmp_path, sensor("perspective", number("fov", 50) + LOOK + moved, crop))
    assert scene.settings.size == (50, 40)
    _, ways = scene.camera.rays(PLACES, 50 / 40)
    places = (np.array([10, 55]) + PLACES * [50, 40]) / [200, 100]
    expected = expected_ways(math.tan(math.radians(25)), places, 2.0, (0.1, -0.2))
    np.testing.assert_allclose(ways, expected, atol=1e-9)


def test_an_orthographic_film_reaches_as_far_as_it_is_scaled(tmp_path: Path) -> None:
    place = (
        '<transform name="to_world"><scale x="3" y="3"/>'
        '<lookat origin="1 2 3" target="1 2 -5" up="0 1 0"/></transform>'
    )
    crop = whole(crop_width=100, crop_height=50, crop_offset_x=100, crop_offset_y=0)
    scene, _ = read(tmp_path, sensor("orthographic", place, crop))
    origins, ways = scene.camera.rays(PLACES, 2.0)
    np.testing.assert_allclose(ways, [[0, 0, -1]] * 3, atol=1e-12)
    x = (2 * (0.5 + PLACES[:, 0] / 2) - 1) * 3
    y = (1 - PLACES[:, 1]) * 1.5
    np.testing.assert_allclose(origins[:, :2] - [1, 2], np.column_stack([x, y]), atol=1e-9)


def test_a_thin_lens(tmp_path: Path) -> None:
    lens = number("fov", 50) + number("aperture_radius", 0.25) + number("focus_distance", 4)
    scene, _ = read(tmp_path, sensor("thinlens", lens))
    assert scene.camera.lens_radius(2.0) == pytest.approx(0.25) and scene.camera.sharp_distance == 4


def test_without_a_place_it_looks_to_z(tmp_path: Path) -> None:
    scene, _ = read(tmp_path, sensor("perspective", number("fov", 50)))
    _, ways = scene.camera.rays(np.array([[0.5, 0.5], [1.0, 0.5]]), 2.0)
    np.testing.assert_allclose(ways[0], [0, 0, 1], atol=1e-12)
    assert ways[1, 0] < 0


def test_the_near_plane_counts_where_something_is_before_it(tmp_path: Path) -> None:
    near = number("near_clip", 0.5) + LOOK
    far_away, _ = read(tmp_path, sensor("perspective", number("fov", 50) + near) + '<shape type="cube"/>')
    around, _ = read(
        tmp_path,
        sensor("perspective", number("fov", 50) + near)
        + '<shape type="cube"><transform name="to_world"><scale value="9"/></transform></shape>',
    )
    assert (far_away.camera.near, around.camera.near) == (0, 0.5)


def test_several_cameras(tmp_path: Path) -> None:
    named = [f'<sensor type="perspective" id="{name}">{number("fov", 40)}</sensor>' for name in "ab"]
    scene, report = read(tmp_path, named[0] + '<sensor type="distant"/>' + named[1])
    assert list(scene.cameras) == ["a", "b"] and scene.camera_name == "a"
    assert any("distant sensor" in text for text in told(report))


def test_without_a_camera_one_looks_at_the_scene(tmp_path: Path) -> None:
    scene, report = read(tmp_path, '<shape type="cube"/>')
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    places, in_front = scene.camera.project(corners, 16 / 9)
    assert in_front.all() and places.min() > 0 and places.max() < 1
    assert any("no camera" in text for text in told(report, Fate.CHANGED))


def test_how_the_scene_is_rendered(tmp_path: Path) -> None:
    path = '<integrator type="{}"><integer name="max_depth" value="{}"/></integrator>'
    # One segment to the first hit, one to the light.
    for depth, bounces in ((7, 5), (2, 0), (-1, 200), (1, 0)):
        scene, report = read(tmp_path, path.format("path", depth))
        assert scene.settings.max_bounces == bounces and report.is_whole
        # Their microfacets scatter once.
        assert not scene.settings.multiple_scattering
    assert read(tmp_path, '<integrator type="direct"/>')[0].settings.max_bounces == 0
    within = f'<integrator type="aov">{path.format("path", 4)}</integrator>'
    scene, report = read(tmp_path, within)
    assert scene.settings.max_bounces == 2 and "aov integrator" in told(report)[0]


def test_glass_of_beckmann_alone_loses_no_light(tmp_path: Path) -> None:
    def scatters_on(*bsdfs: str) -> bool:
        shapes = "".join(f'<shape type="sphere">{one}</shape>' for one in bsdfs)
        return read(tmp_path, shapes)[0].settings.multiple_scattering

    ggx = '<string name="distribution" value="ggx"/>'
    glass, smooth_glass, metal = (f'<bsdf type="rough{kind}">{{}}</bsdf>' for kind in _ROUGH)
    assert scatters_on(glass.format("")) and scatters_on(glass.format(""), smooth_glass.format(""))
    for others in (
        (glass.format(ggx),),
        (glass.format(""), glass.format(ggx)),
        (glass.format(""), metal.format("")),
    ):
        assert not scatters_on(*others)


_ROUGH = ("dielectric", "plastic", "conductor")


def test_filters_and_samples_are_told(tmp_path: Path) -> None:
    content = (
        number("fov", 50) + '<sampler type="independent"><integer name="sample_count" value="64"/></sampler>'
    )
    _, report = read(tmp_path, sensor("perspective", content, '<rfilter type="gaussian"/>'))
    (first, second) = told(report, Fate.CHANGED)
    assert "gaussian rfilter" in first and "--spp 64" in second and report.is_whole
