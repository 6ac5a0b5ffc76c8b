"""Options that several commands share, and what they are read into."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from incpt.core.errors import InputError
from incpt.core.settings import RenderSettings

if TYPE_CHECKING:
    from incpt.scene.model import Scene

SceneArgument = Annotated[Path, typer.Argument(help="Scene file or mesh.", show_default=False)]
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

TimeOption = Annotated[
    float | None, typer.Option("--time", help="Seconds into the animations of glTF and USD files.", min=0)
]
ClipOption = Annotated[
    str | None,
    typer.Option("--clip", help="Of several animations of a glTF file the one that runs, by name."),
]
ParameterOption = Annotated[
    list[str] | None,
    typer.Option(
        "-D", "--define", help="A parameter of a Mitsuba scene: NAME=VALUE; may come several times."
    ),
]
StrictOption = Annotated[
    bool, typer.Option("--strict", help="Refuse files of which anything has to be left out.")
]
UpOption = Annotated[
    str | None, typer.Option("--up", help="The axis that is up in a mesh file (OBJ, PLY, STL ...): y or z.")
]
UnitOption = Annotated[
    str | None,
    typer.Option("--unit", help="The unit of a mesh file: mm, cm, m, km, in, ft, or a number of metres."),
]
OutsideOption = Annotated[
    bool, typer.Option("--allow-outside", help="Let files name others outside their own folders.")
]
MissingOption = Annotated[
    bool,
    typer.Option(
        "--allow-missing", help="Let cubes and single colours stand for meshes and images that are not there."
    ),
]


def import_options(
    up: str | None, unit: str | None, define: list[str] | None = None, **others: Any
) -> dict[str, Any]:
    """The keywords of `registry.load_with_report` that options ask for. Raises InputError."""
    from incpt.formats.orientation import unit_of

    if define:
        others["parameters"] = dict(map(_parameter, define))
    if unit is None:
        return {"up": up, "unit": None, **others}
    try:
        return {"up": up, "unit": unit_of(unit), **others}
    except InputError as error:
        raise InputError(f"--{error}") from None


def _parameter(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not name or not equals:
        raise InputError(f"-D: {text!r} is no NAME=VALUE; write it like spp=64")
    return name, value


def read_for_writing(file: Path, up: str | None, unit: str | None, strict: bool, **others: Any) -> Scene:
    """The scene of a file, to be written elsewhere; what was left out of it is told on stderr. Raises
    InputError."""
    from incpt.cli.console import complain
    from incpt.formats import registry

    scene, report = registry.load_with_report(file, **import_options(up, unit, **others))
    if strict:
        report.check_whole()
    for complaint in registry.complaints(file, scene, report):
        complain(f"warning: {complaint}", 0)
    return scene


def settings_from(scene: Scene, size: str | None, **given: Any) -> RenderSettings:
    """The scene's settings with those of the command line in their place, where there are any."""
    changes = {name: value for name, value in given.items() if value is not None}
    if size is not None:
        changes["size"] = _parse_size(size)
    try:
        return replace(scene.settings, **changes)
    except InputError as error:
        raise InputError(f"--{str(error).replace('_', '-', 1)}") from None


def padded_pixels(settings: RenderSettings) -> int:
    """Paths of one sample per pixel: cut tiles trace as many as whole ones."""
    from incpt.render.tiles import TileGrid

    return TileGrid(*settings.size, settings.tile_size).count * settings.tile_size**2


def _parse_size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,9})[x×,](\d{1,9})", text.strip().lower())
    if match is None:
        raise InputError(f"--size: {text!r} is not a width and a height; write it like 960x540")
    return int(match[1]), int(match[2])
