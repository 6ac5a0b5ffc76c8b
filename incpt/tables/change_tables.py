"""What kernels know of the difference of two scenes, by which they tell which paths meet it
(cl/path/changes.cl)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import affine, layout
from incpt.device.device import Device
from incpt.scene.change import Change, diff
from incpt.scene.contacts import grown_bodies
from incpt.scene.enclosing import has_in_bounds
from incpt.scene.light import Light
from incpt.scene.model import Object, Scene
from incpt.tables.light_pairs import has_same_emitters

_PADDING = 2.0**-19
"""Of boxes, per metre of distance from the world's origin. Float32 rounds by 2^-24, and some ten roundings
are on the way from vertices and ray to a hit (cl/accel/bvh.cl)."""

_MOST_PAIRED = 64
"""Boxes of which all pairs are looked at; more are put together by place before."""

_EVERYWHERE = np.array([[-1e30] * 3, [1e30] * 3])
"""Bounds that every ray crosses."""

Boxes = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Difference:
    """What differs between two scenes with the same camera, for the paths of the second.

    boxes    (N, 2, 3) bounds in world space around objects that are elsewhere, have another shape, or have
             come or gone, where they were and where they are. None where only materials differ. Also around
             lights that differ in anything, which rays may meet. All of space where light from far away does.
    objects  (len(objects),) whether it is enough that a path meets the object, whose material is another one.
    lights   whether lights differ: then the scenes need `paired_tables`, which say which of them do.
    padding  of the boxes, per metre of distance from the world's origin.
    """

    boxes: Boxes
    objects: npt.NDArray[np.bool_]
    lights: bool
    padding: float

    @property
    def is_empty(self) -> bool:
        """Whether no path can meet any of it."""
        return not (len(self.boxes) or self.objects.any() or self.lights)


@dataclass(frozen=True, eq=False)
class ChangeTables:
    """A difference on a device: `change` () layout.CHANGE, and the buffer `objects`, a uint for each."""

    difference: Difference
    change: npt.NDArray[np.void]
    objects: cl.Buffer

    @property
    def is_empty(self) -> bool:
        """Whether no path can meet any of it."""
        return self.difference.is_empty


def change_tables(device: Device, old: Scene, new: Scene) -> ChangeTables:
    """The difference between two scenes for the paths of the new one. Raises DeviceError."""
    found = difference(old, new)
    flags = found.objects.astype(np.uint32)
    return ChangeTables(
        found, change_row(found), device.upload(flags if len(flags) else np.zeros(1, np.uint32))
    )


def difference(old: Scene, new: Scene) -> Difference:
    """What differs between two scenes."""
    change = diff(old, new)
    # Bodies in contact depend on each other.
    before, after = grown_bodies(old), grown_bodies(new)
    displaced = _displaced(change) | _regrown(before, after)
    placed = [
        *_shown(old, before, displaced - change.added),
        *_shown(new, after, displaced - change.removed),
    ]
    # Rays that went through them need not end on them now, and the other way round.
    placed += [*_changed_cutouts(old, old, new, change), *_changed_cutouts(new, old, new, change)]
    # Paths start in the media around the camera, whose boundaries they need not meet.
    placed += [*_changed_around_camera(old, change), *_changed_around_camera(new, change)]
    around = [obj.world_bounds for obj in placed]
    around += [light.world_bounds for scene in (old, new) for light in _met_lights(scene, change.lights)]
    if change.surroundings or change.far_lights:
        around = [_EVERYWHERE]
    boxes = np.array(around).reshape(-1, 2, 3)
    padding = _PADDING * max((_amplification(obj) for obj in placed), default=1.0)
    differing = not has_same_emitters(old, new)
    return Difference(boxes, _with_other_materials(new, change), differing, padding)


def _displaced(change: Change) -> frozenset[str]:
    """Objects that rays meet elsewhere than before."""
    return change.added | change.removed | change.moved | change.deformed | change.reshaped


def _met_lights(scene: Scene, names: frozenset[str]) -> list[Light]:
    return [light for light in scene.lights if light.name in names and light.is_emissive and light.has_size]


def _regrown(before: Mapping[str, Object], after: Mapping[str, Object]) -> frozenset[str]:
    """The objects that are grown in one of two scenes only, or by another amount."""
    both = before.keys() & after.keys()
    same = {
        name for name in both if np.array_equal(before[name].world_from_object, after[name].world_from_object)
    }
    return frozenset((before.keys() | after.keys()) - same)


def _shown(scene: Scene, grown: Mapping[str, Object], names: frozenset[str]) -> list[Object]:
    """Objects where rays meet them."""
    found = [grown.get(name) or scene.object(name) for name in sorted(names)]
    return [obj for obj in found if obj.visible]


def _changed_around_camera(scene: Scene, change: Change) -> list[Object]:
    """The objects with another material in whose boxes the camera is."""
    return [
        obj
        for obj in scene.objects
        if (obj.material in change.materials or obj.name in change.reassigned)
        and obj.visible
        and has_in_bounds(obj, scene.camera.start)
    ]


def _changed_cutouts(scene: Scene, old: Scene, new: Scene, change: Change) -> list[Object]:
    """The objects of a scene, which is one of the two, that have another material, by its name or by what it
    is, where either covers in part."""
    cutouts = {
        name for materials in (old.materials, new.materials) for name, m in materials.items() if m.passes_rays
    }
    if not cutouts:
        return []
    reassigned = {
        name for name in change.reassigned if {old.object(name).material, new.object(name).material} & cutouts
    }
    changed = change.materials & cutouts
    return [
        obj for obj in scene.objects if obj.visible and (obj.material in changed or obj.name in reassigned)
    ]


def _with_other_materials(new: Scene, change: Change) -> npt.NDArray[np.bool_]:
    changed = np.zeros(len(new.objects), np.bool_)
    if change.materials:
        changed[:] = [obj.material in change.materials for obj in new.objects]
    changed[[new.object_index[name] for name in change.reassigned]] = True
    return changed


def _amplification(obj: Object) -> float:
    """By how much the way into the space of an object and back enlarges rounding errors of a position."""
    world, local = np.abs(obj.world_from_object[:, :3]), np.abs(affine.invert(obj.world_from_object)[:, :3])
    return float(max((world @ local).sum(axis=1).max(), 1.0))


def change_row(found: Difference) -> npt.NDArray[np.void]:
    """() layout.CHANGE with at most layout.MOST_CHANGED_BOXES boxes that cover those of the difference."""
    row = np.zeros((), layout.CHANGE)
    row["has_objects"], row["has_lights"] = found.objects.any(), found.lights
    row["padding"] = found.padding
    boxes = joined(found.boxes, layout.MOST_CHANGED_BOXES)
    if len(boxes) % 2:
        boxes = np.concatenate([boxes, boxes[-1:]])
    row["box_count"] = len(boxes)
    row["least"][: len(boxes)], row["greatest"][: len(boxes)] = boxes[:, 0], boxes[:, 1]
    row["reach"] = np.abs(boxes).max(initial=0.0)
    return row


def joined(boxes: Boxes, most: int) -> Boxes:
    """At most `most` boxes that cover `boxes` (N, 2, 3): two at a time become one, those first whose surface
    grows least by it."""
    if len(boxes) > _MOST_PAIRED:
        boxes = _joined_by_place(boxes, _MOST_PAIRED)
    while len(boxes) > most:
        first, second = np.triu_indices(len(boxes), 1)
        around = _around(boxes[first], boxes[second])
        surface = _half_surface(boxes)
        chosen = int((_half_surface(around) - surface[first] - surface[second]).argmin())
        left = np.delete(boxes, (first[chosen], second[chosen]), axis=0)
        boxes = np.concatenate([left, around[chosen][None]])
    return boxes


def _joined_by_place(boxes: Boxes, most: int) -> Boxes:
    """Boxes that stand near each other become one: space is halved where most is between them."""
    groups = [boxes]
    while len(groups) < most:
        extents = [np.ptp(group.mean(axis=1), axis=0) for group in groups]
        several = [len(group) > 1 for group in groups]
        widest = int(np.argmax(np.where(several, np.max(extents, axis=1), -1)))
        group, axis = groups.pop(widest), int(extents[widest].argmax())
        centers = group[:, :, axis].mean(axis=1)
        lower = centers < (centers.min() + centers.max()) / 2
        if not lower.any():  # all have the same place
            lower[: len(group) // 2] = True
        groups += [group[lower], group[~lower]]
    return np.array([[group[:, 0].min(axis=0), group[:, 1].max(axis=0)] for group in groups])


def _around(a: Boxes, b: Boxes) -> Boxes:
    return np.stack([np.minimum(a[:, 0], b[:, 0]), np.maximum(a[:, 1], b[:, 1])], axis=1)


def _half_surface(boxes: Boxes) -> npt.NDArray[np.float64]:
    size = boxes[:, 1] - boxes[:, 0]
    return np.asarray((size * np.roll(size, 1, axis=1)).sum(axis=1))
