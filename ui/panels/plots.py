"""Plots of what rendering takes and what it is worth: step time, and the error against a pinned picture."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from imgui_bundle import imgui, implot

from incpt.ui.widgets import places
from incpt.viewer.viewer import Frame

_MOST_POINTS = 600


@dataclass
class Series:
    """The last values of a quantity: y over x, both as they came."""

    x: deque[float] = field(default_factory=lambda: deque(maxlen=_MOST_POINTS))
    y: deque[float] = field(default_factory=lambda: deque(maxlen=_MOST_POINTS))

    def add(self, x: float, y: float) -> None:
        self.x.append(x)
        self.y.append(y)


class Records:
    """What the frames told, for the plots: step times in milliseconds over seconds of the clock, and for
    each strategy the error over its own rendering time since the last change."""

    def __init__(self) -> None:
        self.step_ms = Series()
        self.errors: dict[str, Series] = {}
        self._last: Frame | None = None

    def add(self, frame: Frame, at: float) -> None:
        """Take a frame that came at that time; the same frame twice counts once."""
        if frame is self._last:
            return
        is_same_scene = self._last is not None and self._last.view.scene is frame.view.scene
        if not is_same_scene or len(self.errors) != len(frame.pictures):
            self.errors = {}
        self._last = frame
        self.step_ms.add(at, frame.step_seconds * 1e3)
        for side, picture in enumerate(frame.pictures):
            if picture.error is not None:
                name = picture.strategy if side or len(frame.pictures) == 1 else "restart (left)"
                series = self.errors.setdefault(name, Series())
                if not series.x or series.x[-1] < picture.seconds:
                    series.add(picture.seconds, picture.error)


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
        # Errors fall: there is room at the upper right.
        implot.setup_legend(implot.Location_.north_east)
        implot.setup_axes("seconds", "RMSE", implot.AxisFlags_.auto_fit, implot.AxisFlags_.auto_fit)
        implot.setup_axis_scale(implot.ImAxis_.y1, implot.Scale_.log10)
        for name, series in records.errors.items():
            _line(name, series)
        implot.end_plot()
        places.note("Error plot")


def _line(name: str, series: Series) -> None:
    implot.plot_line(name, np.array(series.x, np.float64), np.array(series.y, np.float64))
