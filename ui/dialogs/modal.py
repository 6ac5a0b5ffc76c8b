"""What all dialogs share: a modal window in the middle, and a row of buttons at its foot."""

from __future__ import annotations

from collections.abc import Sequence

from imgui_bundle import imgui

from incpt.ui.widgets import theme, widgets

_WIDTH = 460.0
"""Width of a dialog, in points at a scale of 1."""
_LEAST_BUTTON = 76.0
"""Least width of a button, in points at a scale of 1."""


def begin(title: str, width: float = _WIDTH) -> bool:
    """Open a modal window in the middle; where this returned True, `end` has to follow."""
    if not imgui.is_popup_open(title):
        imgui.open_popup(title)
    middle = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(middle, imgui.Cond_.appearing, imgui.ImVec2(0.5, 0.5))
    scale = imgui.get_style().font_scale_dpi
    imgui.set_next_window_size(imgui.ImVec2(width * scale, 0.0), imgui.Cond_.always)
    return imgui.begin_popup_modal(title, None, imgui.WindowFlags_.no_resize)[0]


def end() -> None:
    """End the window that `begin` opened."""
    imgui.end_popup()


def buttons(labels: Sequence[str], takes_keys: bool = True) -> int | None:
    """Buttons in a row at the right; returns the index of the one that was pressed. Enter presses the first,
    Escape the last, unless the keys of this frame are for something else."""
    style = imgui.get_style()
    least = _LEAST_BUTTON * style.font_scale_dpi
    widths = [max(imgui.calc_text_size(label).x + 2 * style.frame_padding.x, least) for label in labels]
    room = imgui.get_content_region_avail().x - sum(widths) - style.item_spacing.x * (len(labels) - 1)
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0.0))
    chosen = None
    for i, (label, width) in enumerate(zip(labels, widths, strict=True)):
        if i > 0:
            imgui.same_line()
        if i == 0:
            imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(*theme.ACCENT[:3], 0.75))
        if widgets.button(label, width=width):
            chosen = i
        if i == 0:
            imgui.pop_style_color()
    if not takes_keys:
        return chosen
    if imgui.is_key_pressed(imgui.Key.enter, False) or imgui.is_key_pressed(imgui.Key.keypad_enter, False):
        chosen = 0
    if imgui.is_key_pressed(imgui.Key.escape, False):
        chosen = len(labels) - 1
    return chosen
