"""The commands of `incpt` and their options, from the command line itself."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import typer

from incpt.benchmarks.main import app as bench_app
from incpt.cli.main import app
from reference.markdown import code, table


def commands_of(application: typer.Typer) -> dict[str, Any]:
    """The commands of an application by name."""
    group: Any = typer.main.get_command(application)
    return dict(group.commands)


def options(command: str) -> str:
    """Arguments and options of a command. Every one has `--help` as well."""
    rows = [(_names(one), _default(one), _sentence(one.help or "")) for one in
            commands_of(app)[command].params]  # fmt: skip
    return table(("argument or option", "default", "what it is"), rows)


def commands() -> str:
    """All commands of `incpt`."""
    rows = ((code(f"incpt {name}"), _sentence(one.help)) for name, one in commands_of(app).items())
    return table(("command", "what it does"), rows)


def benchmarks() -> str:
    """All commands of `incpt bench`."""
    found = commands_of(bench_app).items()
    rows = ((code(f"incpt bench {name}"), _sentence(_first(one.help))) for name, one in found)
    return table(("command", "what it does"), rows)


def _names(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return code(parameter.name.upper())
    return ", ".join(map(code, parameter.opts))


def _default(parameter: Any) -> str:
    if parameter.required:
        return "has to be given"
    if isinstance(parameter.show_default, str):
        return parameter.show_default
    if parameter.default is None or parameter.default is False:
        return "–"
    is_number = isinstance(parameter.default, float)
    return code(f"{parameter.default:g}" if is_number else parameter.default)


def _first(text: str) -> str:
    return " ".join(text.split("\n\n")[0].split())


def _sentence(text: str) -> str:
    return text if text.endswith((".", "]")) else f"{text}."


OPTIONS = tuple(name for name in commands_of(app) if name != "bench")
"""The commands whose options are told; those of the benchmarks tell theirs themselves."""
PIECES: dict[str, Callable[[], str]] = {
    "commands": commands,
    "benchmarks": benchmarks,
    **{f"options {name}": partial(options, name) for name in OPTIONS},
}
