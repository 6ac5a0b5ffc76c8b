"""`incpt pack`: a scene with all that it needs, in one folder or archive."""

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


def pack(
    file: Annotated[Path, typer.Argument(help="Scene file or mesh.", show_default=False)],
    to: Annotated[
        Path, typer.Argument(help="A new folder, or an archive that ends in .zip.", show_default=False)
    ],
    time: TimeOption = None,
    clip: ClipOption = None,
    strict: StrictOption = False,
    allow_outside: OutsideOption = False,
    up: UpOption = None,
    unit: UnitOption = None,
    define: ParameterOption = None,
) -> None:
    """Write a scene with its meshes and images beside it, to be handed to somebody else."""
    from incpt.formats.pack import pack as write

    scene = read_for_writing(
        file, up, unit, strict, define=define, time=time, clip=clip, allow_outside=allow_outside
    )
    write(scene, to)
    print(f"{to}: written")
