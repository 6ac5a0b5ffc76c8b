"""The list of all materials: who has which, giving one to objects, and deleting what nobody has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from imgui_bundle import imgui

from incpt.core.affine import Vector
from incpt.picture.color import srgb_from_linear
from incpt.scene.material import Material
from incpt.ui.widgets import places, theme, widgets
from incpt.ui.widgets.thumbnails import Thumbnails

_ROWS = 8
"""Height of the list, in rows."""
_PAYLOAD = "material"
"""What imgui calls a row that is dragged."""


@dataclass(frozen=True)
class MaterialsState:
    """What the list remembers: `search` is typed into its field, `chosen` is the row whose parameters are
    shown, and `followed` the active object's material, which is chosen when that becomes another one."""

    search: str = ""
    chosen: str | None = None
    followed: str | None = None

    def following(self, active: str | None, materials: Mapping[str, Material]) -> MaterialsState:
        """With a chosen one that is there, and the one that the active object has since this frame."""
        state = self
        if active is not None and active != self.followed:
            state = replace(state, chosen=active)
        if state.chosen not in materials:
            state = replace(state, chosen=next(iter(materials), None))
        return replace(state, followed=active)


@dataclass(frozen=True)
class Outcome:
    """What the user asked for: a material to make, copy, rename, delete, or give to what is selected, its
    objects to select, or those that nobody has to put away."""

    is_new: bool = False
    is_purge: bool = False
    duplicate: str | None = None
    rename: str | None = None
    delete: str | None = None
    assign: str | None = None
    select: str | None = None


def draw(
    materials: Mapping[str, Material],
    users: Mapping[str, int],
    state: MaterialsState,
    can_assign: bool,
    thumbnails: Thumbnails,
) -> tuple[Outcome, MaterialsState]:
    """Draw the list, and buttons for the row that is chosen. `users` are how many objects have each;
    `can_assign`: whether objects are selected."""
    imgui.set_next_item_width(-1)
    _, search = imgui.input_text_with_hint("##search", "Search", state.search)
    places.note("Search materials")
    state = replace(state, search=search)
    wanted = search.strip().lower()
    names = [name for name in materials if wanted in name.lower()]
    outcome = Outcome()
    size = imgui.ImVec2(0, imgui.get_text_line_height_with_spacing() * _ROWS)
    if imgui.begin_child("list", size, imgui.ChildFlags_.borders | imgui.ChildFlags_.resize_y):
        clipper = imgui.ListClipper()
        clipper.begin(len(names))
        while clipper.step():
            for name in names[clipper.display_start : clipper.display_end]:
                outcome, state = _row(name, materials, users.get(name, 0), outcome, state, thumbnails)
        if not names:
            imgui.text_disabled("No material has that in its name." if materials else "There is none.")
    imgui.end_child()
    unused = sum(not users.get(name, 0) for name in materials)
    return _buttons(state.chosen, users, unused, can_assign, outcome), state


def carried(names: tuple[str, ...]) -> str | None:
    """The material whose row is being dragged, of those names; None: none is."""
    payload = imgui.get_drag_drop_payload_py_id()
    if payload is None or payload.type != _PAYLOAD or payload.data_id >= len(names):
        return None
    return names[payload.data_id]


def dropped_on_item(names: tuple[str, ...]) -> str | None:
    """The material that is dropped on the widget drawn last in this frame, if any."""
    found = None
    if imgui.begin_drag_drop_target():
        payload = imgui.accept_drag_drop_payload_py_id(_PAYLOAD)
        if payload is not None and payload.data_id < len(names):
            found = names[payload.data_id]
        imgui.end_drag_drop_target()
    return found


def _row(
    name: str,
    materials: Mapping[str, Material],
    users: int,
    outcome: Outcome,
    state: MaterialsState,
    thumbnails: Thumbnails,
) -> tuple[Outcome, MaterialsState]:
    imgui.push_id(name)
    flags = imgui.SelectableFlags_.allow_double_click
    start, side = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
    pressed, _ = imgui.selectable(f"      {name}###row", name == state.chosen, flags)
    places.note(f"material {name}")
    if imgui.begin_drag_drop_source():
        imgui.set_drag_drop_payload_py_id(_PAYLOAD, list(materials).index(name))
        imgui.text_unformatted(f"{name}: drop it on an object")
        imgui.end_drag_drop_source()
    _draw_ball(materials[name], start, side, thumbnails)
    count = f"{users:,}" if users else "unused"
    tint = imgui.get_color_u32(imgui.ImVec4(*theme.text_color("quiet")))
    right = start.x + imgui.get_content_region_avail().x - imgui.calc_text_size(count).x
    imgui.get_window_draw_list().add_text((right, start.y), tint, count)
    imgui.pop_id()
    if pressed:
        state = replace(state, chosen=name)
        if imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
            outcome = replace(outcome, rename=name)
    return outcome, state


def _draw_ball(material: Material, at: imgui.ImVec2, side: float, thumbnails: Thumbnails) -> None:
    """A ball that looks as the parameters say: its colour or the image of it, the highlight of a smooth one,
    glass as a ring, and lamps without a shadow side."""
    texture = material.emission_texture if material.is_emissive else material.base_color_texture
    if texture is not None:
        inset = 0.04 * side
        place = at.x + inset, at.y + inset
        thumbnails.draw_round(texture.bitmap, texture.bitmap.pixels, place, side - 2 * inset)
        return
    canvas, radius = imgui.get_window_draw_list(), 0.46 * side
    middle = (at.x + 0.5 * side, at.y + 0.5 * side)
    lit, dark = _tints(material)
    if material.transmission > 0.5:
        canvas.add_circle(middle, radius, lit, 0, 0.18 * side)
        return
    canvas.add_circle_filled(middle, radius, dark)
    canvas.add_circle_filled((middle[0] - 0.08 * side, middle[1] - 0.08 * side), 0.8 * radius, lit)
    shine = (
        0.0 if material.is_emissive else (1 - material.roughness) * max(material.specular, material.metallic)
    )
    white = imgui.get_color_u32(imgui.ImVec4(1, 1, 1, min(shine, 1.0)))
    canvas.add_circle_filled((middle[0] - 0.14 * side, middle[1] - 0.14 * side), 0.11 * side, white)


def _tints(material: Material) -> tuple[int, int]:
    """imgui's colours of the side in the light and the one in the dark."""
    color = material.base_color
    if material.is_emissive:
        r, g, b = (component / max(material.emission) for component in material.emission)
        color = r, g, b
    shade = 1.0 if material.is_emissive else 0.35
    return _tint(color, 1.0), _tint(color, shade)


def _tint(color: Vector, factor: float) -> int:
    """imgui's number for a linear colour."""
    r, g, b = (float(c) for c in srgb_from_linear([component * factor for component in color]))
    return imgui.get_color_u32(imgui.ImVec4(r, g, b, 1.0))


def _buttons(
    chosen: str | None, users: Mapping[str, int], unused: int, can_assign: bool, outcome: Outcome
) -> Outcome:
    has, count = chosen is not None, users.get(chosen or "", 0)
    is_new = widgets.button("New##materials", "A new material, also for the selected objects")
    widgets.same_line()
    duplicate = widgets.button("Duplicate##materials", "A copy of it, for nobody yet", enabled=has)
    widgets.same_line()
    rename = widgets.button("Rename…##materials", enabled=has)
    widgets.same_line()
    delete = widgets.button(
        "Delete##materials", "Where objects have it, another is asked for in its place", enabled=has
    )
    assign = widgets.button("Assign##materials", "To what is selected", enabled=has and can_assign)
    widgets.same_line()
    select = widgets.button("Select users##materials", "The objects that have it", enabled=count > 0)
    widgets.same_line()
    is_purge = widgets.button(
        f"Purge {unused:,} unused###purge" if unused else "Purge unused###purge",
        "Delete all that no object has",
        enabled=unused > 0,
    )
    return replace(
        outcome,
        is_new=is_new,
        is_purge=is_purge,
        duplicate=chosen if duplicate else None,
        rename=chosen if rename else outcome.rename,
        delete=chosen if delete else None,
        assign=chosen if assign else None,
        select=chosen if select else None,
    )
