"""Every experiment with its tables: what the report shows and what documents quote."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rich.table import Table

from incpt.benchmarks import build, rays, scale, sweep, table51
from incpt.benchmarks.peers import compare
from incpt.benchmarks.store import Results


@dataclass(frozen=True)
class Experiment:
    """Its title, the tables that show its results, and whether these hold times."""

    title: str
    tables: Callable[[Results], Sequence[Table]]
    timed: bool = True


EXPERIMENTS = {
    table51.NAME: Experiment("The thesis's table 5.1 and figures 5.1 to 5.6", table51.tables, timed=False),
    sweep.NAME: Experiment("Tile size, NoR, strategy, bounces", lambda results: [sweep.table(results)]),
    compare.NAME: Experiment("Beside other renderers", compare.tables),
    rays.NAME: Experiment("Traversal beside Embree", lambda results: [rays.table(results)]),
    build.NAME: Experiment("Trees: build, refit, top level", lambda results: [build.table(results)]),
    scale.NAME: Experiment("How cost grows", lambda results: [scale.table(results)]),
}
