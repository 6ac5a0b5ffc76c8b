"""Plots of what rendering takes and what it is worth: step time, and the error against a pinned picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from imgui_bundle import imgui, implot

from incpt.ui.editor.records import Records, Series
from incpt.ui.widgets import places, widgets


@dataclass(frozen=True)
class ReferenceRequest:
    """What the user asked for about the pinned picture: to pin one or let go of it, or to pin another."""

    is_switch: bool = False
    is_again: bool = False


def draw_reference(is_pinned: bool, is_stale: bool, has_picture: bool) -> ReferenceRequest:
    """The buttons of the pinned picture, which `is_stale` where it is of another scene; returns what is asked
    for."""
    with widgets.row("Reference", "Errors are measured against the picture as it was when pinned"):
        is_switch = widgets.button("Unpin" if is_pinned else "Pin this picture", enabled=has_picture)
        is_again = False
        if is_stale:
            widgets.same_line()
            is_again = widgets.button("Pin again", "The picture of the scene as it is now")
    if is_stale:
        widgets.note("The reference is stale: it is of another scene.", "warning")
    return ReferenceRequest(is_switch, is_again)


def draw(records: Records, step_ms: float) -> None:
    """Both plots; `step_ms` is the time that a step aims at."""
    height = imgui.get_text_line_height() * 8
    flags = implot.Flags_.no_menus | implot.Flags_.no_box_select | implot.Flags_.no_mouse_text
    if implot.begin_plot("Step time##plot", imgui.ImVec2(-1, height), flags | implot.Flags_.no_legend):
        implot.setup_axes("", "ms", implot.AxisFlags_.no_tick_labels | implot.AxisFlags_.auto_fit)
        top = max([2 * step_ms, *records.step_ms.y])
        implot.setup_axis_limits(implot.ImAxis_.y1, 0.0, top, imgui.Cond_.always)
        _line("step", records.step_ms)
        implot.plot_inf_lines("aim", np.array([step_ms]), implot.Spec(flags=implot.InfLinesFlags_.horizontal))
        implot.end_plot()
        places.note("Step time plot")
    if not records.errors:
        imgui.text_disabled("Pin a reference (F9) to plot the error.")
        return
    if implot.begin_plot("Error##plot", imgui.ImVec2(-1, height * 1.6), flags):
        # Errors fall, so there is room for the legend at the upper right.
        implot.setup_legend(implot.Location_.north_east)
        implot.setup_axes("seconds", "RMSE", implot.AxisFlags_.auto_fit, implot.AxisFlags_.auto_fit)
        implot.setup_axis_scale(implot.ImAxis_.y1, implot.Scale_.log10)
        for name, series in records.errors.items():
            _line(name, series)
        implot.end_plot()
        places.note("Error plot")


def _line(name: str, series: Series) -> None:
    implot.plot_line(name, np.array(series.x, np.float64), np.array(series.y, np.float64))
