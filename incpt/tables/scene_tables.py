"""The scene on the device, kept up to date with the least work.

`_PARTS` is the one table that says which change rebuilds what. Moving an object rewrites the objects and
the top level; a material edit rewrites the material table; a camera move rewrites nothing here, since the
camera travels with the parameters of every launch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import compress, count
from operator import is_not
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.accel import bvh, clusters, quads, top_level
from incpt.core import layout, transform
from incpt.core.transform import Vector
from incpt.device.device import Device
from incpt.scene.change import Change, diff
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.tables import albedo, lights

_NOT_MOVED = np.eye(3, 4)
_MOST_FACES_ON_TOP = 512
_MOST_FACES_IN_ALL_ON_TOP = 4096
"""Of one object, and of all, that stand in the top level themselves."""
_HIDDEN = np.iinfo(np.int64).max
"""The size of an object that is not seen."""


@dataclass(frozen=True, eq=False)
class _ObjectTable:
    """What the device knows of each object, kept so that an edit of one among thousands describes that one.

    rows      (N,) layout.OBJECT.
    bounds    (N, 2, 3) in world space.
    sizes     (N,) faces of those that are seen, else _HIDDEN.
    vertices  (V, 3) in world space, of the objects whose triangles are part of the top level, smallest first.
    places    what `rows` was filled in by, beside the objects: see `DeviceScene._build_objects`.
    """

    objects: tuple[Object, ...]
    rows: npt.NDArray[np.void]
    bounds: npt.NDArray[np.float64]
    sizes: npt.NDArray[np.int64]
    vertices: dict[int, npt.NDArray[np.float32]]
    places: object = None

    def follow(
        self,
        objects: tuple[Object, ...],
        places: object,
        fill: Callable[[npt.NDArray[np.void], Object], None],
    ) -> _ObjectTable:
        """The table of other objects; those that are the same are not described again, and filled in again
        only for other `places`."""
        source = self._source(objects)
        known = np.flatnonzero(source >= 0)
        sizes = np.empty(len(objects), np.int64)
        sizes[known] = self.sizes[source[known]]
        for at in np.flatnonzero(source < 0):
            obj = objects[at]
            sizes[at] = len(obj.mesh.faces) if obj.visible else _HIDDEN
        on_top = _objects_on_top(sizes)
        vertices = {
            i: self.vertices[source[i]] if source[i] in self.vertices else _world_vertices(objects[i])
            for i in on_top
        }
        is_on_top, was_on_top = np.zeros(len(objects), np.bool_), np.zeros(len(self.objects), np.bool_)
        is_on_top[on_top] = True
        was_on_top[list(self.vertices)] = True
        same = known[was_on_top[source[known]] == is_on_top[known]]
        rows, bounds = np.zeros(len(objects), layout.OBJECT), np.zeros((len(objects), 2, 3))
        rows[same], bounds[same] = self.rows[source[same]], self.bounds[source[same]]
        other: list[int] = _all_but(len(objects), same).tolist()
        for i in other:
            _describe(objects[i], vertices.get(i), rows[i])
            bounds[i] = objects[i].world_bounds
        for i in other if places == self.places else range(len(objects)):
            fill(rows[i], objects[i])
        return _ObjectTable(objects, rows, bounds, sizes, vertices, places)

    def _source(self, objects: tuple[Object, ...]) -> npt.NDArray[np.int64]:
        """(N,) where each object stood, -1 for those that are new."""
        if len(objects) == len(self.objects):
            changed = list(compress(count(), map(is_not, objects, self.objects)))
            if len(changed) <= 1:  # as in every drag
                source = np.arange(len(objects))
                source[changed] = -1
                return source
        known = {id(obj): i for i, obj in enumerate(self.objects)}
        return np.array([known.get(id(obj), -1) for obj in objects], np.int64)


class DeviceScene:
    """Buffers that describe a scene to the kernels; `update` follows it through edits.

    features are the preprocessor names that choose a variant of the shading kernels.
    has_media tells whether any material lets light through.
    """

    def __init__(self, device: Device, scene: Scene) -> None:
        self.device = device
        self.scene = Scene()
        self.features: tuple[str, ...] = ()
        self.has_media = False
        self.light_count = 0
        self.environment_probability = 0.0
        self._light_scale = 0.0
        self._trees: WeakKeyDictionary[Mesh, bvh.Bvh] = WeakKeyDictionary()
        self._quads: WeakKeyDictionary[Mesh, quads.Quads] = WeakKeyDictionary()
        self._places: dict[Mesh, tuple[int, int, int]] = {}
        nothing = np.zeros(0, layout.OBJECT), np.zeros((0, 2, 3)), np.zeros(0, np.int64)
        self._objects = _ObjectTable((), *nothing, {})
        self._buffers: dict[str, cl.Buffer] = {}
        self._environment: lights.EnvironmentTable | None = None
        self._rebuild(scene, [name for name, _ in _PARTS])

    def update(self, scene: Scene) -> Change:
        """Bring the device to `scene`; returns what had changed. On an error the old scene stays."""
        change = diff(self.scene, scene)
        before = self.__dict__.copy()
        self._buffers = dict(self._buffers)
        try:
            self._prepare_deformed(scene, change)
            self._rebuild(scene, [name for name, changed in _PARTS if changed(change)])
        except Exception:
            self.__dict__ = before
            raise
        return change

    @property
    def variant(self) -> tuple[str, ...]:
        """What chooses the variants of all kernels that this scene needs: what there is, and what is left out
        of describing a hit and of shading."""
        names = {
            "MEDIA": self.has_media,
            "ALL_ON_TOP": self._all_on_top,
            "FLAT": self._flat,
            "SMOOTH_MEDIA": self.has_media and self._smooth_media,
            "CLEAR_MEDIA": self.has_media and self._clear_media,
            "MATT": self._matt,
            "FEW_ON_TOP": self._few_on_top,
        }
        return (*self.features, *(name for name, holds in names.items() if holds))

    @property
    def has_trees(self) -> bool:
        """Whether rays go through trees, beside what is tested by brute force."""
        return not (self._all_on_top and self._few_on_top)

    @property
    def geometry(self) -> tuple[cl.Buffer, ...]:
        """What traversal reads: top nodes and packs, nodes, packs, objects, materials."""
        names = ("top_nodes", "top_packs", "nodes", "packs", "objects", "materials")
        return tuple(self._buffers[n] for n in names)

    @property
    def emitters(self) -> tuple[cl.Buffer, ...]:
        """Triangle lights, and the environment's image and tables."""
        names = ("lights", "environment_image", "marginal", "conditional", "texel_pdf")
        return tuple(self._buffers[n] for n in names)

    @property
    def environment_radiance(self) -> Vector:
        """The constant radiance of the environment, or the factor of its image."""
        environment = self.scene.environment
        # An image that is black all over has no table, and is not told from a missing one on the device.
        black = environment.image is not None and self._environment is None
        return (0.0, 0.0, 0.0) if black else environment.radiance

    def buffer(self, name: str) -> cl.Buffer:
        """One of the buffers: materials, layers, normals ..."""
        return self._buffers[name]

    def _rebuild(self, scene: Scene, parts: list[str]) -> None:
        self.scene = scene
        for name in parts:
            getattr(self, f"_build_{name}")()

    def _upload(self, name: str, array: npt.NDArray[np.generic]) -> None:
        self._buffers[name] = self.device.upload(np.ascontiguousarray(array))

    def _prepare_deformed(self, scene: Scene, change: Change) -> None:
        for name in change.deformed:
            mesh, old = scene.object(name).mesh, self.scene.object(name).mesh
            if mesh not in self._trees:
                self._trees[mesh] = bvh.refit_mesh(self.device, self._trees[old], mesh)

    def _tree(self, mesh: Mesh) -> bvh.Bvh:
        if mesh not in self._trees:
            self._trees[mesh] = bvh.build_mesh(self.device, mesh)
        return self._trees[mesh]

    def _build_geometry(self) -> None:
        meshes = list(dict.fromkeys(obj.mesh for obj in self.scene.objects))
        trees = [self._tree(mesh) for mesh in meshes]
        self._places = {}
        node, pack, normal = 0, 0, 0
        for mesh, tree in zip(meshes, trees, strict=True):
            has_normals = mesh.normals is not None
            self._places[mesh] = (node, pack, normal if has_normals else layout.NO_INDEX)
            node, pack = node + len(tree.nodes), pack + len(tree.packs)
            normal += mesh.normals.size if mesh.normals is not None else 0
        normals = [mesh.normals.ravel() for mesh in meshes if mesh.normals is not None]
        self._upload("nodes", _joined([tree.nodes for tree in trees], layout.NODE))
        self._upload("packs", _joined([tree.packs for tree in trees], layout.TRIANGLE_PACK))
        self._upload("normals", _joined(normals, np.dtype(np.float32)))
        self._flat = not normals

    def _build_objects(self) -> None:
        index = {name: i for i, name in enumerate(self.scene.materials)}
        places = self._places

        def fill(row: npt.NDArray[np.void], obj: Object) -> None:
            row["material"] = index[obj.material]
            row["first_node"], row["first_pack"], row["first_normal"] = places[obj.mesh]

        self._objects = self._objects.follow(self.scene.objects, (places, tuple(index)), fill)
        self._upload("objects", self._objects.rows)
        self._build_top(self._objects.vertices)

    def _build_top(self, vertices: dict[int, npt.NDArray[np.float32]]) -> None:
        """The top level; `vertices`: in world space, those of the objects whose triangles are part of it."""
        others = _all_but(len(self.scene.objects), np.array(list(vertices), np.int64))
        bounds = self._objects.bounds[others]
        meshes = [top_level.PlacedMesh(i, self.scene.objects[i].mesh, v) for i, v in vertices.items()]
        triangles = top_level.join_triangles(self.device, meshes) if meshes else None
        tree = triangles.tree if triangles else None
        brute_force = clusters.arrange(triangles, self._quads_of) if triangles else None
        self._all_on_top = len(others) == 0
        self._few_on_top = brute_force is not None
        nodes = top_level.build_top_with_triangles(self.device, bounds, others, tree)
        self._upload("top_nodes", nodes)
        self._upload("top_packs", _joined([tree.packs] if tree else [], layout.TRIANGLE_PACK))
        self._buffers["block_nodes"] = self._buffers["top_nodes"]
        if brute_force is not None:
            # Blocks of paths meet those triangles without a tree, and take it for the other objects alone.
            alone = top_level.build_top_with_triangles(self.device, bounds, others, None)
            self._upload("block_nodes", alone)
        tables = brute_force if brute_force is not None else clusters.empty_tables()
        self.cluster_count = len(tables.clusters)
        self._upload("facets", _joined([tables.quads], layout.FACET))
        self._upload("solids", _joined([tables.parallelepipeds], layout.SOLID))
        self._upload("clusters", tables.clusters)

    def _quads_of(self, mesh: Mesh) -> quads.Quads:
        if mesh not in self._quads:
            self._quads[mesh] = quads.find_quads(mesh)
        return self._quads[mesh]

    def _build_environment(self) -> None:
        image = self.scene.environment.image
        self._environment = lights.environment_table(image) if image is not None else None
        table, nothing = self._environment, np.zeros(1, np.float32)
        self._upload("environment_image", nothing if table is None or image is None else image.pixels)
        for name in ("marginal", "conditional", "texel_pdf"):
            self._upload(name, nothing if table is None else getattr(table, name))

    def _build_lights(self) -> None:
        # Emission of triangles is known before the share of the environment is, which scales the densities.
        environment = self._environment if any(self.scene.environment.radiance) else None
        emissive = {name for name, material in self.scene.materials.items() if material.is_emissive}
        has_triangles = any(obj.material in emissive and obj.visible for obj in self.scene.objects)
        share = 0.0 if not has_triangles else 0.5 if environment is not None else 1.0
        table = lights.triangle_lights(self.scene, share)
        self.light_count = table.count
        if self.light_count == 0:
            share = 0.0
        self.environment_probability = 0.0 if environment is None else 1.0 - share
        self._upload("lights", table.planes)
        self.features = (("ENVIRONMENT_IMAGE",) if environment is not None else ()) + (
            ("TRIANGLE_LIGHTS",) if self.light_count else ()
        )
        self._light_scale = share / table.total if self.light_count else 0.0

    def _build_materials(self) -> None:
        materials = list(self.scene.materials.values())
        # One row at least: rays that miss read material 0.
        rows = np.zeros(max(len(materials), 1), layout.MATERIAL)
        layers = np.zeros((len(rows), layout.ALBEDO_TABLE_SIZE + 1), np.float32)
        flags = layout.MaterialFlag
        for row, layer, material in zip(rows, layers, materials, strict=False):
            for name in ("base_color", "metallic", "emission", "roughness", "absorption", "specular", "ior",
                         "transmission", "priority"):  # fmt: skip
                row[name] = getattr(material, name)
            row["light_pdf"] = lights.radiant_weight(material) * self._light_scale
            row["flags"] = (flags.DOUBLE_SIDED if material.double_sided else 0) | (
                flags.TRANSMISSIVE if material.transmission > 0 else 0
            )
            layer[:] = albedo.layer_row(material)
        media = [material for material in materials if material.transmission > 0]
        self.has_media = bool(media)
        # Of a material that lets all light through no opaque surface is ever shaded.
        self._matt = all(m.specular == m.metallic == 0 for m in materials if m.transmission < 1)
        self._clear_media = not any(any(m.absorption) for m in media)
        self._smooth_media = all(material.roughness**2 <= layout.MIN_ALPHA for material in media)
        self._upload("materials", rows)
        self._upload("layers", layers)


def _describe(obj: Object, on_top: npt.NDArray[np.float32] | None, row: npt.NDArray[np.void]) -> None:
    """Fill a row of the table of objects with what depends on the object alone. `on_top`: its vertices in
    world space, if its triangles are part of the top level."""
    matrix = obj.world_from_object
    inverse = transform.invert_affine(matrix)
    row["world_from_object"], row["object_from_world"] = matrix.ravel(), inverse.ravel()
    if on_top is not None:
        bounds = np.stack([on_top.min(axis=0), on_top.max(axis=0)])
        row["position_error"] = bvh.position_error(bounds, _NOT_MOVED, _NOT_MOVED)
    else:
        row["position_error"] = bvh.position_error(obj.mesh.bounds, matrix, inverse)
    row["visible"] = obj.visible
    row["winding"] = np.sign(np.linalg.det(matrix[:, :3]))


def _all_but(count: int, chosen: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    left = np.ones(count, np.bool_)
    left[chosen] = False
    return np.flatnonzero(left)


def _world_vertices(obj: Object) -> npt.NDArray[np.float32]:
    vertices = obj.mesh.vertices.astype(np.float64)
    return transform.apply_affine(obj.world_from_object, vertices).astype(np.float32)


def _shape_changed(change: Change) -> bool:
    return bool(change.added or change.removed or change.deformed or change.reshaped)


def _objects_changed(change: Change) -> bool:
    return bool(change.objects or change.reordered or change.materials_added_or_removed)


def _emission_changed(change: Change) -> bool:
    # Whatever may touch an emissive triangle; cheap where there are few of them.
    return bool(change.objects or change.materials or change.environment or change.environment_image
                or change.materials_added_or_removed)  # fmt: skip


def _objects_on_top(sizes: npt.NDArray[np.int64]) -> list[int]:
    """The objects whose triangles become part of the top level, smallest first: rays need no way into the
    space of the object then. Only so many that moving one costs milliseconds."""
    small = np.flatnonzero(sizes <= _MOST_FACES_ON_TOP)
    small = small[np.argsort(sizes[small], kind="stable")]
    fitting = np.searchsorted(np.cumsum(sizes[small]), _MOST_FACES_IN_ALL_ON_TOP, side="right")
    return [int(i) for i in small[: int(fitting)]]


# What is rebuilt, and by which changes; in this order, since lights need the environment and materials
# the densities of the lights.
_PARTS: tuple[tuple[str, Callable[[Change], bool]], ...] = (
    ("geometry", _shape_changed),
    ("objects", _objects_changed),
    ("environment", lambda change: change.environment_image),
    ("lights", _emission_changed),
    ("materials", _emission_changed),
)


def _joined(arrays: Sequence[npt.NDArray[Any]], dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    # A kernel argument needs a buffer even where nobody reads it.
    joined = np.concatenate(arrays) if arrays else np.zeros(0, dtype)
    return joined if len(joined) else np.zeros(1, dtype)
