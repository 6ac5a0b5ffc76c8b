"""The editor's window for tests: a small picture on a virtual display, worked by mouse and keyboard."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from incpt.benchmarks.kit import desktop
from incpt.benchmarks.kit.desktop import Hand
from incpt.core.settings import RenderSettings
from incpt.formats import scene_save
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

DISPLAY_SIZE = (1100, 720)
WINDOW_SIZE = (900, 560)
PICTURE_SIZE = (224, 144)
TILE = 16
ARTEFACTS = Path(os.environ.get("INCPT_ARTEFACTS") or Path(__file__).parents[2] / "out" / "window")


def require_display() -> None:
    """Skip the test where no window can be shown; under CI that is a failure."""
    lacking = [f"{name} (apt install {name.lower()})" for name in desktop.missing_programs()]
    lacking += [f"{name} (pip install incpt[ui])" for name in ("imgui_bundle", "glfw", "moderngl")
                if find_spec(name) is None]  # fmt: skip
    if not lacking:
        return
    line = "the window is not tested; install " + ", ".join(lacking)
    if os.environ.get("CI"):
        pytest.fail(line)
    pytest.skip(line)


def table_scene() -> Scene:
    """A red cube, a blue ball and a grey drum in a row on a matte table, under an even sky."""
    materials = {
        "table": Material((0.6, 0.6, 0.6), specular=0.0),
        "red": Material((0.8, 0.05, 0.05), specular=0.0),
        "blue": Material((0.05, 0.1, 0.8), specular=0.0),
        "grey": Material((0.3, 0.3, 0.3), specular=0.0),
    }
    objects = (
        Object("table", shape("plane"), "table", scale=(12, 1, 12)),
        Object("red cube", shape("cube"), "red", position=(-0.3, 0.5, 0.6), rotation=(0, 30, 0)),
        Object("blue ball", shape("sphere"), "blue", position=(1.5, 0.5, 0)),
        Object("grey drum", shape("cylinder"), "grey", position=(-2, 0.5, 0)),
    )
    sky = Environment((1, 1, 1), Image(np.full((8, 16, 3), 0.8)))
    camera = Camera((0, 2.2, 6.5), (0, 0.4, 0), fov_y=38)
    settings = RenderSettings(size=PICTURE_SIZE, tile_size=TILE, nor=32, max_bounces=2)
    return Scene(camera, sky, materials, objects, settings)


@contextmanager
def opened(file: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Hand]:
    """The editor in its window on a scene file, with a whole picture; ends by asking nobody."""
    from incpt.ui import preferences
    from incpt.ui.app import App
    from incpt.ui.dialogs import native
    from incpt.ui.editor.document import Document

    monkeypatch.setenv(preferences.CONFIG_DIR, str(file.parent / "configuration"))
    # The system's dialogs are windows of other programs.
    monkeypatch.setattr(native, "is_there", lambda: False)
    preferences.save(preferences.Preferences(window_size=WINDOW_SIZE, ui_scale=1.0))
    app = App(Document.open(file), opened=file)
    try:
        hand = Hand(app)
        hand.pump(lambda: is_whole(hand))
        yield hand
    finally:
        app.close()


def scene_file(folder: Path) -> Path:
    """A scene file with `table_scene`, its sky beside it."""
    file = folder / "table.toml"
    scene_save.save(table_scene(), file)
    return file


def is_whole(hand: Hand) -> bool:
    """Whether every pixel of the picture has samples at full resolution."""
    frame = hand.app.editor.frame
    return frame is not None and not frame.is_preview and int(frame.pictures[-1].tile_spp.min()) > 0


def is_answered(hand: Hand) -> bool:
    """Whether the frame that is there shows the scene that is edited."""
    frame, editor = hand.app.editor.frame, hand.app.editor
    return frame is not None and frame.view.scene == editor.shown and frame.view.before is None


def keep(hand: Hand, stage: str) -> npt.NDArray[np.uint8]:
    """The window now, (H, W, 3), kept as an artefact."""
    return hand.screenshot(ARTEFACTS / f"{stage}.png")


def projected(scene: Scene, point: tuple[float, float, float]) -> npt.NDArray[np.float64]:
    """(x, y) of a point of the world in units of the picture from its top left."""
    camera = scene.camera
    position, target = np.array(camera.position), np.array(camera.target)
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    way = np.array(point) - position
    half = np.tan(np.radians(camera.fov_y) / 2)
    aspect = scene.settings.size[0] / scene.settings.size[1]
    depth = way @ forward
    return np.array([0.5 + way @ right / depth / half / aspect / 2, 0.5 - way @ up / depth / half / 2])
