"""`incpt export`: a scene as glTF, for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from incpt.cli.options import (
    ClipOption,
    OutsideOption,
    ParameterOption,
    StrictOption,
    TimeOption,
    UnitOption,
    UpOption,
    read_for_writing,
)


def export(
    file: Annotated[Path, typer.Argument(help="Scene file or mesh.", show_default=False)],
    to: Annotated[Path, typer.Argument(help="The file to write (.glb).", show_default=False)],
    time: TimeOption = None,
    clip: ClipOption = None,
    strict: StrictOption = False,
    allow_outside: OutsideOption = False,
    up: UpOption = None,
    unit: UnitOption = None,
    define: ParameterOption = None,
) -> None:
    """Write a scene as glTF (.glb), and say what that cannot hold."""
    from incpt.formats import import_report
    from incpt.formats.gltf_writer.export import export as write

    scene = read_for_writing(
        file, up, unit, strict, define=define, time=time, clip=clip, allow_outside=allow_outside
    )
    with import_report.gathered() as found:
        write(scene, to)
    print(f"{to}: written")
    if found.report.remarks:
        print(*found.report.lines(), sep="\n")
