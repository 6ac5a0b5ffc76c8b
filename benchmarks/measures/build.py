"""`incpt bench build`: what it costs to make and to change the trees: build, refit, top level, memory."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from incpt.accel import bvh, top_level
from incpt.benchmarks.kit import environment, experiment, options
from incpt.benchmarks.kit.experiment import Outcome, Task, Work
from incpt.benchmarks.kit.fit import fitted
from incpt.benchmarks.kit.scenes import crowd, terrain
from incpt.benchmarks.kit.store import Results, Store, grouped
from incpt.benchmarks.kit.tables import print_table
from incpt.benchmarks.kit.timing import interleaved, significant, summary
from incpt.device.device import Device
from incpt.scene.mesh import Mesh
from incpt.tables.geometry_pool import GeometryPool
from incpt.tables.scene_tables import tables_of

NAME = "build"
TRIANGLES = (1_000, 10_000, 100_000, 1_000_000, 5_000_000)
OBJECTS = (1, 10, 100, 1_000, 10_000, 100_000)
BUILD, REFIT, TOP, MOVE = "build", "refit", "top", "move"


@dataclass(frozen=True)
class Plan:
    """What is built."""

    triangles: Sequence[int] = TRIANGLES
    objects: Sequence[int] = OBJECTS
    repetitions: int = 5


def tasks(device: Device, plan: Plan) -> list[Task]:
    """Sizes take turns, so that a machine that is busy for a while does not spoil one size alone."""
    meshes = [(measure, count) for count in plan.triangles for measure in (BUILD, REFIT)]
    tops = [(measure, count) for count in plan.objects for measure in (TOP, MOVE)]
    measures: dict[str, Callable[[Device, int, Work], dict[str, Any]]] = {
        BUILD: _build, REFIT: _refit, TOP: _top, MOVE: _move,
    }  # fmt: skip
    made = []
    for turn, (measure, count) in interleaved(meshes + tops, plan.repetitions):
        what = "triangles" if measure in (BUILD, REFIT) else "objects"
        subject = {"measure": measure, what: count, "repetition": turn}

        def run(work: Work, measure: str = measure, count: int = count) -> Outcome:
            return Outcome(measures[measure](device, count, work))

        made.append(Task(f"{measure}: {count:,} {what}", subject, run, 1 + count / 1e5))
    return made


def _warm_up(device: Device, work: Work) -> None:
    mesh = terrain(2_000)
    bvh.refit_mesh(device, bvh.build_mesh(device, mesh), mesh)
    top_level.build_top(device, np.tile(mesh.bounds, (100, 1, 1)))
    work.check()
    work.timing_starts()


def _build(device: Device, count: int, work: Work) -> dict[str, Any]:
    mesh = terrain(count)
    _warm_up(device, work)
    began = time.perf_counter()
    tree = bvh.build_mesh(device, mesh)
    seconds = time.perf_counter() - began
    filled = len(mesh.faces) / (tree.packs.size * tree.packs["face"].shape[1])
    nbytes = tree.nodes.nbytes + tree.packs.nbytes
    return {
        "ms": 1e3 * seconds,
        "count": len(mesh.faces),
        "nodes": len(tree.nodes),
        "bytes_per_triangle": nbytes / len(mesh.faces),
        "pack_fill": filled,
    }


def _refit(device: Device, count: int, work: Work) -> dict[str, Any]:
    mesh = terrain(count)
    tree = bvh.build_mesh(device, mesh)
    lifted = mesh.vertices * np.array([1, 1.3, 1], np.float32)
    bent = Mesh(lifted, mesh.faces)
    _warm_up(device, work)
    began = time.perf_counter()
    bvh.refit_mesh(device, tree, bent)
    return {"ms": 1e3 * (time.perf_counter() - began), "count": len(mesh.faces)}


def _top(device: Device, count: int, work: Work) -> dict[str, Any]:
    bounds = np.array([obj.world_bounds for obj in crowd(count).objects[1:]])
    _warm_up(device, work)
    began = time.perf_counter()
    tree = top_level.build_top(device, bounds)
    return {"ms": 1e3 * (time.perf_counter() - began), "count": count, "nodes": len(tree.nodes)}


def _move(device: Device, count: int, work: Work) -> dict[str, Any]:
    scene = crowd(count)
    pool = GeometryPool.of(device)
    tables = tables_of(pool, scene)
    _warm_up(device, work)
    name = scene.objects[-1].name
    moved = scene.with_object(name, position=(0.0, 1.0, 0.0))
    began = time.perf_counter()
    tables_of(pool, moved, tables)
    device.finish()
    return {"ms": 1e3 * (time.perf_counter() - began), "count": count}


WHAT = {
    BUILD: "building the tree of a mesh, by triangles",
    REFIT: "refitting it to other vertices, by triangles",
    TOP: "building the top level, by objects",
    MOVE: "moving one object, everything included, by objects",
}


def points(results: Results, measure: str, what: str | None = None) -> list[tuple[float, float]]:
    """(count, median milliseconds) by count; none where `what` is not what the measure is counted in."""
    chosen = [r for r in results.where(measure=measure) if what is None or what in r.subject]
    times = grouped(Results(records=tuple(chosen)), lambda r: r.values["ms"], "triangles", "objects")
    counts = {(r.subject.get("triangles"), r.subject.get("objects")): r.values["count"] for r in chosen}
    return sorted((float(counts[key]), summary(values).median) for key, values in times.items())


def table(results: Results) -> Table:
    """Medians, and how time grows."""
    shown = Table(title="trees", title_justify="left", box=None, pad_edge=False)
    shown.add_column("")
    for column in ("count", "ms", "per million, s", "bytes each", "grows as"):
        shown.add_column(column, justify="right")
    for measure, what in WHAT.items():
        law = fitted(*zip(*points(results, measure), strict=True)) if results.where(measure=measure) else None
        chosen = Results(records=tuple(results.where(measure=measure)))
        times = grouped(chosen, lambda r: r.values["ms"], "triangles", "objects")
        for i, key in enumerate(sorted(times, key=lambda k: k[0] or k[1])):
            values = chosen.where(triangles=key[0], objects=key[1])[0].values
            each = values.get("bytes_per_triangle")
            shown.add_row(
                what if i == 0 else "",
                f"{values['count']:,}",
                summary(times[key]).text(),
                significant(summary(times[key]).median * 1e3 / values["count"]),
                "" if each is None else significant(each),
                law.text() if law and i == 0 else "",
            )
    return shown


def build(
    output: options.OutputOption = options.DEFAULT_FOLDER,
    triangles: Annotated[list[int] | None, typer.Option(help="Of a mesh; may be repeated.")] = None,
    objects: Annotated[list[int] | None, typer.Option(help="Of a scene; may be repeated.")] = None,
    repetitions: options.RepetitionsOption = None,
    quick: options.QuickOption = False,
    device: options.DeviceOption = None,
) -> None:
    """BVH build, refit, top level and memory, from 1,000 to 5 million triangles, 1 to 100,000 objects."""
    plan = Plan(
        options.counts("--triangles", triangles, TRIANGLES[:3] if quick else TRIANGLES),
        options.counts("--objects", objects, OBJECTS[:4] if quick else OBJECTS),
    )
    plan = replace(plan, repetitions=repetitions or (2 if quick else plan.repetitions))
    opened = Device(device)
    store = Store(output, NAME)
    found = experiment.run(store, tasks(opened, plan), environment.describe(opened))
    print_table(table(found), found, store)
