"""Shapes as objects: their meshes, where they stand, and what they are made of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError, in_place
from incpt.formats import import_report
from incpt.formats.appearance.looks import Look
from incpt.formats.mitsuba.document import Document
from incpt.formats.mitsuba.materials import Materials, Surface
from incpt.formats.mitsuba.meshes import FILES, Meshes
from incpt.formats.mitsuba.node import Node
from incpt.formats.names import Names
from incpt.formats.reading_progress import each
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object
from incpt.scene.transform import Transform

Array = npt.NDArray[np.float64]
MOST_OBJECTS = 1_000_000
"""That a scene may show: instances multiply what they name."""
_BLACK: Look = {"base_color": (0.0, 0.0, 0.0), "specular": 0.0}
"""Of shapes that emit light and have no BSDF."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """A mesh of a shape where it stands in the space of the scene or of a group (4, 4), with the name of its
    material."""

    name: str
    mesh: Mesh
    material: str
    matrix: Array


class Shapes:
    """Makes the objects of a scene. `materials` are those that they use, by name."""

    def __init__(self, document: Document, materials: Materials) -> None:
        self._meshes, self._made = Meshes(document), materials
        self.materials: dict[str, Material] = {}
        self._material_names: dict[object, str] = {}
        self._names, self._labels = Names(), Names()
        self._groups: dict[int, list[_Piece]] = {}

    def objects(self, root: Node) -> tuple[Object, ...]:
        """Of all shapes of the scene. Raises InputError."""
        found: list[Object] = []
        for node in each(list(root.objects_of("shape"))):
            with in_place(node.place):
                if node.kind == "shapegroup":
                    continue
                pieces = self._instance(node) if node.kind == "instance" else self._pieces(node)
                found += [one for piece in pieces if (one := self._object(node, piece)) is not None]
                if len(found) > MOST_OBJECTS:
                    raise InputError(
                        f"the scene shows more than {MOST_OBJECTS:,} objects; use fewer instances"
                    )
        return tuple(found)

    def _object(self, node: Node, piece: _Piece) -> Object | None:
        name = self._names.new(piece.name)
        try:
            transform = Transform.from_matrix(piece.matrix)
        except InputError as error:
            import_report.left_out(f"{node}: {error}")
            return None
        return Object(name, piece.mesh, piece.material, transform=transform)

    def _instance(self, node: Node) -> list[_Piece]:
        """The pieces of the group that it shows."""
        groups = [one for one in node.objects_of("shape") if one.kind == "shapegroup"]
        if not groups:
            raise InputError("an instance needs a <ref> to a shapegroup")
        group = groups[0]
        if id(group) not in self._groups:
            with in_place(group.place):
                self._groups[id(group)] = [
                    piece for one in group.objects_of("shape") for piece in self._pieces(one)
                ]
        matrix, name = node.matrix("to_world"), node.id or group.id or "instance"
        return [
            replace(piece, name=f"{name}/{piece.name}", matrix=matrix @ piece.matrix)
            for piece in self._groups[id(group)]
        ]

    def _pieces(self, node: Node) -> list[_Piece]:
        """The meshes of a shape. What cannot be read of it is told, and there are none."""
        node.ignore("silhouette_sampling_weight")
        for medium in node.objects_of("medium"):
            import_report.left_out(f"{medium} in {node}: no light is scattered in the air")
        surface = self._surface(node)
        meshes = {} if surface is None else self._meshes.of(node, surface)
        if surface is None or not meshes:
            return []
        name = node.id or (Path(node.text("filename")).stem if node.kind in FILES else node.kind)
        material = self._material(node, name, surface)
        to_world = node.matrix("to_world")
        if not np.array_equal(to_world[3], [0, 0, 0, 1]):
            raise InputError("to_world: the last row of the matrix is not 0 0 0 1")
        return [
            _Piece(f"{name}/{part}" if part else name, mesh, material, to_world @ place)
            for part, (mesh, place) in meshes.items()
        ]

    def _surface(self, node: Node) -> Surface | None:
        """What it is made of, with what it emits; None, where it is not seen at all."""
        bsdfs, emitters = list(node.objects_of("bsdf")), list(node.objects_of("emitter"))
        for more in bsdfs[1:]:
            import_report.left_out(f"{more} of {node}: a shape has one BSDF")
        surface = self._made.of_shape(bsdfs[0] if bsdfs else None)
        emitter = next((one for one in emitters if one.kind == "area"), None)
        for other in emitters:
            if other is not emitter:
                import_report.left_out(f"{other} of {node}: only area lights are read of shapes")
        if emitter is None:
            if surface.is_nothing:
                node.ignore(*node.values)
            return None if surface.is_nothing else surface
        if surface.is_nothing or not bsdfs:
            surface = Surface(dict(_BLACK))
        with in_place(emitter.place):
            radiance = self._made.textures.emission(emitter, "radiance")
        look = {**surface.look, "emission": radiance.rgb}
        if radiance.texture is not None:
            look["emission_texture"] = radiance.texture
        return replace(surface, look=look)

    def _material(self, node: Node, name: str, surface: Surface) -> str:
        """The name of the material of a shape, which is that of its BSDF where that has an id and shines
        not. Like ones without a name are one."""
        material = Material(**surface.look)
        bsdf = next(node.objects_of("bsdf"), None)
        label = bsdf.id if bsdf is not None and not material.is_emissive else ""
        key = (label, material)
        if key not in self._material_names:
            self._material_names[key] = self._labels.new(label or name)
            self.materials[self._material_names[key]] = material
        return self._material_names[key]
