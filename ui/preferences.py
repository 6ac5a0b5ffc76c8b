"""What the editor remembers between two starts: TOML in the user's configuration folder.

A file that is broken, or written by another version, never keeps the editor from starting: unknown keys are
left alone, a bad value becomes its default, and a message tells of it.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import platformdirs
import tomlkit
import tomlkit.exceptions

from incpt.core import files
from incpt.core.errors import InputError, OutputError, one_line

CONFIG_DIR = "INCPT_CONFIG_DIR"
"""Environment variable: the folder for everything the editor keeps, in place of the user's own."""
MAX_RECENT = 10
"""How many recent files are remembered."""

PANELS = ("Outliner", "Object", "Materials", "Scene", "Render", "Method")
"""The panels beside the picture."""
CURVES = ("agx", "filmic", "srgb")
"""Curves of tone mapping, by name."""
OVERLAYS = (
    "none", "queue", "replaced", "spp", "object_ids", "normals", "albedo", "depth",
    "error_left", "touched", "pairs", "weight",
)  # fmt: skip
"""What may be laid over the picture, in the order of the menu."""
THEMES = ("dark", "light")
"""How panels look."""
SNAP_TARGETS = ("steps", "surface", "vertex")
"""What a move snaps to."""
SHADINGS = ("rendered", "material", "solid")
"""How the scene is shown: rendered, or shaded by OpenGL with its materials or in plain colours."""
NAVIGATIONS = ("blender", "plain")
"""Sets of keys and moves of the mouse; see `bindings`."""
CHOICES: Mapping[str, tuple[str, ...]] = {
    "curve": CURVES,
    "overlay": OVERLAYS,
    "navigation": NAVIGATIONS,
    "shading": SHADINGS,
    "theme": THEMES,
    "target": SNAP_TARGETS,
}
"""The values that a text may have, by name of the field."""
RANGES: Mapping[str, tuple[float, float]] = {
    "exposure": (-20.0, 20.0),
    "overlay_opacity": (0.0, 1.0),
    "split_position": (0.0, 1.0),
    "move_m": (1e-6, 1e6),
    "rotate_deg": (1e-3, 360.0),
    "scale": (1e-6, 1e3),
    "window_size": (200, 16384),
    "ui_scale": (0.25, 8.0),
    "step_ms": (1.0, 1000.0),
    "drag_nor": (1, 1 << 16),
    "resolution_scale": (0.05, 4.0),
    "autosave_seconds": (1.0, 86400.0),
    "fly_speed": (1e-4, 1e6),
}
"""Least and greatest value of a number, by name of the field."""


@dataclass(frozen=True)
class _Group:
    """Values that are checked and normalised when they are made. Raises InputError."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = _checked(field.name, getattr(self, field.name), field.default)
            object.__setattr__(self, field.name, value)


_G = TypeVar("_G", bound=_Group)


def _checked(name: str, value: Any, default: Any) -> Any:
    """`value` as the field `name` keeps it. Raises InputError."""
    if isinstance(default, (_Group, bool)):
        if not isinstance(value, type(default)):
            wanted = "true or false" if isinstance(default, bool) else type(default).__name__
            raise InputError(f"{name}: {value!r} is not {wanted}")
        return value
    if name == "recent":
        return _recent(value)
    if name == "hidden_panels":
        return _panels(value)
    if name == "keys":
        return _keys(value)
    if name == "window_size":
        if not isinstance(value, (list, tuple)) or len(value) != 2:
            raise InputError(f"{name}: {value!r} is not a pair of width and height")
        return tuple(_number(name, v, whole=True) for v in value)
    if name in CHOICES:
        if value not in CHOICES[name]:
            raise InputError(f"{name}: {value!r} is not known; choose one of {', '.join(CHOICES[name])}")
        return value
    unset = value is None and default is None
    return None if unset else _number(name, value, whole=isinstance(default, int))


def _number(name: str, value: Any, whole: bool) -> float:
    kinds = (int,) if whole else (int, float)
    if isinstance(value, bool) or not isinstance(value, kinds):
        raise InputError(f"{name}: {value!r} is not a {'whole ' if whole else ''}number")
    low, high = RANGES[name]
    if not low <= value <= high:
        raise InputError(f"{name}: is out of range; use {low:g} to {high:g}")
    return value if whole else float(value)


def _recent(value: Any) -> tuple[str, ...]:
    if not isinstance(value, (list, tuple)) or not all(isinstance(path, str) for path in value):
        raise InputError("recent: is not a list of paths")
    return tuple(dict.fromkeys(value))[:MAX_RECENT]


def _panels(value: Any) -> tuple[str, ...]:
    if not isinstance(value, (list, tuple)) or not all(name in PANELS for name in value):
        raise InputError(f"hidden_panels: is not a list of some of {', '.join(PANELS)}")
    return tuple(name for name in PANELS if name in value)


def _keys(value: Any) -> tuple[tuple[str, str], ...]:
    pairs = value if isinstance(value, (list, tuple)) else [None]
    if not all(isinstance(pair, (list, tuple)) and list(map(type, pair)) == [str, str] for pair in pairs):
        raise InputError('keys: are not pairs of a command and its keys, such as ["Hide", "Ctrl+H"]')
    return tuple((command, keys) for command, keys in dict(map(tuple, pairs)).items())


@dataclass(frozen=True)
class DisplaySettings(_Group):
    """How the picture is shown; nothing here touches the accumulation. Raises InputError.

    `exposure` in stops (EV), `curve` one of CURVES, `overlay` one of OVERLAYS at `overlay_opacity`;
    `split_position` is the place of the bar in units of the picture's width. `denoise`: a denoised picture is
    shown where there is noise. `shading` is one of SHADINGS. `floor_grid` and `axes`: whether a grid on the
    floor and the axes of the world are drawn over the picture.
    """

    exposure: float = 0.0
    curve: str = "agx"
    overlay: str = "none"
    overlay_opacity: float = 0.6
    tile_grid: bool = False
    outline: bool = True
    split: bool = False
    split_position: float = 0.5
    denoise: bool = False
    shading: str = "rendered"
    floor_grid: bool = False
    axes: bool = True


@dataclass(frozen=True)
class SnapSettings(_Group):
    """Snapping: to steps of moves, turns and scalings (metres, degrees, factor), or a move to what is under
    the mouse, one of SNAP_TARGETS. Raises InputError."""

    enabled: bool = False
    target: str = "steps"
    move_m: float = 0.1
    rotate_deg: float = 15.0
    scale: float = 0.1


@dataclass(frozen=True)
class Preferences(_Group):
    """Everything that is remembered. Raises InputError for a value out of RANGES or CHOICES.

    window_size       width and height, screen coordinates.
    ui_scale          of texts and widgets; None: as the monitor says.
    theme             one of THEMES.
    navigation        set of mouse bindings, see `bindings.py`.
    recent            absolute paths of scene and mesh files, the latest first.
    step_ms           time that one rendering step aims at.
    drag_nor          repetitions of a tile while a drag is under way.
    resolution_scale  rendered size over the scene's own.
    autosave_seconds  between two writes of the recovery file.
    fly_speed         metres per second.
    hidden_panels     those of PANELS that are not shown.
    keys              of commands that have others than in the tables, by name: "Ctrl+H", or nothing.
    """

    display: DisplaySettings = DisplaySettings()
    snap: SnapSettings = SnapSettings()
    window_size: tuple[int, int] = (1440, 900)
    ui_scale: float | None = None
    theme: str = "dark"
    navigation: str = "blender"
    recent: tuple[str, ...] = ()
    step_ms: float = 33.0
    drag_nor: int = 16
    resolution_scale: float = 1.0
    autosave_seconds: float = 30.0
    fly_speed: float = 2.0
    hidden_panels: tuple[str, ...] = ()
    keys: tuple[tuple[str, str], ...] = ()

    def with_recent(self, path: str | os.PathLike[str]) -> Preferences:
        """Preferences in which `path` was opened last."""
        latest = os.path.abspath(path)
        return replace(self, recent=(latest, *self.recent))

    def with_window_size(self, width: int, height: int) -> Preferences:
        """Preferences with the size of the window; one that is out of range, as a minimised window has,
        is not remembered."""
        low, high = RANGES["window_size"]
        if not low <= min(width, height) <= max(width, height) <= high:
            return self
        return replace(self, window_size=(width, height))

    @property
    def recent_files(self) -> tuple[Path, ...]:
        """The recent files that are still there, the latest first."""
        return tuple(path for path in map(Path, self.recent) if path.is_file())


def config_folder() -> Path:
    """Where preferences and layout are kept; it need not exist."""
    chosen = os.environ.get(CONFIG_DIR)
    return Path(chosen) if chosen else Path(platformdirs.user_config_dir("incpt", appauthor=False))


def preferences_path() -> Path:
    """The file of the preferences."""
    return config_folder() / "preferences.toml"


def layout_path() -> Path:
    """The file in which Dear ImGui keeps the layout of the windows."""
    return config_folder() / "layout.ini"


def load() -> tuple[Preferences, list[str]]:
    """The preferences kept, and a message for everything in them that could not be used.

    A file that is no TOML at all is renamed to preferences.broken.toml, so that saving does not destroy
    what somebody wrote by hand.
    """
    path = preferences_path()
    if not path.exists():
        return Preferences(), []
    try:
        tables = tomllib.loads(files.read_bytes(path).decode("utf-8-sig"))
    except InputError as error:
        return Preferences(), [f"preferences: {error}; defaults are used"]
    except (ValueError, RecursionError) as error:
        kept = path.with_name("preferences.broken.toml")
        try:
            os.replace(path, kept)
        except OSError:
            kept = path
        message = f"preferences: are no valid TOML ({error}); defaults are used, the file is kept as {kept}"
        return Preferences(), [one_line(message)]
    messages: list[str] = []
    return _read(Preferences, tables, "", messages), messages


def save(preferences: Preferences) -> None:
    """Writes the preferences, atomically; comments and keys of other versions stay. Raises OutputError."""
    path = preferences_path()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        document = tomlkit.parse(path.read_text("utf-8-sig")) if path.exists() else tomlkit.document()
        _fill(document, preferences)
    except (ValueError, RecursionError, tomlkit.exceptions.TOMLKitError):
        document = tomlkit.document()
        _fill(document, preferences)
    except OSError as error:
        raise OutputError(one_line(f"{path}: cannot be written ({error.strerror})")) from None
    files.write_bytes(path, tomlkit.dumps(document).encode())


def _fill(table: Any, owner: Any) -> None:
    """The fields of a dataclass as keys of a TOML table; those that are None are left out."""
    for field in fields(owner):
        value = getattr(owner, field.name)
        if isinstance(value, _Group):
            if not isinstance(table.get(field.name), dict):
                table[field.name] = tomlkit.table()
            _fill(table[field.name], value)
        elif value is None:
            table.pop(field.name, None)
        else:
            table[field.name] = _as_lists(value)


def _as_lists(value: Any) -> Any:
    return [_as_lists(one) for one in value] if isinstance(value, tuple) else value


def _read(kind: type[_G], table: Mapping[str, Any], place: str, messages: list[str]) -> _G:
    """A dataclass from a TOML table, with the default of every value that cannot be used."""
    values: dict[str, Any] = {}
    defaults = kind()
    for field in fields(kind):
        default = getattr(defaults, field.name)
        if field.name not in table:
            continue
        value = table[field.name]
        where = f"{place}{field.name}"
        if isinstance(default, _Group):
            if isinstance(value, dict):
                values[field.name] = _read(type(default), value, f"{where}.", messages)
            else:
                messages.append(f"preferences: {where}: is not a table; defaults are used")
            continue
        try:
            values[field.name] = _checked(field.name, value, default)
        except InputError as error:
            messages.append(one_line(f"preferences: {place}{error}; the default is used"))
    return kind(**values)
