"""Lights without a shape, and the light from far away."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from incpt.core.affine import Vector
from incpt.core.errors import InputError, in_place
from incpt.formats import import_report, lat_long
from incpt.formats.appearance.colored import linear_pixels
from incpt.formats.names import Names
from incpt.formats.pbrt.document import Document
from incpt.formats.pbrt.parameters import Statement
from incpt.formats.pbrt.textures import Textures
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.light import Light

Array = npt.NDArray[np.float64]
_LARGEST_SIDE = 2048
"""Columns of a panorama that is made of a square image."""


class Lights:
    """Reads the lights of a scene under a matrix (4, 4) of its whole world."""

    def __init__(self, document: Document, textures: Textures, world: Array, taken: tuple[str, ...]) -> None:
        self._document, self._textures, self._world = document, textures, world
        self._names = Names(*taken)
        self.lights: list[Light] = []
        self.environment: Environment | None = None

    def read(self) -> None:
        """Raises InputError."""
        for placed in self._document.lights:
            statement = placed.statement
            with in_place(statement.place):
                read = _KINDS.get(statement.kind)
                if read is None:
                    statement.ignore(*statement.parameters)
                    import_report.left_out(f"{statement}: lights of that type are not read")
                else:
                    read(self, statement, self._world @ placed.state.matrix)

    def _strength(self, statement: Statement, name: str, solid_angle: float) -> Vector:
        """Intensity or radiance; a power spreads over a solid angle."""
        color, scale = self._textures.light(statement, name), statement.number("scale", 1.0, 0.0)
        power = statement.number("power", -1.0) if solid_angle else -1.0
        r, g, b = (scale * (power / solid_angle if power > 0 else 1.0) * c for c in color)
        return r, g, b

    def point(self, statement: Statement, matrix: Array) -> None:
        place = matrix @ [*statement.vector("from", (0.0, 0.0, 0.0)), 1.0]
        intensity = self._strength(statement, "I", 4 * math.pi)
        x, y, z = place[:3].tolist()
        name = self._names.new("point")
        self.lights.append(Light(name, "point", (x, y, z), color=intensity, power=4 * math.pi, radius=0.0))

    def spot(self, statement: Statement, matrix: Array) -> None:
        first, last = self._ends(statement, matrix)
        cone, delta = (
            statement.number("coneangle", 30.0, 1e-3, 90.0),
            statement.number("conedeltaangle", 5.0, 0.0),
        )
        delta = min(delta, cone)
        light = Light(
            self._names.new("spot"), "spot", matrix=_along(last - first, first), power=1.0, radius=0.0,
            spot_angle=2 * cone, spot_blend=delta / cone,
        )  # fmt: skip
        # Light falls off between the cones as here.
        color = self._strength(statement, "I", light.solid_angle)
        self.lights.append(replace(light, color=color, power=light.solid_angle))

    def distant(self, statement: Statement, matrix: Array) -> None:
        first, last = self._ends(statement, matrix)
        color = self._textures.light(statement, "L")
        scale, illuminance = statement.number("scale", 1.0, 0.0), statement.number("illuminance", -1.0)
        r, g, b = (scale * (illuminance if illuminance > 0 else 1.0) * c for c in color)
        axes = _along(last - first, np.zeros(3))
        name = self._names.new("distant")
        self.lights.append(Light(name, "sun", matrix=axes, color=(r, g, b), irradiance=1.0, angle=0.0))

    def _ends(self, statement: Statement, matrix: Array) -> tuple[Array, Array]:
        """The points (3,) from and to which a light shines, in the world."""
        first = statement.vector("from", (0.0, 0.0, 0.0))
        last = statement.vector("to", (0.0, 0.0, 1.0))
        ends = (matrix @ [*first, 1.0])[:3], (matrix @ [*last, 1.0])[:3]
        if not np.linalg.norm(ends[1] - ends[0]) > 0:
            raise InputError("to: is the same point as from; move one of them")
        return ends

    def infinite(self, statement: Statement, matrix: Array) -> None:
        if self.environment is not None:
            import_report.left_out(f"{statement}: a scene has one environment, and this is another")
            statement.ignore(*statement.parameters)
            return
        if statement.has("portal"):
            import_report.left_out(f"portal of {statement}: light comes from all around")
            statement.ignore("portal")
        scale, illuminance = statement.number("scale", 1.0, 0.0), statement.number("illuminance", -1.0)
        name = statement.text("filename")
        if not name:
            factor = scale * (illuminance / math.pi if illuminance > 0 else 1.0)
            r, g, b = (factor * c for c in self._textures.light(statement, "L"))
            self.environment = Environment((r, g, b))
            return
        if illuminance > 0:
            import_report.left_out(
                f"illuminance of {statement}: its image is as bright as it is, times scale"
            )
        bitmap = self._textures.image(name, str(statement))
        if bitmap is None:
            return
        colors = np.asarray(linear_pixels(bitmap)[..., :3], np.float32)
        if colors.shape[0] != colors.shape[1]:
            raise InputError(f"filename: {name[:60]!r} is not square, as pbrt's environments are")
        back = np.linalg.inv(_turn(matrix))
        width = min(2 * colors.shape[0], _LARGEST_SIDE)
        pixels = lat_long.drawn(width // 2, width, lambda ways: _seen_in_square(colors, back @ ways))
        self.environment = Environment((1.0, 1.0, 1.0), Image(np.maximum(pixels, 0)), intensity=scale)


_KINDS: dict[str, Callable[[Lights, Statement, Array], None]] = {
    "point": Lights.point,
    "spot": Lights.spot,
    "distant": Lights.distant,
    "infinite": Lights.infinite,
}


def _turn(matrix: Array) -> Array:
    """(3, 3) the axes of a matrix, of unit length. Raises InputError."""
    linear = matrix[:3, :3]
    lengths = np.linalg.norm(linear, axis=0)
    if not lengths.min() > 0 or abs(np.linalg.det(linear / lengths)) < 1e-6:
        raise InputError("the transform of the light flattens space")
    return np.asarray(linear / lengths)


def _along(direction: Array, place: Array) -> Array:
    """(3, 4) of a light at a place that shines along a direction, which is -z of its own frame."""
    back = -direction / np.linalg.norm(direction)
    across = np.cross(back, [1.0, 0.0, 0.0] if abs(back[0]) < 0.9 else [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    return np.column_stack([across, np.cross(back, across), back, place])


def _seen_in_square(pixels: npt.NDArray[np.float32], ways: Array) -> npt.NDArray[np.float32]:
    """(N, 3) what a square image of the sphere shows along directions (3, N): the nearest pixel. Equal areas
    of it are equal solid angles (P. Clarberg, "Fast Equal-Area Mapping of the (Hemi)Sphere", JGT 2008)."""
    x, y, z = np.abs(ways / np.linalg.norm(ways, axis=0))
    radius = np.sqrt(np.maximum(1 - z, 0))
    turn = np.arctan2(y, x) * (2 / np.pi)
    v = turn * radius
    u = radius - v
    is_below = ways[2] < 0
    u, v = np.where(is_below, 1 - v, u), np.where(is_below, 1 - u, v)
    side = len(pixels)
    column, row = (
        np.clip((np.copysign(one, way) + 1) / 2 * side, 0, side - 1).astype(int)
        for one, way in ((u, ways[0]), (v, ways[1]))
    )
    return np.asarray(pixels[row, column])
