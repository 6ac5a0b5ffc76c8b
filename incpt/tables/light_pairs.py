"""One choice of lights for two scenes.

A lamp that comes, goes or gets brighter would change the chance of every other lamp, so that the same random
numbers led to other lights in nearly all paths. So both scenes choose among the same lights with the same
chances: those of either scene. In the scene that lacks a light, it emits nothing.

What the law of multiple importance sampling needs holds in each scene: a point on an emitter is chosen with
the density that its material has (`LightTables.densities`), because all that has a material of that name has
the same weight per area in both scenes, the larger of its two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.core import layout
from incpt.device.device import Device
from incpt.scene.model import Object, Scene
from incpt.tables import lights
from incpt.tables.lights import Array, LightTables, TriangleLights

_SAME_AREA = 1e-6
"""By how much, relatively, the areas of a triangle in both scenes may differ where it is one light: what
moving it leaves of rounding errors."""


def has_same_emitters(old: Scene, new: Scene) -> bool:
    """Whether light sampling is the same in both scenes already."""

    def seen(scene: Scene) -> list[tuple[object, ...]]:
        found: list[tuple[object, ...]] = []
        for obj in lights.emissive_objects(scene):
            material = scene.materials[obj.material]
            found.append((id(obj.mesh), obj.transform, material.emission, material.double_sided))
        return found

    return seen(old) == seen(new)


def paired_light_tables(
    device: Device, old: Scene, new: Scene, has_image: bool
) -> tuple[LightTables, LightTables]:
    """The light tables of both scenes; `has_image` tells whether their environment has an image that shines.
    Raises DeviceError."""
    first, second = paired_lights(old, new, lights.share_of_triangles(has_image))
    return LightTables.of(device, first, has_image), LightTables.of(device, second, has_image)


def common_weights(old: Scene, new: Scene) -> dict[str, float]:
    """The weight of each material in both scenes, by name."""
    weights: dict[str, float] = {}
    for scene in (old, new):
        for name, material in scene.materials.items():
            weights[name] = max(weights.get(name, 0.0), lights.radiant_weight(material))
    return weights


def paired_lights(old: Scene, new: Scene, share: float) -> tuple[TriangleLights, TriangleLights]:
    """The lights of both scenes, the same ones in the same order; see `lights.triangle_lights`. Those that
    differ have LightFlag.CHANGED."""
    weights = common_weights(old, new)
    rows = _Rows.joined(_rows(old, new, weights)).chosen()
    power = rows.weight * rows.area
    if len(power) == 0:
        nothing = TriangleLights(np.zeros((len(layout.LightPlane), 0), np.float32), {})
        return nothing, nothing
    scale = share / float(power.sum())
    densities = {name: weights[name] * scale for name in dict.fromkeys(rows.material.tolist())}
    first, second = (
        TriangleLights(
            lights.light_planes(
                rows.corners[i],
                rows.emission[i],
                np.where(rows.shines[i], rows.weight * scale, 0),
                power,
                rows.flags(i),
                rows.errors[i],
            ),
            densities,
        )
        for i in range(2)
    )
    return first, second


@dataclass(frozen=True, eq=False)
class _Triangles:
    """Those of an object: `corners` (F, 3, 3) and `errors` (F, 3), see `_Rows`."""

    corners: Array
    errors: Array

    @classmethod
    def of(cls, obj: Object) -> _Triangles:
        return cls(lights.world_corners(obj), lights.transform_errors(obj))

    def __getitem__(self, chosen: npt.NDArray[np.bool_]) -> _Triangles:
        return _Triangles(self.corners[chosen], self.errors[chosen])


_NO_TRIANGLES = _Triangles(np.zeros((0, 3, 3)), np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class _Rows:
    """N triangles, in the old and in the new scene.

    corners       (2, N, 3, 3); where a scene lacks it, those of the other.
    errors        (2, N, 3) their `lights.transform_errors`.
    emission      (2, N, 3); 0 where a scene lacks it.
    double_sided  (2, N)
    weight        (N,) per area
    material      (N,) its name
    """

    corners: Array
    errors: Array
    emission: Array
    double_sided: npt.NDArray[np.bool_]
    weight: Array
    material: npt.NDArray[np.object_]

    @classmethod
    def joined(cls, parts: list[_Rows]) -> _Rows:
        every = [_row(None, None, "", _NO_TRIANGLES, _NO_TRIANGLES, 0.0), *parts]
        return cls(
            np.concatenate([part.corners for part in every], axis=1),
            np.concatenate([part.errors for part in every], axis=1),
            np.concatenate([part.emission for part in every], axis=1),
            np.concatenate([part.double_sided for part in every], axis=1),
            np.concatenate([part.weight for part in every]),
            np.concatenate([part.material for part in every]),
        )

    def chosen(self) -> _Rows:
        """Those that are large and bright enough to be lights."""
        kept = (self.area >= lights.SMALLEST_AREA) & (self.weight >= lights.SMALLEST_WEIGHT)
        return _Rows(
            self.corners[:, kept],
            self.errors[:, kept],
            self.emission[:, kept],
            self.double_sided[:, kept],
            self.weight[kept],
            self.material[kept],
        )

    @property
    def area(self) -> Array:
        return lights.areas(self.corners[0])

    @property
    def shines(self) -> npt.NDArray[np.bool_]:
        """(2, N)"""
        return np.asarray(self.emission.any(axis=2))

    def flags(self, scene: int) -> npt.NDArray[np.uint32]:
        corners = self.corners.astype(np.float32)
        changed = (corners[0] != corners[1]).any(axis=(1, 2)) | (self.emission[0] != self.emission[1]).any(
            axis=1
        )
        changed |= self.double_sided[0] != self.double_sided[1]
        flag = layout.LightFlag
        return np.asarray(
            self.double_sided[scene] * np.uint32(flag.DOUBLE_SIDED) + changed * np.uint32(flag.CHANGED),
            np.uint32,
        )


def _rows(old: Scene, new: Scene, weights: Mapping[str, float]) -> list[_Rows]:
    """Those of each object that is seen and emits in one of the scenes. They are lights of both where it has
    its name, its material and their area in both."""
    before, after = _seen(old, weights), _seen(new, weights)
    found = []
    for key in [*before, *(key for key in after if key not in before)]:
        a, b = before.get(key), after.get(key)
        first, second = (None if obj is None else _Triangles.of(obj) for obj in (a, b))
        weight = weights[key[1]]
        if first is not None and second is not None and len(first.corners) == len(second.corners):
            before_it, after_it = lights.areas(first.corners), lights.areas(second.corners)
            same = np.isclose(before_it, after_it, rtol=_SAME_AREA, atol=0)
            found.append(_row(old, new, key[1], first[same], second[same], weight))
            first, second = first[~same], second[~same]
        if first is not None:
            found.append(_row(old, None, key[1], first, first, weight))
        if second is not None:
            found.append(_row(None, new, key[1], second, second, weight))
    return found


def _seen(scene: Scene, weights: Mapping[str, float]) -> dict[tuple[str, str], Object]:
    return {
        (obj.name, obj.material): obj for obj in scene.objects if obj.visible and weights[obj.material] > 0
    }


def _row(
    old: Scene | None, new: Scene | None, name: str, first: _Triangles, second: _Triangles, weight: float
) -> _Rows:
    """Triangles with the material of that name in the scenes that are given."""
    count = len(first.corners)
    emission, double_sided = np.zeros((2, count, 3)), np.zeros((2, count), np.bool_)
    for i, scene in enumerate((old, new)):
        if scene is not None:
            material = scene.materials[name]
            emission[i], double_sided[i] = material.emission, material.double_sided
    return _Rows(
        np.stack([first.corners, second.corners]),
        np.stack([first.errors, second.errors]),
        emission,
        double_sided,
        np.full(count, weight),
        np.full(count, name, np.object_),
    )
