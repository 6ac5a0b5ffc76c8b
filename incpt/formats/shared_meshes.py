"""Parts of mesh files that share their meshes: what each mesh is called in its file, and where all stand."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.formats.far_origin import far_offset, moved
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.mesh_part import MeshFile, MeshPart
from incpt.scene.transform import IDENTITY

MOST_PARTS = 1_000_000
"""Meshes at places that a file may show: a small file can name a great many, each of many parts."""


def settled(path: Path, file: MeshFile) -> MeshFile:
    """What a file gives, near to the origin and with meshes that know their place in the file; before, their
    sources have the names of geometries."""
    offset = far_offset(bounds_of(file.parts))
    file = file if offset is None else moved(file, offset)
    return replace(file, parts=_with_sources(path, file.parts))


def _with_sources(path: Path, parts: Sequence[MeshPart]) -> tuple[MeshPart, ...]:
    """A mesh that only one part shows, where it is stored, is that part of the file; others are geometries of
    it."""
    file = os.path.abspath(path)
    uses = Counter(id(part.mesh) for part in parts)
    made: dict[int, Mesh] = {}
    for part in parts:
        mesh = part.mesh
        if id(mesh) not in made:
            is_part = uses[id(mesh)] == 1 and part.transform == IDENTITY
            source = MeshSource(file=file, part=part.name) if is_part else replace(mesh.source, file=file)
            made[id(mesh)] = replace(mesh, source=source)
    return tuple(replace(part, mesh=made[id(part.mesh)]) for part in parts)


def bounds_of(parts: Sequence[MeshPart]) -> npt.NDArray[np.float64]:
    """(2, 3) bounds of all parts, one or more, in the space of the file."""
    corners = np.concatenate(
        [affine.apply(p.transform.world_from_object, affine.box_corners(p.mesh.bounds)) for p in parts]
    )
    return np.stack([corners.min(axis=0), corners.max(axis=0)])
