"""`incpt bench screenshots`: the pictures of the editor for README and documentation, from a real window.

Each is made the way a user gets there, by mouse and keyboard on a virtual display. They wait for samples, not
for the clock, so that they look the same on every machine but for the times that are written in them.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated

import numpy as np
import numpy.typing as npt
import PIL.Image
import PIL.ImageDraw
import PIL.ImageFont
import typer

from incpt.benchmarks.kit import options
from incpt.benchmarks.kit.desktop import Hand, virtual_display
from incpt.formats import registry
from incpt.render.modes import Mode

Pixels = npt.NDArray[np.uint8]

WINDOW = (1280, 760)
"""Beside the panels there is room for the picture pixel by pixel."""
SIZE = (960, 540)
NOR = 64
FEW_SPP = 24
OBJECT = "red cube"
_GAP_PX, _CAPTION_PX, _TEXT_PX = 8, 30, 15
_CELL_WIDTH_PX = 640


@contextlib.contextmanager
def opened(spp: int) -> Iterator[Hand]:
    """The editor on the example, refined to that many samples per pixel."""
    with tempfile.TemporaryDirectory() as folder, virtual_display(WINDOW):
        os.environ["INCPT_CONFIG_DIR"] = folder
        from incpt.ui import preferences
        from incpt.ui.app import App
        from incpt.ui.editor.document import Document

        # A tile of a drag is to look like one of an edit: the pictures stand still.
        preferences.save(
            preferences.Preferences(window_size=WINDOW, ui_scale=1.0, drag_nor=NOR, step_ms=200.0)
        )
        with as_file(files("incpt.scenes") / "editing.toml") as path:
            scene = registry.load(path)
        # The method of the thesis, whose tiles can be seen to come.
        settings = replace(scene.settings, size=SIZE, strategy="spiral", nor=NOR, nor_adapts=False)
        app = App(Document(replace(scene, settings=settings), name="editing"))
        try:
            hand = Hand(app)
            refine(hand, spp)
            yield hand
        finally:
            app.close()
            del os.environ["INCPT_CONFIG_DIR"]


def refine(hand: Hand, spp: int) -> None:
    """Go on until every pixel has that many samples, and rest there."""
    editor = hand.app.editor
    editor.control = replace(editor.control, paused=False, target_spp=spp)

    def is_refined() -> bool:
        frame = editor.frame
        if frame is None or frame.is_preview or frame.view.target_spp != spp:
            return False
        picture = frame.pictures[-1]
        return frame.resting and picture.mode is Mode.REFINE and int(picture.tile_spp.min()) >= spp

    hand.pump(is_refined, timeout=3600)


def stop_after(hand: Hand, tiles: int) -> None:
    """Let that many tiles of the edit be replaced, and rest there."""
    editor = hand.app.editor
    editor.control = replace(editor.control, paused=False, target_spp=None)
    hand.pump(lambda: _is_incremental(hand) and editor.frame.pictures[-1].queue_done >= tiles, timeout=3600)  # type: ignore[union-attr]
    editor.control = replace(editor.control, paused=True)
    hand.pump(lambda: editor.frame is not None and editor.frame.view.paused, timeout=60)


def _is_incremental(hand: Hand) -> bool:
    frame = hand.app.editor.frame
    return (
        frame is not None
        and frame.view.scene == hand.app.editor.shown
        and frame.pictures[-1].mode is Mode.INCREMENTAL
    )


def turn_cube(hand: Hand) -> None:
    """The edit of the thesis's figure 5.3: the cube stands on an edge."""
    editor = hand.app.editor
    # Nothing is replaced for the first of the two values.
    editor.control = replace(editor.control, paused=True)
    hand.click(f"object {OBJECT}")
    corner = hand.place("picture")
    editor.control = replace(editor.control, point=(0.448, 0.75))
    hand.type_into("Position Y", "0.265")
    hand.type_into("Rotation Z", "30")
    hand.move((corner.left + 5, corner.top + 5))


# ------------------------------------------------------------------------------------------ the pictures


def draw_editor(hand: Hand, spp: int) -> Pixels:
    """The cube while it is turned by the gizmo."""
    hand.app.editor.control = replace(hand.app.editor.control, target_spp=None)
    hand.click(hand.in_picture(0.448, 0.75))
    hand.pump(lambda: hand.app.editor.selection.names == (OBJECT,), timeout=30)
    choose(hand, "menu Edit", "Rotate handles")
    x, y = hand.middle("gizmo")
    # The ring about y passes below the middle, in front of the cube.
    start = x + 30, y + 27
    with hand.pressed(start):
        for step in range(1, 7):
            hand.move((start[0] - 4 * step, start[1]))
        hand.pump(lambda: _is_incremental(hand) and _queue_done(hand) >= 420, timeout=3600)
        pixels = hand.screenshot()
    hand.key("ctrl+z")
    choose(hand, "menu Edit", "Move handles")
    hand.key("alt+a")
    return pixels


def choose(hand: Hand, menu: str, entry: str) -> None:
    """Choose an entry of a menu."""
    hand.click(menu)
    hand.click(entry)


def _queue_done(hand: Hand) -> int:
    frame = hand.app.editor.frame
    return 0 if frame is None else frame.pictures[-1].queue_done


def draw_split(hand: Hand, spp: int) -> Pixels:
    """The same edit under restart and under the spiral, after the same time."""
    editor = hand.app.editor
    hand.key("F6")
    hand.pump(lambda: editor.frame is not None and len(editor.frame.pictures) == 2, timeout=60)
    bar = hand.middle("split bar")
    hand.drag(bar, (hand.in_picture(0.452, 0.5)[0], bar[1]))
    turn_cube(hand)
    hand.key("alt+a")
    hand.show_tab("Render")
    stop_after(hand, 340)
    pixels = hand.screenshot()
    hand.key("F6")
    return pixels


def draw_modes(hand: Hand, spp: int) -> Pixels:
    """The four stages of the thesis's figure 3.5."""
    cells = []
    hand.key("ctrl+r")
    refine(hand, 1)
    cells.append((picture(hand), "1. Base: the first picture, 1 sample per pixel"))
    refine(hand, spp)
    cells.append((picture(hand), f"2. Refine: {spp} samples per pixel"))
    turn_cube(hand)
    hand.key("alt+a")
    stop_after(hand, 72)
    cells.append((picture(hand), "3. Incremental: the edit, from its middle outwards"))
    refine(hand, spp)
    cells.append((picture(hand), "4. Refine: all of it shows the edit"))
    return side_by_side(cells)


def draw_overlays(hand: Hand, spp: int) -> Pixels:
    """What can be laid over the picture, in the middle of an edit."""
    turn_cube(hand)
    hand.key("alt+a")
    stop_after(hand, 420)
    hand.show_tab("Method")
    cells = []
    for overlay, caption in (
        ("Order of the queue", "Order of the queue: a spiral around the edit"),
        ("Samples per pixel", f"Samples per pixel: {FEW_SPP} before the edit, {NOR} where it has come"),
        ("Object ids", "Object ids"),
        ("Normals", "Normals"),
    ):
        hand.click("Overlay")
        hand.click(f"Overlay: {overlay}")
        if overlay in ("Object ids", "Normals"):
            hand.pump(
                lambda: hand.app.editor.frame is not None and hand.app.editor.frame.first_hits is not None
            )
        hand.pump(frames=6)
        cells.append((picture(hand), caption))
    return side_by_side(cells)


def draw_method(hand: Hand, spp: int) -> Pixels:
    """The panel of the method: the error of an edit under both strategies, against a pinned picture of it."""
    editor = hand.app.editor
    turn_cube(hand)
    refine(hand, spp)
    hand.key("F9")
    hand.pump(lambda: editor.rendering.is_pinned, timeout=60)
    hand.key("ctrl+z")
    hand.key("ctrl+z")
    hand.key("alt+a")
    hand.key("F6")
    hand.pump(lambda: editor.frame is not None and len(editor.frame.pictures) == 2, timeout=60)
    refine(hand, spp)
    hand.show_tab("Method")
    hand.click("Overlay")
    hand.click("Overlay: Replaced tiles")
    hand.click("Display")
    editor.control = replace(editor.control, paused=True)
    hand.key("ctrl+shift+z")
    hand.key("ctrl+shift+z")
    hand.key("alt+a")
    stop_after(hand, 600)
    return hand.screenshot()


PICTURES: dict[str, Callable[[Hand, int], Pixels]] = {
    "editor": draw_editor,
    "split": draw_split,
    "modes": draw_modes,
    "overlays": draw_overlays,
    "method": draw_method,
}


def picture(hand: Hand) -> Pixels:
    """The part of the window that shows the rendered picture."""
    hand.move(hand.in_picture(0.01, 0.02))
    place = hand.place("picture")
    rows, columns = slice(round(place.top), round(place.bottom)), slice(round(place.left), round(place.right))
    return hand.screenshot()[rows, columns]


def side_by_side(cells: Sequence[tuple[Pixels, str]]) -> Pixels:
    """Pictures with captions below them, two in a row."""
    font = PIL.ImageFont.load_default(_TEXT_PX)
    height = round(cells[0][0].shape[0] * _CELL_WIDTH_PX / cells[0][0].shape[1])
    rows = -(-len(cells) // 2)
    size = 2 * _CELL_WIDTH_PX + _GAP_PX, rows * (height + _CAPTION_PX)
    sheet = PIL.Image.new("RGB", size, (255, 255, 255))
    draw = PIL.ImageDraw.Draw(sheet)
    for i, (pixels, caption) in enumerate(cells):
        x, y = i % 2 * (_CELL_WIDTH_PX + _GAP_PX), i // 2 * (height + _CAPTION_PX)
        scaled = PIL.Image.fromarray(pixels).resize((_CELL_WIDTH_PX, height), PIL.Image.Resampling.LANCZOS)
        sheet.paste(scaled, (x, y))
        draw.text((x + 2, y + height + 5), caption, (20, 20, 20), font)
    return np.asarray(sheet)


def write(path: Path, pixels: Pixels) -> None:
    """As a PNG, in full colour: a palette shifts the colours of small marks."""
    PIL.Image.fromarray(np.ascontiguousarray(pixels)).save(path, optimize=True)


def screenshots(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the pictures.")] = Path(
        "scenes/pictures"
    ),
    only: Annotated[list[str] | None, typer.Option("--only", help="One of them; may be repeated.")] = None,
    spp: Annotated[int, typer.Option(help="Samples per pixel before the edits.", min=2)] = 96,
) -> None:
    """Take the pictures of the editor that README and documentation show."""
    for module in ("imgui_bundle", "glfw", "moderngl"):
        options.optional(module, "screenshots", "ui")
    names = options.chosen("--only", only, list(PICTURES))
    output.mkdir(parents=True, exist_ok=True)
    for name in names:
        with opened(min({"modes": 1, "overlays": FEW_SPP}.get(name, spp), spp)) as hand:
            write(output / f"{name}.png", PICTURES[name](hand, spp))
        print(output / f"{name}.png")
