"""Edits of objects, lights and materials: functions from a Scene to another one.

Those that make objects also return the names of the new ones, to be selected. What they refuse they raise
as InputError and leave the scene as it was, which an immutable one does by itself.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.affine import Vector
from incpt.core.errors import InputError
from incpt.scene import placing
from incpt.scene.camera import Camera
from incpt.scene.light import Light
from incpt.scene.material import Material
from incpt.scene.mesh_part import MeshPart
from incpt.scene.model import CAMERA_NAME, Object, Placed, Scene
from incpt.scene.shapes import shape

Names = tuple[str, ...]

DEFAULT_MATERIAL = "grey"
"""The material of new objects where nothing else is said. It is made when it is not there."""
LIGHT_NAMES = {
    "point": "point light",
    "spot": "spot light",
    "sun": "sun",
    "rectangle": "rectangle light",
    "disk": "disk light",
    "sphere": "sphere light",
}
"""What lights of each kind are called."""


# ------------------------------------------------------------------------------------------ new objects


def floor_point(scene: Scene) -> Vector:
    """Where new things stand: below the camera's target on the floor y = 0, or at the target itself where
    that is lower."""
    x, y, z = scene.camera.target
    return x, min(y, 0.0), z


def add_shape(
    scene: Scene, name: str, at: Vector | None = None, material: str | None = None
) -> tuple[Scene, Names]:
    """The scene with a built-in shape that stands on `at` (`floor_point` if None); the new name.

    `material` None: the one called "grey", made if there is none. Raises InputError.
    """
    mesh = shape(name)
    scene, material = _with_material_for_new(scene, material)
    position = _standing_on(at or floor_point(scene), mesh.bounds)
    new = Object(unique_name(name, scene.names), mesh, material, position)
    return scene.with_added(new), (new.name,)


def add_parts(
    scene: Scene, parts: Sequence[MeshPart], label: str, at: Vector | None = None, material: str | None = None
) -> tuple[Scene, Names]:
    """The scene with the meshes of a file, in its own units and arrangement, their box standing on `at`
    (`floor_point` if None); the new names, which begin with `label`.

    Materials that the file brings come along, under another name where the scene has a different one of
    that name; meshes without one get `material` as in `add_shape`. Raises InputError.
    """
    # Named and put together below; here they tell where they stand in the file.
    placed = [Object("part", part.mesh, "", visible=part.visible, transform=part.transform) for part in parts]
    boxes = np.stack([one.world_bounds for one in placed])
    bounds = np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    moved = np.array(_standing_on(at or floor_point(scene), bounds))
    names: list[str] = []
    brought: dict[str, str] = {}
    for part, one in zip(parts, placed, strict=True):
        if part.material is None or part.material_name is None:
            scene, used = _with_material_for_new(scene, material)
        else:
            if part.material_name not in brought:
                scene, brought[part.material_name] = _with_brought(scene, part.material_name, part.material)
            used = brought[part.material_name]
        wanted = label if part.name is None else f"{label}/{part.name}"
        name = unique_name(wanted or "mesh", scene.names)
        transform = one.transform.with_parts(position=_vector(moved + one.position))
        scene = scene.with_added(replace(one, name=name, material=used, transform=transform))
        names.append(name)
    return scene, tuple(names)


def add_light(scene: Scene, kind: str) -> tuple[Scene, Names]:
    """The scene with a light of that kind above the camera's target, which it lights from as high as suits
    what the camera looks at; the new name. Raises InputError."""
    camera = scene.camera
    height = 0.4 * math.dist(camera.position, camera.target)
    x, y, z = camera.target
    name = unique_name(LIGHT_NAMES.get(kind, kind), scene.names)
    values: dict[str, Any] = {"radius": 0.05 * height, "size": (0.5 * height, 0.5 * height)}
    if kind != "sun":
        values["power"] = 25 * height**2
    position = placing.within_range((x, y + height, z))
    new = Light(name, kind, position, (-50, 30, 0) if kind == "sun" else (-90, 0, 0), **values)
    return scene.with_added_light(new), (new.name,)


# --------------------------------------------------------------------------------------- objects, lights


def duplicate(scene: Scene, names: Iterable[str]) -> tuple[Scene, Names]:
    """The scene with a copy of every named object and light in its place, with the same mesh and material;
    the names of the copies."""
    copies: list[str] = []
    for name in names:
        copy, one = unique_name(name, scene.names), scene.placed(name)
        if isinstance(one, Light):
            scene = scene.with_added_light(replace(one, name=copy))
        else:
            scene = scene.with_added(replace(one, name=copy))
        copies.append(copy)
    return scene, tuple(copies)


@dataclass(frozen=True)
class Copied:
    """Objects and lights taken out of a scene to be added to it or another, with the objects' materials."""

    placed: tuple[Placed, ...] = ()
    materials: Mapping[str, Material] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.placed)


def copied(scene: Scene, names: Iterable[str]) -> Copied:
    """Copies of the named objects and lights. Raises InputError for unknown names."""
    placed = tuple(scene.placed(name) for name in names)
    used = dict.fromkeys(one.material for one in placed if isinstance(one, Object))
    return Copied(placed, {name: scene.material(name) for name in used})


def paste(scene: Scene, copied: Copied) -> tuple[Scene, Names]:
    """The scene with what was copied, under new names where these are taken; the names. A material comes
    along under another name where the scene has a different one of that name."""
    names: list[str] = []
    brought: dict[str, str] = {}
    for name, material in copied.materials.items():
        scene, brought[name] = _with_brought(scene, name, material)
    for one in copied.placed:
        name = unique_name(one.name, scene.names)
        if isinstance(one, Light):
            scene = scene.with_added_light(replace(one, name=name))
        else:
            scene = scene.with_added(replace(one, name=name, material=brought[one.material]))
        names.append(name)
    return scene, tuple(names)


def delete(scene: Scene, names: Iterable[str]) -> Scene:
    """The scene without those objects and lights. Raises InputError."""
    for name in names:
        scene = scene.without(name)
    return scene


def rename(scene: Scene, old: str, new: str) -> Scene:
    """The scene with one object or light called otherwise, in its place. Raises InputError: a name that is
    empty or taken."""
    new = _checked_name(new, old, scene.names, "light" if old in scene.light_index else "object")
    return scene if new == old else scene.with_placed(old, name=new)


def set_visible(scene: Scene, names: Iterable[str], visible: bool) -> Scene:
    """The scene with those objects and lights shown or hidden. Raises InputError."""
    return _with_each(scene, names, {"visible": visible})


def assign_material(scene: Scene, names: Iterable[str], material: str) -> Scene:
    """The scene with those objects made of another material; lights among them have none. Raises
    InputError."""
    scene.material(material)
    objects = [name for name in names if name not in scene.light_index]
    return _with_each(scene, objects, {"material": material})


def with_all(scene: Scene, placed: Mapping[str, Placed]) -> Scene:
    """The scene with these in place of the objects and lights of their keys. Raises InputError."""
    changes: dict[str, Any] = {}
    if not placed.keys().isdisjoint(scene.object_index):
        changes["objects"] = tuple(placed.get(one.name, one) for one in scene.objects)
    if not placed.keys().isdisjoint(scene.light_index):
        changes["lights"] = tuple(placed.get(one.name, one) for one in scene.lights)
    return replace(scene, **changes)


def bounds_of(scene: Scene, names: Collection[str] = ()) -> npt.NDArray[np.float64] | None:
    """(2, 3) bounds in world space of the named objects and lights, or of all that are shown, suns left out;
    None without any.

    Raises InputError for a name that is not in the scene.
    """
    chosen: list[Placed] = [scene.placed(name) for name in names]
    if not chosen:
        chosen += [o for o in scene.objects if o.visible]
        chosen += [light for light in scene.lights if light.visible and not light.is_far]
    if not chosen:
        return None
    boxes = np.stack([obj.world_bounds for obj in chosen])
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def transform_objects(
    scene: Scene,
    names: Iterable[str],
    delta: npt.ArrayLike,
    pivot: Sequence[float] = (0.0, 0.0, 0.0),
) -> Scene:
    """The scene with those objects and lights moved by a (4, 4) affine matrix in world space about a point.

    Give the scene from before the drag and the whole movement since then, so that rounding does not add up.
    Rotations stay near what they were and scales keep their signs; what is not turned keeps its angles and
    what is not scaled its scale, to the bit. Shear, which a scaled group of turned objects would get, is
    dropped (`affine.decompose`), but where an object has a matrix, which then is just multiplied. Numbers
    out of the scene's range are brought back into it, and an object that would be flattened stays as it was.
    Raises InputError for unknown names.
    """
    matrix = np.asarray(delta, np.float64)
    about = np.asarray(pivot, np.float64)
    return with_all(scene, {name: placing.transformed(scene.placed(name), matrix, about) for name in names})


# -------------------------------------------------------------------------------------------- materials


def add_material(scene: Scene, name: str = "material", material: Material | None = None) -> tuple[Scene, str]:
    """The scene with another material, and its name: `name`, or with a number where that is taken."""
    name = unique_name(name, scene.materials)
    return replace(scene, materials={**scene.materials, name: material or Material(roughness=0.6)}), name


def duplicate_material(scene: Scene, name: str) -> tuple[Scene, str]:
    """The scene with a copy of a material, and the copy's name. Raises InputError."""
    return add_material(scene, name, scene.material(name))


def delete_material(scene: Scene, name: str, replacement: str | None = None) -> Scene:
    """The scene without a material; objects that have it get `replacement`. Raises InputError while objects
    use it and there is none, with their names."""
    scene.material(name)
    users = [o.name for o in scene.objects if o.material == name]
    if users and replacement is not None:
        if replacement == name:
            raise InputError(f"material {name!r}: cannot take its own place; choose another one")
        scene, users = assign_material(scene, users, replacement), []
    if users:
        listed = ", ".join(users[:5]) + (f" and {len(users) - 5} more" if len(users) > 5 else "")
        raise InputError(f"material {name!r}: is used by {listed}; give them another one first")
    return replace(scene, materials={n: m for n, m in scene.materials.items() if n != name})


def purge_materials(scene: Scene) -> Scene:
    """The scene without the materials that no object has."""
    used = material_users(scene)
    return replace(scene, materials={n: m for n, m in scene.materials.items() if n in used})


def material_users(scene: Scene) -> Counter[str]:
    """How many objects have each material, by its name."""
    return Counter(obj.material for obj in scene.objects)


def rename_material(scene: Scene, old: str, new: str) -> Scene:
    """The scene with a material called otherwise, in its place and at all objects. Raises InputError: a
    name that is empty or taken."""
    scene.material(old)
    new = _checked_name(new, old, scene.materials, "material")
    if new == old:
        return scene
    return replace(
        scene,
        materials={new if n == old else n: m for n, m in scene.materials.items()},
        objects=tuple(replace(o, material=new) if o.material == old else o for o in scene.objects),
    )


def add_camera(scene: Scene, camera: Camera, name: str = CAMERA_NAME) -> tuple[Scene, str]:
    """The scene with one more camera, through which it is seen now; the camera's name, which begins with
    `name`."""
    name = unique_name(name, scene.cameras)
    return replace(scene, camera=camera, camera_name=name), name


def rename_camera(scene: Scene, old: str, new: str) -> Scene:
    """The scene with a camera called otherwise, in its place. Raises InputError: a name that is empty or
    taken."""
    scene.with_active_camera(old)
    new = _checked_name(new, old, scene.cameras, "camera")
    cameras = {new if name == old else name: camera for name, camera in scene.cameras.items()}
    return replace(scene, cameras=cameras, camera_name=new if scene.camera_name == old else scene.camera_name)


def unique_name(name: str, taken: Collection[str]) -> str:
    """`name` if it is free, else its stem with the first free number: "cube", "cube.001", "cube.002"."""
    if name not in taken:
        return name
    stem = re.sub(r"\.\d{3,}$", "", name) or name
    number = 1
    while f"{stem}.{number:03d}" in taken:
        number += 1
    return f"{stem}.{number:03d}"


def _checked_name(new: str, old: str, taken: Collection[str], what: str) -> str:
    new = " ".join(new.split())
    if not new:
        raise InputError(f"{what} {old!r}: a name cannot be empty; give it a text")
    if new != old and new in taken:
        raise InputError(f"{what} {old!r}: {new!r} is taken by another {what}; choose another name")
    return new


def _with_each(scene: Scene, names: Iterable[str], changes: Mapping[str, Any]) -> Scene:
    # At once, because there may be thousands, and each scene of its own would look at all of them.
    changed = {
        name: replace(one, **changes)
        for name in names
        if any(getattr(one := scene.placed(name), key) != value for key, value in changes.items())
    }
    return with_all(scene, changed) if changed else scene


def _with_material_for_new(scene: Scene, material: str | None) -> tuple[Scene, str]:
    if material is not None:
        scene.material(material)
        return scene, material
    if DEFAULT_MATERIAL in scene.materials:
        return scene, DEFAULT_MATERIAL
    return add_material(scene, DEFAULT_MATERIAL)


def _with_brought(scene: Scene, name: str, material: Material) -> tuple[Scene, str]:
    for known, other in scene.materials.items():
        if other == material and re.fullmatch(re.escape(name) + r"(\.\d{3,})?", known):
            return scene, known
    return add_material(scene, name, material)


def _standing_on(at: Sequence[float], bounds: npt.NDArray[np.floating[Any]]) -> Vector:
    """The position at which a box stands with the middle of its bottom on a point."""
    low, high = np.asarray(bounds, np.float64)
    return _vector(np.asarray(at) - [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])


def _vector(values: npt.NDArray[np.float64]) -> Vector:
    x, y, z = (float(v) for v in values)
    return x, y, z
