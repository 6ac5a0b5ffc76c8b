"""Files whose coordinates are far from their origin, as those of maps are (UTM): what they show is moved.

Single precision has steps of half a metre at 5,000 km. Whole kilometres are taken off before numbers become
so coarse, so that neighbouring tiles of a map still fit together.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from incpt.core.affine import Vector
from incpt.formats import import_report
from incpt.scene.camera import Camera
from incpt.scene.checks import LARGEST
from incpt.scene.light import Light
from incpt.scene.mesh_part import MeshFile
from incpt.scene.transform import Transform

Array = npt.NDArray[np.float64]
FAR = 1e5
"""From this distance on steps are 8 mm in units of a metre."""
_TIMES_ITS_SIZE = 16
"""Things that reach nearly to the origin themselves stay where they are."""
_STEP = 1000.0


def far_offset(points: npt.NDArray[np.floating[Any]]) -> Array | None:
    """(3,) what is to be taken off points (N, 3), which need not be finite; None where they are near enough.
    What is taken off is told."""
    finite = points[np.isfinite(points).all(axis=1)]
    if not len(finite):
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        low, high = finite.min(axis=0).astype(np.float64), finite.max(axis=0).astype(np.float64)
        middle = (low + high) / 2
        distance, size = np.abs(middle).max(), float(np.linalg.norm(high - low))
    if not max(FAR, _TIMES_ITS_SIZE * size) <= distance <= LARGEST:
        return None
    offset = _STEP * np.round(middle / _STEP)
    listed = ", ".join(f"{x:.0f}" for x in offset)
    import_report.changed(f"the origin: is moved to ({listed}) of the file, or it would be too coarse there")
    return np.asarray(offset)


def nearer(vertices: npt.NDArray[np.floating[Any]]) -> Array:
    """The vertices (V, 3) of a whole file: as they are, or moved near to the origin where they are far from
    it."""
    offset = far_offset(vertices)
    return cast(Array, vertices) if offset is None else vertices - offset


def moved(file: MeshFile, offset: Array) -> MeshFile:
    """All that a file places, moved by what is taken off."""
    parts = [replace(part, transform=_moved(part.transform, offset)) for part in file.parts]
    cameras = {name: _moved_camera(camera, offset) for name, camera in file.cameras.items()}
    lights = [_moved_light(light, offset) for light in file.lights]
    return replace(file, parts=tuple(parts), lights=tuple(lights), cameras=cameras)


def _moved(transform: Transform, offset: Array) -> Transform:
    return transform.with_parts(position=_vector(np.array(transform.position) - offset))


def _moved_light(light: Light, offset: Array) -> Light:
    return light if light.is_far else replace(light, transform=_moved(light.transform, offset))


def _moved_camera(camera: Camera, offset: Array) -> Camera:
    position, target = (_vector(np.array(point) - offset) for point in (camera.position, camera.target))
    return replace(camera, position=position, target=target)


def _vector(values: Array) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
