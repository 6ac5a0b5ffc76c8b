"""Lights of glTF files: points, spots and suns of the extension KHR_lights_punctual.

It measures intensity in candela and illuminance in lux. Here they are taken for W / sr and W / m² as they
are, like its emission, which is in nits there and a radiance here: so lamps and glowing surfaces of a file
keep their proportions, and an exposure is all that is between its numbers and ours.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.core.errors import InputError, reason_of
from incpt.formats.gltf import gltf_header
from incpt.scene.light import LARGEST_STRENGTH, Light

_EXTENSION = "KHR_lights_punctual"
_KINDS = {"point": "point", "spot": "spot", "directional": "sun"}

Matrix = npt.NDArray[np.float64]


def lights_of(path: Path) -> tuple[Light, ...]:
    """The lights of a file, in world space, without sizes; none of files that are no glTF. Raises
    InputError."""
    suffix = path.suffix.lower().removeprefix(".")
    if suffix not in ("gltf", "glb"):
        return ()
    header = gltf_header(path, suffix)
    try:
        tables = header.get("extensions", {}).get(_EXTENSION, {}).get("lights", [])
        return tuple(_light(tables[number], matrix, name) for number, matrix, name in _placed(header))
    except InputError as error:
        raise InputError(f"light: {error}") from None
    except Exception as error:  # JSON may have any shape
        raise InputError(f"has lights that cannot be read ({reason_of(error)})") from None


def _placed(header: dict[str, Any]) -> Iterator[tuple[int, Matrix, str]]:
    """The number, the place (4, 4) and the name of each light that a node of the scene carries."""
    nodes, scenes = header.get("nodes", []), header.get("scenes", [])
    roots = scenes[header.get("scene", 0)].get("nodes", []) if scenes else range(len(nodes))
    left = [(number, np.eye(4)) for number in reversed(list(roots))]
    for _ in nodes:  # Each is there once, but in a damaged file one may be below itself.
        if not left:
            return
        number, above = left.pop()
        node = nodes[number]
        matrix = above @ _matrix(node)
        left += [(child, matrix) for child in reversed(node.get("children", []))]
        carried = node.get("extensions", {}).get(_EXTENSION)
        if carried is not None:
            yield carried["light"], matrix, str(node.get("name", ""))


def _matrix(node: dict[str, Any]) -> Matrix:
    """(4, 4) of a node: its matrix, column by column, or translation, rotation (quaternion) and scale."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= np.array(node.get("scale", (1.0, 1.0, 1.0)), np.float64)
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def _light(table: dict[str, Any], matrix: Matrix, name: str) -> Light:
    kind = _KINDS[table["type"]]
    position, rotation, _ = affine.decompose(matrix[:3])
    intensity = min(float(table.get("intensity", 1.0)), LARGEST_STRENGTH)
    values: dict[str, Any] = {
        "color": tuple(table.get("color", (1.0, 1.0, 1.0))),
        "radius": 0.0,
        "angle": 0.0,
    }
    if kind == "spot":
        cone = table.get("spot", {})
        outer = float(cone.get("outerConeAngle", math.pi / 4))
        inner = float(cone.get("innerConeAngle", 0.0))
        values |= {"spot_angle": min(math.degrees(2 * outer), 180.0), "spot_blend": 1 - inner / outer}
    light = Light(name or str(table.get("name") or kind), kind, position, rotation, **values)
    if kind == "sun":
        return replace(light, irradiance=intensity)
    return replace(light, power=intensity * light.solid_angle)
