"""A scene as the kernels see it: immutable tables over the geometry that scenes of a device share.

After an edit, `tables_of` makes the tables of the new scene from those of the old one. They share every part
that the edit leaves alone. `_REBUILT_BY` is the one table that says which change makes which part anew.
Moving an object makes the objects and the top level, a material edit the materials. A camera move makes
nothing, since the camera travels with the parameters of every launch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar
from weakref import WeakKeyDictionary, WeakValueDictionary

import pyopencl as cl

from incpt.core import layout
from incpt.core.affine import Vector
from incpt.core.layout import TextureSlot
from incpt.scene.change import Change, diff
from incpt.scene.contacts import grown_bodies
from incpt.scene.enclosing import transparent_bodies_around
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Scene
from incpt.tables.alias import luminance
from incpt.tables.attributes import AttributeTable, attribute_table
from incpt.tables.environment import EnvironmentTables, environment_tables
from incpt.tables.geometry_pool import GeometryPool, PooledMesh
from incpt.tables.light_pairs import has_same_emitters, paired_light_tables
from incpt.tables.lights import LightTables, light_tables
from incpt.tables.materials import MaterialTables, material_tables
from incpt.tables.object_table import NO_OBJECTS, PlacedObjects
from incpt.tables.textures import TextureTables, texture_tables
from incpt.tables.top_level import TopLevelTables, top_level_tables

_Part = TypeVar("_Part")


@dataclass(frozen=True, eq=False)
class SceneTables:
    """What the kernels read of `scene`, in parts. Made by `tables_of`, or by `paired_tables`.

    unpaired: the tables that the scene has alone, where these choose lights together with another scene.
    """

    pool: GeometryPool
    scene: Scene
    meshes: Mapping[Mesh, PooledMesh]
    objects: PlacedObjects
    top_level: TopLevelTables
    environment: EnvironmentTables
    textures: TextureTables
    attributes: AttributeTable
    lights: LightTables
    materials: MaterialTables
    unpaired: SceneTables | None = None

    def buffer(self, name: str) -> cl.Buffer:
        """One of the buffers: nodes, objects, materials, layers ... as it is now; see GeometryPool.buffer."""
        # These may be others after a pool has moved what it holds.
        if name in ("objects", "textures", "attributes"):
            placed: PlacedObjects | TextureTables | AttributeTable = getattr(self, name)
            return placed.buffer
        if name == "block_nodes" and not self.is_brute_force:
            name = "top_nodes"
        if name == "texels":
            return self.textures.pool.texels
        return self._own_buffers.get(name) or self.pool.buffer(name)

    @cached_property
    def _own_buffers(self) -> Mapping[str, cl.Buffer]:
        """Those that never change, since no other scene has a part in them."""
        parts = (self.top_level, self.environment, self.textures.pool, self.lights, self.materials)
        return {name: buffer for part in parts for name, buffer in part.buffers.items()}

    @cached_property
    def features(self) -> tuple[str, ...]:
        """The preprocessor names that choose a variant of the shading kernels."""
        names = {
            "ENVIRONMENT_IMAGE": self._has_image_light,
            "SUN": self._has_image_light and self.scene.environment.has_sun,
            "TRIANGLE_LIGHTS": self.light_count > 0,
            "SHAPED_LIGHTS": self.lights.shaped.count > 0,
            "LIGHT_TREE": self.lights.tree.levels > 0,
        }
        return tuple(name for name, holds in names.items() if holds)

    @property
    def variant(self) -> tuple[str, ...]:
        """What chooses the variants of all kernels that this scene needs: what there is, and what is left out
        of describing a hit and of shading."""
        materials, top_level = self.materials, self.top_level
        names = {
            "MEDIA": materials.has_media,
            "TOP_LEVEL_ONLY": top_level.all_in_world_space,
            "FLAT": self._is_flat,
            "SMOOTH_MEDIA": materials.has_media and materials.is_media_smooth,
            "CLEAR_MEDIA": materials.has_media and materials.is_media_clear,
            "MATTE": materials.is_matte,
            "BRUTE_FORCE": self.is_brute_force,
            "CUTOUTS": materials.has_cutouts,
            "VERTEX_COLORS": self.attributes.has_colors,
            "LENS": self.scene.camera.is_orthographic
            or self.scene.camera.has_lens
            or self.scene.camera.near > 0,
        }
        numbers = {"TEXTURES": self.textures.slots, "TRAITS": materials.traits}
        numbered = (f"{name} {bits}u" for name, bits in numbers.items() if bits)
        return (*self.features, *numbered, *(name for name, holds in names.items() if holds))

    @property
    def has_media(self) -> bool:
        """Whether any material lets light through."""
        return self.materials.has_media

    @property
    def has_trees(self) -> bool:
        """Whether rays go through trees, beside what is tested by brute force."""
        return not (self.top_level.all_in_world_space and self.is_brute_force)

    @property
    def is_brute_force(self) -> bool:
        """Whether blocks of paths test small meshes without a tree. Rays that may go on behind a hit take
        trees, where few of many rays are traced again."""
        return self.top_level.is_brute_force and not self.materials.has_cutouts

    @property
    def cluster_count(self) -> int:
        """Of the tables for brute force."""
        return self.top_level.cluster_count

    @property
    def light_count(self) -> int:
        """Of the triangles from which light sampling chooses."""
        return self.lights.count

    @property
    def environment_probability(self) -> float:
        """The chance that light sampling turns to the environment."""
        return self.lights.environment_probability

    @property
    def sun_probability(self) -> float:
        """The chance that samples of the environment turn to the sun of its sky, where that shines: its share
        of the light, but neither forgets the other."""
        sky = self.scene.environment.sky
        if sky is None or not sky.has_sun:
            return 0.0
        sun = float(luminance(sky.sun_irradiance))
        return min(max(sun / (sun + self.environment.irradiance), 0.1), 0.9)

    @property
    def environment_radiance(self) -> Vector:
        """The constant radiance of the environment, or the factor of its image."""
        environment = self.scene.environment
        # An image that is black all over has no table, and is not told from a missing one on the device.
        black = environment.picture is not None and not self.environment.has_image
        return (0.0, 0.0, 0.0) if black else environment.radiance

    @cached_property
    def camera_media(self) -> tuple[int, int]:
        """The stack of media around the camera, as the planes MEDIUM_0 and MEDIUM_1 of a path hold it."""
        scene, numbers = self.scene, {name: i for i, name in enumerate(self.scene.materials)}
        stack: list[int] = []
        materials = list(scene.materials.values())
        if self.has_media:
            for obj in transparent_bodies_around(scene, scene.camera.start):
                medium = numbers[obj.material]
                priority = _rank(materials[medium])
                below = [i for i, other in enumerate(stack) if _rank(materials[other]) <= priority]
                stack.insert(below[0] if below else len(stack), medium)
        stack = [*stack, *[layout.MEDIUM_NONE] * layout.MEDIUM_STACK_SIZE][: layout.MEDIUM_STACK_SIZE]
        upper, lower = (stack[i] | stack[i + 1] << layout.MEDIUM_HIGH.shift for i in (0, 2))
        return upper, lower

    @cached_property
    def _is_flat(self) -> bool:
        bend = (TextureSlot.NORMAL, TextureSlot.CLEARCOAT_NORMAL, TextureSlot.BUMP)
        bends = any(self.textures.has(slot) for slot in bend)
        return not bends and all(mesh.normals is None for mesh in self.meshes)

    @property
    def _has_image_light(self) -> bool:
        return _has_image_light(self.scene, self.environment)


def _rank(material: Material) -> float:
    """By which media win over each other: see Material."""
    return material.priority or float("inf")


def tables_of(pool: GeometryPool, scene: Scene, previous: SceneTables | None = None) -> SceneTables:
    """The tables of a scene. They share what has not changed with `previous`, those of the scene before.

    While tables of the same Scene live on this pool, they are those: a split view makes them once. Raises
    DeviceError where the device has no room for them; nothing has changed for others then.
    """
    living = _LIVING.setdefault(pool, WeakValueDictionary())
    tables = living.get(id(scene))
    if tables is None:
        tables = living[id(scene)] = _make(pool, scene, previous)
    return tables


def paired_tables(
    pool: GeometryPool, old: Scene, new: Scene, previous: SceneTables | None = None
) -> tuple[SceneTables, SceneTables]:
    """The tables of two scenes which choose among the same lights with the same chances; see `light_pairs`.
    Where their lights are the same anyway these are what `tables_of` gives, and where only one of them has
    light from an image around, which changes all chances; else they share all but lights and materials with
    that. Raises DeviceError."""
    first = tables_of(pool, old, previous)
    second = tables_of(pool, new, first)
    device, has_image = pool.device, first._has_image_light
    if has_same_emitters(old, new) or has_image != second._has_image_light:
        return first, second
    textures = first.textures, second.textures
    pairs = zip((first, second), paired_light_tables(device, old, new, has_image, textures), strict=True)
    before, after = (
        replace(
            tables,
            lights=lights,
            materials=material_tables(device, tables.scene.materials, lights.densities, tables.textures),
            unpaired=tables,
        )
        for tables, lights in pairs
    )
    return before, after


def _make(pool: GeometryPool, scene: Scene, previous: SceneTables | None) -> SceneTables:
    if previous is not None:
        previous = previous.unpaired or previous
    change = None if previous is None else diff(previous.scene, scene)
    device, limit = pool.device, scene.settings.texture_limit
    has_other_limit = previous is not None and previous.scene.settings.texture_limit != limit

    # Bodies in contact depend on each other, and on what they are made of.
    may_grow = (
        previous is not None
        and change is not None
        and bool(change.materials)
        and bool(grown_bodies(previous.scene) or grown_bodies(scene))
    )

    def part(name: str, make: Callable[[], _Part]) -> _Part:
        if change is None or _REBUILT_BY[name](change) or (may_grow and name in _PLACED):
            return make()
        if has_other_limit and name in _OF_TEXTURES:
            return make()
        kept: _Part = getattr(previous, name)
        return kept

    def hold() -> Mapping[Mesh, PooledMesh]:
        if previous is not None and change is not None:
            for name in change.deformed:
                pool.refit(previous.scene.object(name).mesh, scene.object(name).mesh)
        return pool.hold(dict.fromkeys(obj.mesh for obj in scene.objects))

    def place() -> PlacedObjects:
        before = NO_OBJECTS if previous is None else previous.objects.table
        return PlacedObjects(pool, meshes, before.follow(scene, meshes, pool.packings))

    pool.shrink()
    meshes = part("meshes", hold)
    objects = part("objects", place)
    top_level = part(
        "top_level",
        lambda: top_level_tables(device, objects.table, lambda mesh: meshes[mesh].built.quads(mesh)),
    )
    environment = part(
        "environment",
        lambda: environment_tables(device, scene.environment.picture, scene.environment.has_sun),
    )
    textures = part("textures", lambda: texture_tables(device, scene.materials, limit))
    attributes = part("attributes", lambda: attribute_table(pool, scene, meshes, textures.slots != 0))
    # Lights need the environment, and materials the densities of the lights; both need the textures.
    has_image_light = _has_image_light(scene, environment)
    lights = part("lights", lambda: light_tables(device, scene, has_image_light, textures))
    materials = part(
        "materials", lambda: material_tables(device, scene.materials, lights.densities, textures)
    )
    return SceneTables(
        pool, scene, meshes, objects, top_level, environment, textures, attributes, lights, materials
    )


def _has_image_light(scene: Scene, environment: EnvironmentTables) -> bool:
    """Whether light sampling may choose the environment."""
    return environment.has_image and any(scene.environment.radiance)


def _shapes_changed(change: Change) -> bool:
    return bool(change.added or change.removed or change.deformed or change.reshaped)


def _places_changed(change: Change) -> bool:
    return bool(_shapes_changed(change) or change.moved or change.reordered)


def _objects_changed(change: Change) -> bool:
    return bool(_places_changed(change) or change.reassigned or change.materials_added_or_removed)


def _emission_changed(change: Change) -> bool:
    # Whatever may touch an emissive triangle; cheap where there are few of them.
    return bool(change.objects or change.reordered or change.environment or change.environment_image
                or change.lights or _materials_changed(change))  # fmt: skip


def _materials_changed(change: Change) -> bool:
    return bool(change.materials or change.materials_added_or_removed)


def _attributes_changed(change: Change) -> bool:
    return bool(
        _shapes_changed(change) or change.reordered or change.reassigned or _materials_changed(change)
    )


_REBUILT_BY: Mapping[str, Callable[[Change], bool]] = {
    "meshes": _shapes_changed,
    "objects": _objects_changed,
    "top_level": _places_changed,
    "environment": lambda change: change.environment_image,
    "textures": _materials_changed,
    "attributes": _attributes_changed,
    "lights": _emission_changed,
    "materials": _emission_changed,
}
"""Which change makes which part of the tables anew."""
_OF_TEXTURES = ("textures", "attributes", "lights", "materials")
"""Parts that depend on how large textures are."""

_PLACED = ("objects", "top_level")
"""The parts that depend on where objects are."""

_LIVING: WeakKeyDictionary[GeometryPool, WeakValueDictionary[int, SceneTables]] = WeakKeyDictionary()
"""The tables that live on each pool, by the identity of their scene, which they hold."""
