"""The scene shaded by OpenGL: what is where, in which colours, and what stays on the GPU."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, desk, frame_of, tell

from incpt.device.device import Device
from incpt.render.session import Session
from incpt.scene.camera import Camera
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.texture import Bitmap, Texture
from incpt.ui.display import shading
from incpt.viewer.renderer import Copy, Waiting

if not os.environ.get("CI"):
    pytest.importorskip("moderngl", reason="the editor's packages are not installed")

from incpt.ui.display.shading import Shading
from incpt.ui.rect import Rect

SIZE = (88, 56)
SCENE = mixed_scene(size=SIZE)
BACKGROUND = np.round(np.array(shading._BACKGROUND) * 255)


class Screen:
    def __init__(self, context: Any) -> None:
        self.context, self.shading = context, Shading(context)

    def draw(
        self, scene: Scene, kind: str = "solid", part: Rect[int] | None = None
    ) -> npt.NDArray[np.float64]:
        """(h, w, 3) row 0 on top."""
        width, height = scene.settings.size
        target = self.context.simple_framebuffer((width, height), 4)
        target.clear(1.0, 0.0, 1.0)
        whole = Rect(0, 0, width, height)
        self.shading.draw(target, part or whole, whole, height, scene, kind)
        pixels = np.frombuffer(target.read(components=3, alignment=1), np.uint8)
        target.release()
        return pixels.reshape(height, width, 3)[::-1].astype(float)


@pytest.fixture
def screen(context: Any) -> Iterator[Screen]:
    made = Screen(context)
    yield made
    made.shading.release()


def differs(picture: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Where something is before the background."""
    return np.asarray(np.abs(picture - BACKGROUND).max(axis=2) > 2)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_everything_is_where_the_renderer_sees_it(screen: Screen, device: Device, projection: str) -> None:
    camera = replace(SCENE.camera, projection=projection, ortho_height=3.0, shift_x=0.05)
    scene = replace(SCENE, camera=camera)
    hits = Session(scene, device=device).first_hits()
    shown = screen.draw(scene)
    assert (differs(shown) != (hits.object_id >= 0)).mean() < 0.01
    # What is nearer covers what is farther: the red cube stands before the floor, and so on.
    red = scene.object_index["red cube"]
    is_red = shown[..., 0] > 1.3 * shown[..., 1]
    assert (is_red != (hits.object_id == red)).mean() < 0.02 and is_red.any()
    half = screen.draw(scene, part=Rect(20, 10, 30, 20))
    assert np.array_equal(half[10:30, 20:50], shown[10:30, 20:50])
    assert (half[:10] == (255, 0, 255)).all()


def card(pixels: npt.NDArray[Any], **values: Any) -> Scene:
    """An image on a square that fills the picture, lit from the front."""
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
    faces = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
    uvs = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32)[faces]
    texture = Texture(Bitmap(pixels), **values.pop("texture", {}))
    material = Material(base_color_texture=texture, roughness=1.0, specular=0.0, **values)
    settings = replace(SCENE.settings, size=(32, 32))
    camera = Camera((0, 0, 5), (0, 0, 0), projection="orthographic", ortho_height=2.0)
    mesh = Mesh(corners, faces, uvs=(uvs,))
    return Scene(camera, SCENE.environment, {"card": material}, [Object("card", mesh, "card")], settings)


RED_AND_BLUE = np.zeros((2, 2, 4), np.uint8)
RED_AND_BLUE[..., 3] = 255
RED_AND_BLUE[0, 0], RED_AND_BLUE[1, 1] = (255, 0, 0, 255), (0, 0, 255, 255)


def test_an_image_lies_as_in_the_file(screen: Screen) -> None:
    shown = screen.draw(card(RED_AND_BLUE), "material")
    top_left, bottom_right, dark = shown[4, 4], shown[28, 28], shown[4, 28]
    assert top_left[0] > 100 and top_left[2] < 70 and bottom_right[2] > 100 and bottom_right[0] < 70
    assert dark.max() < 100
    plain = screen.draw(card(RED_AND_BLUE), "solid")
    assert np.ptp(plain[4:28, 4:28], axis=(0, 1)).max() <= 1, "solid shows no images"


@pytest.mark.parametrize(("wrap", "is_red"), [("repeat", True), ("mirror", False), ("clamp", False)])
def test_an_image_goes_on_beyond_its_edges(screen: Screen, wrap: str, is_red: bool) -> None:
    scene = card(RED_AND_BLUE, texture={"wrap": wrap, "offset": (1.0, 0.0)})
    shown = screen.draw(scene, "material")
    assert (shown[4, 4, 0] > 100) == is_red


def test_holes_show_what_is_behind(screen: Screen) -> None:
    holes = np.full((16, 16, 4), 255, np.uint8)
    holes[:, 8:, 3] = 100
    for mode, covered in (("opaque", 1.0), ("mask", 0.5), ("blend", 0.5 + 0.5 * 100 / 255)):
        shown = screen.draw(card(holes, alpha_mode=mode, texture={"filter": "nearest"}), "material")
        assert differs(shown).mean() == pytest.approx(covered, abs=0.12), mode
    glass = card(np.full((1, 1, 3), 255, np.uint8), transmission=1.0)
    assert differs(screen.draw(glass, "material")).mean() == pytest.approx(0.4, abs=0.1)


def test_metal_roughness_and_emission_are_seen(screen: Screen) -> None:
    def ball(**values: Any) -> npt.NDArray[np.float64]:
        material = Material(**{"base_color": (0.5, 0.5, 0.5), **values})
        scene = replace(
            SCENE, materials={"m": material}, objects=(Object("ball", shape("sphere"), "m", (0, 0.5, 0)),)
        )
        return screen.draw(scene, "material")

    rough, smooth = ball(roughness=1.0), ball(roughness=0.1)
    assert smooth.max() > rough.max() + 20, "a highlight"
    assert np.abs(ball(metallic=1.0, roughness=0.3) - ball(roughness=0.3)).max() > 20
    assert ball(emission=(0.0, 3.0, 0.0))[28, 44, 1] > rough[28, 44, 1] + 20
    assert ball(unlit=True, base_color=(0.2, 0.2, 0.2))[differs(ball(unlit=True))].std() < 25


def test_what_is_the_same_is_not_drawn_again_and_nothing_stays_for_long(
    screen: Screen, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[str] = []
    real = Shading._draw_object
    monkeypatch.setattr(
        Shading, "_draw_object", lambda self, one, clip: (drawn.append(one.name), real(self, one, clip))
    )
    first = screen.draw(SCENE)
    assert sorted(drawn) == sorted(one.name for one in SCENE.objects)
    drawn.clear()
    assert np.array_equal(screen.draw(replace(SCENE, lights=())), first) and not drawn
    moved = SCENE.with_object("red cube", position=(0.4, 0.5, 0.4))
    assert not np.array_equal(screen.draw(moved), first) and drawn
    hidden = screen.draw(SCENE.with_object("red cube", visible=False))
    assert not (hidden[..., 0] > 1.3 * hidden[..., 1]).any()
    screen.draw(card(RED_AND_BLUE), "material")
    assert screen.shading.counts == (1, 1)
    screen.draw(card(RED_AND_BLUE), "solid")
    screen.draw(replace(SCENE, objects=()), "material")
    assert screen.shading.counts == (0, 0)


# ------------------------------------------------------------------------------------------ in the editor


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        yield made


def test_the_device_rests_while_the_scene_is_shaded(user: Desk) -> None:
    tell(user, frame_of(user.null.views[-1]))
    user.key("Z")
    user.frames(2)
    user.click("Solid")
    assert user.editor.preferences.display.shading == "solid" and user.undo_count == 0
    view = user.null.views[-1]
    assert view.paused and not view.first_hits
    user.run("Cube")
    assert user.null.views[-1].scene is user.scene, "so that clicks find it"
    user.editor.show_region(Rect(0.25, 0.25, 0.5, 0.5))
    assert user.editor.region is None
    tell(user, Waiting((Copy(),)))
    assert not user.null.views[-1].paused, "a picture waits for it"
    tell(user, Waiting(()))
    user.run("Rendered")
    assert not user.null.views[-1].paused and user.editor.region is not None
