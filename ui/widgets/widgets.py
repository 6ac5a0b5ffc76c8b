"""Widgets that take a value and return the value after this frame. They know no scene and no renderer.

Each stands in a row of its own: label on the left, field on the right. A value that its owner refuses
(InputError) is refused softly: see `accepted`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from imgui_bundle import imgui

from incpt.core.affine import Vector
from incpt.picture.color import linear_from_srgb, srgb_from_linear
from incpt.ui.widgets import focus, mixed, places, theme

_AXES = ("X", "Y", "Z")
"""Names of the fields of a vector."""
_LABEL_SHARE = 0.38
"""Width of a label, as a share of its row's."""
_edited = [0]
"""imgui's number of the widget whose value changed last; a list of one, so that functions can set it."""
_edited_label = [""]
"""The label of that widget."""
_remarks: list[str] = []
"""What fields have to say of what was typed into them, until somebody takes it."""


@contextmanager
def row(label: str, tip: str = "") -> Iterator[str]:
    """A row with a label; yields the hidden label for the field, which gets the width that is left."""
    if mixed.is_silent():
        yield ""
        return
    width = imgui.get_content_region_avail().x
    start = imgui.get_cursor_pos_x()
    imgui.align_text_to_frame_padding()
    clipped_text(label, width * _LABEL_SHARE)
    if tip:
        imgui.set_item_tooltip(tip)
    imgui.same_line(start + width * _LABEL_SHARE)
    imgui.set_next_item_width(width * (1 - _LABEL_SHARE))
    yield f"##{label}"


def number(
    label: str,
    value: float,
    *,
    low: float = 0.0,
    high: float = 0.0,
    speed: float = 0.01,
    unit: str = "",
    decimals: int = 3,
    tip: str = "",
    logarithmic: bool = False,
    zero: str = "",
) -> float:
    """A number to drag, or to type after a double click. `low` and `high` bound the drag only; `zero` stands
    in place of 0."""
    if mixed.is_told(label, value):
        return value
    flags = imgui.SliderFlags_.logarithmic if logarithmic else imgui.SliderFlags_.none
    with row(label, tip) as field:
        form = zero if zero and value == 0 else _form(label, decimals, unit)
        changed, result = imgui.drag_float(field, value, speed, low, high, form, flags)
        _note(label, changed)
    return result if changed else value


def whole_number(
    label: str,
    value: int,
    *,
    low: int,
    high: int,
    speed: float = 0.1,
    tip: str = "",
    enabled: bool = True,
    why_not: str = "",
) -> int:
    """A whole number to drag or to type, held between `low` and `high`, which is said of a number that was
    typed beyond them. Where it is not `enabled`, the tip says `why_not`."""
    if mixed.is_told(label, value):
        return value
    with row(label, tip if enabled else f"{tip}. {why_not}") as field:
        # A file may hold numbers beyond the bounds of the widget, or beyond imgui's 32 bits.
        shown = min(max(value, -(1 << 31)), (1 << 31) - 1)
        imgui.begin_disabled(not enabled)
        changed, typed = imgui.drag_int(field, shown, speed, low, high, _form(label, None))
        imgui.end_disabled()
        result = min(max(typed, low), high)
        # A file may hold numbers beyond the bounds, which nobody has typed.
        if changed and result != typed:
            _remarks.append(
                f"{label}: {typed:,} is out of range; {result:,} is taken, of {low:,} to {high:,}"
            )
        _note(label, changed)
        if not enabled and imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
            imgui.set_tooltip(why_not)
    return result if changed else value


def vector(
    label: str,
    value: Vector,
    *,
    speed: float = 0.01,
    low: float = 0.0,
    high: float = 0.0,
    unit: str = "",
    decimals: int = 3,
    tip: str = "",
    names: Sequence[str] = _AXES,
) -> Vector:
    """Three numbers below one another, each with the colour of its axis. Named "label X" and so on."""
    labels = [f"{label} {name}" for name in names]
    if mixed.is_silent():
        for one, component in zip(labels, value, strict=True):
            mixed.is_told(one, component)
        return value
    result = list(value)
    imgui.push_id(label)
    for axis, name in enumerate(names):
        with row(label if axis == 0 else "", tip):
            _axis_mark(axis, name)
            form = _form(labels[axis], decimals, unit)
            changed, typed = imgui.drag_float(f"##{axis}", value[axis], speed, low, high, form)
            _note(labels[axis], changed)
        if changed:
            result[axis] = typed
    imgui.pop_id()
    return result[0], result[1], result[2]


def color(label: str, value: Vector, *, is_radiance: bool = False, tip: str = "") -> Vector:
    """A linear RGB colour, which people see and type in sRGB, as in other programs: numbers, hex (by a right
    click) and the picker. Where `is_radiance`, components may be over 1."""
    if mixed.is_told(label, value):
        return value
    flags = imgui.ColorEditFlags_.float
    if is_radiance:
        flags |= imgui.ColorEditFlags_.hdr
    if mixed.is_in(label):
        flags |= imgui.ColorEditFlags_.no_inputs
        tip = f"{_MIXED_COLOR}. {tip}" if tip else _MIXED_COLOR
    with row(label, f"{tip}. {_SRGB}" if tip else _SRGB) as field:
        shown = [_rounded(float(c)) for c in srgb_from_linear(value)]
        changed, result = imgui.color_edit3(field, shown, flags)
        _note(label, changed)
        if mixed.is_in(label):
            same_line()
            imgui.text_disabled(mixed.TEXT)
    # A component that was not touched keeps its value to the bit; imgui's 32 bits would round it.
    r, g, b = (
        old if new == seen else float(linear_from_srgb(new))
        for old, seen, new in zip(value, shown, result, strict=True)
    )
    return r, g, b


def radiance(label: str, value: Vector, tip: str = "") -> Vector:
    """A radiance as a colour whose greatest component is 1 and a strength. Named "label colour" and
    "label strength"."""
    strength = max(value)
    tint = (
        (value[0] / strength, value[1] / strength, value[2] / strength) if strength > 0 else (1.0, 1.0, 1.0)
    )
    new_tint = color(f"{label} colour", tint, tip=tip)
    new_strength = number(f"{label} strength", strength, high=1e6, speed=0.02, tip=tip)
    if new_tint == tint and new_strength == strength:
        return value
    r, g, b = (component * new_strength for component in new_tint)
    return r, g, b


def checkbox(label: str, value: bool, tip: str = "") -> bool:
    """On or off."""
    if mixed.is_told(label, value):
        return value
    with row(label, tip) as field:
        imgui.push_item_flag(imgui.ItemFlags_.mixed_value, mixed.is_in(label))
        changed, result = imgui.checkbox(field, value)
        imgui.pop_item_flag()
        _note(label, changed)
    return result


def choice(label: str, value: str, options: Sequence[tuple[str, str]], tip: str = "") -> str:
    """One of `options`, given as (value, text)."""
    if mixed.is_told(label, value):
        return value
    texts = dict(options)
    with row(label, tip) as field:
        shown = mixed.TEXT if mixed.is_in(label) else texts.get(value, value)
        is_open = imgui.begin_combo(field, shown, imgui.ComboFlags_.height_large)
        places.note(label)
        arrow = imgui.get_frame_height() + imgui.get_style().frame_padding.x
        if imgui.calc_text_size(shown).x > imgui.get_item_rect_size().x - arrow:
            imgui.set_item_tooltip(shown)
        if is_open:
            for option, text in options:
                chosen = imgui.selectable(text, option == value and not mixed.is_in(label))[0]
                _note(f"{label}: {text}", chosen)
                if chosen:
                    value = option
                    mixed.give(label)
            imgui.end_combo()
    return value


def text(label: str, value: str, tip: str = "") -> str | None:
    """A text; the new one when Enter or a click elsewhere ends the typing, None before that."""
    with row(label, tip) as field:
        _, typed = imgui.input_text(field, value, imgui.InputTextFlags_.auto_select_all)
        places.note(label)
    return typed if imgui.is_item_deactivated_after_edit() and typed != value else None


def button(label: str, tip: str = "", *, enabled: bool = True, width: float = 0.0) -> bool:
    """Whether it was pressed."""
    if mixed.is_silent():
        return False
    imgui.begin_disabled(not enabled)
    pressed = imgui.button(label, imgui.ImVec2(width, 0.0))
    imgui.end_disabled()
    places.note(label)
    if tip and imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
        imgui.set_tooltip(tip)
    return pressed


def same_line() -> None:
    """The next button stands beside the last one."""
    if mixed.is_silent():
        return
    imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)


def value_row(label: str, value: str, tip: str = "") -> None:
    """A value that is shown only."""
    with row(label, tip):
        imgui.align_text_to_frame_padding()
        clipped_text(value, imgui.get_content_region_avail().x)
        places.note(label)


@contextmanager
def section(label: str, is_open: bool = True) -> Iterator[bool]:
    """A part of a panel with a header that folds it; yields whether it is unfolded."""
    if mixed.is_silent():
        yield True
        return
    flags = imgui.TreeNodeFlags_.default_open if is_open else imgui.TreeNodeFlags_.none
    shown = imgui.collapsing_header(label, flags)
    places.note(label)
    imgui.push_id(label)
    yield shown
    imgui.pop_id()


def note(message: str, role: str = "quiet") -> None:
    """A remark below a field, wrapped; `role` is that of `theme.text_color`."""
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.text_color(role)))
    imgui.text_wrapped(message)
    imgui.pop_style_color()


def take_remarks() -> list[str]:
    """What fields have said since the last call: which numbers were held within their bounds."""
    said = list(_remarks)
    _remarks.clear()
    return said


def edited() -> int:
    """imgui's number of the widget whose value changed last: what the edits of one drag have in common."""
    return _edited[0]


def edited_label() -> str:
    """The label of that widget, as it is on the screen."""
    return _edited_label[0]


def _note(name: str, has_changed: bool) -> None:
    places.note(name)
    # imgui tells of no change where the number that was typed is the one that the first object has.
    is_given = mixed.is_in(name) and imgui.is_item_deactivated() and focus.has_typed()
    if is_given:
        mixed.give(name)
    if has_changed or is_given:
        _edited[0], _edited_label[0] = imgui.get_item_id(), name


def _axis_mark(axis: int, name: str) -> None:
    # It is drawn to the left of the field that follows, where no widget stands.
    at, height = imgui.get_cursor_screen_pos(), imgui.get_frame_height()
    width = max(2.0, height * 0.12)
    draw = imgui.get_window_draw_list()
    tint = imgui.get_color_u32(imgui.ImVec4(*theme.AXIS_COLORS[axis]))
    draw.add_rect_filled((at.x - width, at.y), (at.x, at.y + height), tint)
    size = imgui.calc_text_size(name)
    place = (at.x - 3.0 * width - size.x, at.y + (height - size.y) / 2)
    draw.add_text(place, imgui.get_color_u32(imgui.ImVec4(*theme.text_color("quiet"))), name)


def clipped_text(label: str, width: float) -> None:
    """A text that is cut where it has not the room; hovering shows all of it."""
    shown = label
    while len(shown) > 1 and imgui.calc_text_size(shown).x > width - imgui.get_style().item_inner_spacing.x:
        shown = shown[:-2].rstrip() + "…"
    imgui.text_unformatted(shown)
    if shown != label:
        imgui.set_item_tooltip(label)


_MIXED_COLOR = "Differs among what is selected; another one is for all of it"
_SRGB = "In sRGB here; files and Python have it linear"


def _rounded(value: float) -> float:
    return float(np.float32(value))


def _form(label: str, decimals: int | None, unit: str = "") -> str:
    """How imgui prints a number: with so many decimals (None: a whole one) and a unit, or that it differs."""
    if mixed.is_in(label):
        return mixed.TEXT
    number = "%d" if decimals is None else f"%.{decimals}f"
    return number + unit.replace("%", "%%")
