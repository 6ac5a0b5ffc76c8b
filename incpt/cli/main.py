"""The command line: `incpt render`, `replay`, `devices`, `check`, `pack`, `export`, and the doors to the
editor and the benchmarks.

What a command prints goes to stdout; progress, warnings and errors go to stderr, each error in one line
that names the fix. Exit status 2 for bad input and usage, 1 for a failure of device, disk or program, 130
after Ctrl-C.
"""

from __future__ import annotations

import sys
import traceback
import warnings
from collections.abc import Sequence
from typing import Annotated, Any

import typer

from incpt.cli import check, devices, doors, export, pack, render, replay
from incpt.cli.console import INTERRUPTED, Stopped, complain
from incpt.core.errors import DeviceError, InputError, InputWarning, OutputError, one_line

app = typer.Typer(
    name="incpt",
    help="An OpenCL path tracer that keeps its picture across an edit. Without a command: the editor.",
    add_completion=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

# A new command is a line here.
app.command("edit")(doors.edit)
app.command("bench", context_settings=doors.PASS_ON)(doors.bench)
app.command("render")(render.render)
app.command("replay")(replay.replay)
app.command("devices")(devices.devices)
app.command("check")(check.check)
app.command("pack")(pack.pack)
app.command("export")(export.export)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status; never raises but for the interpreter's own exit."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in given
    warnings.showwarning = _show_warning
    try:
        result = app([a for a in given if a != "--debug"], prog_name="incpt", standalone_mode=False)
        if result == INTERRUPTED:  # what typer makes of KeyboardInterrupt
            raise KeyboardInterrupt
        return result if isinstance(result, int) else 0
    except (KeyboardInterrupt, typer.Abort):
        return complain("stopped", INTERRUPTED)
    except Stopped as error:
        return complain(str(error), INTERRUPTED)
    except Exception as error:
        if debug:
            traceback.print_exc()
        return complain(*_explain(error))


def _explain(error: Exception) -> tuple[str, int]:
    """The line and the exit status for an exception that ended a command."""
    if isinstance(error, InputError):
        return str(error), 2
    if isinstance(error, DeviceError | OutputError):
        return str(error), 1
    if hasattr(error, "format_message"):  # a usage error of typer, or of the click below older ones
        return f"{error.format_message().rstrip('.')}; see incpt --help", int(getattr(error, "exit_code", 2))
    if isinstance(error, MemoryError):
        return "memory ran out; use a smaller image or scene", 1
    if isinstance(error, OSError):
        return f"{error.filename or 'the system'}: {error.strerror or error}", 1
    return f"unexpected {type(error).__name__}: {error}; --debug shows where it came from", 1


def _show_warning(message: Warning | str, category: type[Warning], *rest: Any, **more: Any) -> None:
    if issubclass(category, InputWarning):
        print(f"incpt: warning: {one_line(message)}", file=sys.stderr)
    elif "--debug" in sys.argv:
        print(f"incpt: {category.__name__}: {one_line(message)}", file=sys.stderr)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"incpt {version('incpt')}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    show_version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show tracebacks and warnings; may stand anywhere.")
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        raise typer.Exit(doors.enter("incpt.ui.app", "the editor", None, None))
