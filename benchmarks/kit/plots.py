"""The report's plots: matplotlib figures, each as an SVG text. Raises ImportError where it is missing."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

from incpt.benchmarks.kit.fit import PowerLaw
from incpt.benchmarks.kit.timing import Summary

Points = Sequence[tuple[float, float]]

_STYLE = {
    "axes.grid": True, "grid.alpha": 0.3, "axes.spines.top": False, "axes.spines.right": False,
    "figure.constrained_layout.use": True, "font.size": 9, "svg.hashsalt": "incpt",
}  # fmt: skip
_WIDTH, _HEIGHT = 6.4, 3.8


def lines(
    curves: Mapping[str, Points],
    x_label: str,
    y_label: str,
    title: str,
    laws: Mapping[str, PowerLaw] | None = None,
) -> str:
    """Curves with logarithmic axes; a law is drawn dashed over the range of its curve."""
    from matplotlib import rc_context

    with rc_context(_STYLE):
        figure, axes = _figure()
        for (name, points), marker in zip(curves.items(), _markers(len(curves)), strict=True):
            x, y = zip(*points, strict=True)
            law = (laws or {}).get(name)
            label = name if law is None else f"{name}: {law.text()}"
            (line,) = axes.plot(x, y, marker=marker, markersize=4, linewidth=1.2, label=label)
            if law is not None:
                ends = [min(x), max(x)]
                axes.plot(ends, [law.at(e) for e in ends], "--", color=line.get_color(), linewidth=0.8)
        # A logarithm has no zero: the step right after the edit stands at the left edge.
        axes.set_xscale("symlog" if _has_zero(curves) else "log")
        axes.set_yscale("log")
        axes.set_xlabel(x_label)
        axes.set_ylabel(y_label)
        axes.set_title(title, loc="left")
        axes.legend(fontsize=7)
        return _svg(figure)


def bars(
    groups: Mapping[str, Mapping[str, Summary]], y_label: str, title: str, logarithmic: bool = False
) -> str:
    """For each group (an x position) a bar of each name, with the range of its measurements."""
    from matplotlib import rc_context

    with rc_context(_STYLE):
        figure, axes = _figure()
        names = list(dict.fromkeys(name for group in groups.values() for name in group))
        width = 0.8 / max(len(names), 1)
        for i, name in enumerate(names):
            places = [
                j + (i - (len(names) - 1) / 2) * width for j, g in enumerate(groups.values()) if name in g
            ]
            found = [g[name] for g in groups.values() if name in g]
            low = [s.median - s.low for s in found]
            high = [s.high - s.median for s in found]
            heights = [s.median for s in found]
            axes.bar(places, heights, width, yerr=[low, high], label=name, error_kw={"elinewidth": 0.8})
        tilt = {"rotation": 25, "ha": "right"} if len(groups) > 6 else {}
        axes.set_xticks(range(len(groups)), list(groups), **tilt)
        if logarithmic:
            axes.set_yscale("log")
        axes.set_ylabel(y_label)
        axes.set_title(title, loc="left")
        figure.legend(loc="outside lower center", ncols=max(len(names), 1), fontsize=7)
        return _svg(figure)


def _figure() -> tuple[Any, Any]:
    # Not by pyplot, which keeps figures and may look for a window.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, _HEIGHT))
    return figure, figure.add_subplot()


def _markers(count: int) -> Sequence[str]:
    known = "osD^v<>pPX*h"
    return [known[i % len(known)] for i in range(count)]


def _has_zero(curves: Mapping[str, Points]) -> bool:
    return any(x <= 0 for points in curves.values() for x, _ in points)


def _svg(figure: Any) -> str:
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    # Without the XML declaration and document type, which have no place inside a page.
    drawn = text.getvalue()
    return drawn[drawn.index("<svg") :]
