"""Geometry of a glTF file: the triangles of a primitive, bent by morph targets and skins."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError, in_place
from incpt.formats.gltf import compression
from incpt.formats.gltf.accessors import Accessors, as_floats
from incpt.formats.gltf.table import Table
from incpt.formats.vertex_attributes import VertexAttributes
from incpt.scene.texture import UV_SETS

TRIANGLES, STRIP, FAN = 4, 5, 6
_WITHOUT_AREA = {0: "points", 1: "lines", 2: "lines", 3: "lines"}
_WIDTHS = {"POSITION": (3,), "NORMAL": (3,), "TANGENT": (4,), "COLOR": (3, 4), "TEXCOORD": (2,)}
"""Components of the attributes that are read; those with a number have its base's."""
_MORPHED_WIDTHS = {**_WIDTHS, "TANGENT": (3,)}
_READ = ("POSITION", "NORMAL", "TANGENT", "COLOR_0", *(f"TEXCOORD_{i}" for i in range(UV_SETS)))

Array = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Triangles:
    """What a primitive has at its V vertices by the names of its attributes, (V, width) each, and its faces
    (F, 3), which may name vertices that are not there."""

    attributes: dict[str, Array]
    faces: npt.NDArray[np.int64]

    @property
    def positions(self) -> Array:
        """(V, 3)"""
        return self.attributes["POSITION"]

    @property
    def normals(self) -> Array | None:
        """(V, 3) of any length, or None."""
        return self.attributes.get("NORMAL")

    @property
    def other(self) -> VertexAttributes:
        """Texture coordinates, colours and tangents."""
        found = self.attributes
        sets = [found.get(f"TEXCOORD_{number}") for number in range(UV_SETS)]
        last = max((number for number, uvs in enumerate(sets) if uvs is not None), default=-1)
        # A second set without a first one stays the second.
        uvs = tuple(np.zeros((len(self.positions), 2)) if one is None else one for one in sets[: last + 1])
        colors = found.get("COLOR_0")
        if colors is not None and colors.shape[1] == 3:
            colors = np.column_stack([colors, np.ones(len(colors), np.float32)])
        return VertexAttributes(uvs, colors, found.get("TANGENT"))


def without_area(primitive: Table) -> str | None:
    """What a primitive consists of that has no area, "points" or "lines"; None for triangles of any kind.
    Raises InputError."""
    return _WITHOUT_AREA.get(primitive.whole("mode", 0, FAN, TRIANGLES))


def unread_attributes(primitive: Table) -> list[str]:
    """The names of those attributes that change how triangles look, and are not read."""
    names = primitive.table("attributes")
    # Those of applications begin with an underscore and mean nothing to others.
    return [name for name in names if re.match(r"TEXCOORD_|COLOR_", name) and name not in _READ]


def triangles(primitive: Table, accessors: Accessors) -> Triangles:
    """The triangles of a primitive at rest: all modes that have area, with and without indices. Raises
    InputError."""
    with primitive.in_messages():
        draco = primitive.extension(compression.DRACO)
        if "bufferView" in draco and not _is_stored(primitive, accessors):
            found = _decompressed(primitive, draco, accessors)
        else:
            names = primitive.table("attributes")
            found = Triangles(_attributes(names, _WIDTHS, accessors), np.zeros((0, 3), np.int64))
            if "POSITION" in found.attributes:
                found = replace(found, faces=_faces(primitive, len(found.positions), accessors))
        if "POSITION" not in found.attributes:
            raise InputError("attributes: have no POSITION; the file is damaged")
        counts = {len(values) for values in found.attributes.values()}
        if len(counts) > 1:
            raise InputError(f"attributes: have {sorted(counts)} values; the file is damaged")
        return found


def _is_stored(primitive: Table, accessors: Accessors) -> bool:
    """Whether a primitive that Draco has compressed is stored uncompressed too."""
    number = primitive.table("attributes").index("POSITION")
    return number is not None and "bufferView" in accessors.document.item("accessors", number)


def _decompressed(primitive: Table, draco: Table, accessors: Accessors) -> Triangles:
    content, _ = accessors.view(draco.whole("bufferView", 0, 1 << 31))
    stored, faces = compression.decoded_primitive(draco, content)
    names = primitive.table("attributes")
    # What is not among the compressed attributes has an accessor of its own.
    rest = [name for name in names if name not in stored]
    found = _attributes(names, _WIDTHS, accessors, rest)
    for name, values in stored.items():
        number = names.index(name)
        if name not in _READ or number is None:
            continue
        accessor = accessors.document.item("accessors", number)
        found[name] = as_floats(values, accessor.flag("normalized"))
    return Triangles(found, faces)


def _attributes(
    names: Table, widths: dict[str, tuple[int, ...]], accessors: Accessors, of: Sequence[str] = _READ
) -> dict[str, Array]:
    found = {}
    for name in _READ:
        number = names.index(name) if name in of else None
        if number is not None:
            with in_place(f"attributes.{name}"):
                found[name] = accessors.floats(number, *widths[name.split("_")[0]])
    return found


def _faces(primitive: Table, count: int, accessors: Accessors) -> npt.NDArray[np.int64]:
    """(F, 3)"""
    number = primitive.index("indices")
    if number is None:
        order = np.arange(count)
    else:
        with in_place("indices"):
            raw = accessors.raw(number, 1)
            if raw.dtype.kind != "u":
                raise InputError("are no whole numbers from 0 on; the file is damaged")
            order = raw[:, 0].astype(np.int64)
    mode = primitive.whole("mode", 0, FAN, TRIANGLES)
    if mode == TRIANGLES:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    place = np.arange(max(len(order) - 2, 0))
    if mode == STRIP:
        # Every second triangle is turned over, so that all have one side in front.
        return order[np.column_stack([place, place + 1 + place % 2, place + 2 - place % 2])]
    return order[np.column_stack([place + 1, place + 2, np.zeros_like(place)])]


def morphed(base: Triangles, primitive: Table, weights: Sequence[float], accessors: Accessors) -> Triangles:
    """The triangles with their morph targets added as much as the weights say. Raises InputError."""
    targets = list(primitive.tables("targets"))
    if not any(weights[: len(targets)]):
        return base
    attributes = {name: values.astype(np.float32) for name, values in base.attributes.items()}
    for target, weight in zip(targets, weights, strict=False):
        if weight == 0:
            continue
        with target.in_messages(), np.errstate(all="ignore"):
            for name, moves in _attributes(target, _MORPHED_WIDTHS, accessors).items():
                if name not in attributes or len(moves) != len(attributes[name]):
                    raise InputError(f"{name}: does not fit the mesh; the file is damaged")
                width = min(moves.shape[1], attributes[name].shape[1])
                attributes[name][:, :width] += np.float32(weight) * moves[:, :width]
    return replace(base, attributes=attributes)


def skinned(
    base: Triangles, primitive: Table, joints: npt.NDArray[np.float64], accessors: Accessors
) -> Triangles:
    """The triangles in world space, moved by joints (J, 4, 4), each of which takes points of the mesh at rest
    to the world. Linear blend skinning. Raises InputError."""
    with primitive.in_messages(), np.errstate(all="ignore"):
        matrices = _blended(primitive.table("attributes"), joints, len(base.positions), accessors)
    attributes = dict(base.attributes)
    linear = matrices[:, :, :3]
    with np.errstate(all="ignore"):
        attributes["POSITION"] = _applied(linear, base.positions) + matrices[:, :, 3].astype(np.float32)
        if "NORMAL" in attributes:
            # The cofactor matrix is det · inverse transpose, and exists for flat placements too.
            x, y, z = (linear[:, :, axis] for axis in range(3))
            cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=2)
            attributes["NORMAL"] = _applied(cofactors, attributes["NORMAL"])
        if "TANGENT" in attributes:
            along = _applied(linear, attributes["TANGENT"][:, :3])
            attributes["TANGENT"] = np.concatenate([along, attributes["TANGENT"][:, 3:]], axis=1)
    return replace(base, attributes=attributes)


def _applied(matrices: npt.NDArray[np.float64], vectors: Array) -> Array:
    result: Array = np.einsum("vij,vj->vi", matrices, vectors).astype(np.float32)
    return result


def _blended(
    names: Table, joints: npt.NDArray[np.float64], count: int, accessors: Accessors
) -> npt.NDArray[np.float64]:
    """(V, 3, 4) the matrix of each vertex: that of its joints, as much of each as its weights say."""
    total = np.zeros((count, 1))
    result = np.zeros((count, 3, 4))
    number = 0
    while f"JOINTS_{number}" in names and f"WEIGHTS_{number}" in names:
        chosen = accessors.raw(names.whole(f"JOINTS_{number}", 0, 1 << 31), 4)
        weights = accessors.doubles(names.whole(f"WEIGHTS_{number}", 0, 1 << 31), 4)
        if chosen.dtype.kind != "u" or len(chosen) != count or len(weights) != count:
            raise InputError(f"attributes.JOINTS_{number}: do not fit the mesh; the file is damaged")
        if chosen.max() >= len(joints):
            raise InputError(
                f"attributes.JOINTS_{number}: go to {chosen.max()} of {len(joints)}; the file is damaged"
            )
        weights = np.where(np.isfinite(weights) & (weights > 0), weights, 0)
        total += weights.sum(axis=1, keepdims=True)
        for place in range(4):
            result += weights[:, place, None, None] * joints[chosen[:, place], :3]
        number += 1
    # Weights are to add up to 1, and do but for rounding.
    blended: npt.NDArray[Any] = result / np.where(total > 0, total, 1)[:, :, None]
    blended[total[:, 0] == 0] = np.eye(4)[:3]
    return blended
