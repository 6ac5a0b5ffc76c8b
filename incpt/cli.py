"""The command line: `incpt render`, `replay`, `devices`, `check`, and the doors to editor and benchmarks.

What a command prints goes to stdout; progress, warnings and errors go to stderr, each error in one line
that names the fix. Exit status 2 for bad input and usage, 1 for a failure of device, disk or program, 130
after Ctrl-C.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
import traceback
import warnings
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import pyopencl as cl
import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from incpt import device as opencl
from incpt import scene_io
from incpt.console import Stopped, interruption, path_progress
from incpt.edit_script import load_edits
from incpt.errors import DeviceError, InputError, InputWarning, OutputError, one_line
from incpt.export import SUFFIXES, write_picture
from incpt.replay import Replay, variants
from incpt.replay_report import ReplayReport
from incpt.scene import Scene
from incpt.session import Session, StepReport
from incpt.settings import STRATEGIES, RenderSettings
from incpt.tiles import TileGrid

INTERRUPTED = 130
"""Exit status of a command that Ctrl-C stopped: 128 + SIGINT, as shells have it."""

app = typer.Typer(
    name="incpt",
    help="An OpenCL path tracer that keeps its picture across an edit. Without a command: the editor.",
    add_completion=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

SceneArgument = Annotated[Path, typer.Argument(help="Scene file (.toml).", show_default=False)]
DeviceOption = Annotated[
    str | None,
    typer.Option(
        "--device", help="Index or part of the name, as `incpt devices` lists them [or INCPT_DEVICE]."
    ),
]
SizeOption = Annotated[str | None, typer.Option("--size", help="Width and height, such as 960x540.")]
SeedOption = Annotated[int | None, typer.Option("--seed", help="Chooses the random numbers.")]
BouncesOption = Annotated[
    int | None, typer.Option("--max-bounces", help="Scattering events after the first hit.")
]


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
        return _complain("stopped", INTERRUPTED)
    except Stopped as error:
        return _complain(str(error), INTERRUPTED)
    except Exception as error:
        if debug:
            traceback.print_exc()
        return _complain(*_explain(error))


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


def _complain(message: str, status: int) -> int:
    print(f"incpt: {one_line(message)}", file=sys.stderr)
    return status


def _show_warning(message: Warning | str, category: type[Warning], *rest: Any, **more: Any) -> None:
    if issubclass(category, InputWarning):
        print(f"incpt: warning: {one_line(message)}", file=sys.stderr)
    elif "--debug" in sys.argv:
        print(f"incpt: {category.__name__}: {one_line(message)}", file=sys.stderr)


def _print_version(wanted: bool) -> None:
    if wanted:
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
        raise typer.Exit(_enter("incpt.ui.app", "the editor", None, None))


# ------------------------------------------------------------------------------------------ commands

_EXTRAS = {"ui": "ui", "benchmarks": "bench"}
_PASS_ON = {"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}


@app.command()
def edit(
    file: Annotated[
        Path | None, typer.Argument(help="Scene file or mesh.", show_default="an example")
    ] = None,
    device: DeviceOption = None,
) -> None:
    """The editor: select and drag things, and see the change at once."""
    raise typer.Exit(_enter("incpt.ui.app", "the editor", file, device))


@app.command(context_settings=_PASS_ON)
def bench(context: typer.Context) -> None:
    """The benchmarks: incpt bench sweep|table51|rays|peers."""
    raise typer.Exit(_enter("incpt.benchmarks.main", "the benchmarks", context.args))


def _enter(module_name: str, what: str, *arguments: Any) -> int:
    """Call `main` of a part that incpt does not import until it is asked for."""
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        missing = error.name or module_name
        if module_name.startswith(missing):
            return _complain(f"{what}: not in this version; it comes with a later one", 1)
        extra = _EXTRAS[module_name.split(".")[1]]
        return _complain(f'{what}: {missing} is not installed; run pip install "incpt[{extra}]"', 1)
    except ImportError as error:
        return _complain(f"{what}: {error}; install that library of the system (OpenGL: libgl1)", 1)
    return int(module.main(*arguments))


@app.command()
def render(
    scene_file: SceneArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help=".exr: linear radiance; .png: tone-mapped sRGB.")
    ],
    spp: Annotated[int, typer.Option(help="Samples per pixel.", min=1)] = 256,
    size: SizeOption = None,
    seed: SeedOption = None,
    strategy: Annotated[str | None, typer.Option(help="restart or spiral.")] = None,
    max_bounces: BouncesOption = None,
    aovs: Annotated[
        bool, typer.Option("--aovs", help="Put object ids, normals, depth and base colours into the .exr.")
    ] = False,
    device: DeviceOption = None,
) -> None:
    """Render a scene to a picture. Ctrl-C keeps what is done."""
    _check_picture_path(output)
    if aovs and output.suffix.lower() != ".exr":
        raise InputError(f"--aovs: {output} cannot hold them; use an .exr")
    scene = scene_io.load(scene_file)
    settings = _settings(scene, size=size, seed=seed, strategy=strategy, max_bounces=max_bounces)
    session = Session(scene, settings=settings, device=device)
    pixels = _padded_pixels(settings)
    nonfinite = 0
    with interruption() as stop, path_progress("rendering", spp * pixels, pixels) as progress:

        def on_step(report: StepReport) -> None:
            nonlocal nonfinite
            nonfinite += report.nonfinite
            progress.advance(report.paths)
            stop.check()

        try:
            session.render(spp, on_step)
        except KeyboardInterrupt:
            if not stop.requested:
                raise
        # Still inside, so that another Ctrl-C does not tear the picture that is kept.
        write_picture(output, session, aovs)
    samples = int(session.spp().min())
    if nonfinite:
        _complain(f"warning: {nonfinite:,} samples were not finite and count as black", 0)
    print(f"{output}: {session.size[0]} x {session.size[1]}, {samples} samples per pixel")
    if stop.requested:
        raise Stopped(f"stopped at {samples} of {spp} samples per pixel")


@app.command()
def replay(
    scene_file: SceneArgument,
    edits_file: Annotated[Path, typer.Argument(help="Edit script (.toml).", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for what comes out.")],
    strategy: Annotated[
        list[str] | None, typer.Option(help="restart or spiral; may be repeated [default: both].")
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
    scene = scene_io.load(scene_file)
    script = load_edits(edits_file, scene)
    settings = _settings(scene, size=size, seed=seed, max_bounces=max_bounces)
    compared = variants(strategy or STRATEGIES, nor or [settings.nor])
    for variant in compared:
        _settings(scene, size=None, strategy=variant.strategy, nor=variant.nor)  # says which option is wrong
    plan = Replay(scene, script, compared, settings, base_spp, reference_spp)
    if plan.left_out:
        what = f"{edits_file}: {plan.left_out} captures come after the next edit and are left out"
        warnings.warn(what, InputWarning, stacklevel=1)
    report = ReplayReport(output, script.edits)
    opened = opencl.Device(device)
    pixels = _padded_pixels(settings)
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
        _print_table(report.table())
    print(f"{output}: pictures, {report.sheet_path.name}, {report.csv_path.name}")
    if stop.requested:
        raise Stopped(f"stopped; {output} holds what was done")


@app.command()
def devices(
    device: DeviceOption = None,
    test: Annotated[bool, typer.Option("--test", help="Build and run a kernel on the chosen one.")] = False,
) -> None:
    """List the OpenCL devices, and which one is taken."""
    taken = opencl.choose(device)
    table = Table(box=None, pad_edge=False)
    for heading, side in (("", "right"), ("device", "left"), ("kind", "left"), ("units", "right")):
        table.add_column(heading, justify=side)  # type: ignore[arg-type]
    table.add_column("memory", justify="right")
    table.add_column("")
    for i, one in enumerate(opencl.all_devices()):
        table.add_row(
            str(i),
            escape(opencl.device_name(one)),
            "GPU" if one.type & cl.device_type.GPU else "CPU" if one.type & cl.device_type.CPU else "other",
            str(one.max_compute_units),
            f"{one.global_mem_size / 2**30:.1f} GiB",
            "taken" if one == taken else "",
        )
    _print_table(table)
    if test:
        Session(Scene(), size=(16, 16), device=device).step()
        print("the kernels build and run")


@app.command()
def check(file: Annotated[Path, typer.Argument(help="Scene file or mesh.", show_default=False)]) -> None:
    """Validate a scene file or a mesh, and print what is in it."""
    scene = scene_io.load(file)
    # Problems are among the warnings of `load`.
    print(
        f"{file}: valid", *(line for line in scene_io.describe(scene) if "warning:" not in line), sep="\n  "
    )


# ------------------------------------------------------------------------------------- what they share


def _settings(scene: Scene, size: str | None, **given: Any) -> RenderSettings:
    """The scene's settings with those of the command line in their place, where there are any."""
    changes = {name: value for name, value in given.items() if value is not None}
    if size is not None:
        changes["size"] = _parse_size(size)
    try:
        return replace(scene.settings, **changes)
    except InputError as error:
        raise InputError(f"--{str(error).replace('_', '-', 1)}") from None


def _padded_pixels(settings: RenderSettings) -> int:
    """Paths of one sample per pixel: cut tiles trace as many as whole ones."""
    return TileGrid(*settings.size, settings.tile_size).count * settings.tile_size**2


def _print_table(table: Table) -> None:
    console = Console()
    # Without a terminal rich takes 80 columns, too few for a replay's table.
    (console if console.is_terminal else Console(width=120)).print(table)


def _parse_size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,9})[x×,](\d{1,9})", text.strip().lower())
    if match is None:
        raise InputError(f"--size: {text!r} is not a width and a height; write it like 960x540")
    return int(match[1]), int(match[2])


def _check_picture_path(path: Path) -> None:
    """Before the long work: a suffix that names a format, and a place that can be written."""
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"-o {path}: ends in no known format; use .exr or .png")
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; name a file in it")
    _check_folder(path.parent)


def _check_folder(folder: Path) -> None:
    if not folder.is_dir():
        raise OutputError(f"{folder}: no such folder; make it first")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"{folder}: cannot be written; choose another folder")
