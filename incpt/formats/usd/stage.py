"""Opens a USD file with all layers that it is composed of, once it is known where these lie."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pxr import Ar, Sdf, Usd, UsdUtils

from incpt.core.errors import InputError, one_line
from incpt.formats import import_report
from incpt.formats.outside import check_inside
from incpt.formats.usd import probe
from incpt.scene.checks import LARGEST

MOST_LAYERS = 10_000
_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
_IN_LAYER = re.compile(r"\S*/(\S+):(\d+):\d+:")
"""How messages of the library name a place in a text, and a file."""
_ASSET = re.compile(r"@[^@]*/([^@/]+)@")
_GRAMMAR = re.compile(r"parse error matching .*", re.DOTALL)
"""How they quote the names of their own grammar."""
_HARMLESS = re.compile("has deprecated version|MaterialBindingAPI is not applied")
"""Warnings of what is read all the same."""
_CONTEXT = " (instantiating stage"
"""With what the library's messages go on that tell of its memory."""


@dataclass(frozen=True, eq=False)
class OpenStage:
    """A composed stage, the moment at which it is read, and the files beside the file that it consists of."""

    path: Path
    stage: Any
    moment: Any
    files: list[Path]

    def file(self, asset: Any) -> str:
        """Where an asset that a layer names lies: a file, or one within a .usdz as "package[name]". It stays
        in the folder of the stage, unless the options let it. Raises InputError."""
        named = one_line(asset.path)[:80]
        resolved = asset.resolvedPath or self._of_windows(str(asset.path))
        if not resolved:
            raise InputError(f"{named!r}: no such file; check the path")
        found = outer_file(resolved)
        _check_inside(self.path, found)
        if found not in self.files and found != Path(os.path.abspath(self.path)):
            self.files.append(found)
        return str(resolved)

    def _of_windows(self, name: str) -> str:
        """The file of a name with backslashes beside the stage; nothing, where there is none."""
        path = os.path.abspath(self.path.parent / name.replace("\\", "/"))
        return path if "\\" in name and os.path.isfile(path) else ""


def outer_file(resolved: str) -> Path:
    """The file of a path, which may lead on within a package."""
    return Path(Ar.SplitPackageRelativePathOuter(resolved)[0])


def open_stage(path: Path, time: float) -> OpenStage:
    """The stage of a file as it is `time` seconds after its first time code. Raises InputError: a file that
    consists of files outside its folder, unless the options let it. Also what `plain_errors` is for."""
    layers = _checked_layers(path)
    stage = Usd.Stage.Open(layers[0], Usd.Stage.LoadAll)
    # Names that are computed may lead to other files in the whole than in a layer by itself.
    used = [outer_file(layer.realPath) for layer in stage.GetUsedLayers() if layer.realPath]
    for file in used:
        _check_inside(path, file)
    beside = [file for file in dict.fromkeys(used) if file != Path(os.path.abspath(path))]
    return OpenStage(path, stage, _moment(stage, time), beside)


def _check_inside(path: Path, file: Path) -> None:
    """Raises InputError, see `check_inside`; it names the file as seen from the folder of the stage."""
    with suppress(ValueError):  # on another drive
        file = Path(os.path.relpath(file, os.path.abspath(path.parent)))
    check_inside(path.parent, str(file))


def _moment(stage: Any, time: float) -> Any:
    start = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else 0.0
    code = start + time * stage.GetTimeCodesPerSecond()
    return Usd.TimeCode(max(-LARGEST, min(code, LARGEST)))


def _checked_layers(path: Path) -> list[Any]:
    """The layer of a file, and before they are composed all that it may be composed of, also in variants that
    are not chosen. Raises InputError, and the library's own errors."""
    found: dict[str, Any] = {}
    names = [os.path.abspath(path)]
    while names:
        files = [outer_file(name) for name in names]
        for file in files:
            _check_inside(path, file)
        # Those that others name are opened together, because each other process costs a quarter of a second.
        probe.check_opens(list(dict.fromkeys(files)))
        for name in names:
            found[name] = Sdf.Layer.FindOrOpen(name)
            if found[name] is None:
                raise InputError("is no USD file, or a damaged one")
        if len(found) > MOST_LAYERS:
            raise InputError(f"consists of more than {MOST_LAYERS:,} files")
        named = (one for name in names for one in _layers_named_by(found[name], name))
        names = [name for name in dict.fromkeys(named) if name not in found]
    return list(found.values())


def _layers_named_by(layer: Any, name: str) -> Iterator[str]:
    """The files of layers that one names and that are there: what is missing is told when they are
    composed."""
    resolver = Ar.GetResolver()
    sublayers, others, payloads = UsdUtils.ExtractExternalReferences(name)
    for asset in dict.fromkeys([*sublayers, *others, *payloads]):
        outer = Sdf.Layer.SplitIdentifier(asset)[0]
        if Path(outer.rstrip("]")).suffix.lower() in _SUFFIXES:
            resolved = str(resolver.Resolve(layer.ComputeAbsolutePath(outer)))
            if resolved:
                yield resolved


@contextmanager
def plain_errors() -> Iterator[None]:
    """Around all that is asked of the library: what it would print is told, and its errors become
    InputErrors."""
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    except MemoryError:
        raise InputError("needs more memory than files of its size do; it is damaged") from None
    except (TypeError, AttributeError):
        # Where a file says another type than the schema does, its values come as objects that are nothing.
        raise InputError("has values of other types than its schemas; it is damaged") from None
    except (RuntimeError, UnicodeDecodeError) as error:
        raise InputError(f"is no USD file, or a damaged one ({_first_of(error)})") from None
    finally:
        for diagnostic in delegate.TakeUncoalescedDiagnostics():
            with suppress(UnicodeDecodeError):  # Files may hold bytes that are no text.
                text = one_line(diagnostic.commentary.split(_CONTEXT)[0]).rstrip(".")
                if not _HARMLESS.search(text):
                    import_report.left_out(_ASSET.sub(r"@\1@", text))


def _first_of(error: Exception) -> str:
    """What the library says of its first error, without the places in its own code."""
    try:
        lines = [line for line in str(error).splitlines() if line.strip()]
    except UnicodeDecodeError:
        lines = []
    text = lines[0].split(" : '", 1)[-1] if lines else "it holds bytes that are no text"
    text = _IN_LAYER.sub(r"\1, line \2:", _ASSET.sub(r"@\1@", text))
    return one_line(_GRAMMAR.sub("not understood", text))[:160].strip(" '.")
