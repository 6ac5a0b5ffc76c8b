"""`incpt bench`: measures incpt, and other renderers beside it. Each command is a module of this package."""

from __future__ import annotations

from collections.abc import Sequence

import typer

from incpt.benchmarks import report
from incpt.benchmarks.impact import command
from incpt.benchmarks.measures import (
    build,
    fuzz,
    latency,
    rays,
    scale,
    screenshots,
    soak,
    steps,
    sweep,
    table51,
)
from incpt.benchmarks.peers import agreement, compare
from incpt.core.errors import InputError

app = typer.Typer(
    name="incpt bench",
    help="Measure incpt, and other renderers beside it. What is finished is never measured again.",
    add_completion=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

# A new command is a line here.
app.command("sweep")(sweep.sweep)
app.command("table51")(table51.table51)
app.command("impact")(command.impact)
app.command("rays")(rays.rays)
app.command("peers")(compare.peers)
app.command("agreement")(agreement.agreement)
app.command("build")(build.build)
app.command("scale")(scale.scale)
app.command("steps")(steps.steps)
app.command("latency")(latency.latency)
app.command("soak")(soak.soak)
app.command("fuzz")(fuzz.fuzz)
app.command("screenshots")(screenshots.screenshots)
app.command("report")(report.report)


@app.callback(invoke_without_command=True)
def _bench(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        print(context.get_help())


def main(arguments: Sequence[str]) -> int:
    """Run a benchmark and return its exit status. Raises InputError, Stopped and others, which `incpt.cli`
    explains."""
    try:
        result = app(list(arguments), prog_name="incpt bench", standalone_mode=False)
    except Exception as error:
        if hasattr(error, "format_message"):  # a usage error, as typer or its click raise it
            message = str(error.format_message()).rstrip(".")
            raise InputError(f"bench: {message}; see incpt bench --help") from None
        raise
    return result if isinstance(result, int) else 0
