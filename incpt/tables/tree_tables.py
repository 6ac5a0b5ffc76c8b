"""The light tree of a scene on the device, and when there is one.

A tree costs a descent for each light sample, so that few lights have a table of chances instead. From
`LEAST_LAMPS` lamps on the tree is quicker, because rays no longer go over all lights; a mesh that shines is
one lamp. From `LEAST_TRIANGLES` triangles on it is worth its time by the noise that it saves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import layout
from incpt.device.device import Device
from incpt.scene.model import Object
from incpt.tables import light_tree
from incpt.tables.light_tree import LightTree, TreeLights, merged_cones

Array = npt.NDArray[np.float64]

LEAST_LAMPS = 32
"""From how many lamps on lights have a tree: lights of their own, and objects that shine."""
LEAST_TRIANGLES = 16_384
"""From how many emissive triangles on."""


def takes_tree(lamps: int, triangles: int) -> bool:
    """Whether so many lights are chosen by a tree."""
    return lamps >= LEAST_LAMPS or triangles >= LEAST_TRIANGLES


@dataclass(frozen=True, eq=False)
class Emitters:
    """Where N emissive triangles come from, and what the tree needs to know of them.

    corners       (S, N, 3, 3) in the one scene or in both of which they are lights
    power         (N,) by which they are chosen
    double_sided  (N,) whether both sides shine, in any of the scenes
    names         of objects
    owner         (N,) the object of each triangle in `names`
    face          (N,) its number in the mesh
    present       (N,) whether the scene at hand has it
    """

    corners: Array
    power: Array
    double_sided: npt.NDArray[np.bool_]
    names: Sequence[str]
    owner: npt.NDArray[np.integer]
    face: npt.NDArray[np.integer]
    present: npt.NDArray[np.bool_]

    def tree_lights(self, first: int) -> TreeLights:
        """The triangles as the tree takes them; the first has the number `first`."""
        count = len(self.power)
        bounds = np.stack([self.corners.min(axis=(0, 2)), self.corners.max(axis=(0, 2))], axis=1)
        axis, spread = _normals(self.corners[0]), np.where(self.double_sided, np.pi, 0.0)
        if len(self.corners) > 1:
            axis, spread = merged_cones((axis, spread), (_normals(self.corners[1]), spread))
        sides = np.where(self.double_sided, 2, 1)
        numbers = np.arange(first, first + count, dtype=np.uint32)
        right_angle = np.full(count, np.pi / 2)
        return TreeLights(
            bounds, axis, spread, right_angle, self.power / sides, np.zeros(count, np.bool_), numbers
        )


NO_EMITTERS = Emitters(
    np.zeros((1, 0, 3, 3)), np.zeros(0), np.zeros(0, np.bool_), (), np.zeros(0, np.int64),
    np.zeros(0, np.int64), np.zeros(0, np.bool_),
)  # fmt: skip


def _normals(corners: Array) -> Array:
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(normal / np.linalg.norm(normal, axis=1)[:, None])


@dataclass(frozen=True, eq=False)
class TreeTables:
    """The tree on a device: the buffers, by name; the chance that light sampling chooses by it; and how many
    levels it has, 0 where there is none."""

    buffers: Mapping[str, cl.Buffer] = field(default_factory=dict)
    probability: float = 0.0
    levels: int = 0


def no_tree(device: Device) -> TreeTables:
    """What kernels get that know of no tree."""
    known = _NO_TREES.get(device)
    if known is None:
        buffer = device.upload(np.zeros(1, layout.LIGHT_NODE))
        known = TreeTables(
            dict.fromkeys(("light_nodes", "light_boxes", "first_trail", "face_trails"), buffer)
        )
        _NO_TREES[device] = known
    return known


_NO_TREES: WeakKeyDictionary[Device, TreeTables] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class TreeBuffers:
    """A tree over the lights of one scene, or of two that are compared: its buffers, by name, how many levels
    it has, and the trails of lights of their own and of triangles."""

    buffers: Mapping[str, cl.Buffer]
    levels: int
    shaped_trails: npt.NDArray[np.uint32]
    triangle_trails: npt.NDArray[np.uint32]

    @classmethod
    def of(cls, device: Device, shaped: TreeLights, triangles: TreeLights) -> TreeBuffers:
        """The tree over these lights, one at least. Raises DeviceError."""
        lights = TreeLights.joined([shaped, triangles])
        tree: LightTree = light_tree.build(lights)
        buffers = {"light_nodes": device.upload(tree.nodes), "light_boxes": device.upload(tree.boxes)}
        count = len(shaped.numbers)
        levels = light_tree.level_count(len(lights.numbers))
        return cls(buffers, levels, tree.trails[:count], tree.trails[count:])

    def tables(
        self, device: Device, emitters: Emitters, objects: tuple[Object, ...], probability: float
    ) -> TreeTables:
        """What a scene with these objects needs of it, whose emissive triangles are `emitters`."""
        first, of_faces = _face_trails(emitters, self.triangle_trails, objects)
        own = {"first_trail": device.upload(first), "face_trails": device.upload(of_faces)}
        return TreeTables({**self.buffers, **own}, probability, self.levels)


def _face_trails(
    emitters: Emitters, trails: npt.NDArray[np.uint32], objects: tuple[Object, ...]
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint32]]:
    """Where the faces of each object begin (objects,), and the trail and 1 over the chance by power alone of
    every face (faces, FACE_TRAIL_SIZE)."""
    place, begins = 0, {}
    first = np.full(max(len(objects), 1), layout.NO_INDEX, np.uint32)
    owners = {name: i for i, name in enumerate(emitters.names)}
    lit = set(np.unique(emitters.owner[emitters.present]).tolist())
    for i, obj in enumerate(objects):
        owner = owners.get(obj.name)
        if owner is not None and owner in lit:
            first[i] = begins[owner] = place
            place += len(obj.mesh.faces)
    of_faces = np.zeros((max(place, 1), layout.FACE_TRAIL_SIZE), np.uint32)
    if lit:
        shown = emitters.present
        begin = np.zeros(len(emitters.names), np.int64)
        begin[list(begins)] = list(begins.values())
        rows = begin[emitters.owner[shown]] + emitters.face[shown]
        of_faces[rows, 0] = trails[shown]
        inverse = (emitters.power.sum() / emitters.power[shown]).astype(np.float32)
        of_faces[rows, 1] = inverse.view(np.uint32)
    return first, of_faces
