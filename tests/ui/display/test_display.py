"""What arrives on the screen, read back from an offscreen OpenGL context."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from support.small_scenes import mixed_scene

from incpt import Session
from incpt.device.device import Device
from incpt.picture.tone_mapping import CURVES, tone_map
from incpt.render import tiles
from incpt.render.first_hits import FirstHits
from incpt.render.modes import Mode
from incpt.scene.camera import Camera
from incpt.scene.model import Scene
from incpt.ui.display import overlays
from incpt.ui.preferences import DisplaySettings
from incpt.viewer.view import Picture

if os.environ.get("CI"):
    import moderngl
else:
    moderngl = pytest.importorskip("moderngl", reason="the editor's packages are not installed")

from incpt.ui.display.display import Display
from incpt.ui.display.outline import ACTIVE, SELECTED, Outlined, is_closed
from incpt.ui.display.projection import split_x
from incpt.ui.rect import Rect

CLEAR = (51, 51, 51)
PLAIN = DisplaySettings(curve="srgb", outline=False)
EDGE_PIXELS = 3
"""Pixels whose centre lies on an edge to within rounding may fall to either side."""


class Screen:
    """A framebuffer of its own and a Display that draws into it."""

    def __init__(self, context: Any, size: tuple[int, int]) -> None:
        self.size = size
        self._texture = context.texture(size, 4)
        self._framebuffer = context.framebuffer([self._texture])
        self.display = Display(context)

    def draw(
        self, rect: Rect[float], settings: DisplaySettings = PLAIN, **more: Any
    ) -> npt.NDArray[np.uint8]:
        """(h, w, 3), row 0 on top."""
        self._framebuffer.use()
        self._framebuffer.clear(*(c / 255 for c in CLEAR))
        self.display.draw(rect, settings, framebuffer_size=self.size, **more)
        pixels = np.frombuffer(self._framebuffer.read(components=4, alignment=1), np.uint8)
        return pixels.reshape(self.size[1], self.size[0], 4)[::-1, :, :3]

    def release(self) -> None:
        for each in (self.display, self._framebuffer, self._texture):
            each.release()


@pytest.fixture
def screen(context: Any) -> Iterator[Any]:
    made: list[Screen] = []

    def make(width: int, height: int) -> Screen:
        made.append(Screen(context, (width, height)))
        return made[-1]

    yield make
    for each in made:
        each.release()


def picture(rgb: npt.ArrayLike, tile_size: int = 8, alpha: npt.ArrayLike = 1.0) -> Picture:
    rgb = np.asarray(rgb, np.float32)
    image = np.empty((*rgb.shape[:2], 4), np.float32)
    image[..., :3], image[..., 3] = rgb, alpha
    grid = tiles.TileGrid(rgb.shape[1], rgb.shape[0], tile_size)
    zeros = np.zeros(grid.count, np.int64)
    return Picture(image, grid, Mode.REFINE, tiles.base_queue(grid), 0, zeros, zeros > 0, 0.0, None, "spiral")


def noise(width: int, height: int) -> npt.NDArray[np.float32]:
    return np.random.default_rng(1).random((height, width, 3), np.float32)


def mapped(rgb: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    return tone_map(rgb, curve="srgb")


def assert_same(shown: npt.NDArray[np.uint8], expected: npt.NDArray[np.uint8], within: int = 1) -> None:
    assert shown.shape == expected.shape
    assert np.abs(shown.astype(int) - expected).max(initial=0) <= within


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("exposure", [-20.0, -7.3, 0.0, 0.5, 4.0, 20.0])
def test_the_screen_shows_what_a_png_holds(screen: Any, curve: str, exposure: float) -> None:
    random = np.random.default_rng(2)
    hue = random.random((64, 64, 3)) ** 4
    rgb = (hue * np.logspace(-9, 9, 64)[None, :, None]).astype(np.float32)
    rgb[0] = np.linspace(0, 1.2, 64)[:, None]
    rgb[1, :4] = [[0, 0, 0], [-1, 2, 3], [np.inf, 0, 0], [-np.inf] * 3]
    rgb[1, 4:8] = [[np.nan, 1, 1], [1, 1, -np.nan], [1e38, 1e-38, 1e-44], [65504, 65505, 1e6]]
    window = screen(64, 64)
    window.display.upload([picture(rgb)])
    shown = window.draw(Rect(0, 0, 64, 64), replace(PLAIN, curve=curve, exposure=exposure))
    assert_same(shown, tone_map(rgb, exposure, curve))


def test_pixels_keep_their_places_and_clipping_holds(screen: Any) -> None:
    rgb = noise(20, 10)
    window = screen(64, 48)
    window.display.upload([picture(rgb)])
    blocks = mapped(rgb).repeat(4, axis=0).repeat(4, axis=1)
    shown = window.draw(Rect(-8, 12, 80, 40))
    assert_same(shown[12:], blocks[:36, 8:72])
    assert (shown[:12] == CLEAR).all()
    shown = window.draw(Rect(-8, 12, 80, 40), clip_px=Rect(10, 20, 30, 8))
    assert_same(shown[20:28, 10:40], blocks[8:16, 18:48])
    outside = np.ones(shown.shape[:2], bool)
    outside[20:28, 10:40] = False
    assert (shown[outside] == CLEAR).all()
    for nowhere in (Rect(100, 0, 80, 40), Rect(3.5, 3.5, 0, 9), Rect(0, 0, 9, float("nan"))):
        assert (window.draw(nowhere) == CLEAR).all()


def test_far_magnification_shows_the_right_pixel(screen: Any) -> None:
    rgb = noise(20, 10)
    window = screen(30, 20)
    window.display.upload([picture(rgb)])
    shown = window.draw(Rect(-1000 * 7 - 500, -1000 * 3 - 500, 20_000, 10_000))
    assert_same(shown, np.broadcast_to(mapped(rgb)[3, 7], shown.shape))


def test_pixels_are_squares_from_twofold_magnification(screen: Any) -> None:
    rgb = np.zeros((8, 8, 3))
    rgb[:, 4:] = 1
    window = screen(64, 64)
    window.display.upload([picture(rgb)])
    assert set(np.unique(window.draw(Rect(0, 0, 16, 16))[:16, :16])) == {0, 255}
    assert len(np.unique(window.draw(Rect(0, 0, 15, 15))[:15, :15])) > 2


def test_a_new_exposure_or_picture_is_shown_and_the_same_array_is_not_sent_again(screen: Any) -> None:
    first, second = picture(noise(16, 8)), picture(noise(16, 8)[::-1])
    window, rect = screen(16, 8), Rect(0, 0, 16, 8)
    for shown in (first, second, first):
        window.display.upload([shown])
        assert_same(window.draw(rect), mapped(shown.image[..., :3]))
    brighter = replace(PLAIN, exposure=1.0)
    assert_same(window.draw(rect, brighter), tone_map(first.image[..., :3], 1.0, "srgb"))
    before = mapped(first.image[..., :3])
    first.image[:] = 0.5
    window.display.upload([replace(first, queue_done=3)])
    assert_same(window.draw(rect), before)


def test_the_preview_shows_until_its_successor_is_complete(screen: Any) -> None:
    red, blue = np.array([0.8, 0.1, 0.1]), np.array([0.1, 0.1, 0.8])
    preview = picture(np.broadcast_to(red, (4, 8, 3)))
    alpha = np.zeros((8, 16))
    alpha[:4] = 1
    half, whole = (picture(np.broadcast_to(blue, (8, 16, 3)), alpha=a) for a in (alpha, 1.0))
    later = picture(np.broadcast_to(blue, (8, 16, 3)), alpha=alpha)
    window, rect = screen(16, 8), Rect(0, 0, 16, 8)
    window.display.upload([preview])
    assert_same(window.draw(rect), np.broadcast_to(mapped(red), (8, 16, 3)))
    window.display.upload([half])
    shown = window.draw(rect)
    assert_same(shown[:4], np.broadcast_to(mapped(blue), (4, 16, 3)))
    assert_same(shown[4:], np.broadcast_to(mapped(red), (4, 16, 3)))
    window.display.upload([whole])
    assert_same(window.draw(rect), np.broadcast_to(mapped(blue), (8, 16, 3)))
    window.display.upload([later])
    background = np.rint(np.array(window.display.background) * 255).astype(np.uint8)
    assert_same(window.draw(rect)[4:], np.broadcast_to(background, (4, 16, 3)))
    window.display.upload([preview])
    window.display.forget()
    window.display.upload([half])
    assert_same(window.draw(rect)[4:], np.broadcast_to(background, (4, 16, 3)))


def test_a_transparent_picture_lies_on_a_checkerboard(screen: Any) -> None:
    rgb, alpha = noise(32, 16) * 0.5, np.zeros((16, 32))
    alpha[:, 8:16], alpha[:, 16:] = 0.5, 1.0
    seen = replace(picture(rgb * alpha[..., None], alpha=alpha), transparent=True)
    window = screen(32, 16)
    window.display.upload([seen])
    shown = window.draw(Rect(0, 0, 32, 16))
    assert_same(shown[:, 16:], mapped(rgb)[:, 16:])
    board = shown[:, :8]
    assert len(np.unique(board)) == 2 and (board[0, 0] != board[8, 0]).all()
    # The squares alternate along a row too, so that those of the next columns are the other ones.
    behind = board[::-1].astype(int)
    assert_same(shown[:, 8:16], np.rint((mapped(rgb)[:, 8:16].astype(int) + behind) / 2).astype(np.uint8), 2)


def test_the_preview_of_a_transparent_picture_shows_until_all_tiles_are_there(screen: Any) -> None:
    red = picture(np.broadcast_to((0.8, 0.1, 0.1), (4, 8, 3)))
    whole = replace(red, transparent=True, tile_spp=red.tile_spp + 1)
    alpha = np.zeros((8, 16))
    waiting = replace(picture(np.zeros((8, 16, 3)), alpha=alpha), transparent=True)
    window, rect = screen(16, 8), Rect(0, 0, 16, 8)
    window.display.upload([whole])
    window.display.upload([waiting])
    assert_same(window.draw(rect), np.broadcast_to(mapped((0.8, 0.1, 0.1)), (8, 16, 3)))
    empty = picture(np.zeros((8, 16, 3)), alpha=alpha)
    window.display.upload([replace(empty, transparent=True, tile_spp=empty.tile_spp + 1)])
    assert len(np.unique(window.draw(rect))) == 2


@pytest.mark.parametrize(
    "rect", [Rect(0, 0, 111, 63), Rect(3.3, 2.6, 150.9, 85.7), Rect(-40.25, -20.5, 444, 250.9)]
)
def test_each_tile_line_is_one_pixel_wide(screen: Any, rect: Rect[float]) -> None:
    window = screen(160, 90)
    window.display.upload([picture(np.full((28, 44, 3), 0.05), tile_size=9)])
    plain = window.draw(rect)
    lines = (window.draw(rect, replace(PLAIN, tile_grid=True)) != plain).any(axis=-1)
    inside = (plain != CLEAR).any(axis=-1)
    columns = [int(np.floor(rect.left + k * 9 * rect.width / 44)) for k in range(1, 5)]
    rows = [int(np.floor(rect.top + k * 9 * rect.height / 28)) for k in range(1, 4)]
    expected = np.zeros_like(lines)
    expected[:, [c for c in columns if 0 <= c < 160]] = True
    expected[[r for r in rows if 0 <= r < 90]] = True
    assert (lines == (expected & inside)).all()


def test_tile_lines_contrast_with_what_they_cross_and_fade_when_dense(screen: Any) -> None:
    rgb = np.zeros((32, 32, 3)) + 0.01
    rgb[:, 16:] = 0.9
    window = screen(128, 128)
    window.display.upload([picture(rgb)])
    with_grid, plain = (
        window.draw(Rect(0, 0, 128, 128), replace(PLAIN, tile_grid=on)).astype(int) for on in (True, False)
    )
    changed = (with_grid - plain)[5, :, 0]
    assert changed[32] > 40 and changed[96] < -40
    assert (
        window.draw(Rect(0, 0, 10, 10), replace(PLAIN, tile_grid=True)) == window.draw(Rect(0, 0, 10, 10))
    ).all()


def first_hits(width: int, height: int) -> FirstHits:
    ids = np.random.default_rng(3).integers(-1, 5, (height, width)).astype(np.int32)
    shape = (height, width)
    return FirstHits(ids, np.zeros((*shape, 3), np.float32), np.ones(shape, np.float32), np.ones((*shape, 3)))


def test_overlays_lie_on_their_pixels_and_blend(screen: Any) -> None:
    shown, hits = picture(noise(44, 28), tile_size=9), first_hits(44, 28)
    window, rect = screen(88, 56), Rect(0, 0, 88, 56)
    window.display.upload([shown], hits)
    for kind in ("object_ids", "queue"):
        overlay = overlays.build(kind, shown, hits)
        assert overlay is not None
        image = overlay.image
        if kind == "queue":
            image = image.repeat(9, axis=0).repeat(9, axis=1)[:28, :44]
        below = mapped(shown.image[..., :3])
        for opacity in (0.0, 0.6, 1.0):
            weight = image[..., 3:] / 255 * opacity
            expected = np.rint(below * (1 - weight) + image[..., :3] * weight).astype(np.uint8)
            got = window.draw(rect, replace(PLAIN, overlay=kind, overlay_opacity=opacity))
            assert_same(got, expected.repeat(2, axis=0).repeat(2, axis=1))
        drawn = window.display.overlay()
        assert drawn is not None and (drawn.image == overlay.image).all()
    window.draw(rect)
    assert window.display.overlay() is None


def test_an_overlay_follows_its_picture(screen: Any) -> None:
    window, rect = screen(44, 28), Rect(0, 0, 44, 28)
    settings = replace(PLAIN, overlay="replaced")
    shown = picture(np.full((28, 44, 3), 0.2))
    window.display.upload([shown])
    assert_same(window.draw(rect, settings), mapped(shown.image[..., :3]))
    replaced = np.zeros(shown.grid.count, bool)
    replaced[1] = True
    window.display.upload([replace(shown, replaced=replaced)])
    changed = (window.draw(rect, settings) != mapped(shown.image[..., :3])).any(axis=-1)
    assert changed[:8, 8:16].all() and changed.sum() == 64


def test_a_split_view_shows_both_sides_and_a_bar(screen: Any) -> None:
    left, right = picture(np.full((60, 80, 3), 0.02)), picture(np.full((60, 80, 3), 0.3))
    window, rect = screen(90, 60), Rect(6, 0, 80, 60)
    window.display.upload([left, right])
    dark, bright = int(mapped([[0.02] * 3])[0, 0]), int(mapped([[0.3] * 3])[0, 0])
    shown = window.draw(rect, replace(PLAIN, split=True, split_position=0.25))
    bar = round(split_x(rect, 0.25))
    assert bar == 26
    row = shown[3, :, 0].astype(int)
    assert np.abs(row[6 : bar - 3] - dark).max() <= 1 and np.abs(row[bar + 3 : 86] - bright).max() <= 1
    assert (row[bar - 1 : bar + 1] > 230).all() and row[bar - 2] < dark and row[bar + 1] < bright
    assert (shown[30, bar - 4 : bar + 4, 0] > 100).sum() > 5  # the grip
    for position in (0.0, 1.0):
        ends = window.draw(rect, replace(PLAIN, split=True, split_position=position))
        assert np.abs(int(ends[3, 45, 0]) - (bright if position == 0 else dark)) <= 1
    unsplit = window.draw(rect)
    assert np.abs(unsplit[:, 6:86].astype(int) - bright).max() <= 1
    window.display.upload([right])
    assert_same(window.draw(rect, replace(PLAIN, split=True)), unsplit)


# The outline.


def lone(name: str, **changes: Any) -> Scene:
    scene = mixed_scene(size=(96, 64), tile_size=16)
    return replace(scene, objects=(replace(scene.object(name), **changes),))


def outlined(scene: Scene, *names: str, active: str | None = None) -> Outlined:
    return Outlined(scene, frozenset(names), active)


def mask_at(window: Screen, rect: Rect[float], selection: Outlined) -> npt.NDArray[np.uint8]:
    """(h, w) of the screen."""
    window.draw(rect, replace(PLAIN, outline=True), selection=selection)
    part, (x, y, width, height) = window.display.outline.mask()
    whole = np.zeros((window.size[1], window.size[0]), np.uint8)
    whole[y : y + height, x : x + width] = part
    return whole


@pytest.mark.parametrize(
    "scene",
    [
        lone("red cube"),
        lone("red cube", scale=(-1.2, 0.7, 1.0), rotation=(20, 40, 70)),
        lone("glass ball", position=(-1.3, 0.9, 1.0)),
        lone("grey drum").with_camera(up=(0.3, 1, 0.1), fov_y=70, position=(-2, 0.2, 1)),
        lone("floor"),
        lone("red cube", scale=(30, 30, 30)),
        lone("floor", scale=(400, 1, 400)),
        lone("red cube").with_camera(projection="orthographic", ortho_height=3, shift_x=0.2),
        lone("floor", scale=(400, 1, 400)).with_camera(projection="orthographic", ortho_height=3),
        lone("red cube").with_camera(shift_x=0.2, shift_y=-0.1, focal_length=30),
        lone("floor").with_camera(near=4.0),
    ],
    ids=[
        "cube",
        "mirrored",
        "ball",
        "tilted",
        "floor",
        "from inside",
        "behind the camera too",
        "orthographic",
        "behind an orthographic camera too",
        "shifted",
        "near",
    ],
)
def test_the_mask_is_what_the_path_tracer_sees(screen: Any, device: Device, scene: Scene) -> None:
    seen = Session(scene, device=device).first_hits().object_id >= 0
    window = screen(96, 64)
    window.display.upload([picture(noise(96, 64))])
    name = scene.objects[0].name
    mask = mask_at(window, Rect(0, 0, 96, 64), outlined(scene, name, active=name)) > 0
    assert seen.sum() > 100
    assert (mask != seen).sum() <= EDGE_PIXELS


def test_the_mask_follows_zoom_and_pan(screen: Any, device: Device) -> None:
    scene = lone("grey drum")
    seen = Session(scene, size=(384, 256), device=device).first_hits().object_id >= 0
    window = screen(120, 90)
    window.display.upload([picture(noise(96, 64))])
    mask = mask_at(window, Rect(-70, -110, 384, 256), outlined(scene, "grey drum")) > 0
    expected = seen[110:200, 70:190]
    assert 0.2 < expected.mean() < 0.8 and (mask != expected).sum() <= EDGE_PIXELS


def test_nearer_objects_and_the_active_one_lie_on_top(screen: Any) -> None:
    scene = mixed_scene()
    near = outlined(scene, "red cube", "glass ball", "floor")
    assert [o.name for o in near.objects][-1] != "floor"
    active = outlined(scene, "red cube", "glass ball", "floor", active="floor")
    assert [o.name for o in active.objects][-1] == "floor"
    hidden = scene.with_object("red cube", visible=False)
    assert outlined(hidden, "red cube", "gone").objects == ()


def is_color(shown: npt.NDArray[np.uint8], color: tuple[float, float, float]) -> npt.NDArray[np.bool_]:
    near: npt.NDArray[np.bool_] = np.abs(shown / 255 - np.array(color)).max(axis=-1) < 0.02
    return near


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_the_line_is_outside_two_pixels_wide_and_follows_a_drag(screen: Any, scale: float) -> None:
    scene, rect = lone("red cube", rotation=(0, 0, 0)), Rect(0, 0, 192, 128)
    window = screen(192, 128)
    window.display.upload([picture(np.full((64, 96, 3), 0.2))])
    settings = replace(PLAIN, outline=True)
    plain = window.draw(rect)
    places = []
    for x in (0.0, 0.8):
        moved = scene.with_object("red cube", position=(x, 0.5, 0))
        selection = outlined(moved, "red cube", active="red cube")
        shown = window.draw(rect, settings, selection=selection, scale=scale)
        mask = mask_at(window, rect, selection) > 0
        assert (shown[mask] == plain[mask]).all()
        line = is_color(shown, ACTIVE)
        row = np.flatnonzero(line[70])
        first = int(np.flatnonzero(mask[70])[0])
        assert row[: int(2 * scale)].tolist() == list(range(first - int(2 * scale), first))
        assert shown[70, first - int(2 * scale) - 1].max() < plain[70, 0].min() - 30  # the rim
        places.append(first)
    assert places[1] - places[0] > 10
    assert (window.draw(rect, replace(settings, outline=False), selection=selection) == plain).all()
    assert (window.draw(rect, settings, selection=outlined(scene)) == plain).all()


def test_the_active_object_is_brighter(screen: Any) -> None:
    scene, rect = mixed_scene(), Rect(0, 0, 176, 112)
    window = screen(176, 112)
    window.display.upload([picture(np.full((28, 44, 3), 0.2))])
    both = outlined(scene, "red cube", "grey drum", active="red cube")
    shown = window.draw(rect, replace(PLAIN, outline=True), selection=both)
    assert is_color(shown, ACTIVE).sum() > 50 and is_color(shown, SELECTED).sum() > 50
    assert sum(ACTIVE) > sum(SELECTED)
    assert is_color(shown[:, :60], SELECTED).any() and not is_color(shown[:, :60], ACTIVE).any()


def test_meshes_are_kept_only_while_selected(screen: Any) -> None:
    scene, rect = mixed_scene(), Rect(0, 0, 44, 28)
    window = screen(44, 28)
    window.display.upload([picture(noise(44, 28))])
    counts = []
    for names in (("red cube", "grey drum"), ("red cube",), (), ("floor", "lamp")):
        window.draw(rect, replace(PLAIN, outline=True), selection=outlined(scene, *names))
        counts.append(window.display.outline.mesh_count)
    assert counts == [2, 1, 0, len({id(scene.object(n).mesh) for n in ("floor", "lamp")})]


def test_closed_surfaces_are_told_from_open_ones() -> None:
    scene = mixed_scene()
    assert is_closed(scene.object("red cube").mesh) and is_closed(scene.object("glass ball").mesh)
    cube = replace(scene.object("red cube").mesh, uvs=())
    assert not is_closed(scene.object("floor").mesh)
    assert not is_closed(replace(cube, faces=cube.faces[:-1]))
    turned = cube.faces.copy()
    turned[0] = turned[0, ::-1]
    assert not is_closed(replace(cube, faces=turned))


def test_everything_is_given_back(context: Any) -> None:
    context.gc_mode = "context_gc"
    try:
        window = Screen(context, (88, 56))
        small, large = picture(noise(22, 14)), picture(noise(44, 28), alpha=0.0)
        settings = DisplaySettings(overlay="queue", tile_grid=True, split=True)
        for shown in (small, large):
            window.display.upload([shown, shown], first_hits(44, 28))
            window.draw(Rect(0, 0, 88, 56), settings, selection=outlined(mixed_scene(), "red cube"))
        window.release()
        del window
        assert len(context.objects) > 15
        assert [o for o in context.objects if not isinstance(o, moderngl.InvalidObject)] == []
    finally:
        context.objects.clear()
        context.gc_mode = None


def test_a_region_lies_in_the_last_whole_picture(screen: Any) -> None:
    whole, part, later = noise(20, 10), noise(10, 4)[:, ::-1], noise(20, 10)[::-1]
    region, camera = Rect(0.25, 0.2, 0.5, 0.4), Camera()
    window = screen(80, 40)
    window.display.upload([picture(whole)], None, None, camera)
    window.display.upload([picture(part)], None, region, camera)
    expected = mapped(whole).repeat(4, axis=0).repeat(4, axis=1)
    expected[8:24, 20:60] = mapped(part).repeat(4, axis=0).repeat(4, axis=1)
    assert_same(window.draw(Rect(0, 0, 80, 40)), expected)
    other = Rect(0.5, 0.2, 0.5, 0.4)
    window.display.upload([picture(part)], None, other, camera)
    shown = window.draw(Rect(0, 0, 80, 40))
    assert_same(shown[:, :40], mapped(whole).repeat(4, axis=0).repeat(4, axis=1)[:, :40])
    # Seen by another camera nothing is known of what lies around it.
    window.display.upload([picture(part)], None, other, Camera(fov_y=12))
    shown = window.draw(Rect(0, 0, 80, 40))
    assert (shown[:, :40] == CLEAR).all() and not (shown[8:24, 40:] == CLEAR).all()
    window.display.upload([picture(later)])
    assert_same(window.draw(Rect(0, 0, 80, 40)), mapped(later).repeat(4, axis=0).repeat(4, axis=1))


def test_the_whole_picture_shows_through_after_a_region(screen: Any) -> None:
    whole, part = noise(20, 10), noise(10, 4)
    window = screen(80, 40)
    window.display.upload([picture(whole)])
    window.display.upload([picture(part)], None, Rect(0.25, 0.2, 0.5, 0.4))
    rows = np.zeros((10, 20), np.float32)
    rows[:5] = 1
    window.display.upload([picture(whole * 0.5, alpha=rows)])
    expected = (
        np.concatenate([mapped(whole * 0.5)[:5], mapped(whole)[5:]]).repeat(4, axis=0).repeat(4, axis=1)
    )
    # The old one is smooth where it is magnified.
    shown = window.draw(Rect(0, 0, 80, 40))
    assert_same(shown[:20], expected[:20])
    assert np.abs(shown[20:].astype(int) - expected[20:]).max() < 128
