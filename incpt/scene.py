"""The immutable scene, and the difference between two of them.

An edit makes a new Scene that shares whatever did not change, so comparing parts by identity first
makes `diff` cheap, undo is a list of scenes, and nobody has to set a flag that could be forgotten.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import compress, count
from operator import is_not
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt import transform
from incpt.errors import InputError
from incpt.layout import ENVIRONMENT_MAX_SIZE, MEDIUM_NONE
from incpt.settings import RenderSettings

Vector = tuple[float, float, float]

LARGEST = 1e9
"""Bound on every length, angle and radiance: squares and products of such numbers still fit float32."""
SMALLEST_SCALE = 1e-6


@dataclass(frozen=True)
class Camera:
    """A pinhole camera. Positions in world space, metres; `fov_y` is the full vertical angle, degrees."""

    position: Vector = (0.0, 1.2, 5.0)
    target: Vector = (0.0, 1.0, 0.0)
    up: Vector = (0.0, 1.0, 0.0)
    fov_y: float = 40.0

    def __post_init__(self) -> None:
        for name in ("position", "target", "up"):
            _set_vector(self, name)
        _set_number(self, "fov_y", 0.01, 179.0)
        if math.dist(self.position, self.target) < 1e-9:
            raise InputError("target: is the same point as position; move one of them")
        if math.hypot(*self.up) < 1e-9:
            raise InputError("up: has no length; use [0, 1, 0]")


@dataclass(frozen=True, eq=False)
class Image:
    """A lat-long radiance image: `pixels` (H, W, 3) float32, linear; `source` is the file it came from.

    OpenEXR's convention: the centre looks to +z, three quarters to the right is -x, the top row is +y.
    """

    pixels: npt.NDArray[np.float32]
    source: str | None = None

    def __post_init__(self) -> None:
        pixels = np.ascontiguousarray(self.pixels, np.float32)
        if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.size == 0:
            raise InputError(f"image: has shape {pixels.shape}; an environment has shape (height, width, 3)")
        if max(pixels.shape[:2]) > ENVIRONMENT_MAX_SIZE:
            raise InputError(
                f"image: {pixels.shape[1]} x {pixels.shape[0]} pixels are more than "
                f"{ENVIRONMENT_MAX_SIZE} a side; scale it down"
            )
        if not np.isfinite(pixels).all() or pixels.min() < 0:
            raise InputError("image: holds negative, infinite or undefined radiance; repair the file")
        object.__setattr__(self, "pixels", _read_only(pixels))


@dataclass(frozen=True)
class Environment:
    """Light from far away: radiance `color` times `intensity`, times the image where there is one.

    `rotation_y` turns the image right-handed about +y, degrees.
    """

    color: Vector = (0.0, 0.0, 0.0)
    image: Image | None = None
    rotation_y: float = 0.0
    intensity: float = 1.0

    def __post_init__(self) -> None:
        _set_vector(self, "color", low=0.0)
        _set_number(self, "rotation_y", -LARGEST, LARGEST)
        _set_number(self, "intensity", 0.0, LARGEST)

    @property
    def radiance(self) -> Vector:
        """The factor of the image, or the constant radiance: color times intensity."""
        r, g, b = (c * self.intensity for c in self.color)
        return r, g, b


@dataclass(frozen=True)
class Material:
    """Terms and ranges follow glTF 2.0; see design and `cl/material.cl` for the equations.

    GGX alpha is `roughness` squared. `absorption` is per metre inside a transmissive body, `priority`
    orders nested dielectrics (the higher wins, 0 is the highest of all), `emission` is radiance, from
    the front side only unless `double_sided`. `specular` scales the dielectric layer: 0 is Lambertian.
    """

    base_color: Vector = (0.8, 0.8, 0.8)
    metallic: float = 0.0
    roughness: float = 1.0
    specular: float = 1.0
    ior: float = 1.5
    transmission: float = 0.0
    absorption: Vector = (0.0, 0.0, 0.0)
    priority: int = 0
    emission: Vector = (0.0, 0.0, 0.0)
    double_sided: bool = False

    def __post_init__(self) -> None:
        _set_vector(self, "base_color", low=0.0, high=1.0)
        for name in ("metallic", "roughness", "specular", "transmission"):
            _set_number(self, name, 0.0, 1.0)
        _set_number(self, "ior", 1.0, 100.0)
        _set_vector(self, "absorption", low=0.0)
        _set_vector(self, "emission", low=0.0)
        if isinstance(self.priority, bool) or not isinstance(self.priority, int):
            raise InputError(f"priority: {self.priority!r} is not a whole number; use one from 0 to 1000")
        if not 0 <= self.priority <= 1000:
            raise InputError(f"priority: {self.priority} is out of range; use a whole number from 0 to 1000")
        if not isinstance(self.double_sided, bool):
            raise InputError(f"double_sided: {self.double_sided!r} is not true or false")

    @property
    def is_emissive(self) -> bool:
        return any(c > 0 for c in self.emission)


@dataclass(frozen=True)
class MeshSource:
    """Where a mesh came from, which is what a scene file stores: a built-in shape, or a file and a part
    of it (a named geometry, where the file holds several). Both None: made in Python."""

    shape: str | None = None
    file: str | None = None
    part: str | None = None


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in object space: `vertices` (V, 3) float32, `faces` (F, 3) int32 counter-clockwise from
    outside, `normals` (F, 3, 3) float32 unit shading normals per corner, or None for flat faces.

    Compared by identity: objects that share one Mesh share its BVH.
    """

    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.int32]
    normals: npt.NDArray[np.float32] | None = None
    source: MeshSource = MeshSource()

    def __post_init__(self) -> None:
        vertices = np.ascontiguousarray(self.vertices, np.float32)
        faces = np.ascontiguousarray(self.faces, np.int32)
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise InputError(f"vertices: have shape {vertices.shape}; a mesh has shape (V, 3)")
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
            raise InputError(f"faces: have shape {faces.shape}; a mesh has one triangle or more, (F, 3)")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise InputError(f"faces: use a vertex outside 0 to {len(vertices) - 1}")
        if not np.isfinite(vertices).all() or np.abs(vertices).max() > LARGEST:
            raise InputError(f"vertices: hold a number that is not finite or beyond {LARGEST:g}")
        object.__setattr__(self, "vertices", _read_only(vertices))
        object.__setattr__(self, "faces", _read_only(faces))
        if self.normals is not None:
            normals = np.ascontiguousarray(self.normals, np.float32)
            if normals.shape != (len(faces), 3, 3) or not np.isfinite(normals).all():
                raise InputError(f"normals: need shape ({len(faces)}, 3, 3) and finite numbers")
            object.__setattr__(self, "normals", _read_only(normals))

    @cached_property
    def bounds(self) -> npt.NDArray[np.float32]:
        """(2, 3) least and greatest coordinates of the vertices that faces use, object space."""
        used = self.vertices[self.faces.ravel()]
        return np.stack([used.min(axis=0), used.max(axis=0)])


@dataclass(frozen=True)
class Object:
    """An instance of a mesh: material by name; position in metres, rotation in degrees (about x, then y,
    then z: R = Rz · Ry · Rx), scale by axis."""

    name: str
    mesh: Mesh
    material: str
    position: Vector = (0.0, 0.0, 0.0)
    rotation: Vector = (0.0, 0.0, 0.0)
    scale: Vector = (1.0, 1.0, 1.0)
    visible: bool = True

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise InputError(f"name: {self.name!r} is not a name; give the object a text")
        if not isinstance(self.mesh, Mesh):
            raise InputError(f"mesh: {self.mesh!r} is not a Mesh; use shape() or load_mesh()")
        if not isinstance(self.material, str):
            raise InputError(f"material: {self.material!r} is not the name of a material")
        if not isinstance(self.visible, bool):
            raise InputError(f"visible: {self.visible!r} is not true or false")
        for name in ("position", "rotation", "scale"):
            _set_vector(self, name)
        if min(abs(s) for s in self.scale) < SMALLEST_SCALE:
            raise InputError(
                f"scale: {list(self.scale)} flattens the object; use at least {SMALLEST_SCALE:g}"
            )

    @cached_property
    def world_from_object(self) -> npt.NDArray[np.float64]:
        """(3, 4) affine matrix."""
        return transform.world_from_object(self.position, self.rotation, self.scale)

    @cached_property
    def world_bounds(self) -> npt.NDArray[np.float64]:
        """(2, 3) bounds of the corners of the mesh's box, in world space."""
        corners = transform.apply_affine(self.world_from_object, transform.box_corners(self.mesh.bounds))
        return np.stack([corners.min(axis=0), corners.max(axis=0)])


@dataclass(frozen=True)
class Scene:
    """Everything that is seen. `settings` is the scene's own proposal of how to render it."""

    camera: Camera = field(default_factory=Camera)
    environment: Environment = field(default_factory=Environment)
    materials: Mapping[str, Material] = field(default_factory=dict)
    objects: tuple[Object, ...] = ()
    settings: RenderSettings = RenderSettings()

    def __post_init__(self) -> None:
        object.__setattr__(self, "materials", MappingProxyType(dict(self.materials)))
        object.__setattr__(self, "objects", tuple(self.objects))
        if len(self.materials) >= MEDIUM_NONE:
            raise InputError(f"materials: {len(self.materials)} are more than {MEDIUM_NONE - 1}; merge some")
        seen: set[str] = set()
        for obj in self.objects:
            if obj.name in seen:
                raise InputError(f"objects: two are named {obj.name!r}; rename one of them")
            seen.add(obj.name)
            if obj.material not in self.materials:
                raise InputError(
                    f"object {obj.name!r}: material {obj.material!r} is not in the scene; "
                    f"{_known(self.materials)}"
                )

    @cached_property
    def object_index(self) -> Mapping[str, int]:
        """Place of each object in `objects`, by name."""
        return {obj.name: i for i, obj in enumerate(self.objects)}

    def object(self, name: str) -> Object:
        """The object of that name. Raises InputError."""
        if name not in self.object_index:
            raise InputError(f"object {name!r} is not in the scene; {_known(self.object_index)}")
        return self.objects[self.object_index[name]]

    def material(self, name: str) -> Material:
        """The material of that name. Raises InputError."""
        if name not in self.materials:
            raise InputError(f"material {name!r} is not in the scene; {_known(self.materials)}")
        return self.materials[name]

    def with_camera(self, **changes: Any) -> Scene:
        """A scene whose camera has other values: position, target, up, fov_y."""
        return replace(self, camera=_replace(self.camera, changes))

    def with_environment(self, **changes: Any) -> Scene:
        """A scene whose environment has other values: color, image, rotation_y, intensity."""
        return replace(self, environment=_replace(self.environment, changes))

    def with_material(self, name: str, /, **changes: Any) -> Scene:
        """A scene with a changed material, or with a new one of that name."""
        material = _replace(self.materials.get(name, Material()), changes)
        return replace(self, materials={**self.materials, name: material})

    def with_object(self, name: str, /, **changes: Any) -> Scene:
        """A scene with one object changed: mesh, material, position, rotation, scale, visible, name."""
        changed = _replace(self.object(name), changes)
        return replace(self, objects=tuple(changed if o.name == name else o for o in self.objects))

    def with_added(self, *objects: Object) -> Scene:
        """A scene with more objects."""
        return replace(self, objects=(*self.objects, *objects))

    def without_object(self, name: str) -> Scene:
        """A scene without that object."""
        self.object(name)
        return replace(self, objects=tuple(o for o in self.objects if o.name != name))

    def __getstate__(self) -> dict[str, Any]:
        # A mappingproxy cannot be pickled or deep-copied.
        return {
            **{k: v for k, v in self.__dict__.items() if k != "object_index"},
            "materials": dict(self.materials),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, materials=MappingProxyType(state["materials"]))


@dataclass(frozen=True)
class Change:
    """What differs between two scenes. Names of objects and materials; flags for what there is one of.

    moved        objects with another transform (or shown, or hidden)
    deformed     objects whose mesh has other vertices or normals but the same faces
    reshaped     objects with another mesh
    reassigned   objects with another material
    """

    camera: bool = False
    environment: bool = False
    environment_image: bool = False
    materials: frozenset[str] = frozenset()
    materials_added_or_removed: bool = False
    added: frozenset[str] = frozenset()
    removed: frozenset[str] = frozenset()
    reordered: bool = False
    moved: frozenset[str] = frozenset()
    deformed: frozenset[str] = frozenset()
    reshaped: frozenset[str] = frozenset()
    reassigned: frozenset[str] = frozenset()

    @property
    def is_global(self) -> bool:
        """Whether the whole image is affected alike: camera or environment."""
        return self.camera or self.environment or self.environment_image

    @property
    def is_local(self) -> bool:
        """Whether something in the scene changed that affects a part of the image most."""
        return bool(self.materials or self.objects)

    @property
    def objects(self) -> frozenset[str]:
        """Every object that changed, came or went."""
        return self.added | self.removed | self.moved | self.deformed | self.reshaped | self.reassigned


def diff(old: Scene, new: Scene) -> Change:
    """What changed from `old` to `new`. Unused materials count too: an object may use them next."""
    before, after = (
        {o.name: o for o in objects} for objects in _without_equal_ends(old.objects, new.objects)
    )
    common = [name for name in after if name in before and after[name] is not before[name]]
    pairs = [(name, before[name], after[name]) for name in common]
    old_image, new_image = old.environment.image, new.environment.image
    return Change(
        camera=old.camera != new.camera,
        environment=old.environment != new.environment,
        environment_image=old_image is not new_image,
        materials=frozenset(
            name
            for name in old.materials.keys() & new.materials.keys()
            if old.materials[name] != new.materials[name]
        ),
        materials_added_or_removed=list(old.materials) != list(new.materials),
        added=frozenset(after.keys() - before.keys()),
        removed=frozenset(before.keys() - after.keys()),
        reordered=[n for n in before if n in after] != [n for n in after if n in before],
        moved=frozenset(
            name
            for name, a, b in pairs
            if (a.position, a.rotation, a.scale, a.visible) != (b.position, b.rotation, b.scale, b.visible)
        ),
        deformed=frozenset(
            name for name, a, b in pairs if a.mesh is not b.mesh and is_deformation(a.mesh, b.mesh)
        ),
        reshaped=frozenset(
            name for name, a, b in pairs if a.mesh is not b.mesh and not is_deformation(a.mesh, b.mesh)
        ),
        reassigned=frozenset(name for name, a, b in pairs if a.material != b.material),
    )


def _without_equal_ends(
    old: tuple[Object, ...], new: tuple[Object, ...]
) -> tuple[tuple[Object, ...], tuple[Object, ...]]:
    """Both without the objects that are the same from the first on and from the last on: nearly all."""

    def same(a: Iterable[Object], b: Iterable[Object], most: int) -> int:
        return next(compress(count(), map(is_not, a, b)), most)

    most = min(len(old), len(new))
    first = same(old, new, most)
    last = min(same(reversed(old), reversed(new), most), most - first)
    return old[first : len(old) - last], new[first : len(new) - last]


def is_deformation(old: Mesh, new: Mesh) -> bool:
    """Whether `new` has the faces of `old` with other vertices, so that its BVH can be refitted."""
    same_faces = old.faces is new.faces or np.array_equal(old.faces, new.faces)
    return same_faces and (old.normals is None) == (new.normals is None)


SHAPES = ("cube", "sphere", "plane", "cylinder")


@cache
def shape(name: str) -> Mesh:
    """A built-in mesh: cube ([-0.5, 0.5]^3), sphere (radius 0.5), plane (1 x 1, facing +y), cylinder
    (radius 0.5, height 1, along y). Sphere and cylinder carry shading normals. Raises InputError."""
    from incpt import shapes

    if name not in SHAPES:
        raise InputError(f"shape {name!r} is not known; choose one of {', '.join(SHAPES)}")
    vertices, faces, normals = getattr(shapes, name)()
    return Mesh(vertices, faces, normals, MeshSource(shape=name))


def _known(names: Iterable[str]) -> str:
    listed = sorted(names)
    if not listed:
        return "it has none"
    return "it has " + ", ".join(listed[:8]) + (f" and {len(listed) - 8} more" if len(listed) > 8 else "")


def _replace(value: Any, changes: Mapping[str, Any]) -> Any:
    for key in changes:
        if key not in value.__dataclass_fields__:
            known = ", ".join(value.__dataclass_fields__)
            raise InputError(f"{key}: is no property of {type(value).__name__.lower()}; it has {known}")
    return replace(value, **changes)


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    view = array.view()
    view.flags.writeable = False
    return view


def _set_number(owner: object, name: str, low: float, high: float) -> None:
    object.__setattr__(owner, name, _number(name, getattr(owner, name), low, high))


def _set_vector(owner: object, name: str, low: float = -LARGEST, high: float = LARGEST) -> None:
    value = getattr(owner, name)
    if isinstance(value, str) or not isinstance(value, (Sequence, np.ndarray)) or len(value) != 3:
        raise InputError(f"{name}: {value!r} is not a list of three numbers")
    object.__setattr__(owner, name, tuple(_number(name, v, low, high) for v in value))


def _number(name: str, value: Any, low: float, high: float) -> float:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InputError(f"{name}: {value!r} is not a number")
    try:
        number = float(value)
    except OverflowError:
        raise InputError(
            f"{name}: a whole number that large is out of range; use {low:g} to {high:g}"
        ) from None
    if not math.isfinite(number):
        raise InputError(f"{name}: {number} is not a finite number")
    if not low <= number <= high:
        raise InputError(f"{name}: {number:g} is out of range; use {low:g} to {high:g}")
    return number
