"""Lights that are objects of their own, as the kernels read them (layout.ShapedPlane)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.core import layout
from incpt.core.layout import ShapedFlag, ShapedPlane
from incpt.scene.light import Light
from incpt.scene.model import Scene
from incpt.tables.alias import alias_table, luminance
from incpt.tables.light_tree import TreeLights, merged_cones

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
    light sampling chooses one of them, or beside a light tree one of the suns."""

    planes: npt.NDArray[np.float32]
    sun_count: int = 0
    probability: float = 0.0

    @property
    def count(self) -> int:
        return int(self.planes.shape[1])


NO_SHAPED_LIGHTS = ShapedLights(np.zeros((len(ShapedPlane), 0), np.float32))


def emissive_lights(scene: Scene) -> list[Light]:
    """Those that are there, suns first."""
    lights = [light for light in scene.lights if light.is_emissive]
    suns = [light for light in lights if light.kind == "sun"]
    return suns + [light for light in lights if light.kind != "sun"] if suns else lights


def sun_count(lights: Sequence[Light]) -> int:
    """How many suns stand in front of others."""
    return next((i for i, light in enumerate(lights) if not light.is_far), len(lights))


def weight(light: Light) -> float:
    """The power that counts in choosing lights, W: the luminance of `Light.watts`."""
    known = light.__dict__
    if "_weight" not in known:
        known["_weight"] = _weight(light)
    return float(known["_weight"])


def _weight(light: Light) -> float:
    factor = np.pi * SUN_RADIUS**2 if light.is_far else 1.0
    return factor * float(luminance(light.watts))


def _rows(lights: Sequence[Light | None], name: str, make: Callable[[Light], bytes]) -> bytes:
    """What `make` makes of each light, one after the other; of None it is `_NOTHING`. It is kept with the
    light, which never changes: an edit changes one of ten thousand lights, and all stand in the new table."""
    try:
        return b"".join([_NOTHING if light is None else light.__dict__[name] for light in lights])
    except KeyError:
        for light in lights:
            if light is not None and name not in light.__dict__:
                light.__dict__[name] = make(light)
        return _rows(lights, name, make)


@dataclass(frozen=True, eq=False)
class Shares:
    """How light sampling chooses: the chances of the environment, of all triangles together, and of each
    light (N,). With a light tree all that is in it takes the place of triangles, and suns that of lights."""

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
    lights: Sequence[Light | None],
    chances: Array,
    changed: npt.NDArray[np.bool_],
    trails: npt.NDArray[np.uint32] | None = None,
) -> npt.NDArray[np.float32]:
    """(len(ShapedPlane), N): None is a light that another scene has in its place, which emits nothing
    here. `chances` (N,) of choosing each among all lights; `changed` (N,) see LightFlag.CHANGED. With
    `trails` the lights have them in a light tree, but for the suns in front: as many as are given less."""
    columns = _rows(lights, "_column", _column)
    planes = np.frombuffer(columns, np.float32).reshape(-1, len(ShapedPlane)).T.copy()
    flags = planes[ShapedPlane.FLAGS].view(np.uint32)
    flags |= changed.astype(np.uint32) * np.uint32(ShapedFlag.CHANGED)
    suns = 0 if trails is None else len(lights) - len(trails)
    table = slice(None) if trails is None else slice(suns)
    planes[ShapedPlane.PROBABILITY] = 1
    planes[ShapedPlane.PROBABILITY, table] = chances[table]
    if len(chances[table]):
        planes[ShapedPlane.ALIAS_PROBABILITY, table], alias = alias_table(chances[table])
        planes[ShapedPlane.ALIAS, table] = alias.view(np.float32)
    if trails is not None:
        planes[ShapedPlane.TRAIL, suns:] = trails.view(np.float32)
    return planes


def _flags(light: Light) -> int:
    return (
        _SHAPES[light.kind]
        | (ShapedFlag.DOUBLE_SIDED if light.double_sided and light.kind in ("rectangle", "disk") else 0)
        | (0 if light.has_size else ShapedFlag.POINT)
        | (0 if light.camera_visible else ShapedFlag.HIDDEN)
        | (0 if light.casts_shadows else ShapedFlag.SHADOWLESS)
    )


def _column(light: Light) -> bytes:
    """What planes have of a light, but for chances and places."""
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
    column[plane.FLAGS : plane.FLAGS + 1].view(np.uint32)[0] = _flags(light)
    return column.tobytes()


def _nothing() -> bytes:
    column = np.zeros(len(ShapedPlane), np.float32)
    column[ShapedPlane.FLAGS : ShapedPlane.FLAGS + 1].view(np.uint32)[0] = ShapedFlag.BALL | ShapedFlag.POINT
    return column.tobytes()


_NOTHING = _nothing()


def tree_lights(lights: Sequence[Light], first: int) -> TreeLights:
    """What the light tree needs to know of lights that are no suns; the first has the number `first`."""
    rows = np.frombuffer(_rows(lights, "_tree_row", _tree_row), np.float64).reshape(-1, _TREE_ROW_SIZE)
    return TreeLights(
        rows[:, :6].reshape(-1, 2, 3),
        rows[:, 6:9],
        rows[:, 9],
        rows[:, 10],
        rows[:, 11],
        rows[:, 12] > 0,
        np.arange(first, first + len(lights), dtype=np.uint32),
    )


_TREE_ROW_SIZE = 13


def _tree_row(light: Light) -> bytes:
    spread, falloff = np.pi, np.pi / 2
    if light.kind in ("rectangle", "disk") and not light.double_sided:
        spread = 0.0
    elif light.kind == "spot":
        inner, outer = np.arccos(light.cone)
        spread, falloff = inner, outer - inner
    intensity = float(luminance(light.emitted)) * (light.face if light.has_size else 1.0)
    row = [*light.world_bounds.ravel(), *-light.axes[2], spread, falloff, intensity, light.has_size]
    return np.array(row, np.float64).tobytes()


def paired_tree_lights(pairs: Sequence[tuple[Light | None, Light | None]], first: int) -> TreeLights:
    """The same of lights in two scenes, None where one is not there: bounds of both, and the larger power."""
    before, after = (
        tree_lights([pair[i] or pair[1 - i] for pair in pairs], first)  # type: ignore[misc]
        for i in range(2)
    )
    differs = np.array([None not in pair and pair[0] is not pair[1] for pair in pairs], np.bool_)
    axis, spread = before.axis.copy(), before.spread.copy()
    axis[differs], spread[differs] = merged_cones(
        (before.axis[differs], before.spread[differs]), (after.axis[differs], after.spread[differs])
    )
    return TreeLights(
        np.stack(
            [
                np.minimum(before.bounds[:, 0], after.bounds[:, 0]),
                np.maximum(before.bounds[:, 1], after.bounds[:, 1]),
            ],
            axis=1,
        ),
        axis,
        spread,
        np.maximum(before.falloff, after.falloff),
        np.maximum(before.power, after.power),
        before.met | after.met,
        before.numbers,
    )
