"""Pictures of cameras that are no plain pinholes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import device
from support.pairs import check, session_of, traced_pairs
from support.renders import render
from support.small_scenes import mixed_scene

from incpt.core.settings import RenderSettings
from incpt.render.impact.exploration import seen_tiles, windows
from incpt.render.session import Session
from incpt.render.strategies import point_of_change
from incpt.render.tiles import TileGrid
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

KINDS: dict[str, dict[str, object]] = {
    "lens": {"f_stop": 0.1, "focus_distance": 3.0},
    "blades": {"f_stop": 0.1, "blades": 5, "focal_length": 30.0},
    "orthographic": {"projection": "orthographic", "ortho_height": 3.0},
    "shifted": {"shift_x": 0.2, "shift_y": -0.15},
    "near": {"near": 2.5},
    "all": {"projection": "orthographic", "ortho_height": 3.0, "shift_x": 0.1, "f_stop": 3.0, "near": 1.0},
}
kinds = pytest.mark.parametrize("kind", KINDS)
Array = npt.NDArray[np.float64]


def lamp_before(camera: Camera, depth: float, size: float = 0.01) -> Scene:
    """A small lamp that far along the view of a camera that looks along -z."""
    materials = {"lamp": Material((0, 0, 0), emission=(1, 1, 1))}
    lamp = Object("lamp", shape("sphere"), "lamp", (0, 0, camera.position[2] - depth), scale=(size,) * 3)
    return Scene(camera, Environment(), materials, (lamp,))


def spread(image: Array) -> tuple[Array, float]:
    """The centroid (x, y) of a picture's radiance, and the mean square distance from it, in pixels."""
    weights = image[..., 0] / image[..., 0].sum()
    y, x = np.mgrid[: image.shape[0], : image.shape[1]] + 0.5
    middle = np.array([(weights * x).sum(), (weights * y).sum()])
    return middle, float((weights * ((x - middle[0]) ** 2 + (y - middle[1]) ** 2)).sum())


@pytest.mark.slow
@pytest.mark.parametrize("blades", [0, 3, 6])
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("depth", [1.5, 6.0])
def test_a_point_off_focus_is_a_disk_of_the_size_that_optics_say(
    depth: float, projection: str, blades: int
) -> None:
    # c = A |S2 - S1| / S2 on the plane that is sharp, at S1, for a point at S2 and an aperture A wide; where
    # rays are parallel, c = A |S2 - S1| / S1.
    size, focus, radius, lamp = (64, 48), 3.0, 0.15, 0.06
    camera = Camera(
        (0, 0, 0), (0, 0, -1), fov_y=60, projection=projection, ortho_height=2.0, focus_distance=focus,
        focal_length=50, sensor_fit="vertical", blades=blades,
    )  # fmt: skip
    length = 1.0 if projection == "orthographic" else 0.050
    camera = replace(camera, f_stop=length / (2 * radius))
    image = render(lamp_before(camera, depth, lamp), 4096, size)
    height = 2.0 if projection == "orthographic" else focus * 24 / 50
    pixels = size[1] / height
    circle = pixels * 2 * radius * abs(depth - focus) / (focus if projection == "orthographic" else depth)
    around = 1 / 2 if blades == 0 else (2 + np.cos(2 * np.pi / blades)) / 6
    middle, found = spread(image)
    # The lamp is a small disk, and places are known to the width of a pixel.
    width = pixels * lamp * (1.0 if projection == "orthographic" else focus / depth)
    expected = (circle / 2) ** 2 * around + (width / 2) ** 2 / 2 + 2 / 12
    assert found == pytest.approx(expected, rel=0.03)
    assert middle == pytest.approx([32, 24], abs=0.1)
    point = np.array([[0.0, 0.0, -depth]])
    assert camera.blur(point, size[0] / size[1])[0] * size == pytest.approx([circle / 2] * 2)


def test_light_of_a_point_does_not_depend_on_the_aperture() -> None:
    """Rays carry radiance: what a wider lens spreads it does not add."""
    camera = Camera((0, 0, 0), (0, 0, -1), fov_y=60, focus_distance=3.0, focal_length=50)
    sums = [
        render(lamp_before(replace(camera, f_stop=f_stop), 2.0, 0.1), 1024).sum() for f_stop in (0.0, 0.3)
    ]
    # The lamp is seen from all over the lens at nearly the same distance.
    assert sums[1] == pytest.approx(sums[0], rel=0.03)


@pytest.mark.slow
@kinds
def test_in_a_furnace_all_is_white(kind: str) -> None:
    scene = Scene(
        Camera((0, 1.4, 4.2), (0, 0.5, 0)),
        Environment((1, 1, 1)),
        {"white": Material((1, 1, 1), specular=0)},
        (
            Object("ball", shape("sphere"), "white", (0, 0.5, 0)),
            Object("cube", shape("cube"), "white", (1, 0, 1)),
        ),
    ).with_camera(**KINDS[kind])
    np.testing.assert_allclose(render(scene, 16, max_bounces=100, roulette_depth=200), 1, rtol=2e-3)


@pytest.mark.slow
@kinds
@pytest.mark.parametrize("in_blocks", [True, False], ids=["blocks", "wavefront"])
def test_what_is_picked_is_where_it_is_seen(kind: str, in_blocks: bool) -> None:
    scene = mixed_scene().with_camera(**KINDS[kind])
    session = session_of(device(), scene, in_blocks)
    width, height = session.size
    hits = session.first_hits()
    assert {-1} < set(hits.object_id.ravel().tolist())
    at = np.argwhere(hits.object_id >= 0)
    starts, ways = scene.camera.rays(
        np.column_stack([(at[:, 1] + 0.5) / width, (at[:, 0] + 0.5) / height]), width / height
    )
    depth = hits.depth[hits.object_id >= 0]
    points = starts + ways / np.linalg.norm(ways, axis=1, keepdims=True) * depth[:, None]
    # Where a ray ends lies in the bounds of the object, as far as single precision tells.
    for name, number in scene.object_index.items():
        mine = points[hits.object_id[hits.object_id >= 0] == number]
        low, high = scene.object(name).world_bounds
        assert ((mine > low - 1e-4) & (mine < high + 1e-4)).all(), name
    for row, column in at[:: max(len(at) // 6, 1)]:
        assert session.pick((int(column), int(row))) == scene.objects[hits.object_id[row, column]].name
    # Rows of a picture are a picture of their own.
    part = session.first_hits(rows=(7, 19))
    np.testing.assert_array_equal(part.object_id, hits.object_id[7:19])
    np.testing.assert_allclose(part.depth, hits.depth[7:19], rtol=1e-5)


@pytest.mark.slow
@kinds
def test_a_change_is_seen_within_the_windows_of_its_object(kind: str) -> None:
    """Base colours of what samples meet first change with the cube nowhere else, and the windows are no
    larger than what is seen from all over the lens."""
    scene = mixed_scene().with_camera(**KINDS[kind])
    scene = scene.with_object("red cube", position=(0.2, 1.0, 0.8), scale=(0.5, 0.5, 0.5), rotation=(0, 0, 0))
    settings = RenderSettings(size=(88, 56), tile_size=8, aovs=True, base_nor=64)
    pictures = []
    for one in (scene, scene.without_object("red cube")):
        session = Session(one, settings=settings, device=device())
        session.render(256)
        pictures.append(session.pass_image("albedo"))
    differs = (pictures[0] != pictures[1]).any(axis=-1)
    grid = TileGrid(88, 56, 8)
    (window,) = windows(grid, scene.camera, (scene.object("red cube"),))
    left, top, right, bottom = window
    rows, columns = np.flatnonzero(differs.any(axis=1)), np.flatnonzero(differs.any(axis=0))
    assert left <= columns[0] <= left + 5 and right - 5 <= columns[-1] < right
    assert top <= rows[0] <= top + 5 and bottom - 5 <= rows[-1] < bottom
    seen = seen_tiles(grid, scene.camera, (scene.object("red cube"),))
    assert 0 < len(seen) < grid.count
    x, y = point_of_change(scene.camera, (scene.object("red cube"),), 88, 56)
    assert left < x < right and top < y < bottom


@pytest.mark.slow
@kinds
def test_blocks_and_wavefront_agree(kind: str) -> None:
    scene = mixed_scene(size=(53, 37), base_nor=8).with_camera(**KINDS[kind])
    images = []
    for in_blocks in (True, False):
        session = session_of(device(), scene, in_blocks, 8)
        session.render(8)
        images.append(session.image())
    assert np.median(np.abs(images[0] - images[1])) < 1e-5
    assert images[0].mean() == pytest.approx(images[1].mean(), rel=1e-3)


@pytest.mark.slow
def test_an_edit_behind_a_lens_converges_to_a_fresh_render() -> None:
    """What was moved is far out of focus, so that no pixel shows it alone."""
    scene = mixed_scene(strategy="impact", size=(40, 28), base_nor=16).with_camera(
        f_stop=0.03, focus_distance=1.8
    )
    session = Session(scene, device=device())
    session.render(128)
    scene = scene.with_object("red cube", position=(0.7, 0.9, 0.3))
    session.edit(scene)
    early = []
    session.render(128)
    early.append(session.image())
    pictures = []
    for seed in (5, 6, 7, 8):
        fresh = Session(
            replace(scene, settings=replace(scene.settings, seed=seed, strategy="restart")), device=device()
        )
        fresh.render(128)
        pictures.append(fresh.image())
    mean, noise = np.mean(pictures, axis=0), np.std(pictures, axis=0, ddof=1)
    error = np.sqrt(((session.image() - mean) ** 2).mean())
    assert error < 1.3 * np.sqrt((noise**2).mean() * 1.25)
    bias = (session.image() - mean).mean()
    assert abs(bias) < 5 * np.sqrt((noise**2).mean() * 1.25 / mean.size)


@pytest.mark.slow
def test_pixels_that_show_a_bit_of_what_changed_count_as_changed() -> None:
    """Behind a lens that is as far as the blur reaches, whatever the middle of the lens sees."""
    shown = []
    for f_stop in (0.0, 0.1):
        scene = mixed_scene(strategy="impact").with_camera(f_stop=f_stop, focus_distance=1.5)
        session = Session(scene, device=device())
        session.render(4)
        session.edit(scene.with_material("red", base_color=(0.1, 0.2, 0.8)))
        comparison = session._state.comparison
        assert comparison is not None
        shown.append(comparison.seen.changed)
        with_colour = session.first_hits().object_id == scene.object_index["red cube"]
        np.testing.assert_array_equal(shown[-1] & with_colour, with_colour)
    y, x = np.nonzero(shown[0])
    blur = scene.camera.blur(np.array([[0.0, 0.5, 0.0]]), 44 / 28)[0] * (44, 28)
    # Every pixel within the blur of the cube's middle, across and down, is among them.
    for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        column = np.clip(x + int(dx * blur[0]), 0, 43)
        row = np.clip(y + int(dy * blur[1]), 0, 27)
        assert shown[1][row, column].all()
    assert blur.min() > 2 and shown[1].sum() < shown[1].size


@pytest.mark.slow
@pytest.mark.parametrize("in_blocks", [True, False], ids=["blocks", "wavefront"])
@pytest.mark.parametrize("near", [0.0, 2.2])
def test_a_medium_around_the_near_plane_is_a_part_of_all_paths(near: float, in_blocks: bool) -> None:
    """The camera itself stands outside of the body; where its rays start they are inside."""
    clear = Material((1, 1, 1), roughness=0, transmission=1, ior=1.0, specular=0, absorption=(1,) * 3)
    body = Object("body", shape("cube"), "dark", scale=(2, 2, 2))
    # Paths end on it, inside of the body, whose boundary they need not meet.
    wall = Object("wall", shape("plane"), "wall", (0, 0, -0.5), (90, 0, 0), (1.5, 1, 1.5))
    materials = {"dark": clear, "wall": Material((0, 0, 0), specular=0, emission=(1, 1, 1))}
    settings = RenderSettings(size=(16, 16), tile_size=8)
    scene = Scene(Camera((0, 0, 3), (0, 0, 0), fov_y=10, near=near), Environment((1, 1, 1)), materials,
                  (body, wall), settings)  # fmt: skip
    check(traced_pairs(device(), scene, scene.with_material("dark", absorption=(0.5, 2, 0)), in_blocks))


def test_near_cuts_off_what_is_nearer() -> None:
    scene = mixed_scene().with_camera(position=(0, 0.5, 4.0), target=(0, 0.5, 0))
    cube = scene.object("red cube")
    front = 4.0 - cube.world_bounds[1][2]
    for near, is_seen in ((front - 0.01, True), (4.0 - cube.world_bounds[0][2] + 0.01, False)):
        hits = Session(scene.with_camera(near=near), device=device()).first_hits()
        assert (hits.object_id == scene.object_index["red cube"]).any() == is_seen
        assert (hits.depth[np.isfinite(hits.depth)] >= near).all()


@pytest.mark.slow
def test_a_camera_starts_in_the_media_around_its_near_plane() -> None:
    materials = {
        "dark": Material((1, 1, 1), roughness=0, transmission=1, ior=1.0, specular=0, absorption=(1,) * 3)
    }
    body = Object("body", shape("cube"), "dark", scale=(2, 2, 2))
    scene = Scene(Camera((0, 0, 3), (0, 0, 0), fov_y=1), Environment((1, 1, 1)), materials, (body,))
    for changes, depth in (({}, 2.0), ({"near": 2.5}, 1.5), ({"near": 4.5}, 0.0), ({"near": 1.0}, 2.0)):
        image = render(scene.with_camera(**changes), 1, (8, 8))
        np.testing.assert_allclose(image, np.exp(-depth), rtol=1e-3, err_msg=str(changes))
    inside = scene.with_camera(position=(0, 0, 0.5), projection="orthographic", ortho_height=0.5)
    np.testing.assert_allclose(render(inside, 1, (8, 8)), np.exp(-1.5), rtol=1e-3)
