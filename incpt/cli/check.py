"""`incpt check`: validates a file and says what is in it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def check(file: Annotated[Path, typer.Argument(help="Scene file or mesh.", show_default=False)]) -> None:
    """Validate a scene file or a mesh, and print what is in it."""
    from incpt.formats import registry
    from incpt.scene import summary

    scene = registry.load(file)
    # Problems are among the warnings of `load`.
    print(f"{file}: valid", *(line for line in summary.describe(scene) if "warning:" not in line), sep="\n  ")
