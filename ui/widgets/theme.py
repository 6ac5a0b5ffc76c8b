"""How the editor looks: one font, one accent colour, and greys that do not tint the eye beside a picture.
There is a dark theme and a light one; what lies over the picture looks the same in both."""

from __future__ import annotations

from pathlib import Path

import imgui_bundle
from imgui_bundle import ImVec4, imgui

from incpt.ui.widgets import icons

FONT_SIZE = 15.0
"""Height of text at 100 % scale, in points of the screen."""

Rgba = tuple[float, float, float, float]
"""sRGB with alpha, 0 to 1."""

ACCENT: Rgba = (0.91, 0.49, 0.16, 1.0)
"""The colour of what is marked; the outline of the selection has it too, so that a marked row and a marked
object are seen to belong together."""
ON_PICTURE: Rgba = (0.88, 0.88, 0.88, 1.0)
"""The colour of text over the picture, which has a dark ground in either theme."""

_TEXTS: dict[str, dict[str, Rgba]] = {
    "dark": {
        "text": (0.88, 0.88, 0.88, 1.0),
        "quiet": (0.60, 0.60, 0.60, 1.0),
        "warning": (0.98, 0.75, 0.25, 1.0),
        "error": (1.00, 0.45, 0.40, 1.0),
        "marked": ACCENT,
    },
    "light": {
        "text": (0.10, 0.10, 0.10, 1.0),
        "quiet": (0.36, 0.36, 0.36, 1.0),
        "warning": (0.50, 0.31, 0.00, 1.0),
        "error": (0.75, 0.10, 0.08, 1.0),
        "marked": (0.62, 0.26, 0.02, 1.0),
    },
}
"""Colours of text by theme: ordinary, in the background, what was refused or lost, what failed, and what is
marked, for which the accent is too bright on a light ground."""
THEMES = tuple(_TEXTS)
"""The names of the themes."""
SURROUND: dict[str, float] = {"dark": 0.085, "light": 0.55}
"""The grey around the picture, sRGB, by theme."""
_theme = ["dark"]
"""The theme that was applied last; a list of one, so that functions can set it."""

AXIS_COLORS: tuple[Rgba, Rgba, Rgba] = (
    (0.90, 0.35, 0.38, 1.0),
    (0.52, 0.78, 0.30, 1.0),
    (0.35, 0.58, 0.95, 1.0),
)
"""The colours of x, y and z, as in the gizmo."""

_DARK: dict[str, Rgba] = {
    "text": _TEXTS["dark"]["text"],
    "text_disabled": (0.50, 0.50, 0.50, 1.0),
    "window_bg": (0.155, 0.155, 0.155, 1.0),
    "popup_bg": (0.125, 0.125, 0.125, 0.98),
    "menu_bar_bg": (0.125, 0.125, 0.125, 1.0),
    "border": (0.08, 0.08, 0.08, 1.0),
    "frame_bg": (0.235, 0.235, 0.235, 1.0),
    "frame_bg_hovered": (0.29, 0.29, 0.29, 1.0),
    "frame_bg_active": (0.33, 0.33, 0.33, 1.0),
    "title_bg": (0.11, 0.11, 0.11, 1.0),
    "title_bg_active": (0.11, 0.11, 0.11, 1.0),
    "tab": (0.125, 0.125, 0.125, 1.0),
    "tab_hovered": (0.26, 0.26, 0.26, 1.0),
    "tab_selected": (0.20, 0.20, 0.20, 1.0),
    "tab_dimmed": (0.11, 0.11, 0.11, 1.0),
    "tab_dimmed_selected": (0.17, 0.17, 0.17, 1.0),
    "tab_selected_overline": ACCENT,
    "header": (0.30, 0.30, 0.30, 1.0),
    "header_hovered": (0.27, 0.27, 0.27, 1.0),
    "header_active": (0.34, 0.34, 0.34, 1.0),
    "button": (0.27, 0.27, 0.27, 1.0),
    "button_hovered": (0.34, 0.34, 0.34, 1.0),
    "button_active": (0.42, 0.42, 0.42, 1.0),
    "check_mark": ACCENT,
    "checkbox_selected_bg": (0.235, 0.235, 0.235, 1.0),
    "slider_grab": (0.55, 0.55, 0.55, 1.0),
    "slider_grab_active": ACCENT,
    "separator": (0.09, 0.09, 0.09, 1.0),
    "separator_hovered": ACCENT,
    "separator_active": ACCENT,
    "resize_grip": (0.0, 0.0, 0.0, 0.0),
    "plot_histogram": ACCENT,
    "plot_lines": (0.75, 0.75, 0.75, 1.0),
    "docking_preview": (0.91, 0.49, 0.16, 0.5),
    "docking_empty_bg": (0.0, 0.0, 0.0, 0.0),
    "nav_cursor": ACCENT,
    "modal_window_dim_bg": (0.0, 0.0, 0.0, 0.55),
    "text_selected_bg": (0.91, 0.49, 0.16, 0.45),
    "drag_drop_target": ACCENT,
}
"""All colours of imgui's that are not those of its own dark style, by its names for them."""
_LIGHT: dict[str, Rgba] = {
    "text": _TEXTS["light"]["text"],
    "text_disabled": (0.48, 0.48, 0.48, 1.0),
    "window_bg": (0.86, 0.86, 0.86, 1.0),
    "popup_bg": (0.93, 0.93, 0.93, 0.99),
    "menu_bar_bg": (0.80, 0.80, 0.80, 1.0),
    "border": (0.66, 0.66, 0.66, 1.0),
    "frame_bg": (0.96, 0.96, 0.96, 1.0),
    "frame_bg_hovered": (1.00, 1.00, 1.00, 1.0),
    "frame_bg_active": (0.90, 0.90, 0.90, 1.0),
    "title_bg": (0.76, 0.76, 0.76, 1.0),
    "title_bg_active": (0.76, 0.76, 0.76, 1.0),
    "tab": (0.78, 0.78, 0.78, 1.0),
    "tab_hovered": (0.92, 0.92, 0.92, 1.0),
    "tab_selected": (0.88, 0.88, 0.88, 1.0),
    "tab_dimmed": (0.76, 0.76, 0.76, 1.0),
    "tab_dimmed_selected": (0.86, 0.86, 0.86, 1.0),
    "tab_selected_overline": ACCENT,
    "header": (0.74, 0.74, 0.74, 1.0),
    "header_hovered": (0.79, 0.79, 0.79, 1.0),
    "header_active": (0.70, 0.70, 0.70, 1.0),
    "button": (0.75, 0.75, 0.75, 1.0),
    "button_hovered": (0.80, 0.80, 0.80, 1.0),
    "button_active": (0.68, 0.68, 0.68, 1.0),
    "check_mark": _TEXTS["light"]["marked"],
    "checkbox_selected_bg": (0.96, 0.96, 0.96, 1.0),
    "slider_grab": (0.55, 0.55, 0.55, 1.0),
    "slider_grab_active": ACCENT,
    "separator": (0.68, 0.68, 0.68, 1.0),
    "separator_hovered": ACCENT,
    "separator_active": ACCENT,
    "resize_grip": (0.0, 0.0, 0.0, 0.0),
    "plot_histogram": ACCENT,
    "plot_lines": (0.30, 0.30, 0.30, 1.0),
    "docking_preview": (0.91, 0.49, 0.16, 0.5),
    "docking_empty_bg": (0.0, 0.0, 0.0, 0.0),
    "nav_cursor": ACCENT,
    "modal_window_dim_bg": (0.0, 0.0, 0.0, 0.35),
    "text_selected_bg": (0.91, 0.49, 0.16, 0.45),
    "drag_drop_target": ACCENT,
}
"""The same, beside those of its own light style."""


def text_color(role: str) -> Rgba:
    """The colour of text in a panel: "text", "quiet", "warning", "error" or "marked"."""
    return _TEXTS[_theme[0]][role]


def surround() -> float:
    """The grey around the picture, sRGB."""
    return SURROUND[_theme[0]]


def load_font() -> None:
    """Put the text font into imgui's atlas, and the icons with it. The files come with imgui-bundle."""
    folder = Path(imgui_bundle.__file__).parent / "assets" / "fonts"
    fonts = imgui.get_io().fonts
    fonts.add_font_from_file_ttf(str(folder / "Roboto" / "Roboto-Regular.ttf"), FONT_SIZE)
    merged = imgui.ImFontConfig()
    merged.merge_mode = True
    fonts.add_font_from_file_ttf(str(folder / icons.FILE), FONT_SIZE, merged)


def apply(scale: float, theme: str = "dark") -> None:
    """Colours and sizes for a display where a point has `scale` pixels. Fonts are drawn at that size, so that
    they are sharp."""
    style = imgui.get_style()
    _reset(style)
    _theme[0] = theme
    is_light = theme == "light"
    (imgui.style_colors_light if is_light else imgui.style_colors_dark)(style)
    for name, color in (_LIGHT if is_light else _DARK).items():
        style.set_color_(getattr(imgui.Col_, name), ImVec4(*color))
    style.frame_rounding = style.grab_rounding = style.popup_rounding = style.tab_rounding = 3.0
    style.window_border_size = 0.0
    style.window_padding = imgui.ImVec2(9.0, 8.0)
    style.frame_padding = imgui.ImVec2(7.0, 3.5)
    style.item_spacing = imgui.ImVec2(7.0, 5.0)
    style.item_inner_spacing = imgui.ImVec2(5.0, 4.0)
    style.scrollbar_size = 11.0
    style.indent_spacing = 12.0
    style.window_menu_button_position = imgui.Dir.none
    style.scale_all_sizes(scale)
    style.font_size_base = FONT_SIZE
    style.font_scale_dpi = scale


def _reset(style: imgui.Style) -> None:
    # scale_all_sizes multiplies what is there, so a second scale has to start from the defaults again.
    fresh = imgui.Style()
    for name in dir(fresh):
        value = getattr(fresh, name)
        if not name.startswith("_") and isinstance(value, (int, float, imgui.ImVec2)):
            setattr(style, name, value)
