"""`incpt replay`: an edit session without a window."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from incpt.cli.console import Stopped, interruption, path_progress, print_table
from incpt.cli.options import (
    BouncesOption,
    DeviceOption,
    SceneArgument,
    SeedOption,
    SizeOption,
    padded_pixels,
    settings_from,
)
from incpt.core.errors import InputWarning
from incpt.core.settings import STRATEGIES

if TYPE_CHECKING:
    from incpt.render.session import StepReport


def replay(
    scene_file: SceneArgument,
    edits_file: Annotated[Path, typer.Argument(help="Edit script (.toml).", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for what comes out.")],
    strategy: Annotated[
        list[str] | None, typer.Option(help=f"{' or '.join(STRATEGIES)}; may be repeated [default: all].")
    ] = None,
    nor: Annotated[
        list[int] | None, typer.Option(help="Repetitions of a tile; may be repeated [default: the scene's].")
    ] = None,
    base_spp: Annotated[int, typer.Option(help="Samples per pixel before the edits.", min=1)] = 256,
    reference_spp: Annotated[int, typer.Option(help="Samples per pixel to compare with.", min=1)] = 1024,
    size: SizeOption = None,
    seed: SeedOption = None,
    max_bounces: BouncesOption = None,
    device: DeviceOption = None,
) -> None:
    """Edit a scene without a window, under several strategies, and measure the error after each edit."""
    from incpt.device.device import Device
    from incpt.formats import registry
    from incpt.formats.edit_script import load_edits
    from incpt.replay.replay import Replay, variants
    from incpt.replay.report import ReplayReport

    scene = registry.load(scene_file)
    script = load_edits(edits_file, scene)
    settings = settings_from(scene, size=size, seed=seed, max_bounces=max_bounces)
    names, nors = strategy or STRATEGIES, nor or [settings.nor]
    # What cannot be is refused here, by the name of its option.
    for name in names:
        settings_from(scene, size=None, strategy=name)
    for one in nors:
        settings_from(scene, size=None, nor=one)
    compared = variants(names, nors)
    plan = Replay(scene, script, compared, settings, base_spp, reference_spp)
    if plan.left_out:
        what = f"{edits_file}: {plan.left_out} captures come after the next edit and are left out"
        warnings.warn(what, InputWarning, stacklevel=1)
    report = ReplayReport(output, script.edits)
    opened = Device(device)
    pixels = padded_pixels(settings)
    with interruption() as stop, path_progress("", plan.paths_per_pixel * pixels, pixels) as progress:

        def on_step(what: str, step: StepReport) -> None:
            progress.describe(what)
            progress.advance(step.paths)
            stop.check()

        try:
            for picture in plan.pictures(opened, on_step):
                report.add(picture)
        except KeyboardInterrupt:
            if not stop.requested:
                raise
        report.finish()
    if report.has_captures:
        print_table(report.table())
    print(f"{output}: pictures, {report.sheet_path.name}, {report.csv_path.name}")
    if stop.requested:
        raise Stopped(f"stopped; {output} holds what was done")
