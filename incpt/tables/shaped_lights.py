"""Lights that are objects of their own, as the kernels read them (layout.ShapedPlane)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.core import layout
from incpt.core.layout import ShapedFlag, ShapedPlane
from incpt.scene.light import Light
from incpt.scene.model import Scene
from incpt.tables.alias import alias_table, luminance

Array = npt.NDArray[np.float64]

SUN_RADIUS = 3.0
"""Metres. A sun counts as a lamp with the power that it sends into a scene of that radius."""
EVEN_SHARE = 0.5
"""Of the choices among lights, how many take each of them alike, whatever its power: a weak lamp that is
near would else be lost beside a strong one that is far, or behind a wall."""
_SHAPES = {"point": ShapedFlag.BALL, "sphere": ShapedFlag.BALL, "spot": ShapedFlag.BALL,
           "rectangle": ShapedFlag.RECTANGLE, "disk": ShapedFlag.DISK, "sun": ShapedFlag.SUN}  # fmt: skip
_NO_CONE = (-2.0, 1.0)
"""Cosine and scale with which nothing falls off."""
_SHARPEST = 1e-6
"""Least difference of the cosines between which the light of a spot falls off."""


@dataclass(frozen=True, eq=False)
class ShapedLights:
    """`planes` (len(ShapedPlane), N) float32, uints bit for bit; how many of them are suns; the chance that
    light sampling chooses one of them."""

    planes: npt.NDArray[np.float32]
    sun_count: int = 0
    probability: float = 0.0

    @property
    def count(self) -> int:
        return int(self.planes.shape[1])


NO_SHAPED_LIGHTS = ShapedLights(np.zeros((len(ShapedPlane), 0), np.float32))


def emissive_lights(scene: Scene) -> list[Light]:
    """Those that are there, suns first."""
    return sorted((light for light in scene.lights if light.is_emissive), key=lambda light: not light.is_far)


def weight(light: Light) -> float:
    """The power that counts in choosing lights, W: the luminance of `Light.watts`."""
    factor = np.pi * SUN_RADIUS**2 if light.is_far else 1.0
    return factor * float(luminance(light.watts))


@dataclass(frozen=True, eq=False)
class Shares:
    """How light sampling chooses: the chances of the environment, of all triangles together, and of each
    light (N,)."""

    environment: float
    triangles: float
    lights: Array


def shares(has_image: bool, triangle_power: float, weights: Sequence[float]) -> Shares:
    """The chances where an image of the environment takes half of the choices, if there is one, and all
    triangles count as one light of their power."""
    near = 1.0 - 0.5 * has_image
    power = np.array([triangle_power, *weights])
    lit = power > 0
    chosen = EVEN_SHARE * lit / lit.sum() + (1 - EVEN_SHARE) * power / power.sum()
    return Shares(1.0 - near, near * float(chosen[0]), near * chosen[1:])


def shaped_planes(
    lights: Sequence[Light | None], chances: Array, changed: npt.NDArray[np.bool_]
) -> npt.NDArray[np.float32]:
    """(len(ShapedPlane), N): None is a light that another scene has in its place, which emits nothing
    here. `chances` (N,) of choosing each among all lights; `changed` (N,) see LightFlag.CHANGED."""
    planes = np.zeros((len(ShapedPlane), len(lights)), np.float32)
    flags = np.array([_flags(light) for light in lights], np.uint32)
    flags |= changed.astype(np.uint32) * np.uint32(ShapedFlag.CHANGED)
    for i, light in enumerate(lights):
        if light is not None:
            planes[:, i] = _column(light)
    planes[ShapedPlane.PROBABILITY] = chances
    planes[ShapedPlane.ALIAS_PROBABILITY], alias = alias_table(chances)
    planes[ShapedPlane.ALIAS] = alias.view(np.float32)
    planes[ShapedPlane.FLAGS] = flags.view(np.float32)
    return planes


def _flags(light: Light | None) -> int:
    if light is None:
        return ShapedFlag.BALL | ShapedFlag.POINT
    return (
        _SHAPES[light.kind]
        | (ShapedFlag.DOUBLE_SIDED if light.double_sided and light.kind in ("rectangle", "disk") else 0)
        | (0 if light.has_size else ShapedFlag.POINT)
        | (0 if light.camera_visible else ShapedFlag.HIDDEN)
        | (0 if light.casts_shadows else ShapedFlag.SHADOWLESS)
    )


def _column(light: Light) -> npt.NDArray[np.float32]:
    plane, column = layout.ShapedPlane, np.zeros(len(ShapedPlane), np.float32)
    column[plane.CENTER_X : plane.CENTER_Z + 1] = light.position
    column[plane.X_X : plane.X_Z + 1], column[plane.Y_X : plane.Y_Z + 1] = light.axes[:2]
    column[plane.HALF_X : plane.HALF_Y + 1] = light.half_size
    column[plane.EMISSION_R : plane.EMISSION_B + 1] = light.emitted
    column[plane.CAP] = light.cap if light.is_far else 0.0
    outer, scale = _NO_CONE
    if light.kind == "spot":
        inner, outer = light.cone
        scale = 1 / max(inner - outer, _SHARPEST)
    column[plane.CONE_OUTER], column[plane.CONE_SCALE] = outer, scale
    return column
