"""Edit scripts of `incpt replay`: TOML files with a list of edits to a scene.

```toml
capture = [0, 2, 5, 10]     # steps after each edit at which pictures are taken
cumulative = true           # each edit on top of the one before; false: each on the scene as loaded

[[edits]]
name = "rotate red cube"    # optional label
step = 0                    # rendering step, after the base picture, at which the edit happens
object = "red cube"         # or material = "red", light = "lamp", camera = true (the active one), camera =
"top",
                            # environment = true
rotation = [0, 30, 35]      # the new values, with the keys of the scene file
pixel = [480, 270]          # optional: the point of change, for point_of_change = "pixel"
capture = [0, 30]           # optional: instead of the file's
```

A camera has the key `active` as well: the scene is seen through it from then on. The `sky` of an environment
is a table with the keys of the scene file, such as `sky = {sun_elevation = 5}`; what it leaves out is as
usual.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from incpt.core.errors import InputError, in_place
from incpt.core.files import check_readable
from incpt.formats import images, textures
from incpt.formats.mesh_library import MeshLibrary
from incpt.formats.scene_toml import (
    CAMERA_KEYS,
    ENVIRONMENT_KEYS,
    LIGHT_KEYS,
    MATERIAL_KEYS,
    MESH_KEYS,
    PLACEMENT_KEYS,
    sky_of,
)
from incpt.formats.toml_kit import check_keys, quoted, read_toml, text_of
from incpt.scene.model import Scene

KINDS = ("object", "material", "light", "camera", "environment")
DEFAULT_CAPTURE = (0, 2, 5, 10)
MAX_STEP = 10_000_000

_FILE_KEYS = ("capture", "cumulative", "edits")
_EDIT_KEYS = ("name", "step", "pixel", "capture")
_VALUE_KEYS: dict[str, tuple[str, ...]] = {
    "object": (*PLACEMENT_KEYS, "material", *MESH_KEYS),
    "material": MATERIAL_KEYS,
    "light": LIGHT_KEYS,
    "camera": (*CAMERA_KEYS, "active"),
    "environment": ENVIRONMENT_KEYS,
}


@dataclass(frozen=True)
class Edit:
    """One edit: at rendering step `step` (0: right after the base picture) the `changes` are made.

    `kind` is one of KINDS, `name` the object, material or camera (None for the active camera and for the
    environment). `changes` are the keyword arguments of `Scene.with_object` and its kin, and `active` of a
    camera. Pictures are taken `capture` steps after the
    edit. `pixel` is the point of change, where the script gives one.
    """

    step: int
    label: str
    kind: str
    name: str | None
    changes: Mapping[str, Any]
    capture: tuple[int, ...]
    pixel: tuple[int, int] | None = None

    def apply(self, scene: Scene) -> Scene:
        """The scene with this edit. Raises InputError."""
        if self.kind == "camera":
            return self._with_camera(scene)
        if self.kind == "environment":
            return scene.with_environment(**self.changes)
        assert self.name is not None
        if self.kind == "material":
            scene.material(self.name)
            return scene.with_material(self.name, **self.changes)
        if self.kind == "light":
            return scene.with_light(self.name, **self.changes)
        return scene.with_object(self.name, **self.changes)

    def _with_camera(self, scene: Scene) -> Scene:
        name = scene.camera_name if self.name is None else self.name
        seen_through = scene.with_active_camera(name)
        scene = seen_through if self.changes.get("active") else scene
        return scene.with_camera(name, **{k: v for k, v in self.changes.items() if k != "active"})


@dataclass(frozen=True)
class EditScript:
    """The edits of a file, by step. Not `cumulative`: each starts from the scene as loaded."""

    edits: tuple[Edit, ...]
    cumulative: bool = True

    def __iter__(self) -> Iterator[Edit]:
        return iter(self.edits)

    def __len__(self) -> int:
        return len(self.edits)

    def __getitem__(self, index: int) -> Edit:
        return self.edits[index]

    def scenes(self, base: Scene) -> list[Scene]:
        """The scene after each edit."""
        result: list[Scene] = []
        for edit in self.edits:
            result.append(edit.apply(result[-1] if self.cumulative and result else base))
        return result


def load_edits(path: str | os.PathLike[str], scene: Scene) -> EditScript:
    """Reads an edit script and checks names and values against the scene that it will be applied to.

    Raises InputError, one line that names the file, the number of the edit and the key.
    """
    path = Path(path)
    check_readable(path)
    with in_place(str(path)):
        tables = read_toml(path)
        check_keys(tables, _FILE_KEYS, "table or key")
        cumulative = tables.get("cumulative", True)
        if not isinstance(cumulative, bool):
            raise InputError(f"cumulative: {cumulative!r} is not true or false")
        capture = _capture(tables.get("capture", list(DEFAULT_CAPTURE)))
        edits = tables.get("edits", [])
        if not isinstance(edits, list) or not edits:
            raise InputError("edits: there are none; add an [[edits]] table for each edit")
        library = MeshLibrary(path.parent)
        parsed: list[Edit] = []
        current = scene
        for number, table in enumerate(edits, 1):
            with in_place(f"[[edits]] {number}{_label_of(table)}"):
                edit = _edit(table, number, capture, library)
                if cumulative and parsed and edit.step < parsed[-1].step:
                    raise InputError(
                        f"step: {edit.step} comes before that of the last edit; order them by step"
                    )
                changed = edit.apply(current)
                current = changed if cumulative else scene
                parsed.append(edit)
    return EditScript(tuple(parsed), cumulative)


def _label_of(table: Any) -> str:
    name = table.get("name") if isinstance(table, dict) else None
    return f" ({quoted(name)})" if isinstance(name, str) else ""


def _edit(table: Any, number: int, capture: tuple[int, ...], library: MeshLibrary) -> Edit:
    if not isinstance(table, dict):
        raise InputError("is not a table; write [[edits]] and its keys below")
    kind, name, values = _target(table)
    check_keys(values, _VALUE_KEYS[kind], f"key of an edit of {_with_article(kind)}")
    if not values:
        raise InputError(f"changes nothing; give new values, such as {_VALUE_KEYS[kind][0]}")
    label = text_of(table, "name", "give a text") if "name" in table else name or kind
    return Edit(
        step=_step("step", table.get("step", 0)),
        label=label,
        kind=kind,
        name=name,
        changes=MappingProxyType(_changes(values, library)),
        capture=_capture(table["capture"]) if "capture" in table else capture,
        pixel=_pixel(table["pixel"]) if "pixel" in table else None,
    )


def _target(table: dict[str, Any]) -> tuple[str, str | None, dict[str, Any]]:
    """Kind, name and new values of an edit. `material` is a new value where `object` is the target."""
    kinds = [kind for kind in KINDS if kind in table]
    if "object" in kinds and "material" in kinds:
        kinds.remove("material")
    if len(kinds) != 1:
        found = f"has {' and '.join(kinds)}" if kinds else "has no target"
        raise InputError(f"{found}; give one of {', '.join(KINDS)}")
    kind = kinds[0]
    values = {key: value for key, value in table.items() if key not in _EDIT_KEYS and key != kind}
    if kind in ("object", "material", "light") or (kind == "camera" and isinstance(table[kind], str)):
        return kind, text_of(table, kind, f"name the {kind}"), values
    if table[kind] is not True:
        raise InputError(f"{kind}: {table[kind]!r} is not true; write {kind} = true and its new values below")
    return kind, None, values


def _changes(values: dict[str, Any], library: MeshLibrary) -> dict[str, Any]:
    """The values as `Scene.with_*` take them: files are read."""
    changes = {key: value for key, value in values.items() if key not in MESH_KEYS}
    if len(changes) < len(values):
        meshes = library.meshes(values)
        if len(meshes) > 1:
            raise InputError(f"mesh: {values['mesh']} holds {len(meshes)} meshes; choose one with `part`")
        changes["mesh"] = meshes[0][1]
    if "image" in changes:
        with in_place("image"):
            name = text_of(changes, "image", "name an OpenEXR file")
            changes["image"] = images.load_image(library.folder / name)
    if "sky" in changes:
        changes["sky"] = sky_of(changes["sky"])
    if "active" in changes and changes["active"] is not True:
        raise InputError(
            f"active: {changes['active']!r} is not true; leave it out, or make another one active"
        )
    if "material" in changes:
        text_of(changes, "material", "name a material of the scene")
    return textures.with_textures(changes, library.folder)


def _step(name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= MAX_STEP:
        raise InputError(f"{name}: {value!r} is not a step; use a whole number from 0 to {MAX_STEP:,}")
    return value


def _capture(value: Any) -> tuple[int, ...]:
    if not isinstance(value, list) or not value:
        raise InputError(f"capture: {value!r} is not a list of steps, such as [0, 2, 5, 10]")
    return tuple(sorted({_step("capture", step) for step in value}))


def _pixel(value: Any) -> tuple[int, int]:
    if (
        not isinstance(value, list)
        or len(value) != 2
        or not all(isinstance(v, int) and not isinstance(v, bool) for v in value)
        or not all(abs(v) <= MAX_STEP for v in value)
    ):
        raise InputError(f"pixel: {value!r} is not a pair of whole numbers, column and row")
    return value[0], value[1]


def _with_article(kind: str) -> str:
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"
