"""Shapes as objects: their meshes, where they stand, and what they are made of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError, in_place
from incpt.formats import import_report, mesh_files, primitive_shapes
from incpt.formats.appearance.looks import Look
from incpt.formats.clean import tell_of_faces, usable_mesh
from incpt.formats.import_options import current_options, reading_with
from incpt.formats.names import Names
from incpt.formats.pbrt.document import Document, Placed
from incpt.formats.pbrt.materials import Materials
from incpt.formats.pbrt.parameters import Statement
from incpt.formats.placement import turned_over
from incpt.formats.reading_progress import each
from incpt.formats.vertex_attributes import VertexAttributes
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.model import Object
from incpt.scene.transform import Transform

Array = npt.NDArray[np.float64]
MOST_OBJECTS = 1_000_000
"""That a scene may show: instances multiply what they name."""
_BLACK: Look = {"base_color": (0.0, 0.0, 0.0), "specular": 0.0}


@dataclass(frozen=True, eq=False)
class _Piece:
    """A mesh where it stands (4, 4), with the name of its material."""

    name: str
    mesh: Mesh
    material: str
    matrix: Array


class Shapes:
    """Makes the objects of a scene under a matrix (4, 4) of its whole world. `materials` are those that they
    use, by name."""

    def __init__(self, document: Document, materials: Materials, world: Array) -> None:
        self._document, self._made, self._world = document, materials, world
        self.materials: dict[str, Material] = {}
        self._material_names: dict[object, str] = {}
        self._names, self._labels = Names(), Names()
        self._by_statement = {id(one): name for name, one in document.materials.items()}
        self._turned: dict[int, tuple[Mesh, Mesh]] = {}
        self._objects: dict[str, list[_Piece]] = {}

    def objects(self) -> tuple[Object, ...]:
        """Raises InputError."""
        pieces = [piece for shape in each(self._document.shapes) for piece in self._pieces(shape)]
        found = [one for piece in pieces if (one := self._object(piece)) is not None]
        for placed in self._document.instances:
            found += self._instance(placed)
            if len(found) > MOST_OBJECTS:
                raise InputError(f"the scene shows more than {MOST_OBJECTS:,} objects; use fewer instances")
        return tuple(found)

    def _instance(self, placed: Placed) -> list[Object]:
        name = placed.statement.kind
        with in_place(placed.statement.place):
            if name not in self._document.objects:
                raise InputError(f"ObjectInstance: {name[:40]!r} is not begun before; correct the name")
            if name not in self._objects:
                shapes = self._document.objects[name]
                self._objects[name] = [piece for shape in shapes for piece in self._pieces(shape)]
            found = []
            for piece in self._objects[name]:
                own = replace(piece, name=f"{name}/{piece.name}", matrix=placed.state.matrix @ piece.matrix)
                obj = self._object(own)
                found += [] if obj is None else [obj]
            return found

    def _object(self, piece: _Piece) -> Object | None:
        name = self._names.new(piece.name)
        try:
            transform = Transform.from_matrix(self._world @ piece.matrix)
        except InputError as error:
            import_report.left_out(f"{name}: {error}")
            return None
        return Object(name, piece.mesh, piece.material, transform=transform)

    def _pieces(self, placed: Placed) -> list[_Piece]:
        """The meshes of a shape. What cannot be read of it is told, and there are none."""
        shape, state = placed.statement, placed.state
        with in_place(shape.place):
            if state.has_medium:
                import_report.left_out("media: no light is scattered in the air")
            look = self._look(placed)
            meshes = {} if look is None else self._meshes(shape)
            if look is None or not meshes:
                shape.ignore(*shape.parameters)
                return []
            named = self._by_statement.get(id(state.material), "") if state.area_light is None else ""
            name = Path(shape.text("filename")).stem if shape.kind == "plymesh" else shape.kind
            material = self._material(named or name, look)
            return [
                _Piece(
                    f"{name}/{part}" if part else name, self._side(mesh, state.turns_over), material, matrix
                )
                for part, (mesh, place) in meshes.items()
                for matrix in [state.matrix @ place]
            ]

    def _side(self, mesh: Mesh, turns: bool) -> Mesh:
        """The same mesh for all that want the same side of it out."""
        if not turns:
            return mesh
        if id(mesh) not in self._turned:
            # The mesh is kept, so that no other gets its identity.
            self._turned[id(mesh)] = (mesh, turned_over(mesh))
        return self._turned[id(mesh)][1]

    def _look(self, placed: Placed) -> Look | None:
        """What a shape is made of, with what it emits; None where it is not seen at all."""
        look, light = self._made.look(placed.state.material), placed.state.area_light
        if light is None:
            return None if look is None else self._made.masked(placed.statement, look)
        with in_place(light.place):
            if light.kind != "diffuse":
                raise InputError(f'AreaLightSource: {light.kind[:40]!r} is not known; write "diffuse"')
            color = np.array(self._made.textures.light(light, "L"))
            scale = light.number("scale", 1.0, 0.0)
            if light.has("power"):
                import_report.left_out(f"power of {light}: give its radiance by L and scale")
                light.ignore("power")
            emission: Look = {
                "emission": tuple((scale * color).tolist()),
                "double_sided": light.flag("twosided", False),
            }
            name = light.text("filename")
            bitmap = self._made.textures.image(name, str(light)) if name else None
            if bitmap is not None:
                import_report.changed(f"image of {light}: lies by the texture coordinates of the shape")
        return self._made.masked(placed.statement, {**(_BLACK if look is None else look), **emission})

    def _material(self, label: str, look: Look) -> str:
        """The name of a material; like ones under one label are one."""
        material = Material(**look)
        key = (label, material)
        if key not in self._material_names:
            self._material_names[key] = self._labels.new(label)
            self.materials[self._material_names[key]] = material
        return self._material_names[key]

    def _meshes(self, shape: Statement) -> dict[str, tuple[Mesh, Array]]:
        """The meshes of a shape by the names of parts, each with its place (4, 4) in the shape's space."""
        if shape.kind == "plymesh":
            return self._meshes_of_file(shape)
        if shape.kind in ("trianglemesh", "bilinearmesh", "loopsubdiv"):
            mesh = _listed_mesh(shape)
            return {} if mesh is None else {"": (mesh, np.eye(4))}
        if shape.kind in ("sphere", "disk", "cylinder"):
            return {"": _round(shape)}
        import_report.left_out(f"{shape}: shapes of that type are not read")
        return {}

    def _meshes_of_file(self, shape: Statement) -> dict[str, tuple[Mesh, Array]]:
        name = shape.text("filename")
        if shape.has("displacement"):
            shape.ignore("displacement", "edgelength")
            import_report.left_out(f"displacement of {shape}: surfaces are not displaced")
        try:
            if name.endswith(".gz"):
                raise InputError(f"{name}: compressed files are not read; unpack it")
            with reading_with(replace(current_options(), materials=False)):
                parts = mesh_files.load_file(self._document.file(name)).parts
        except InputError as error:
            import_report.left_out(f"{shape}: {error}")
            return {}
        bottom = [[0.0, 0.0, 0.0, 1.0]]
        return {
            part.name or "": (_uncolored(part.mesh), np.vstack([part.transform.world_from_object, bottom]))
            for part in parts
        }


def _uncolored(mesh: Mesh) -> Mesh:
    """Colours of vertices tint nothing there."""
    return mesh if mesh.colors is None else replace(mesh, colors=None, source=MeshSource())


def _listed_mesh(shape: Statement) -> Mesh | None:
    """A mesh whose vertices stand in the scene file."""
    vertices, normals = shape.vectors("P"), shape.vectors("N")
    if vertices is None:
        raise InputError("P: is missing; a mesh has points")
    uvs = next((found for name in ("uv", "st") if (found := shape.vectors(name, 2)) is not None), None)
    shape.ignore("S", "faceIndices", "levels", "scheme", "emissionfilename")
    if shape.kind == "bilinearmesh":
        patches = shape.indices("indices", 4)
        patches = np.arange(len(vertices) // 4 * 4).reshape(-1, 4) if patches is None else patches
        # Corners stand there as 00, 10, 01, 11.
        faces = np.concatenate([patches[:, [0, 1, 3]], patches[:, [0, 3, 2]]])
        import_report.changed(f"{shape}: curved patches are two triangles each")
    else:
        triangles = shape.indices("indices", 3)
        faces = np.arange(len(vertices) // 3 * 3).reshape(-1, 3) if triangles is None else triangles
    if shape.kind == "loopsubdiv":
        import_report.changed(f"{shape}: is not subdivided")
    for name, values in (("N", normals), ("uv", uvs)):
        if values is not None and len(values) != len(vertices):
            raise InputError(f"{name}: holds {len(values)} for {len(vertices)} points")
    # (0, 0) is at the bottom left of an image there.
    attributes = VertexAttributes(() if uvs is None else (uvs * [1, -1] + [0, 1],))
    counts: dict[str, int] = {}
    mesh = usable_mesh(vertices, faces, normals, counts, attributes)
    try:
        tell_of_faces(counts)
    except InputError as error:
        import_report.left_out(f"{shape}: {error}")
    return mesh


def _round(shape: Statement) -> tuple[Mesh, Array]:
    """A sphere, a disk or a cylinder, whole, and its place (4, 4)."""
    radius, matrix = shape.number("radius", 1.0, 0.0), np.eye(4)
    parts: dict[str, Any] = {"sphere": ("zmin", "zmax"), "disk": ("innerradius",), "cylinder": ()}
    cut = [name for name in (*parts[shape.kind], "phimax") if shape.has(name)]
    shape.ignore(*cut)
    if cut:
        import_report.changed(f"{', '.join(cut)} of {shape}: the shape is whole")
    if shape.kind == "sphere":
        matrix[:3] = primitive_shapes.SPHERE_FROM_OURS * radius
        return primitive_shapes.sphere(), matrix
    if shape.kind == "disk":
        matrix[:3] = np.diag([radius, radius, 1.0, 0])[:3]
        matrix[2, 3] = shape.number("height", 0.0)
        return _disk(), matrix
    low, high = shape.number("zmin", -1.0), shape.number("zmax", 1.0)
    matrix[:3] = np.diag([radius, radius, high - low, 0])[:3]
    matrix[2, 3] = low
    return _cylinder(), matrix


@cache
def _disk() -> Mesh:
    """With u as the share of a turn, and v from the rim to the middle."""
    disk = primitive_shapes.disk()
    return replace(disk, uvs=(disk.uvs[0][..., ::-1],))


@cache
def _cylinder() -> Mesh:
    """With v upwards."""
    cylinder = primitive_shapes.cylinder()
    flipped = cylinder.uvs[0] * np.array([1, -1], np.float32) + np.array([0, 1], np.float32)
    return replace(cylinder, uvs=(flipped,))
