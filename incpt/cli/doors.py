"""The commands that open parts of incpt which are imported when they are asked for: editor and benchmarks."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Annotated, Any

import typer

from incpt.cli.console import complain
from incpt.cli.options import DeviceOption, ParameterOption, UnitOption, UpOption, import_options

_EXTRAS = {"ui": "ui", "benchmarks": "bench"}
PASS_ON = {"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}
"""Settings of typer with which a command gets its options as they are."""


def edit(
    file: Annotated[
        Path | None, typer.Argument(help="Scene file or mesh.", show_default="an example")
    ] = None,
    up: UpOption = None,
    unit: UnitOption = None,
    define: ParameterOption = None,
    device: DeviceOption = None,
) -> None:
    """The editor: select and drag things, and see the change at once."""
    options = import_options(up, unit, define)
    raise typer.Exit(enter("incpt.ui.app", "the editor", file, device, options))


def bench(context: typer.Context) -> None:
    """The benchmarks: incpt bench sweep|table51|rays|peers."""
    raise typer.Exit(enter("incpt.benchmarks.main", "the benchmarks", context.args))


def enter(module_name: str, what: str, *arguments: Any) -> int:
    """Call `main` of a part that incpt does not import until it is asked for."""
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        missing = error.name or module_name
        if module_name.startswith(missing):
            return complain(f"{what}: is not part of this installation; install incpt again", 1)
        extra = _EXTRAS[module_name.split(".")[1]]
        return complain(f'{what}: {missing} is not installed; run pip install "incpt[{extra}]"', 1)
    except ImportError as error:
        return complain(f"{what}: {error}; install that library of the system (OpenGL: libgl1)", 1)
    return int(module.main(*arguments))
