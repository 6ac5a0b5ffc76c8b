"""`incpt bench sweep`: tile size, NoR, strategy and bounces over the edits of a script.

After each edit the error at given steps and at given seconds, tiles and time per step, the time to the first
updated tile and until the queue is done.
"""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from rich.table import Table

from incpt.benchmarks.kit import environment, experiment, options
from incpt.benchmarks.kit.experiment import Outcome, Task, Work
from incpt.benchmarks.kit.pictures import Gallery
from incpt.benchmarks.kit.store import Results, Store, grouped
from incpt.benchmarks.kit.tables import print_table
from incpt.benchmarks.kit.timing import interleaved, summary
from incpt.benchmarks.measures.edits import EditBench, Marks, Timeline, edit_subject
from incpt.core.errors import in_place
from incpt.core.settings import STRATEGIES, RenderSettings
from incpt.device.device import Device
from incpt.formats import registry
from incpt.formats.edit_script import Edit, EditScript, load_edits
from incpt.render.strategies import RESTART
from incpt.replay.replay import Variant, variants

NAME = "sweep"
TILE_SIZES = (8, 16, 32, 64)
NORS = (1, 16, 64, 128, 256, 512)
STEPS = (1, 2, 5, 10, 30)
SECONDS = (0.1, 0.3, 1.0, 3.0, 10.0)


@dataclass(frozen=True)
class Grid:
    """Everything that is varied, and how it is measured."""

    tile_sizes: Sequence[int] = TILE_SIZES
    variants: Sequence[Variant] = tuple(variants(STRATEGIES, NORS))
    bounces: Sequence[int] = (3,)
    marks: Marks = Marks(STEPS, SECONDS, done=True)
    repetitions: int = 3
    base_spp: int = 1024
    reference_spp: int = 4096


@dataclass(frozen=True)
class Case:
    """One edit under one strategy with one set of settings."""

    edit: Edit
    variant: Variant
    settings: RenderSettings

    @property
    def label(self) -> str:
        """For people."""
        tile, bounces = self.settings.tile_size, self.settings.max_bounces
        return f"{self.edit.label}: tile {tile}, {bounces} bounces, {self.variant.label}"


def cases(script: EditScript, settings: RenderSettings, grid: Grid) -> list[Case]:
    """All combinations; those that are compared with each other come next to each other."""
    return [
        Case(
            edit,
            variant,
            replace(variant.settings(settings), tile_size=tile, max_bounces=bounces),
        )
        for bounces, edit, tile, variant in itertools.product(
            grid.bounces, script.edits, grid.tile_sizes, grid.variants
        )
    ]


def tasks(bench: EditBench, script: EditScript, settings: RenderSettings, grid: Grid) -> list[Task]:
    """A task for each repetition of each case; the variants of a setting take turns."""
    every = cases(script, settings, grid)
    step = len(grid.variants)
    groups = [every[i : i + step] for i in range(0, len(every), step)]
    return [
        _task(bench, case, grid, repetition)
        for group in groups
        for repetition, case in interleaved(group, grid.repetitions)
    ]


def _task(bench: EditBench, case: Case, grid: Grid, repetition: int) -> Task:
    # Only once to the end of the queue: with NoR 512 that takes as long as 512 pictures. The errors at steps
    # are the same in every repetition.
    first = repetition == 0
    marks = replace(grid.marks, done=grid.marks.done and first, flip=first)
    settings = case.settings
    subject = edit_subject(bench, case.edit, settings, marks, repetition)

    def measure(work: Work) -> Outcome:
        line: Timeline = bench.run(case.edit, settings, marks, work.check, work.timing_starts)
        return Outcome(line.values(), [capture.as_row() for capture in line.captures])

    weight = max((*marks.steps, 1)) + 4 * max((*marks.seconds, 0.0))
    return Task(case.label, subject, measure, weight + (case.variant.nor if marks.done else 0))


class Place(NamedTuple):
    """What one row of the long table is about."""

    edit: str
    strategy: str
    nor: int | None
    tile_size: int
    max_bounces: int


def tables(results: Results) -> list[Table]:
    """What NoR is worth, what tile size is worth, and everything."""
    return [_table_of_nors(results), _table_of_tiles(results), _long_table(results)]


def errors(results: Results, mark: str) -> dict[Place, float]:
    """The median normalized RMSE of each place that has one at a mark."""
    found = grouped(results, lambda record: error_at(record.rows, mark), *Place._fields)
    return {Place(*names): statistics.median(values) for names, values in found.items()}


def nor_errors(results: Results, mark: str) -> dict[tuple[str, int | None], float]:
    """Errors at a mark relative to that of restarting with the same edit, tile size and bounces, by strategy
    and NoR: the geometric mean over what they have in common."""
    found = errors(results, mark)
    ratios: dict[tuple[str, int | None], list[float]] = {}
    for place, error in found.items():
        restarted = found.get(place._replace(strategy=RESTART.name, nor=None))
        if error > 0 and restarted:
            ratios.setdefault((place.strategy, place.nor), []).append(error / restarted)
    return {variant: statistics.geometric_mean(values) for variant, values in ratios.items()}


def tile_errors(results: Results, mark: str) -> dict[tuple[int], float]:
    """Errors at a mark relative to the mean over tile sizes with the same edit, strategy, NoR and bounces, by
    tile size; means are geometric. A strategy without a NoR is left out: every step of it goes over the whole
    picture."""
    found = {place: e for place, e in errors(results, mark).items() if place.nor is not None and e > 0}
    alike: dict[Place, list[float]] = {}
    for place, error in found.items():
        alike.setdefault(place._replace(tile_size=0), []).append(error)
    ratios: dict[tuple[int], list[float]] = {}
    for place, error in found.items():
        mean = statistics.geometric_mean(alike[place._replace(tile_size=0)])
        ratios.setdefault((place.tile_size,), []).append(error / mean)
    return {size: statistics.geometric_mean(values) for size, values in ratios.items()}


def _table_of_nors(results: Results) -> Table:
    title = "normalized RMSE by NoR, relative to restarting: means over edits and tile sizes"
    return _relative_table(title, ("strategy", "NoR"), results, nor_errors)


def _table_of_tiles(results: Results) -> Table:
    title = "normalized RMSE by tile size, relative to the mean of all sizes"
    return _relative_table(title, ("tile",), results, tile_errors)


def _relative_table(
    title: str,
    names: Sequence[str],
    results: Results,
    values: Callable[[Results, str], Mapping[tuple[Any, ...], float]],
) -> Table:
    shown = Table(title=title, title_justify="left", box=None, pad_edge=False)
    marks = [mark for mark in _marks(results) if mark != "done"]
    for name in (*names, *marks):
        shown.add_column(name, justify="left" if name == "strategy" else "right", no_wrap=True)
    columns = [values(results, mark) for mark in marks]
    rows = dict.fromkeys(key for column in columns for key in column)
    for key in sorted(rows, key=lambda key: [(part is not None, part) for part in key]):
        cells = ["" if part is None else str(part) for part in key]
        shown.add_row(*cells, *(f"{column[key]:.2f}" if key in column else "" for column in columns))
    return shown


def _marks(results: Results) -> list[str]:
    return sorted({row["mark"] for r in results.records for row in r.rows}, key=_mark_order)


def _long_table(results: Results) -> Table:
    shown = Table(
        title="medians; below steps and seconds the normalized RMSE",
        title_justify="left",
        box=None,
        pad_edge=False,
    )
    marks = _marks(results)
    for name in (
        "edit",
        "strategy",
        "NoR",
        "tile",
        "bounces",
        "Mpaths/s",
        "first tile ms",
        "step ms",
        "queue s",
        *marks,
    ):
        shown.add_column(name, justify="left" if name in ("edit", "strategy") else "right", no_wrap=True)
    timings = [
        grouped(results, lambda r, v=value: r.values.get(v), *Place._fields)  # type: ignore[misc]
        for value in ("paths_per_second", "first_tile_ms", "step_ms", "queue_s")
    ]
    at_marks = [errors(results, mark) for mark in marks]
    for place in map(Place._make, timings[0]):
        cells = ["" if name is None else str(name) for name in place]
        cells.append(summary([rate / 1e6 for rate in timings[0][place]]).text())
        cells += [_median(timing.get(place)) for timing in timings[1:]]
        shown.add_row(*cells, *(f"{found[place]:.4f}" if place in found else "" for found in at_marks))
    return shown


def error_at(rows: Sequence[Mapping[str, Any]], mark: str) -> float | None:
    """The normalized RMSE at a mark, where there is one."""
    return next((float(row["normalized_rmse"]) for row in rows if row["mark"] == mark), None)


def _mark_order(mark: str) -> tuple[int, float]:
    number, _, unit = mark.partition(" ")
    return (2, 0.0) if mark == "done" else (int(unit == "s"), float(number))


def _median(values: Sequence[float] | None) -> str:
    return summary(values).text() if values else ""


def sweep(
    scene_file: Annotated[Path, typer.Argument(help="Scene file (.toml).", show_default=False)],
    edits_file: Annotated[Path, typer.Argument(help="Edit script (.toml).", show_default=False)],
    output: options.OutputOption = options.DEFAULT_FOLDER,
    tile: Annotated[list[int] | None, typer.Option(help="Tile size; may be repeated.")] = None,
    nor: Annotated[list[int] | None, typer.Option(help="NoR; may be repeated.")] = None,
    strategy: Annotated[list[str] | None, typer.Option(help="Strategy; may be repeated.")] = None,
    max_bounces: Annotated[
        list[int] | None, typer.Option("--max-bounces", help="May be repeated [default: the scene's].")
    ] = None,
    at_step: Annotated[list[int] | None, typer.Option(help="Compare after so many steps.")] = None,
    at_second: Annotated[list[float] | None, typer.Option(help="Compare after so many seconds.")] = None,
    base_spp: Annotated[int | None, typer.Option(help="Samples per pixel before the edits.", min=1)] = None,
    reference_spp: Annotated[int | None, typer.Option(help="Samples to compare with.", min=1)] = None,
    size: options.SizeOption = None,
    repetitions: options.RepetitionsOption = None,
    quick: options.QuickOption = False,
    device: options.DeviceOption = None,
) -> None:
    """Tile size x NoR x strategy x bounces: error at steps and seconds, and times, after each edit."""
    scene = registry.load(scene_file)
    script = load_edits(edits_file, scene)
    if script.cumulative:
        script = EditScript(script.edits, cumulative=False)  # each edit starts from the same picture
    for edit in script.edits:
        edit.apply(scene)
    settings = replace(
        scene.settings, size=options.parse_size(size, (320, 180) if quick else scene.settings.size)
    )
    grid = Grid(
        options.counts("--tile", tile, (16, 64) if quick else TILE_SIZES),
        variants(
            options.chosen("--strategy", strategy, STRATEGIES),
            options.counts("--nor", nor, (16, 256) if quick else NORS),
        ),
        options.counts("--max-bounces", max_bounces, (scene.settings.max_bounces,), least=0),
        Marks(
            tuple(options.counts("--at-step", at_step, STEPS, least=0)),
            options.moments("--at-second", at_second, SECONDS[:3] if quick else SECONDS),
            done=True,
        ),
        repetitions or (1 if quick else 3),
        base_spp or (128 if quick else 1024),
        reference_spp or (512 if quick else 4096),
    )
    with in_place("--tile, --nor or --max-bounces"):  # before anything is rendered
        cases(script, settings, grid)
    opened = Device(device)
    store = Store(output, NAME)
    gallery = Gallery(output / "references", opened)
    bench = EditBench(opened, gallery, scene, grid.base_spp, grid.reference_spp)
    found = experiment.run(store, tasks(bench, script, settings, grid), environment.describe(opened))
    print_table(tables(found), found, store)
