"""What mesh files have at vertices beside positions and normals: texture coordinates, colours, tangents."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.arrays import handed_over
from incpt.scene.checks import LARGEST
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh

Array = npt.NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class VertexAttributes:
    """For V vertices, as the file has them: up to two sets of texture coordinates (V, 2), (0, 0) at the top
    left of an image; linear colours (V, 4); tangents with the side of v (V, 4)."""

    uvs: tuple[Array, ...] = ()
    colors: Array | None = None
    tangents: Array | None = None

    def placed(self, linear: Array) -> VertexAttributes:
        """Under a (3, 3) matrix."""
        if self.tangents is None:
            return self
        with np.errstate(all="ignore"):
            along = self.tangents[:, :3] @ linear.T
            side = self.tangents[:, 3:] * np.sign(np.linalg.det(linear))
        return replace(self, tangents=np.concatenate([along, side], axis=1))

    def at_corners(
        self,
        faces: npt.NDArray[np.int64],
        uv_at: npt.NDArray[np.int64] | None = None,
        color_at: npt.NDArray[np.int64] | None = None,
    ) -> dict[str, Any]:
        """The keywords of a Mesh for faces (F, 3). `uv_at` and `color_at` (F, 3): where their texture
        coordinates and their colours stand, if not at the vertices. Numbers that are not finite become 0."""
        places = faces if uv_at is None else uv_at

        def at(values: Array, where: npt.NDArray[np.int64] = faces) -> Array:
            return handed_over(np.take(values.astype(np.float32, copy=False), where, axis=0))

        keywords: dict[str, Any] = {"uvs": tuple(at(_within(uv, LARGEST), places) for uv in self.uvs)}
        if self.colors is not None:
            colors = np.clip(_within(self.colors, LARGEST), 0, 1)
            keywords["colors"] = at(colors, faces if color_at is None else color_at)
        if self.tangents is not None:
            keywords["tangents"] = at(_unit_tangents(self.tangents))
        return keywords


NO_ATTRIBUTES = VertexAttributes()


def material_of_colors(mesh: Mesh) -> tuple[str, Material] | tuple[None, None]:
    """The name and the material of a mesh whose file has colours for it and no material: they are its own
    colours then, and cover as much as they say."""
    if mesh.colors is None:
        return None, None
    is_opaque = bool((mesh.colors[..., 3] == 1).all())
    name, mode = ("colors", "opaque") if is_opaque else ("transparent colors", "blend")
    return name, Material(base_color=(1.0, 1.0, 1.0), roughness=0.6, alpha_mode=mode)


def _within(values: Array, largest: float) -> Array:
    return np.clip(np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0), -largest, largest)


def _unit_tangents(tangents: Array) -> Array:
    finite = _within(tangents, LARGEST)
    length = np.linalg.norm(finite[:, :3], axis=1, keepdims=True)
    usable = length > 1e-12
    along = np.where(usable, finite[:, :3] / np.where(usable, length, 1), [1.0, 0.0, 0.0])
    return np.concatenate([along, np.where(finite[:, 3:] < 0, -1.0, 1.0)], axis=1)
