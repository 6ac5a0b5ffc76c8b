"""The immutable scene and its objects.

An edit makes a new Scene that shares whatever did not change, so comparing parts by identity first
makes `diff` cheap, undo is a list of scenes, and nobody has to set a flag that could be forgotten.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from types import MappingProxyType, NoneType
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.core.affine import Vector
from incpt.core.checks import described, require, require_bool
from incpt.core.errors import InputError
from incpt.core.layout import MEDIUM_NONE
from incpt.core.settings import RenderSettings
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.light import Light, changed
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.transform import IDENTITY, Transform

_PLACEMENT = ("position", "rotation", "scale", "matrix")
"""Keywords of an object that stand for parts of its transform."""
_NAME, _MATERIAL = attrgetter("name"), attrgetter("material")


CAMERA_NAME = "camera"
"""That of a camera that was given none."""


@dataclass(frozen=True)
class Object:
    """An instance of a mesh: `material` is the name of one in the scene, `transform` says where it stands.

    The transform may be given as a whole, as `position` (metres), `rotation` (degrees) and `scale`, or as a
    `matrix`: (3, 4) or (4, 4), affine. These take the place of parts of the transform, as
    `Transform.with_parts` does it, also in `dataclasses.replace` and `Scene.with_object`. Raises InputError.
    """

    name: str
    mesh: Mesh
    material: str
    transform: Transform
    visible: bool

    def __init__(
        self,
        name: str,
        mesh: Mesh,
        material: str,
        position: Vector | None = None,
        rotation: Vector | None = None,
        scale: Vector | None = None,
        visible: bool = True,
        *,
        matrix: npt.ArrayLike | None = None,
        transform: Transform = IDENTITY,
    ) -> None:
        if not isinstance(name, str) or not name:
            raise InputError(f"name: {described(name)} is not a name; give the object a text")
        require("mesh", mesh, Mesh, "a Mesh; use shape() or load_mesh()")
        require("material", material, str, "the name of a material")
        require_bool("visible", visible)
        require("transform", transform, Transform, "a Transform")
        placed = transform.with_parts(position, rotation, scale, matrix)
        values = {
            "name": name, "mesh": mesh, "material": material, "transform": placed, "visible": visible,
        }  # fmt: skip
        for key, value in values.items():
            object.__setattr__(self, key, value)

    @property
    def position(self) -> Vector:
        """Of the mesh's origin in world space, metres."""
        return self.transform.position

    @property
    def rotation(self) -> Vector:
        """Degrees about x, then y, then z; of a matrix the nearest, see Transform."""
        return self.transform.rotation

    @property
    def scale(self) -> Vector:
        """Factors along the rotated axes; of a matrix the nearest, see Transform."""
        return self.transform.scale

    @property
    def world_from_object(self) -> npt.NDArray[np.float64]:
        """(3, 4) affine matrix."""
        return self.transform.world_from_object

    @cached_property
    def world_bounds(self) -> npt.NDArray[np.float64]:
        """(2, 3) bounds of the corners of the mesh's box, in world space."""
        corners = affine.apply(self.world_from_object, affine.box_corners(self.mesh.bounds))
        return np.stack([corners.min(axis=0), corners.max(axis=0)])


Placed = Object | Light
"""What stands in a scene under a name of its own."""


@dataclass(frozen=True)
class Scene:
    """Everything that is seen: materials by name, and objects and lights whose names differ. `settings` is
    the scene's own proposal of how to render it.

    `camera` is the active one, through which the scene is seen. All cameras stand in `cameras` by name, the
    active one under `camera_name`, whatever else was given for it there. Raises InputError.
    """

    camera: Camera = field(default_factory=Camera)
    environment: Environment = field(default_factory=Environment)
    materials: Mapping[str, Material] = field(default_factory=dict)
    objects: tuple[Object, ...] = ()
    settings: RenderSettings = RenderSettings()
    lights: tuple[Light, ...] = ()
    camera_name: str = CAMERA_NAME
    cameras: Mapping[str, Camera] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require("camera", self.camera, Camera, "a Camera")
        require("camera_name", self.camera_name, str, "a name; name the camera by a text")
        require("cameras", self.cameras, Mapping, "a mapping of names to Cameras")
        cameras = {**self.cameras, self.camera_name: self.camera}
        _require_all("cameras", cameras, str, "a name; name each by a text")
        _require_all("cameras", cameras.values(), Camera, "a Camera")
        object.__setattr__(self, "cameras", MappingProxyType(cameras))
        require("environment", self.environment, Environment, "an Environment")
        require("materials", self.materials, Mapping, "a mapping of names to Materials")
        require("settings", self.settings, RenderSettings, "RenderSettings")
        try:
            materials, objects = dict(self.materials), tuple(self.objects)
        except TypeError:
            raise InputError(f"objects: {described(self.objects)} is not a list of Objects") from None
        object.__setattr__(self, "materials", MappingProxyType(materials))
        object.__setattr__(self, "objects", objects)
        object.__setattr__(self, "lights", self._checked_lights())
        _require_all("materials", materials, str, "a name; name each by a text")
        _require_all("materials", materials.values(), Material, "a Material")
        if len(materials) >= MEDIUM_NONE:
            raise InputError(f"materials: {len(materials)} are more than {MEDIUM_NONE - 1}; merge some")
        # Asked of all objects at once, because every edit makes a scene, and there may be thousands.
        try:
            names, used = set(map(_NAME, objects)), set(map(_MATERIAL, objects))
        except (AttributeError, TypeError):  # other things than objects
            names, used = set(), set()
        if len(names) < len(objects) or not used <= materials.keys():
            self._complain_of_objects()
        for name in names.intersection(map(_NAME, self.lights)):
            raise InputError(f"lights: {name!r} is the name of an object too; rename one of them")

    def _checked_lights(self) -> tuple[Light, ...]:
        """`lights` as a tuple. Raises InputError."""
        try:
            lights = tuple(self.lights)
        except TypeError:
            raise InputError(f"lights: {described(self.lights)} is not a list of Lights") from None
        _require_all("lights", lights, Light, "a Light")
        if len(set(map(_NAME, lights))) < len(lights):
            name = next(name for name, count in Counter(map(_NAME, lights)).items() if count > 1)
            raise InputError(f"lights: two are named {name!r}; rename one of them")
        return lights

    def _complain_of_objects(self) -> None:
        """Raises InputError for the first object that cannot be in the scene."""
        seen: set[str] = set()
        for obj in self.objects:
            require("objects", obj, Object, "an Object")
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
        if not isinstance(name, str) or name not in self.object_index:
            raise InputError(f"object {described(name)} is not in the scene; {_known(self.object_index)}")
        return self.objects[self.object_index[name]]

    @cached_property
    def light_index(self) -> Mapping[str, int]:
        """Place of each light in `lights`, by name."""
        return {light.name: i for i, light in enumerate(self.lights)}

    @property
    def everything(self) -> tuple[Placed, ...]:
        """All objects and lights, in order."""
        return (*self.objects, *self.lights)

    @property
    def names(self) -> frozenset[str]:
        """Those of all objects and lights."""
        return frozenset((*self.object_index, *self.light_index))

    def light(self, name: str) -> Light:
        """The light of that name. Raises InputError."""
        if not isinstance(name, str) or name not in self.light_index:
            raise InputError(f"light {described(name)} is not in the scene; {_known(self.light_index)}")
        return self.lights[self.light_index[name]]

    def placed(self, name: str) -> Object | Light:
        """The object or the light of that name. Raises InputError."""
        if isinstance(name, str) and name in self.light_index:
            return self.light(name)
        return self.object(name)

    def material(self, name: str) -> Material:
        """The material of that name. Raises InputError."""
        if not isinstance(name, str) or name not in self.materials:
            raise InputError(f"material {described(name)} is not in the scene; {_known(self.materials)}")
        return self.materials[name]

    def with_camera(self, name: str | None = None, /, **changes: Any) -> Scene:
        """A scene with a changed camera, or with a new one of that name; None is the active one. See Camera
        for what it has. A new `fov_y` ends a focal length, unless one is given too."""
        require("name", name, (str, NoneType), "the name of a camera")
        name = self.camera_name if name is None else name
        if "fov_y" in changes:
            changes = {"focal_length": 0.0, **changes}
        camera = _replace(self.cameras.get(name, Camera()), changes)
        if name == self.camera_name:
            return replace(self, camera=camera)
        return replace(self, cameras={**self.cameras, name: camera})

    def with_active_camera(self, name: str) -> Scene:
        """A scene that is seen through another of its cameras. Raises InputError."""
        if not isinstance(name, str) or name not in self.cameras:
            raise InputError(f"camera {described(name)} is not in the scene; {_known(self.cameras)}")
        return replace(self, camera=self.cameras[name], camera_name=name)

    def without_camera(self, name: str) -> Scene:
        """A scene without one of its cameras, seen through the first of the others where that was the active
        one. Raises InputError."""
        self.with_active_camera(name)
        others = {other: camera for other, camera in self.cameras.items() if other != name}
        if not others:
            raise InputError(f"camera {name!r}: is the only one; add another before")
        active = next(iter(others)) if self.camera_name == name else self.camera_name
        return replace(self, camera=others[active], camera_name=active, cameras=others)

    def with_environment(self, **changes: Any) -> Scene:
        """A scene whose environment has other values: color, image, rotation_y, intensity, sky. A new image
        takes the place of a sky, and a new sky that of an image."""
        for new, old in (("image", "sky"), ("sky", "image")):
            if changes.get(new) is not None:
                changes = {old: None, **changes}
        return replace(self, environment=_replace(self.environment, changes))

    def with_material(self, name: str, /, **changes: Any) -> Scene:
        """A scene with a changed material, or with a new one of that name."""
        require("name", name, str, "the name of a material")
        material = _replace(self.materials.get(name, Material()), changes)
        return replace(self, materials={**self.materials, name: material})

    def with_object(self, name: str, /, **changes: Any) -> Scene:
        """A scene with one object changed: mesh, material, visible, name, and where it stands: `position`,
        `rotation`, `scale`, or a `matrix`, or a whole `transform`. See Object. Raises InputError."""
        changed = _replace(self.object(name), changes, _PLACEMENT)
        return replace(self, objects=tuple(changed if o.name == name else o for o in self.objects))

    def with_added(self, *objects: Object) -> Scene:
        """A scene with more objects."""
        return replace(self, objects=(*self.objects, *objects))

    def without_object(self, name: str) -> Scene:
        """A scene without that object."""
        self.object(name)
        return replace(self, objects=tuple(o for o in self.objects if o.name != name))

    def with_light(self, name: str, /, **changes: Any) -> Scene:
        """A scene with one light changed: what Light takes, also where it stands, as for `with_object`. A
        power, radiance or irradiance takes the place of the one that it has. Raises InputError."""
        new = changed(self.light(name), changes)
        return replace(self, lights=tuple(new if light.name == name else light for light in self.lights))

    def with_placed(self, name: str, /, **changes: Any) -> Scene:
        """A scene with the object or the light of that name changed; see `with_object` and `with_light`."""
        is_light = isinstance(name, str) and name in self.light_index
        return self.with_light(name, **changes) if is_light else self.with_object(name, **changes)

    def with_added_light(self, *lights: Light) -> Scene:
        """A scene with more lights."""
        return replace(self, lights=(*self.lights, *lights))

    def without_light(self, name: str) -> Scene:
        """A scene without that light."""
        self.light(name)
        return replace(self, lights=tuple(light for light in self.lights if light.name != name))

    def without(self, name: str) -> Scene:
        """A scene without the object or the light of that name. Raises InputError."""
        is_light = isinstance(name, str) and name in self.light_index
        return self.without_light(name) if is_light else self.without_object(name)

    def __getstate__(self) -> dict[str, Any]:
        # A mappingproxy cannot be pickled or deep-copied.
        return {
            **{k: v for k, v in self.__dict__.items() if k not in ("object_index", "light_index")},
            "materials": dict(self.materials),
            "cameras": dict(self.cameras),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        mappings = {name: MappingProxyType(state[name]) for name in ("materials", "cameras")}
        self.__dict__.update(state, **mappings)


def _require_all(name: str, values: Collection[object], kind: type, wanted: str) -> None:
    """Raises InputError for the first value that is of no such type."""
    if not set(map(type, values)) <= {kind}:  # else all are of the very type, which is told quickly
        for value in values:
            require(name, value, kind, wanted)


def _known(names: Iterable[str]) -> str:
    listed = sorted(names)
    if not listed:
        return "it has none"
    return "it has " + ", ".join(listed[:8]) + (f" and {len(listed) - 8} more" if len(listed) > 8 else "")


def _replace(value: Any, changes: Mapping[str, Any], more_keys: tuple[str, ...] = ()) -> Any:
    known = (*value.__dataclass_fields__, *more_keys)
    for key in changes:
        if key not in known:
            raise InputError(
                f"{key}: is no property of {type(value).__name__.lower()}; it has {', '.join(known)}"
            )
    return replace(value, **changes)
