"""The list of objects and lights: select, show and hide, rename."""

from __future__ import annotations

from dataclasses import dataclass, replace

from imgui_bundle import imgui

from incpt.scene.light import Light
from incpt.scene.model import Object, Placed, Scene
from incpt.scene.selection import Selection
from incpt.ui.panels import materials
from incpt.ui.widgets import icons, places, theme


@dataclass(frozen=True)
class OutlinerState:
    """What the list remembers from one frame to the next.

    search       what is typed into its field: names have to hold it.
    sought       the active one as it was shown last: the list is scrolled to another one, once.
    renaming     the row whose name is typed; None: none is.
    typed        that name as it stands.
    is_opening   whether the field for it takes the keyboard in this frame.
    """

    search: str = ""
    sought: str | None = None
    renaming: str | None = None
    typed: str = ""
    is_opening: bool = False

    def begun_renaming(self, name: str) -> OutlinerState:
        """With the field for another name open in its row, which no search may hide."""
        is_hidden = self.search.strip().lower() not in name.lower()
        search = "" if is_hidden else self.search
        return replace(self, search=search, renaming=name, typed=name, is_opening=True)


@dataclass(frozen=True)
class Outcome:
    """What the user did in a frame: the selection after it, an object or light to show or hide, one with the
    name that was typed for it, and an object with the material that was dropped on it."""

    selection: Selection
    switched: str | None = None
    renamed: tuple[str, str] | None = None
    made_of: tuple[str, str] | None = None


def draw(scene: Scene, selection: Selection, state: OutlinerState) -> tuple[Outcome, OutlinerState]:
    """Draw the list of objects and lights whose names hold what is searched for; returns the outcome and the
    state after this frame."""
    imgui.set_next_item_width(-1)
    _, search = imgui.input_text_with_hint("##search", "Search", state.search)
    places.note("Search")
    state = replace(state, search=search)
    if state.renaming is not None and state.renaming not in scene.names:
        state = replace(state, renaming=None)
    wanted = search.strip().lower()
    names = [one.name for one in scene.everything if wanted in one.name.lower()]
    outcome = Outcome(selection)
    if imgui.begin_child("objects"):
        outcome, state = _rows(scene, names, outcome, state)
        _empty_space(names, scene)
    imgui.end_child()
    if imgui.is_item_clicked() and not imgui.is_any_item_hovered():
        outcome = Outcome(Selection())
    # What was clicked here is seen here.
    return outcome, replace(state, sought=outcome.selection.active)


def _rows(
    scene: Scene, names: list[str], outcome: Outcome, state: OutlinerState
) -> tuple[Outcome, OutlinerState]:
    """Draw the rows that are in sight, and the one to scroll to."""
    active = outcome.selection.active
    sought = active if active != state.sought and active in names else None
    clipper = imgui.ListClipper()
    clipper.begin(len(names))
    for needed in (sought, state.renaming):
        if needed is not None and needed in names:
            clipper.include_item_by_index(names.index(needed))
    while clipper.step():
        for name in names[clipper.display_start : clipper.display_end]:
            if name == state.renaming:
                outcome, state = _name_field(name, outcome, state)
            else:
                outcome, state = _row(scene, name, outcome, state, names)
            if name in (sought, state.renaming if state.is_opening else None):
                imgui.internal.scroll_to_item(imgui.internal.ScrollFlags_.keep_visible_edge_y)
    return outcome, state


def _row(
    scene: Scene, name: str, outcome: Outcome, state: OutlinerState, names: list[str]
) -> tuple[Outcome, OutlinerState]:
    one, selection = scene.placed(name), outcome.selection
    imgui.push_id(name)
    eye = icons.EYE if one.visible else icons.EYE_SLASH
    style = imgui.get_style()
    width = imgui.get_content_region_avail().x
    button = imgui.calc_text_size(icons.EYE_SLASH).x + 2 * style.frame_padding.x + style.item_spacing.x
    tint = theme.text_color("marked" if name == selection.active else "text" if one.visible else "quiet")
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*tint))
    flags = imgui.SelectableFlags_.allow_double_click
    label = f"{_text(one)}###{name}"
    pressed, _ = imgui.selectable(label, name in selection.names, flags, imgui.ImVec2(width - button, 0))
    imgui.pop_style_color()
    places.note(f"object {name}")
    material = materials.dropped_on_item(tuple(scene.materials)) if isinstance(one, Object) else None
    if material is not None:
        outcome = replace(outcome, made_of=(name, material))
    if _is_missing(one):
        imgui.set_item_tooltip(f"Its mesh is missing: {one.mesh.source.file}")  # type: ignore[union-attr]
    if pressed:  # A row at the edge may be seen in part only.
        imgui.internal.scroll_to_item(imgui.internal.ScrollFlags_.keep_visible_edge_y)
    if pressed and imgui.is_mouse_double_clicked(0):
        state = state.begun_renaming(name)
    if pressed:
        outcome = replace(outcome, selection=_pressed(name, selection, names))
    imgui.same_line(width - button + style.item_spacing.x)
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.text_color("quiet")))
    imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(0, 0, 0, 0))
    if imgui.small_button(eye):
        outcome = replace(outcome, switched=name)
    imgui.pop_style_color(2)
    imgui.set_item_tooltip("Hide" if one.visible else "Show")
    places.note(f"visible {name}")
    imgui.pop_id()
    return outcome, state


def _text(one: Placed) -> str:
    if isinstance(one, Light):
        return f"{icons.LIGHTBULB}  {one.name}  ·  {one.kind}"
    return f"{icons.WARNING if _is_missing(one) else icons.CUBE}  {one.name}"


def _is_missing(one: Placed) -> bool:
    return not isinstance(one, Light) and one.mesh.is_placeholder


def _name_field(name: str, outcome: Outcome, state: OutlinerState) -> tuple[Outcome, OutlinerState]:
    """The field in place of a row; Enter or a press elsewhere give the name, Escape leaves it."""
    if state.is_opening:
        imgui.set_keyboard_focus_here()
    imgui.set_next_item_width(-1)
    # As low as the other rows, for which the clipper takes it.
    padding = imgui.ImVec2(imgui.get_style().frame_padding.x, 0.0)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, padding)
    _, typed = imgui.input_text(f"##rename {name}", state.typed, imgui.InputTextFlags_.auto_select_all)
    imgui.pop_style_var()
    places.note(f"rename {name}")
    if imgui.is_item_deactivated():
        is_new = imgui.is_item_deactivated_after_edit() and typed != name
        outcome = replace(outcome, renamed=(name, typed)) if is_new else outcome
        return outcome, replace(state, renaming=None)
    return outcome, replace(state, typed=typed, is_opening=False)


def _pressed(name: str, selection: Selection, names: list[str]) -> Selection:
    io = imgui.get_io()
    if io.key_ctrl:
        return selection.toggled(name)
    return selection.extended(name, names) if io.key_shift else Selection((name,))


def _empty_space(names: list[str], scene: Scene) -> None:
    if not names:
        imgui.text_disabled("Nothing has that in its name." if scene.names else "The scene is empty.")
