"""Options that the benchmarks share, and what they are read into."""

from __future__ import annotations

import importlib
import re
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Annotated

import typer

from incpt.core.errors import InputError

DEFAULT_FOLDER = Path("out/bench")

OutputOption = Annotated[
    Path, typer.Option("-o", "--output", help="Folder for results; what is in it is not measured again.")
]
DeviceOption = Annotated[
    str | None, typer.Option("--device", help="Index or part of the name, as `incpt devices` lists them.")
]
QuickOption = Annotated[bool, typer.Option("--quick", help="Smaller pictures and fewer cases: minutes.")]
SizeOption = Annotated[str | None, typer.Option("--size", help="Width and height, such as 960x540.")]
RepetitionsOption = Annotated[
    int | None, typer.Option("--repetitions", help="How often each case is measured.", min=1)
]
SceneOption = Annotated[
    list[str] | None, typer.Option("--scene", help="A benchmark scene; may be repeated [default: all].")
]


def parse_size(text: str | None, default: tuple[int, int]) -> tuple[int, int]:
    """Width and height. Raises InputError."""
    if text is None:
        return default
    match = re.fullmatch(r"(\d{1,6})[x×,](\d{1,6})", text.strip().lower())
    if match is None or "0" in (match[1].lstrip("0") or "0", match[2].lstrip("0") or "0"):
        raise InputError(f"--size: {text!r} is not a width and a height; write it like 960x540")
    return int(match[1]), int(match[2])


def chosen(option: str, given: Sequence[str] | None, known: Sequence[str]) -> list[str]:
    """The names that were given, each once, or all. Raises InputError for one that is not known."""
    for name in given or ():
        if name not in known:
            raise InputError(f"{option}: {name!r} is not known; choose from {', '.join(known)}")
    return list(dict.fromkeys(given)) if given else list(known)


def counts(option: str, given: Sequence[int] | None, default: Sequence[int], least: int = 1) -> list[int]:
    """Whole numbers in rising order, each once. Raises InputError for one below `least`."""
    for number in given or ():
        if number < least:
            raise InputError(f"{option}: {number} is too small; use {least} or more")
    return sorted(set(given)) if given else list(default)


def moments(option: str, given: Sequence[float] | None, default: Sequence[float]) -> tuple[float, ...]:
    """Seconds in rising order, each once. Raises InputError for those that are no time."""
    for number in given or ():
        if not 0 < number < 1e6:
            raise InputError(f"{option}: {number:g} is out of range; use a positive number of seconds")
    return tuple(sorted(set(given))) if given else tuple(default)


def optional(module: str, what: str, extra: str) -> ModuleType:
    """A module of an optional library. Raises InputError, which names the extra that brings it."""
    try:
        return importlib.import_module(module)
    except ImportError:
        raise InputError(f'{what}: {module} is not installed; run pip install "incpt[{extra}]"') from None
