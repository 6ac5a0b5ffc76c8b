"""`incpt bench impact`: the strategy impact beside restarting, a denoiser and the spiral of the thesis.

Each edit starts from the same kept picture under every variant, and is compared with a converged picture of
another seed: at equal paths, where a partner is a path as any other, and at equal seconds, where all counts
that stands between a hand and its picture.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from incpt.benchmarks.impact.bench import ImpactBench
from incpt.benchmarks.impact.edits import DRAG, EDITS
from incpt.benchmarks.impact.pictures import write_pictures
from incpt.benchmarks.impact.tables import MEASURES, NAME, tables
from incpt.benchmarks.impact.tasks import Plan, tasks
from incpt.benchmarks.kit import environment, experiment, options
from incpt.benchmarks.kit.pictures import Gallery
from incpt.benchmarks.kit.store import Store
from incpt.benchmarks.kit.tables import print_table
from incpt.core.errors import InputError, in_place
from incpt.device.device import Device

_FULL = Plan()
_QUICK = Plan(
    nors=(16, 64), steps=(1, 2, 5), seconds=(0.05, 0.2, 1.0), bases=(256,), reference_spp=512, size_scale=0.5
)


def impact(
    output: options.OutputOption = options.DEFAULT_FOLDER,
    edit: Annotated[
        list[str] | None, typer.Option(help=f"{', '.join((*EDITS, DRAG))}; may be repeated [default: all].")
    ] = None,
    measure: Annotated[
        list[str] | None, typer.Option(help=f"{', '.join(MEASURES)}; may be repeated [default: all].")
    ] = None,
    nor: Annotated[list[int] | None, typer.Option(help="NoR of a spiral; may be repeated.")] = None,
    at_step: Annotated[list[int] | None, typer.Option(help="Compare after so many steps.")] = None,
    at_second: Annotated[list[float] | None, typer.Option(help="Compare after so many seconds.")] = None,
    base_spp: Annotated[
        list[int] | None, typer.Option(help="Samples per pixel before the edits; may be repeated.")
    ] = None,
    reference_spp: Annotated[int | None, typer.Option(help="Samples to compare with.", min=1)] = None,
    tile: Annotated[int, typer.Option(help="Tile size.", min=1)] = _FULL.tile_size,
    size_scale: Annotated[
        float | None, typer.Option(help="By what the sizes of pictures are multiplied.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the random numbers.", min=0)] = _FULL.seed,
    repetitions: options.RepetitionsOption = None,
    pictures: Annotated[
        Path | None, typer.Option(help="Write pictures of the edits into this folder, too.")
    ] = None,
    quick: options.QuickOption = False,
    device: options.DeviceOption = None,
) -> None:
    """Errors after 31 edits and a drag, of impact, restarting, restarting with a denoiser, and spirals."""
    usual = _QUICK if quick else _FULL
    plan = Plan(
        edits=options.chosen("--edit", edit, (*EDITS, DRAG)),
        measures=options.chosen("--measure", measure, MEASURES),
        nors=options.counts("--nor", nor, usual.nors),
        steps=options.counts("--at-step", at_step, usual.steps),
        seconds=options.moments("--at-second", at_second, usual.seconds),
        bases=sorted(options.counts("--base-spp", base_spp, usual.bases), reverse=True),
        reference_spp=reference_spp or usual.reference_spp,
        tile_size=tile,
        size_scale=_scale(size_scale, usual.size_scale),
        seed=seed,
        repetitions=repetitions or usual.repetitions,
    )
    with in_place("--tile, --nor, --seed or --size-scale"):  # before anything is rendered
        plan.check()
    opened = Device(device)
    store = Store(output, NAME)
    bench = ImpactBench(opened, Gallery(output / "references", opened), plan.reference_spp)
    found = experiment.run(store, tasks(bench, plan), environment.describe(opened))
    print_table(tables(found), found, store)
    if pictures is not None:
        for path in write_pictures(pictures, bench, plan, lambda fraction: None):
            print(path)


def _scale(given: float | None, usual: float) -> float:
    if given is not None and not 0 < given <= 16:
        raise InputError(f"--size-scale: {given:g} is out of range; use a number above 0, up to 16")
    return usual if given is None else given
