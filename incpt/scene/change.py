"""The difference between two scenes, and the objects that look different after it.

Parts of a scene that did not change are shared by the new one, so comparing by identity first makes `diff`
cheap. Nobody sets a flag, so no edit can be forgotten.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import compress, count
from operator import is_not

from incpt.core.checks import require
from incpt.scene.environment import Environment
from incpt.scene.light import Light
from incpt.scene.mesh import is_deformation
from incpt.scene.model import Object, Placed, Scene
from incpt.scene.transform import Transform


@dataclass(frozen=True)
class Change:
    """What differs between two scenes. Names of objects and materials; flags for what there is one of.

    moved        objects with another transform (or shown, or hidden)
    deformed     objects whose mesh has other vertices or normals but the same faces
    reshaped     objects with another mesh
    reassigned   objects with another material
    lights       lights that changed, came or went
    far_lights   whether any of them shines from far away, as it is or as it was
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
    lights: frozenset[str] = frozenset()
    far_lights: bool = False

    @property
    def is_global(self) -> bool:
        """Whether the whole image is affected alike: camera, environment, or light from far away."""
        return self.camera or self.surroundings or self.far_lights

    @property
    def surroundings(self) -> bool:
        """Whether the environment is another one, or has another image."""
        return self.environment or self.environment_image

    @property
    def is_local(self) -> bool:
        """Whether something in the scene changed that affects a part of the image most."""
        return bool(self.materials or self.objects or self.lights)

    @property
    def objects(self) -> frozenset[str]:
        """Every object that changed, came or went."""
        return self.added | self.removed | self.moved | self.deformed | self.reshaped | self.reassigned


def diff(old: Scene, new: Scene) -> Change:
    """What changed from `old` to `new`. Unused materials count too: an object may use them next. Raises
    InputError."""
    require("old", old, Scene, "a Scene")
    require("new", new, Scene, "a Scene")
    before, after = (
        {o.name: o for o in objects} for objects in _without_equal_ends(old.objects, new.objects)
    )
    common = [name for name in after if name in before and after[name] is not before[name]]
    pairs = [(name, before[name], after[name]) for name in common]
    lights = _changed_lights(old, new)
    return Change(
        camera=old.camera != new.camera,
        environment=old.environment != new.environment,
        environment_image=not _has_same_picture(old.environment, new.environment),
        materials=frozenset(
            name
            for name in old.materials.keys() & new.materials.keys()
            if old.materials[name] != new.materials[name]
        ),
        materials_added_or_removed=list(old.materials) != list(new.materials),
        added=frozenset(after.keys() - before.keys()),
        removed=frozenset(before.keys() - after.keys()),
        reordered=[n for n in before if n in after] != [n for n in after if n in before],
        moved=frozenset(name for name, a, b in pairs if (a.transform, a.visible) != (b.transform, b.visible)),
        deformed=frozenset(
            name for name, a, b in pairs if a.mesh is not b.mesh and is_deformation(a.mesh, b.mesh)
        ),
        reshaped=frozenset(
            name for name, a, b in pairs if a.mesh is not b.mesh and not is_deformation(a.mesh, b.mesh)
        ),
        reassigned=frozenset(name for name, a, b in pairs if a.material != b.material),
        lights=frozenset(light.name for light in lights),
        far_lights=any(light.is_far for light in lights),
    )


def _changed_lights(old: Scene, new: Scene) -> list[Light]:
    """Those that differ, as they were and as they are."""
    if old.lights is new.lights:
        return []
    shared = set(map(id, old.lights)) & set(map(id, new.lights))
    before, after = (
        {light.name: _as_it_shines(light) for light in scene.lights if id(light) not in shared}
        for scene in (old, new)
    )
    return [
        light
        for own, other in ((before, after), (after, before))
        for name, light in own.items()
        if other.get(name) != light
    ]


def _as_it_shines(light: Light) -> Light:
    """The light without what makes no difference: where a sun stands."""
    return replace(light, transform=Transform(rotation=light.rotation)) if light.is_far else light


def _has_same_picture(old: Environment, new: Environment) -> bool:
    """Whether the tables of the one serve for the other. The picture of a sky is not made for that."""
    if old.sky is not None and new.sky is not None:
        return old.sky.atmosphere == new.sky.atmosphere and old.has_sun == new.has_sun
    return old.sky is new.sky and old.image is new.image


def _without_equal_ends(
    old: tuple[Object, ...], new: tuple[Object, ...]
) -> tuple[tuple[Object, ...], tuple[Object, ...]]:
    """Both without the objects that are the same from the first on and from the last on, which nearly all
    are."""

    def same(a: Iterable[Object], b: Iterable[Object], most: int) -> int:
        return next(compress(count(), map(is_not, a, b)), most)

    most = min(len(old), len(new))
    first = same(old, new, most)
    last = min(same(reversed(old), reversed(new), most), most - first)
    return old[first : len(old) - last], new[first : len(new) - last]


def affected_objects(old: Scene, new: Scene, change: Change) -> list[Placed]:
    """The objects and lights that look different, as they were and as they are; hidden ones do not count, nor
    does one that is there as before under another name, its own or its material's."""
    gone = _touched(old, change.objects - change.added, change.materials)
    come = _touched(new, change.objects - change.removed, change.materials)
    same = Counter(_look(old, o) for o in gone) & Counter(_look(new, o) for o in come)
    return [*_without(old, gone, same), *_without(new, come, same), *_affected_lights(old, new, change)]


def _affected_lights(old: Scene, new: Scene, change: Change) -> list[Light]:
    gone, come = (
        [light for light in scene.lights if light.name in change.lights and light.visible]
        for scene in (old, new)
    )

    def renamed(light: Light, others: list[Light]) -> bool:
        return any(replace(other, name=light.name) == light for other in others)

    return [
        *(light for light in gone if not renamed(light, come)),
        *(light for light in come if not renamed(light, gone)),
    ]


def _touched(scene: Scene, names: frozenset[str], materials: frozenset[str]) -> list[Object]:
    if not materials:  # Few objects may have changed among thousands, and are found by their names.
        chosen = (scene.objects[i] for i in sorted(scene.object_index[name] for name in names))
        return [obj for obj in chosen if obj.visible]
    return [o for o in scene.objects if o.visible and (o.name in names or o.material in materials)]


def _look(scene: Scene, obj: Object) -> tuple[object, ...]:
    # Meshes are compared by identity, see Mesh.
    return id(obj.mesh), obj.transform, scene.materials[obj.material]


def _without(scene: Scene, objects: list[Object], same: Counter[tuple[object, ...]]) -> list[Object]:
    left, found = same.copy(), []
    for obj in objects:
        look = _look(scene, obj)
        if left[look] > 0:
            left[look] -= 1
        else:
            found.append(obj)
    return found
