"""The list of objects and lights: select, show and hide, rename."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import imgui

from incpt.scene.light import Light
from incpt.scene.model import Scene
from incpt.scene.selection import Selection
from incpt.ui.widgets import places, theme


@dataclass(frozen=True)
class Outcome:
    """What the user did in a frame: the selection after it, an object or light to show or hide, one to
    rename."""

    selection: Selection
    switched: str | None = None
    renaming: str | None = None


def draw(scene: Scene, selection: Selection, search: str) -> tuple[Outcome, str]:
    """Draw the list of objects and lights whose names hold `search`; returns the outcome and the new search
    text."""
    imgui.set_next_item_width(-1)
    _, search = imgui.input_text_with_hint("##search", "Search", search)
    places.note("Search")
    wanted = search.strip().lower()
    names = [one.name for one in scene.everything if wanted in one.name.lower()]
    outcome = Outcome(selection)
    if imgui.begin_child("objects"):
        clipper = imgui.ListClipper()
        clipper.begin(len(names))
        while clipper.step():
            for name in names[clipper.display_start : clipper.display_end]:
                outcome = _row(scene, name, outcome, names)
        _empty_space(names, scene)
    imgui.end_child()
    if imgui.is_item_clicked() and not imgui.is_any_item_hovered():
        outcome = Outcome(Selection())
    return outcome, search


def _row(scene: Scene, name: str, outcome: Outcome, names: list[str]) -> Outcome:
    one, selection = scene.placed(name), outcome.selection
    imgui.push_id(name)
    style = imgui.get_style()
    width = imgui.get_content_region_avail().x
    button = imgui.calc_text_size("Show").x + 2 * style.frame_padding.x + style.item_spacing.x
    tint = theme.ACCENT if name == selection.active else theme.TEXT if one.visible else theme.QUIET
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*tint))
    flags = imgui.SelectableFlags_.allow_double_click
    label = f"{name}  ·  {one.kind}###{name}" if isinstance(one, Light) else name
    pressed, _ = imgui.selectable(label, name in selection.names, flags, imgui.ImVec2(width - button, 0))
    imgui.pop_style_color()
    places.note(f"object {name}")
    if pressed:
        outcome = _pressed(name, selection, names)
    imgui.same_line(width - button + style.item_spacing.x)
    if imgui.small_button("Hide" if one.visible else "Show"):
        outcome = Outcome(outcome.selection, switched=name)
    places.note(f"visible {name}")
    imgui.pop_id()
    return outcome


def _pressed(name: str, selection: Selection, names: list[str]) -> Outcome:
    io = imgui.get_io()
    if io.key_ctrl:
        return Outcome(selection.toggled(name))
    if io.key_shift:
        return Outcome(selection.extended(name, names))
    return Outcome(Selection((name,)), renaming=name if imgui.is_mouse_double_clicked(0) else None)


def _empty_space(names: list[str], scene: Scene) -> None:
    if not names:
        imgui.text_disabled("Nothing has that in its name." if scene.names else "The scene is empty.")
