"""Every experiment with its tables: what the report shows and what documents quote."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rich.table import Table

from incpt.benchmarks.impact import tables as impact_tables
from incpt.benchmarks.kit.store import Results, Row
from incpt.benchmarks.measures import build, latency, rays, scale, steps, sweep, table51
from incpt.benchmarks.peers import compare


@dataclass(frozen=True)
class Experiment:
    """Its title, the tables that show its results, what must be the same for all results in one table
    (names in their subjects), and whether the results are times."""

    title: str
    tables: Callable[[Results], Sequence[Table]]
    setup: tuple[str, ...] = ()
    timed: bool = True


EXPERIMENTS = {
    table51.NAME: Experiment(
        "The thesis's table 5.1 and figures 5.1 to 5.6",
        table51.tables,
        ("scene", "size", "base_spp", "reference_spp"),
        timed=False,
    ),
    sweep.NAME: Experiment(
        "Tile size, NoR, strategy, bounces",
        sweep.tables,
        ("scene", "size", "base_spp", "reference_spp"),
    ),
    impact_tables.NAME: Experiment(
        "The strategy impact beside others",
        impact_tables.tables,
        ("reference", "size_scale", "tile_size", "seed"),
    ),
    compare.NAME: Experiment("Beside other renderers", compare.tables, ("size", "threads", "reference_spp")),
    rays.NAME: Experiment("Traversal beside Embree", lambda results: [rays.table(results)], ("size",)),
    build.NAME: Experiment("Trees: build, refit, top level", lambda results: [build.table(results)]),
    scale.NAME: Experiment(
        "How cost grows", lambda results: [scale.table(results)], ("size", "max_bounces", "least_s")
    ),
    steps.NAME: Experiment(
        "Steps: host and device, and repetition",
        steps.tables,
        ("steps", "close_size", "samples", "spiral_steps"),
    ),
    latency.NAME: Experiment(
        "How soon the editor answers", lambda results: [latency.table(results)], ("size",)
    ),
}


def setup_text(apart: Row) -> str:
    """What sets results apart, such as "size 512 x 512, threads 2"; machine and device are told elsewhere."""
    words = []
    for name, value in apart.items():
        if name not in ("machine", "device", "scene") and value is not None:
            shown = " x ".join(map(str, value)) if isinstance(value, list) else str(value)
            words.append(f"{name.replace('_', ' ')} {shown}")
    return ", ".join(words)
