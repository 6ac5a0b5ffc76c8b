"""The keys of scene files and edit scripts: types, ranges, defaults and meanings.

Keys and defaults are those of the dataclasses. Ranges are asked of their checks: each is made with a value
that cannot be, and says what can. Meanings are those of docstrings where these have a line for each key, and
stand in `meanings` where not.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np

from incpt.core.errors import InputError
from incpt.core.settings import RenderSettings
from incpt.formats import edit_script, scene_toml, textures
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.light import KINDS, Light, keys_of
from incpt.scene.material import Material
from incpt.scene.shapes import SHAPES
from incpt.scene.sky import Sky
from incpt.scene.texture import Bitmap, Texture
from reference import meanings
from reference.markdown import code, one_of, table, toml

_HEADINGS = ("key", "value", "default", "meaning")
_IMPOSSIBLE = 10**15
"""A number that no key may have."""
_LINE = re.compile(r"^(\w+(?:, \w+)*) {2,}(\S.*)$")
"""A line of a docstring that begins the meaning of a key, or of several."""


def documented(kind: type) -> dict[str, str]:
    """The meanings that the docstring of a class has, by key."""
    found: dict[str, str] = {}
    keys: list[str] = []
    for line in inspect.cleandoc(kind.__doc__ or "").splitlines():
        begun = _LINE.match(line)
        if begun is not None:
            keys = begun[1].split(", ")
            found |= dict.fromkeys(keys, begun[2])
        elif line.startswith(" ") and keys:
            found |= {key: f"{found[key]} {line.strip()}" for key in keys}
        else:
            keys = []
    return {key: text.rstrip(".") for key, text in found.items()}


def allowed(make: Callable[..., Any], name: str, default: Any) -> str:
    """What a key may hold, as `make(**{name: value})` tells it of a value that cannot be."""
    if isinstance(default, bool):
        return f"{toml(True)} or {toml(False)}"
    if isinstance(default, str):
        return one_of(_refusal(make, name, "?").split("choose one of ")[1].split(", "))
    kind = "whole number" if isinstance(default, int) else "number"
    if isinstance(default, tuple):
        refused = _refusal(make, name, (type(default[0])(_IMPOSSIBLE),) * len(default))
        kind = "whole number" if isinstance(default[0], int) else "number"
        return f"list of {len(default)} {kind}s, each {_span(refused)}"
    return f"{kind}, {_span(_refusal(make, name, type(default)(_IMPOSSIBLE)))}"


def _refusal(make: Callable[..., Any], name: str, value: Any) -> str:
    try:
        make(**{name: value})
    except InputError as error:
        return str(error)
    raise AssertionError(f"{name}: {value!r} is taken")


def _span(refusal: str) -> str:
    """The least and the greatest value from the end of a message: "use 0 to 1", "use up to 1e+09"."""
    span = re.search(r"(\S+) to (\S+)$", refusal)
    assert span is not None, refusal
    low = f"-{span[2]}" if span[1] == "up" else span[1]
    return f"{low} to {span[2]}".replace("e+0", "e").replace("e-0", "e-")


def _rows(
    keys: Iterable[str], make: Callable[..., Any], default_of: Callable[[str], Any], told: Mapping[str, str]
) -> Iterable[tuple[str, ...]]:
    for key in keys:
        value, default = meanings.VALUES.get((key, default_of(key))), default_of(key)
        if value is None:
            value = allowed(make, key, default)
        yield code(key), value, "–" if default is None else toml(default), told[key]


def _table(keys: Iterable[str], make: Callable[..., Any], default: Any, told: Mapping[str, str]) -> str:
    return table(_HEADINGS, _rows(keys, make, partial(getattr, default), told))


def file() -> str:
    """The tables and keys at the top of a scene file."""
    return table(("table or key", "what it holds"), _explained(scene_toml._TABLES, meanings.FILE))


def camera() -> str:
    """`[camera]` and `[cameras.NAME]`."""
    return _table(scene_toml.CAMERA_KEYS, Camera, Camera(), {**documented(Camera), **meanings.CAMERA})


def environment() -> str:
    """`[environment]`."""
    return _table(scene_toml.ENVIRONMENT_KEYS, Environment, Environment(), meanings.ENVIRONMENT)


def sky() -> str:
    """`[environment.sky]`."""
    return _table(scene_toml.SKY_KEYS, Sky, Sky(), documented(Sky))


def render() -> str:
    """`[render]`."""
    return _table(RenderSettings.names(), RenderSettings, RenderSettings(), documented(RenderSettings))


def material() -> str:
    """`[materials.NAME]`."""
    return _table(scene_toml.MATERIAL_KEYS, Material, Material(), meanings.MATERIAL)


def texture() -> str:
    """The table of a texture."""
    pixel = Bitmap(np.zeros((1, 1, 3), np.uint8))
    told = {**documented(Texture), **meanings.TEXTURE}
    default = Texture(pixel)
    rows = _rows(textures._OPTIONS, partial(Texture, pixel), partial(getattr, default), told)
    return table(_HEADINGS, [*_placed(("file", "image"), meanings.TEXTURE_FILE), *rows])


def objects() -> str:
    """`[[objects]]`."""
    return table(_HEADINGS, _placed(scene_toml._OBJECT_KEYS, meanings.OBJECT))


def lights() -> str:
    """`[[lights]]`."""
    told = documented(Light)
    rows = []
    for key in ("name", *scene_toml.LIGHT_KEYS):
        if key in meanings.LIGHT:
            rows.append((code(key), *meanings.LIGHT[key]))
            continue
        kind = next(kind for kind in KINDS if key in keys_of(kind))
        make = partial(Light, "light", kind)
        default = getattr(make(), key)
        rows.append((code(key), allowed(make, key, default), toml(default), told[key]))
    return table(_HEADINGS, rows)


def light_kinds() -> str:
    """Which keys each kind of light has beside those of all."""
    common = set.intersection(*(set(keys_of(kind)) for kind in KINDS))
    rows = (
        (toml(kind), ", ".join(code(key) for key in keys_of(kind) if key not in common)) for kind in KINDS
    )
    return table(("kind", "keys of its own"), rows)


def edits_file() -> str:
    """The keys of an edit script."""
    return table(_HEADINGS, _placed(edit_script._FILE_KEYS, meanings.EDITS_FILE))


def edit() -> str:
    """The keys of `[[edits]]`."""
    keys = (*edit_script._EDIT_KEYS, *edit_script.KINDS)
    return table(_HEADINGS, _placed(keys, meanings.EDIT))


def edit_values() -> str:
    """Which new values an edit of each kind may have."""
    rows = [(code(kind), meanings.EDIT_VALUES[kind]) for kind in edit_script.KINDS]
    return table(("target", "keys of new values"), rows)


def shapes() -> str:
    """The built-in shapes."""
    return ", ".join(toml(name) for name in SHAPES)


def _explained(keys: Iterable[str], told: Mapping[str, str]) -> Iterable[tuple[str, str]]:
    return ((code(key), told[key]) for key in keys)


def _placed(keys: Iterable[str], told: Mapping[str, tuple[str, ...]]) -> Iterable[tuple[str, ...]]:
    return ((code(key), *told[key]) for key in keys)


PIECES: dict[str, Callable[[], str]] = {
    "scene file": file, "camera": camera, "environment": environment, "sky": sky, "render": render,
    "material": material, "texture": texture, "objects": objects, "lights": lights,
    "kinds of lights": light_kinds, "shapes": shapes, "edit script": edits_file, "edit": edit,
    "values of edits": edit_values,
}  # fmt: skip
