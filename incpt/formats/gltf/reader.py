"""Whole glTF files: the scene that they show as meshes, lights and cameras, and what became of the rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.formats import import_report
from incpt.formats.clean import tell_of_faces, usable_mesh
from incpt.formats.gltf import primitives
from incpt.formats.gltf.accessors import Accessors
from incpt.formats.gltf.animation import animate
from incpt.formats.gltf.cameras import camera_of
from incpt.formats.gltf.compression import DRACO
from incpt.formats.gltf.document import Document
from incpt.formats.gltf.lights import light_of, watts_of
from incpt.formats.gltf.materials import Materials
from incpt.formats.gltf.nodes import Node, Nodes, instances
from incpt.formats.gltf.table import Table
from incpt.formats.gltf.textures import Textures
from incpt.formats.import_options import current_options
from incpt.formats.import_report import counted
from incpt.formats.names import Names
from incpt.formats.placement import placed_arrays, transform_of
from incpt.formats.reading_progress import each
from incpt.formats.shared_meshes import MOST_PARTS, bounds_of, settled
from incpt.scene.camera import Camera
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.mesh_part import MeshFile, MeshPart
from incpt.scene.model import CAMERA_NAME
from incpt.scene.transform import IDENTITY


def read_gltf(path: Path) -> MeshFile:
    """What a .gltf or .glb file shows: the nodes of its default scene. Raises InputError."""
    document = Document(path)
    document.check_extensions()
    accessors = Accessors(document)
    options = current_options()
    animate(options.time, options.clip, document, accessors)
    nodes = Nodes(document)
    in_scene = nodes.in_scene()
    parts = _Parts(document, accessors, nodes).of(in_scene)
    bounds = bounds_of(parts)
    lights = tuple(light for node in in_scene if (light := light_of(node, document)) is not None)
    if lights:
        factor = "" if watts_of(document) == 1 else ", 683 of them for one, as Blender's exporter has them"
        import_report.changed(f"the units of lights: candela and lux are taken for W / sr and W / m²{factor}")
    cameras: dict[str, Camera] = {}
    # Under the name that is left out stands the camera of files that have none.
    names = Names(CAMERA_NAME)
    for node in in_scene:
        found = camera_of(node, document, bounds)
        if found is not None:
            cameras[names.new(found[0])] = found[1]
    _tell_of_variants(document)
    meshes = len({id(part.mesh) for part in parts})
    counts = {"object": len(parts), "mesh": meshes, "light": len(lights), "camera": len(cameras)}
    import_report.read(", ".join(counted(count, what) for what, count in counts.items() if count))
    return settled(path, MeshFile(parts, lights, cameras, tuple(document.files)))


def _tell_of_variants(document: Document) -> None:
    table = document.root.extension("KHR_materials_variants")
    names = [one.text("name") for one in table.tables("variants")]
    if names:
        listed = ", ".join(map(repr, names[:8])) + (", …" if len(names) > 8 else "")
        import_report.left_out(f"variants of materials ({listed}): the default is used")


@dataclass(frozen=True, eq=False)
class _Placed:
    """A primitive at a place (4, 4) of the scene, under the name of a part. `label` is that of its mesh.
    `joints` (J, 4, 4) are those of a skin, which alone say where its vertices are."""

    name: str
    label: str
    primitive: Table
    matrix: npt.NDArray[np.float64]
    is_visible: bool
    weights: tuple[float, ...]
    skin: int | None
    joints: npt.NDArray[np.float64] | None


class _Parts:
    """Makes parts of nodes: each geometry is one mesh, however many nodes show it."""

    def __init__(self, document: Document, accessors: Accessors, nodes: Nodes) -> None:
        self._document, self._accessors, self._nodes = document, accessors, nodes
        self._materials = Materials(document, Textures(document, accessors))
        self._counts: dict[str, int] = {}
        self._meshes: dict[object, Mesh | None] = {}
        self._names, self._labels = Names(), Names()
        self._joints: dict[int, npt.NDArray[np.float64]] = {}
        self._without_area: dict[str, None] = {}

    def of(self, nodes: Sequence[Node]) -> tuple[MeshPart, ...]:
        """The parts that nodes show. Raises InputError where no face is left."""
        shown = (one for node in nodes if "mesh" in node.table for one in self._placed(node))
        placed = list(islice(shown, MOST_PARTS + 1))
        if len(placed) > MOST_PARTS:
            raise InputError(f"shows more than {MOST_PARTS:,} meshes; split it")
        if not placed and self._without_area:
            raise InputError(f"has no usable face (no {' or '.join(self._without_area)} have area)")
        parts = [part for one in each(placed) if (part := self._part(one)) is not None]
        tell_of_faces(self._counts)
        if len(placed) == 1:
            parts = [replace(parts[0], name=None)]
        return tuple(parts)

    def _placed(self, node: Node) -> Iterator[_Placed]:
        """Every primitive that has area of the mesh of a node, at each place where the node shows it."""
        number = node.table.whole("mesh", 0, 1 << 31)
        table = self._document.item("meshes", number)
        label = table.text("name") or f"mesh {number}"
        shown = [one for one in table.tables("primitives") if self._has_area(one, label)]
        is_bent = any("JOINTS_0" in primitive.table("attributes") for primitive in shown)
        skin = node.table.index("skin") if is_bent else None
        if skin is not None:
            matrices, joints = np.eye(4)[None], self._joints_of(skin)
        else:
            found = instances(node.table, self._accessors)
            matrices, joints = node.world[None] if found is None else node.world @ found, None
        weights = _weights(node.table if "weights" in node.table else table)
        is_one = len(shown) * len(matrices) == 1
        for matrix in matrices:
            for place, primitive in enumerate(shown, 1):
                name = self._names.new(node.name) if is_one else self._names.numbered(node.name)
                mesh = label if len(shown) == 1 else f"{label}.{place}"
                yield _Placed(name, mesh, primitive, matrix, node.is_visible, weights, skin, joints)

    def _has_area(self, primitive: Table, label: str) -> bool:
        kind = primitives.without_area(primitive)
        if kind is not None:
            self._without_area[kind] = None
            import_report.left_out(f"{kind} of mesh {label!r}: have no area")
        for name in primitives.unread_attributes(primitive):
            import_report.left_out(f"{name} of mesh {label!r}: is a set of values more than are read")
        return kind is None

    def _joints_of(self, number: int) -> npt.NDArray[np.float64]:
        """(J, 4, 4) what takes points of a mesh at rest to the world by each joint of a skin."""
        if number not in self._joints:
            table = self._document.item("skins", number)
            with table.in_messages():
                numbers = table.indices("joints")
                if not numbers or max(numbers) >= len(self._nodes.worlds):
                    raise InputError("joints: are none, or not among the nodes; the file is damaged")
                joints = np.stack([self._nodes.worlds[joint] for joint in numbers])
                inverse = table.index("inverseBindMatrices")
                if inverse is not None:
                    stored = self._accessors.doubles(inverse, 16)
                    if len(stored) < len(joints):
                        raise InputError("inverseBindMatrices: are fewer than joints; the file is damaged")
                    # Matrices are stored column by column. What is not finite ends in vertices that are
                    # left out.
                    with np.errstate(all="ignore"):
                        joints = joints @ stored[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
            self._joints[number] = joints
        return self._joints[number]

    def _part(self, placed: _Placed) -> MeshPart | None:
        """The part of a placed primitive; None where no face of it is left."""
        material = placed.primitive.index("material")
        name, made = (None, None) if material is None else self._materials.named(material)
        transform = transform_of(placed.matrix)
        if transform is None:
            text = f"the placement of {placed.name!r}: flattens it, so it stands in the vertices"
            import_report.changed(text)
            mesh, transform = self._mesh(placed, placed.matrix), IDENTITY
        else:
            key = (*_geometry_key(placed.primitive), placed.weights, placed.skin)
            if key not in self._meshes:
                self._meshes[key] = self._mesh(placed, np.eye(4))
            mesh = self._meshes[key]
        if mesh is None:
            return None
        return MeshPart(placed.name, mesh, name, made, transform, placed.is_visible)

    def _mesh(self, placed: _Placed, matrix: npt.NDArray[np.float64]) -> Mesh | None:
        """The mesh of a primitive, under a matrix; None where no face is left."""
        primitive, accessors = placed.primitive, self._accessors
        found = primitives.triangles(primitive, accessors)
        found = primitives.morphed(found, primitive, placed.weights, accessors)
        if placed.joints is not None and "JOINTS_0" in primitive.table("attributes"):
            found = primitives.skinned(found, primitive, placed.joints, accessors)
        arrays = placed_arrays(found.positions, found.faces, found.normals, matrix)
        mesh = usable_mesh(*arrays, self._counts, found.other.placed(matrix[:3, :3]))
        if mesh is None:
            return None
        return replace(mesh, source=MeshSource(geometry=self._labels.new(placed.label)))


def _weights(owner: Table) -> tuple[float, ...]:
    """Those of morph targets that a node or a mesh has."""
    return owner.numbers("weights", (0.0,) * len(owner.entries("weights")))


def _geometry_key(primitive: Table) -> tuple[object, ...]:
    """The same for primitives that differ in nothing but their materials."""
    draco = primitive.extension(DRACO)
    return (primitive.described("attributes", "indices", "mode", "targets"), draco.described("bufferView"))
