"""`incpt bench report`: one page with plots and pictures from whatever results are there.

The page holds everything in itself: plots as SVG, pictures as PNG in the text.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable
from html import escape
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from incpt.benchmarks.catalogue import EXPERIMENTS, setup_text
from incpt.benchmarks.impact import tables as impact
from incpt.benchmarks.kit import options, plots, store, tables
from incpt.benchmarks.kit.fit import fitted
from incpt.benchmarks.kit.store import Results, grouped
from incpt.benchmarks.kit.timing import Summary, summary
from incpt.benchmarks.measures import build, rays, scale, steps, sweep, table51
from incpt.benchmarks.peers import compare
from incpt.core import files
from incpt.core.errors import InputError

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1100px; margin: 2em auto; padding: 0 1em }
h1, h2 { line-height: 1.2 } h2 { margin-top: 2.5em; border-bottom: 1px solid #ccc }
table { border-collapse: collapse; margin: 1em 0; font-size: 13px }
th, td { padding: .25em .7em; border-bottom: 1px solid #ddd; text-align: right } th:first-child,
td:first-child { text-align: left; white-space: nowrap }
.wide { overflow-x: auto }
figure { display: inline-block; margin: .5em 1em .5em 0 }
figure svg { width: 33em; height: auto } /* two beside each other */
svg, img { max-width: 100%; height: auto } .busy { background: #fff3cd; padding: .5em 1em }
code { font-size: 12px; overflow-wrap: anywhere } .small { color: #555; font-size: 13px }
"""


def page(folder: Path) -> str:
    """The whole page. Raises InputError where there are no results."""
    found = {name: store.read(folder / f"{name}.jsonl") for name in EXPERIMENTS}
    there = {name: results for name, results in found.items() if results.records}
    if not there:
        raise InputError(f"{folder}: no results; measure first, for example with incpt bench sweep")
    parts = ["<h1>incpt: benchmarks</h1>"]
    for name, results in there.items():
        experiment = EXPERIMENTS[name]
        parts.append(f'<h2 id="{name}">{escape(experiment.title)}</h2>')
        for apart, part in results.parts(*experiment.setup):
            parts.append(f"<h3>{escape(setup_text(apart))}</h3>")
            parts += _context(part, experiment.timed)
            parts += _PLOTS[name](part) if name in _PLOTS else ()
            parts += (html_table(table) for table in experiment.tables(part))
        if name == table51.NAME:
            parts += _figures(folder)
    body = "\n".join(parts)
    head = f'<meta charset="utf-8"><title>incpt: benchmarks</title><style>{_STYLE}</style>'
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>\n<body>\n{body}\n</body></html>\n'


def _context(results: Results, timed: bool) -> Iterable[str]:
    """On what it was measured, by which commands, and whether the machine was busy."""
    for line in tables.notes(results, timed):
        kind = "busy" if line.startswith("BUSY") else "small"
        yield f'<p class="{kind}">{escape(line)}</p>'
    for command in dict.fromkeys(record.command for record in results.records if record.command):
        yield f"<p><code>{escape(command)}</code></p>"


def html_table(table: Table) -> str:
    """A table of the terminal as one of a page."""
    title = f"<p><b>{escape(str(table.title))}</b></p>" if table.title else ""
    head = "".join(f"<th>{escape(str(column.header))}</th>" for column in table.columns)
    columns = [list(column.cells) for column in table.columns]
    rows = [
        "<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>"
        for row in zip(*columns, strict=True)
    ]
    return f'{title}<div class="wide"><table><tr>{head}</tr>{"".join(rows)}</table></div>'


def _figure(drawn: str) -> str:
    return f"<figure>{drawn}</figure>"


# --------------------------------------------------------------------------------- plots and pictures


def _sweep(results: Results) -> Iterable[str]:
    names = ("scene", "edit", "tile_size", "max_bounces")
    for key in dict.fromkeys(tuple(r.subject[name] for name in names) for r in results.records):
        chosen = results.where(**dict(zip(names, key, strict=True)))
        yield from (
            _figure(drawn) for drawn in _sweep_plots(Results(results.environments, tuple(chosen)), key)
        )


def _sweep_plots(results: Results, key: tuple[Any, ...]) -> Iterable[str]:
    _, edit, tile, bounces = key
    title = f"{edit} (tile {tile}, {bounces} bounces)"
    for unit, x_label in (("steps", "steps after the edit"), ("s", "seconds after the edit")):
        curves: dict[str, list[tuple[float, float]]] = {}
        for record in results.records:
            if record.subject["repetition"] != 0:
                continue
            nor = record.subject["nor"]
            name = record.subject["strategy"] + ("" if nor is None else f" {nor}")
            points = [
                (float(row["mark"].split()[0]), float(row["normalized_rmse"]))
                for row in record.rows
                if row["mark"].endswith(f" {unit}")
            ]
            if points:
                curves[name] = sorted(points)
        if curves:
            yield plots.lines(curves, x_label, "normalized RMSE", title)


def _table51(results: Results) -> Iterable[str]:
    curves = {}
    for variant in table51.VARIANTS:
        record = table51.record_of(results, table51.TABLE_EDIT, variant)
        if record is not None:
            points = [(float(row["steps"]), float(row["normalized_rmse"])) for row in record.rows]
            curves[variant.label] = sorted(points)
    for i, label in enumerate(("standard", "NoR 64", "NoR 128", "NoR 256")):
        curves[f"thesis: {label}"] = [(float(n), row[i]) for n, row in table51.THESIS.items()]
    yield _figure(plots.lines(curves, "steps after the edit", "normalized RMSE", table51.TABLE_EDIT))


def _figures(folder: Path) -> Iterable[str]:
    for picture in sorted(folder.glob("figures-*.png")):
        encoded = base64.b64encode(picture.read_bytes()).decode()
        yield f'<figure><img alt="{escape(picture.stem)}" src="data:image/png;base64,{encoded}"></figure>'


def _impact(results: Results) -> Iterable[str]:
    for measure, x_label in (
        (impact.STEPS, "steps after the edit"),
        (impact.SECONDS, "seconds after the edit"),
    ):
        for base, curves in impact.curves(results, measure).items():
            title = f"mean over edits of a picture of {base:,} samples"
            yield _figure(plots.lines(curves, x_label, "normalized RMSE, restart = 1", title))


def _rays(results: Results) -> Iterable[str]:
    rates = grouped(results, lambda r: r.values.get("rays_per_second"), "scene", "rays", "tracer")
    for scene in dict.fromkeys(scene for scene, _, _ in rates):
        groups: dict[str, dict[str, Summary]] = {}
        for (place, kind, tracer), values in rates.items():
            if place == scene:
                groups.setdefault(str(kind), {})[str(tracer)] = summary([v / 1e6 for v in values])
        yield _figure(plots.bars(groups, "million rays per second", str(scene)))


def _peers(results: Results) -> Iterable[str]:
    drawn = (
        (compare.RATE, "paths_per_second", 1e-6, "million camera paths per second", False),
        (compare.RATE, "error_seconds", 1.0, "relMSE x seconds", True),
        (compare.MOVE, "ms", 1.0, "edit to first picture, ms", True),
    )
    for measure, value, factor, label, logarithmic in drawn:
        groups: dict[str, dict[str, Summary]] = {}
        for (peer, scene), values in compare.medians(results, measure, value).items():
            groups.setdefault(scene, {})[peer] = summary([factor * v for v in values])
        if groups:
            yield _figure(plots.bars(groups, label, label, logarithmic))


def _build(results: Results) -> Iterable[str]:
    for what in ("triangles", "objects"):
        curves = {name: points for name in build.WHAT if (points := build.points(results, name, what))}
        laws = {
            name: law
            for name, points in curves.items()
            if (law := fitted([x for x, _ in points], [y for _, y in points]))
        }
        if curves:
            yield _figure(plots.lines(curves, what, "ms", f"trees against {what}", laws))


def _scale(results: Results) -> Iterable[str]:
    for axis in scale.AXES:
        points, law = scale.growth(results, axis.name)
        if points:
            laws = {} if law is None else {axis.name: law}
            label = "milliseconds of a step"
            yield _figure(plots.lines({axis.name: points}, axis.what, label, axis.name, laws))


def _steps(results: Results) -> Iterable[str]:
    groups: dict[str, dict[str, Summary]] = {}
    for (scene, mode), rates in steps.repetition_rates(results).items():
        groups.setdefault(scene, {})[mode] = summary(rates)
    if groups:
        yield _figure(plots.bars(groups, "million paths per second", "over the same tiles"))


_PLOTS: dict[str, Callable[[Results], Iterable[str]]] = {
    table51.NAME: _table51,
    sweep.NAME: _sweep,
    compare.NAME: _peers,
    impact.NAME: _impact,
    rays.NAME: _rays,
    build.NAME: _build,
    scale.NAME: _scale,
    steps.NAME: _steps,
}


def report(
    folder: Annotated[Path, typer.Argument(help="Folder with results.")] = options.DEFAULT_FOLDER,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="The page [default: report.html there].")
    ] = None,
) -> None:
    """One self-contained HTML page with plots and pictures from whatever results are there."""
    options.optional("matplotlib", "bench report", "bench")
    target = folder / "report.html" if output is None else output
    files.write_bytes(target, page(folder).encode())
    print(target)
