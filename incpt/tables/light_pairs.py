"""One choice of lights for two scenes.

A lamp that comes, goes or gets brighter would change the chance of every other lamp, so that the same random
numbers led to other lights in nearly all paths. So both scenes choose among the same lights with the same
chances: those of either scene. In the scene that lacks a light, it emits nothing.

What the law of multiple importance sampling needs holds in each scene: a point on an emitter is chosen with
the density that its material has (`LightTables.densities`), because all that has a material of that name has
the same weight per area in both scenes, the larger of its two. The same goes for the share of a face in it,
where emission has a texture in one of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.core import layout
from incpt.core.layout import TextureSlot
from incpt.device.device import Device
from incpt.scene.light import Light
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.tables import lights
from incpt.tables.emitter_shares import face_shares
from incpt.tables.lights import Array, LightTables, TriangleLights
from incpt.tables.shaped_lights import (
    NO_SHAPED_LIGHTS,
    ShapedLights,
    Shares,
    emissive_lights,
    paired_tree_lights,
    shaped_planes,
    shares,
    weight,
)
from incpt.tables.textures import TextureTables
from incpt.tables.tree_tables import Emitters, TreeBuffers, takes_tree

_SAME_AREA = 1e-6
"""By how much, relatively, the areas of a triangle in both scenes may differ where it is one light: what
moving it leaves of rounding errors."""


_PLAIN = Material()


def _untextured(material: Material) -> int:
    """The number of white, in place of a texture."""
    return 0


def has_same_emitters(old: Scene, new: Scene) -> bool:
    """Whether light sampling is the same in both scenes already."""

    def seen(scene: Scene) -> list[tuple[object, ...]]:
        found: list[tuple[object, ...]] = []
        for obj in lights.emissive_objects(scene):
            material = scene.materials[obj.material]
            found.append(
                (
                    id(obj.mesh),
                    obj.transform,
                    material.emission,
                    material.double_sided,
                    material.emission_texture,
                    material.is_cutout,
                )
            )
        return found

    same_lights = old.lights is new.lights or emissive_lights(old) == emissive_lights(new)
    return same_lights and seen(old) == seen(new)


def paired_light_tables(
    device: Device, old: Scene, new: Scene, has_image: bool, textures: tuple[TextureTables, TextureTables]
) -> tuple[LightTables, LightTables]:
    """The light tables of both scenes; `has_image` tells whether their environment has an image that shines.
    `textures` are those of both. Raises DeviceError."""
    pairs, numbers = _light_pairs(old, new), (textures[0].emission_number, textures[1].emission_number)
    textured = tuple(own.has(TextureSlot.EMISSION) for own in textures)
    if _takes_tree(old, new, pairs):
        triangles = paired_lights(old, new, 1.0, numbers)
        suns = _sun_count(pairs)
        if len(pairs) > suns or triangles[0].count:
            return _paired_tree_tables(device, (old, new), pairs, triangles, has_image, textured)
    share, shaped = lights.share_of_triangles(has_image), (NO_SHAPED_LIGHTS, NO_SHAPED_LIGHTS)
    if pairs:
        chosen = shares(has_image, _triangle_power(old, new), [_common_weight(pair) for pair in pairs])
        share, shaped = chosen.triangles, paired_shaped_lights(pairs, chosen)
    triangles = paired_lights(old, new, share, numbers)
    first, second = (
        LightTables.of(device, each, has_image, scene.objects, own, beside)
        for each, scene, own, beside in zip(triangles, (old, new), textured, shaped, strict=True)
    )
    return first, second


def _takes_tree(old: Scene, new: Scene, pairs: list[_Pair]) -> bool:
    """Whether there are so many lights in both scenes together that they are chosen by a tree."""
    weights = common_weights(old, new)
    shining = {**_seen(old, weights), **_seen(new, weights)}
    near = len(pairs) - _sun_count(pairs)
    return takes_tree(near + len(shining), sum(len(obj.mesh.faces) for obj in shining.values()))


def _paired_tree_tables(
    device: Device,
    scenes: tuple[Scene, Scene],
    pairs: list[_Pair],
    triangles: tuple[TriangleLights, TriangleLights],
    has_image: bool,
    textured: Sequence[bool],
) -> tuple[LightTables, LightTables]:
    """Those of both scenes with one light tree, over all that is a light in one of them."""
    suns = _sun_count(pairs)
    weights = [_common_weight(pair) for pair in pairs]
    emitters = triangles[0].emitters
    chosen = lights.tree_shares(has_image, emitters, weights[:suns], weights[suns:])
    tree = TreeBuffers.of(device, paired_tree_lights(pairs[suns:], suns), emitters.tree_lights(len(pairs)))
    changed = _changed(pairs)
    first, second = (
        LightTables.of(
            device,
            triangles[i].in_tree(),
            has_image,
            scenes[i].objects,
            textured[i],
            ShapedLights(
                shaped_planes([pair[i] for pair in pairs], chosen.lights, changed, tree.shaped_trails),
                suns,
                float(chosen.lights.sum()),
            ),
            tree.tables(device, triangles[i].emitters, scenes[i].objects, chosen.triangles),
        )
        for i in range(2)
    )
    return first, second


_Pair = tuple[Light | None, Light | None]
"""A light in the old scene and in the new one, None where it is not there."""


def _light_pairs(old: Scene, new: Scene) -> list[_Pair]:
    """Those that are objects of their own and emit anything in one of the scenes, suns first. They are the
    same where they have the same name."""
    before, after = ({light.name: light for light in emissive_lights(scene)} for scene in (old, new))
    pairs = [(before.get(name), after.get(name)) for name in {**before, **after}]
    # Suns stand in front in each scene, and hardly ever among ten thousand others.
    has_suns = any(next(iter(lights.values())).is_far for lights in (before, after) if lights)
    return sorted(pairs, key=lambda pair: not _is_far(pair)) if has_suns else pairs


def _is_far(pair: _Pair) -> bool:
    return any(light is not None and light.is_far for light in pair)


def _sun_count(pairs: list[_Pair]) -> int:
    """How many suns stand in front of others."""
    return next((i for i, pair in enumerate(pairs) if not _is_far(pair)), len(pairs))


def _changed(pairs: list[_Pair]) -> npt.NDArray[np.bool_]:
    return np.array([first is not second and first != second for first, second in pairs], np.bool_)


def _common_weight(pair: _Pair) -> float:
    first, second = pair
    if first is None or second is None:
        return weight(first or second)  # type: ignore[arg-type]
    return weight(first) if first is second else max(weight(first), weight(second))


def _triangle_power(old: Scene, new: Scene) -> float:
    weights = common_weights(old, new)
    found = _rows(old, new, weights, _shares(old, new, weights), (_untextured, _untextured))
    rows = _Rows.joined(found).chosen()
    return float(np.pi * (rows.weight * rows.share * rows.area).sum())


def paired_shaped_lights(pairs: list[_Pair], chosen: Shares) -> tuple[ShapedLights, ShapedLights]:
    """The lights of both scenes that are objects of their own. Those that differ have ShapedFlag.CHANGED."""
    changed, suns = _changed(pairs), _sun_count(pairs)
    first, second = (
        ShapedLights(
            shaped_planes([pair[i] for pair in pairs], chosen.lights, changed),
            suns,
            float(chosen.lights.sum()),
        )
        for i in range(2)
    )
    return first, second


def common_weights(old: Scene, new: Scene) -> dict[str, float]:
    """The weight of each material in both scenes, by name."""
    weights: dict[str, float] = {}
    for scene in (old, new):
        for name, material in scene.materials.items():
            weights[name] = max(weights.get(name, 0.0), lights.radiant_weight(material))
    return weights


def paired_lights(
    old: Scene,
    new: Scene,
    share: float,
    texture_numbers: tuple[Callable[[Material], int], Callable[[Material], int]] = (_untextured, _untextured),
) -> tuple[TriangleLights, TriangleLights]:
    """The lights of both scenes, the same ones in the same order; see `lights.triangle_lights`. Those that
    differ have LightFlag.CHANGED. `texture_numbers` are those of materials in both scenes."""
    weights = common_weights(old, new)
    face_parts = _shares(old, new, weights)
    rows = _Rows.joined(_rows(old, new, weights, face_parts, texture_numbers)).chosen()
    power = rows.weight * rows.share * rows.area
    if len(power) == 0:
        nothing = TriangleLights(np.zeros((len(layout.LightPlane), 0), np.float32), {})
        return nothing, nothing
    scale = share / float(power.sum())
    densities = {name: weights[name] * scale for name in dict.fromkeys(rows.material.tolist())}
    first, second = (
        TriangleLights(
            lights.light_planes(
                rows.corners[i],
                rows.emission[i],
                np.where(rows.shines[i], rows.weight * rows.share * scale, 0),
                power,
                rows.flags(i),
                rows.errors[i],
            ),
            densities,
            face_parts[i],
            rows.emitters(i, power),
        )
        for i in range(2)
    )
    for i, triangles in enumerate((first, second)):
        lights.set_textures(triangles.planes, rows.texture[i], rows.places[i])
    return first, second


def _shares(
    old: Scene, new: Scene, weights: Mapping[str, float]
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Of both scenes, by the names of objects: the shares of faces in the density of their material, where
    any are not 1. Those of faces that are lights of both scenes are the same, the larger of the two."""
    found: tuple[dict[str, Array], dict[str, Array]] = {}, {}
    before, after = _seen(old, weights), _seen(new, weights)
    for key in [*before, *(key for key in after if key not in before)]:
        a, b = before.get(key), after.get(key)
        if not any(
            scene.materials[key[1]].emission_texture for scene in (old, new) if key[1] in scene.materials
        ):
            continue  # as nearly all: every share is 1
        own = {
            i: face_shares(obj.mesh, scene.materials[key[1]])
            for i, (obj, scene) in enumerate(((a, old), (b, new)))
            if obj is not None
        }
        same = None if a is None or b is None else _same_faces(_Triangles.of(a), _Triangles.of(b))
        if same is not None:
            larger = np.maximum(own[0], own[1])
            own = {i: np.where(same, larger, values) for i, values in own.items()}
        for i, values in own.items():
            if (values != 1).any():
                found[i][key[0]] = values
    return found


@dataclass(frozen=True, eq=False)
class _Triangles:
    """Those of an object: `corners` (F, 3, 3), `errors` (F, 3), `share` (F,), `places` (F, 3, 2) and `face`
    (F,), see `_Rows`."""

    corners: Array
    errors: Array
    share: Array
    places: Array
    face: npt.NDArray[np.int64]

    @classmethod
    def of(cls, obj: Object, share: Array | None = None, material: Material = _PLAIN) -> _Triangles:
        """Those of an object; 1 are the shares of its faces where none are given."""
        faces = len(obj.mesh.faces)
        return cls(
            lights.world_corners(obj),
            lights.transform_errors(obj),
            np.ones(faces) if share is None else share,
            lights.texture_places(obj, material),
            np.arange(faces),
        )

    def __getitem__(self, chosen: npt.NDArray[np.bool_]) -> _Triangles:
        return _Triangles(*(getattr(self, name)[chosen] for name in _Triangles.__dataclass_fields__))


_NO_TRIANGLES = _Triangles(
    np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3, 2)), np.zeros(0, np.int64)
)


@dataclass(frozen=True, eq=False)
class _Rows:
    """N triangles, in the old and in the new scene.

    corners       (2, N, 3, 3); where a scene lacks it, those of the other.
    errors        (2, N, 3) their `lights.transform_errors`.
    emission      (2, N, 3); 0 where a scene lacks it.
    double_sided  (2, N)
    weight        (N,) per area
    share         (N,) of that
    material      (N,) its name
    texture       (2, N) numbers of the textures of emission
    places        (2, N, 3, 2) texture coordinates at the corners
    has_other_texture  (N,) whether the textures of both scenes differ
    name          (N,) of the object
    face          (N,) its number in the mesh
    present       (2, N) whether the scene has it
    """

    corners: Array
    errors: Array
    emission: Array
    double_sided: npt.NDArray[np.bool_]
    weight: Array
    share: Array
    material: npt.NDArray[np.object_]
    texture: npt.NDArray[np.uint32]
    places: Array
    has_other_texture: npt.NDArray[np.bool_]
    name: npt.NDArray[np.object_]
    face: npt.NDArray[np.int64]
    present: npt.NDArray[np.bool_]

    @classmethod
    def joined(cls, parts: list[_Rows]) -> _Rows:
        every = [_row(None, None, ("", ""), _NO_TRIANGLES, _NO_TRIANGLES, 0.0), *parts]
        return cls(
            np.concatenate([part.corners for part in every], axis=1),
            np.concatenate([part.errors for part in every], axis=1),
            np.concatenate([part.emission for part in every], axis=1),
            np.concatenate([part.double_sided for part in every], axis=1),
            np.concatenate([part.weight for part in every]),
            np.concatenate([part.share for part in every]),
            np.concatenate([part.material for part in every]),
            np.concatenate([part.texture for part in every], axis=1),
            np.concatenate([part.places for part in every], axis=1),
            np.concatenate([part.has_other_texture for part in every]),
            np.concatenate([part.name for part in every]),
            np.concatenate([part.face for part in every]),
            np.concatenate([part.present for part in every], axis=1),
        )

    def chosen(self) -> _Rows:
        """Those that are large and bright enough to be lights."""
        kept = (self.area >= lights.SMALLEST_AREA) & (self.weight * self.share >= lights.SMALLEST_WEIGHT)
        return _Rows(
            self.corners[:, kept],
            self.errors[:, kept],
            self.emission[:, kept],
            self.double_sided[:, kept],
            self.weight[kept],
            self.share[kept],
            self.material[kept],
            self.texture[:, kept],
            self.places[:, kept],
            self.has_other_texture[kept],
            self.name[kept],
            self.face[kept],
            self.present[:, kept],
        )

    @property
    def area(self) -> Array:
        return lights.areas(self.corners[0])

    def emitters(self, scene: int, power: Array) -> Emitters:
        """What a light tree needs of them, in one of the scenes."""
        names, owner = np.unique(self.name.astype(str), return_inverse=True)
        sides = self.double_sided[0] | self.double_sided[1]
        return Emitters(self.corners, power, sides, names.tolist(), owner, self.face, self.present[scene])

    @property
    def shines(self) -> npt.NDArray[np.bool_]:
        """(2, N)"""
        return np.asarray(self.emission.any(axis=2))

    def flags(self, scene: int) -> npt.NDArray[np.uint32]:
        corners = self.corners.astype(np.float32)
        changed = (corners[0] != corners[1]).any(axis=(1, 2)) | (self.emission[0] != self.emission[1]).any(
            axis=1
        )
        changed |= self.double_sided[0] != self.double_sided[1]
        changed |= self.has_other_texture | (self.places[0] != self.places[1]).any(axis=(1, 2))
        flag = layout.LightFlag
        return np.asarray(
            self.double_sided[scene] * np.uint32(flag.DOUBLE_SIDED) + changed * np.uint32(flag.CHANGED),
            np.uint32,
        )


def _rows(
    old: Scene,
    new: Scene,
    weights: Mapping[str, float],
    shares: tuple[Mapping[str, Array], Mapping[str, Array]],
    texture_numbers: tuple[Callable[[Material], int], Callable[[Material], int]],
) -> list[_Rows]:
    """Those of each object that is seen and emits in one of the scenes. They are lights of both where it has
    its name, its material and their area in both."""
    before, after = _seen(old, weights), _seen(new, weights)
    found = []
    for key in [*before, *(key for key in after if key not in before)]:
        first, second = (
            None if obj is None else _Triangles.of(obj, own.get(key[0]), scene.materials[key[1]])
            for obj, scene, own in zip((before.get(key), after.get(key)), (old, new), shares, strict=True)
        )
        weight = weights[key[1]]
        if first is not None and second is not None:
            same = _same_faces(first, second)
            if same is not None:
                found.append(_row(old, new, key, first[same], second[same], weight, texture_numbers))
                first, second = first[~same], second[~same]
        if first is not None:
            found.append(_row(old, None, key, first, first, weight, texture_numbers))
        if second is not None:
            found.append(_row(None, new, key, second, second, weight, texture_numbers))
    return found


def _same_faces(first: _Triangles, second: _Triangles) -> npt.NDArray[np.bool_] | None:
    """(F,) which triangles of an object have the same area in both scenes; None where their numbers
    differ."""
    if len(first.corners) != len(second.corners):
        return None
    before, after = lights.areas(first.corners), lights.areas(second.corners)
    return np.isclose(before, after, rtol=_SAME_AREA, atol=0)


def _seen(scene: Scene, weights: Mapping[str, float]) -> dict[tuple[str, str], Object]:
    return {
        (obj.name, obj.material): obj for obj in scene.objects if obj.visible and weights[obj.material] > 0
    }


def _row(
    old: Scene | None,
    new: Scene | None,
    key: tuple[str, str],
    first: _Triangles,
    second: _Triangles,
    weight: float,
    texture_numbers: tuple[Callable[[Material], int], Callable[[Material], int]] = (_untextured, _untextured),
) -> _Rows:
    """Triangles of an object with a material, of these names, in the scenes that are given."""
    obj, name = key
    count = len(first.corners)
    emission, double_sided = np.zeros((2, count, 3)), np.zeros((2, count), np.bool_)
    texture = np.zeros((2, count), np.uint32)
    for i, scene in enumerate((old, new)):
        if scene is not None:
            material = scene.materials[name]
            emission[i] = (0, 0, 0) if material.is_cutout else material.emission
            double_sided[i] = material.double_sided
            texture[i] = texture_numbers[i](material)
    has_other = (
        old is not None
        and new is not None
        and old.materials[name].emission_texture != new.materials[name].emission_texture
    )
    return _Rows(
        np.stack([first.corners, second.corners]),
        np.stack([first.errors, second.errors]),
        emission,
        double_sided,
        np.full(count, weight),
        first.share,
        np.full(count, name, np.object_),
        texture,
        np.stack([first.places, second.places]),
        np.full(count, has_other),
        np.full(count, obj, np.object_),
        first.face,
        np.repeat([[old is not None], [new is not None]], count, axis=1),
    )
