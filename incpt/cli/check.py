"""`incpt check`: validates a file and says what is in it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from incpt.cli.console import complain
from incpt.cli.options import (
    ClipOption,
    MissingOption,
    OutsideOption,
    ParameterOption,
    StrictOption,
    TimeOption,
    UnitOption,
    UpOption,
    import_options,
)


def check(
    file: Annotated[Path, typer.Argument(help="Scene file or mesh.", show_default=False)],
    time: TimeOption = None,
    clip: ClipOption = None,
    strict: StrictOption = False,
    allow_outside: OutsideOption = False,
    allow_missing: MissingOption = False,
    up: UpOption = None,
    unit: UnitOption = None,
    define: ParameterOption = None,
) -> None:
    """Validate a scene file or a mesh, and print what is in it and what was left out."""
    from incpt.formats import registry
    from incpt.scene import summary

    scene, report = registry.load_with_report(
        file,
        **import_options(
            up, unit, define, time=time, clip=clip, allow_outside=allow_outside, allow_missing=allow_missing
        ),
    )
    if strict:
        report.check_whole()
    for problem in summary.scene_problems(scene):
        complain(f"warning: {file}: {problem}", 0)
    described = [line for line in summary.describe(scene) if "warning:" not in line]
    print(f"{file}: valid", *described, sep="\n  ")
    if report.remarks:
        print(*report.lines(), sep="\n")
