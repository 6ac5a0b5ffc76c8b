"""Tables of the benchmark of the strategy impact: every cell, and what they come to.

A *cell* is an edit of a kept picture and a mark. The *best spiral* of a cell is the one whose NoR turned out
best there: nobody knows it beforehand.
"""

from __future__ import annotations

import re
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from rich.table import Table

from incpt.benchmarks.impact.bench import DENOISED, DRAG_VARIANTS, IMPACT, RESTART
from incpt.benchmarks.impact.edits import DRAG, EDITS
from incpt.benchmarks.kit.store import Record, Results, grouped

NAME = "impact"
STEPS, DRAGS, SECONDS = "steps", "drags", "seconds"
MEASURES = (STEPS, DRAGS, SECONDS)
"""At equal paths, in a drag, and at equal seconds."""
METRICS = {"normalized_rmse": "normalized RMSE", "relative_mse": "relMSE", "flip": "FLIP"}
TOLERANCE = 0.03
"""By how much an error may be above another one before it counts as worse."""
BEST_SPIRAL, BETTER = "best spiral of each cell", "better of restart and best spiral"
_NUMBER = re.compile(r"[\d.]+")
_DIGITS = {"normalized_rmse": 0, "relative_mse": 1, "flip": 0}
"""Digits behind the point of an error times 10^4."""


class Cell(NamedTuple):
    """What errors are compared in: the kept picture's samples, the edit, and when."""

    base: int
    edit: str
    mark: str


Errors = Mapping[str, float]
"""By the label of a variant."""


def cells(results: Results, measure: str, metric: str) -> dict[Cell, Errors]:
    """The errors in each cell of a measure: medians of repetitions. Cells stand in the order of EDITS."""
    found: dict[Cell, dict[str, float]] = {}
    for mark in marks(results, measure):
        value = partial(_error, measure, metric, mark)
        values = grouped(results, value, "base", "edit", "variant")
        for (base, edit, variant), errors in values.items():
            found.setdefault(Cell(base, edit, mark), {})[variant] = statistics.median(errors)
    order = {name: place for place, name in enumerate(EDITS)}
    return dict(sorted(found.items(), key=lambda item: (-item[0].base, order.get(item[0].edit, -1))))


def marks(results: Results, measure: str) -> list[str]:
    """The marks of a measure, in order."""
    found = [row["mark"] for r in results.records if r.subject["measure"] == measure for row in r.rows]
    return sorted(dict.fromkeys(found), key=_mark_order)


def _mark_order(mark: str) -> tuple[bool, float]:
    return mark.startswith("rest"), float(_NUMBER.findall(mark)[0])


def _error(measure: str, metric: str, mark: str, record: Record) -> float | None:
    if record.subject["measure"] != measure:
        return None
    values = [row[metric] for row in record.rows if row["mark"] == mark]
    return values[0] if values else None


def best_spiral(errors: Errors) -> float | None:
    """The least error of those with a fixed NoR."""
    fixed = (error for name, error in errors.items() if re.fullmatch(r"spiral \d+", name))
    return min(fixed, default=None)


def better(errors: Errors) -> float | None:
    """The lesser of the errors of restarting and of the best spiral."""
    return min((e for e in (errors.get(RESTART), best_spiral(errors)) if e is not None), default=None)


Rival = Callable[[Errors], float | None]


def rivals(found: Mapping[Cell, Errors]) -> dict[str, Rival]:
    """With what impact is compared, by name."""
    labels = dict.fromkeys(label for errors in found.values() for label in errors if label != IMPACT)
    return {BEST_SPIRAL: best_spiral, BETTER: better, **{label: partial(_of, label) for label in labels}}


def _of(label: str, errors: Errors) -> float | None:
    return errors.get(label)


def ratio(errors: Errors, rival: Rival) -> float | None:
    """The error of impact over that of a rival, where there are both."""
    own, other = errors.get(IMPACT), rival(errors)
    return None if own is None or not other else own / other


def mean_ratio(found: Mapping[Cell, Errors], rival: Rival) -> float | None:
    """The geometric mean of the ratios in some cells."""
    ratios = [r for errors in found.values() if (r := ratio(errors, rival))]
    return statistics.geometric_mean(ratios) if ratios else None


def curves(results: Results, measure: str) -> dict[int, dict[str, list[tuple[float, float]]]]:
    """By the kept picture's samples and by variant: (mark, error relative to that of restarting), the
    geometric mean over edits."""
    found = cells(results, measure, "normalized_rmse")
    ratios: dict[tuple[int, str, str], list[float]] = {}
    for cell, errors in found.items():
        if restarted := errors.get(RESTART):
            for label, error in errors.items():
                if error > 0:
                    ratios.setdefault((cell.base, label, cell.mark), []).append(error / restarted)
    made: dict[int, dict[str, list[tuple[float, float]]]] = {}
    for (base, label, mark), values in ratios.items():
        point = _mark_order(mark)[1], statistics.geometric_mean(values)
        made.setdefault(base, {}).setdefault(label, []).append(point)
    return {base: {label: sorted(points) for label, points in lines.items()} for base, lines in made.items()}


# --------------------------------------------------------------------------------------------- tables


def tables(results: Results) -> list[Table]:
    """All: cells, means, and cells that impact loses, at equal paths and at equal seconds; drags."""
    made = []
    for measure in (STEPS, SECONDS):
        bases = list(dict.fromkeys(cell.base for cell in cells(results, measure, "normalized_rmse")))
        made += [_cells_table(results, measure, base) for base in bases]
        made += [_means_table(results, measure, base) for base in bases]
    return [*made, *_drag_tables(results), *_lost_tables(results)]


def _table(title: str, left: Sequence[str], right: Iterable[str]) -> Table:
    made = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for name in left:
        made.add_column(name, no_wrap=True)
    for name in right:
        made.add_column(name, justify="right", no_wrap=True)
    return made


def _of_base(found: Mapping[Cell, Errors], base: int) -> dict[Cell, Errors]:
    return {cell: errors for cell, errors in found.items() if cell.base == base}


def _cells_table(results: Results, measure: str, base: int) -> Table:
    found = _of_base(cells(results, measure, "normalized_rmse"), base)
    title = (
        f"normalized RMSE x 10^4 after an edit of a picture of {base:,} samples: restart / restart + OIDN / "
        "best spiral / impact, then impact to the better of restart and spiral"
    )
    columns = marks(results, measure)
    made = _table(title, ("edit",), columns)
    for edit in dict.fromkeys(cell.edit for cell in found):
        made.add_row(_words(edit), *(_cell_text(found.get(Cell(base, edit, mark), {})) for mark in columns))
    return made


def _cell_text(errors: Errors) -> str:
    if not errors:
        return ""
    shown = [errors.get(RESTART), errors.get(DENOISED), best_spiral(errors), errors.get(IMPACT)]
    text = "/".join("-" if error is None else f"{1e4 * error:.0f}" for error in shown)
    part = ratio(errors, better)
    return text if part is None else f"{text} {part:.2f}"


def _means_table(results: Results, measure: str, base: int) -> Table:
    columns = marks(results, measure)
    title = f"error of impact relative to others, picture of {base:,} samples: geometric means over edits"
    made = _table(title, ("error", "relative to"), [*columns, "all"])
    for metric, words in METRICS.items():
        found = _of_base(cells(results, measure, metric), base)
        for name, rival in rivals(found).items():
            parts = [{c: e for c, e in found.items() if c.mark == mark} for mark in columns]
            means = [mean_ratio(part, rival) for part in (*parts, found)]
            if any(mean is not None for mean in means):
                made.add_row(words, name, *("" if mean is None else f"{mean:.3f}" for mean in means))
    return made


def _lost_tables(results: Results) -> list[Table]:
    """How many cells impact loses to whom, and which, the worst first."""
    title = f"cells in which impact is worse by more than {100 * TOLERANCE:.0f} %"
    counts = _table(title, ("at equal", "error", "than"), ("lost", "of", "worst ratio"))
    lost = _table(
        title, ("at equal", "error", "than", "picture of", "edit"), ("after", "theirs", "impact", "ratio")
    )
    rows: list[tuple[float, list[str]]] = []
    judges: dict[str, Rival] = {BETTER: better, DENOISED: partial(_of, DENOISED)}
    for measure in (STEPS, SECONDS):
        for metric, words in METRICS.items():
            found = cells(results, measure, metric)
            for name, rival in judges.items():
                ratios = {c: r for c, errors in found.items() if (r := ratio(errors, rival))}
                worse = {cell: r for cell, r in ratios.items() if r > 1 + TOLERANCE}
                if ratios:
                    worst = f"{max(ratios.values()):.2f}"
                    counts.add_row(_unit(measure), words, name, str(len(worse)), str(len(ratios)), worst)
                for cell, r in worse.items():
                    errors = [_error_text(metric, e) for e in (rival(found[cell]), found[cell][IMPACT])]
                    place = [_unit(measure), words, name, f"{cell.base:,}", _words(cell.edit), cell.mark]
                    rows.append((r, [*place, *errors, f"{r:.2f}"]))
    for _, row in sorted(rows, key=lambda entry: -entry[0]):
        lost.add_row(*row)
    return [counts, lost]


def _words(edit: str) -> str:
    if edit not in EDITS:
        return edit
    return EDITS[edit].words + ("" if EDITS[edit].local else " (everything)")


def _error_text(metric: str, error: float | None) -> str:
    return "" if error is None else f"{1e4 * error:.{_DIGITS[metric]}f}"


def _unit(measure: str) -> str:
    return "paths" if measure == STEPS else "seconds"


def _drag_tables(results: Results) -> list[Table]:
    found = cells(results, DRAGS, "normalized_rmse")
    columns, made = marks(results, DRAGS), []
    for base in dict.fromkeys(cell.base for cell in found):
        title = (
            "normalized RMSE x 10^4 in a drag of the block in the Cornell box and after it, "
            f"picture of {base:,} samples"
        )
        table = _table(title, ("",), columns)
        for variant in DRAG_VARIANTS:
            errors = [found.get(Cell(base, DRAG, mark), {}).get(variant.label) for mark in columns]
            if any(error is not None for error in errors):
                table.add_row(variant.label, *("" if e is None else f"{1e4 * e:.0f}" for e in errors))
        made.append(table)
    return made
