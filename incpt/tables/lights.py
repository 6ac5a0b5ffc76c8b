"""Emissive triangles, from which light sampling chooses by their power."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import affine, layout
from incpt.core.layout import TextureSlot
from incpt.device.device import Device
from incpt.scene.light import Light
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.tables.alias import alias_table, luminance
from incpt.tables.emitter_shares import corner_places, face_shares
from incpt.tables.shaped_lights import (
    NO_SHAPED_LIGHTS,
    ShapedLights,
    Shares,
    emissive_lights,
    shaped_planes,
    shares,
    sun_count,
    tree_lights,
    weight,
)
from incpt.tables.textures import TextureTables
from incpt.tables.tree_tables import NO_EMITTERS, Emitters, TreeBuffers, TreeTables, no_tree, takes_tree

Array = npt.NDArray[np.float64]

SMALLEST_AREA = 1e-18
"""Square metres in world space from which on triangles are lights. In single precision a smaller one has no
normal, and where all are that small the density of a point has no end."""
_HALF_ULP = 2.0**-24
_COORDINATE_ULPS, _EXTENT_ULPS, _TRANSFORM_ULPS, _TEST_ULPS = 8, 16, 10, 4
"""Rounding errors of a point on a triangle, as those of a hit in cl/path/setup_surface.cl, and of the
distance at which a ray meets it, for the extent of the triangle."""
SMALLEST_WEIGHT = float(np.finfo(np.float32).tiny)
"""The least `radiant_weight` of lights: in single precision less is black."""


def radiant_weight(material: Material) -> float:
    """Power per area that counts in choosing lights: luminance, twice where both sides shine. What covers in
    part is left to the rays that meet it."""
    if material.is_cutout:
        return 0.0
    return float(luminance(material.emission)) * (2.0 if material.double_sided else 1.0)


@dataclass(frozen=True, eq=False)
class TriangleLights:
    """`planes` (len(LightPlane), N) float32, uints bit for bit; `densities` as in LightTables; `shares`: by
    the name of an object whose emission has a texture, those of its faces in the density (F,); `emitters`
    is what a light tree needs of them."""

    planes: npt.NDArray[np.float32]
    densities: Mapping[str, float]
    shares: Mapping[str, Array] = field(default_factory=dict)
    emitters: Emitters = NO_EMITTERS

    @property
    def count(self) -> int:
        return int(self.planes.shape[1])

    def in_tree(self) -> TriangleLights:
        """The same where a light tree chooses: the density of each is that of its points alone. Of those that
        were chosen with a share of 1."""
        planes, power = self.planes.copy(), self.emitters.power
        planes[layout.LightPlane.PDF_AREA] *= power.sum() / power
        return replace(self, planes=planes)


@dataclass(frozen=True, eq=False)
class LightTables:
    """The buffers, by name, and how light sampling chooses.

    count                    how many triangles there are to choose from
    densities                density per area of choosing a point, by the name of its material, but for the
                             share of its face (`emitter_shares`). Others have 0: their points are left to
                             the rays that meet them
    environment_probability  the chance that light sampling turns to the environment's image
    shaped                   the lights that are objects of their own
    tree                     the light tree, or what stands for none
    """

    buffers: Mapping[str, cl.Buffer]
    count: int
    densities: Mapping[str, float]
    environment_probability: float
    shaped: ShapedLights
    tree: TreeTables

    @classmethod
    def of(
        cls,
        device: Device,
        triangles: TriangleLights,
        has_image: bool,
        objects: tuple[Object, ...],
        is_textured: bool,
        shaped: ShapedLights = NO_SHAPED_LIGHTS,
        tree: TreeTables | None = None,
    ) -> LightTables:
        """Those of triangles that were chosen with `share_of_triangles`, or beside the lights `shaped` with
        the share that is left; `has_image` tells whether the environment has an image that shines. `objects`
        are those of the scene; `is_textured` tells whether any material has a texture of emission. With a
        `tree` the triangles are those of `TriangleLights.in_tree`."""
        share = share_of_triangles(has_image) if triangles.count or shaped.count else 0.0
        probability = 1.0 - share if has_image else 0.0
        first, of_faces = _share_tables(triangles.shares, objects if is_textured else ())
        planes = triangles.planes if is_textured else triangles.planes[: layout.LightPlane.TEXTURE]
        buffers = {
            "lights": device.upload(planes),
            # Beside a tree, all of a light stands in a row: see shaped_light.cl.
            "shaped_lights": device.upload(shaped.planes if tree is None else shaped.planes.T),
            "first_share": device.upload(first),
            "emitter_shares": device.upload(of_faces),
        }
        tree = no_tree(device) if tree is None else tree
        buffers |= tree.buffers
        return cls(buffers, triangles.count, triangles.densities, probability, shaped, tree)


def _share_tables(
    shares: Mapping[str, Array], objects: tuple[Object, ...]
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.float32]]:
    """Where the shares of each object's faces begin, and all shares behind a 1, which others have."""
    place, places = 1, {}
    for name, values in shares.items():
        places[name] = place
        place += len(values)
    first = np.array([places.get(obj.name, 0) for obj in objects] or [0], np.uint32)
    return first, np.concatenate([[1.0], *shares.values()]).astype(np.float32)


def light_tables(device: Device, scene: Scene, has_image: bool, textures: TextureTables) -> LightTables:
    """Those of a scene; `has_image` tells whether its environment has an image that shines."""
    objects, number = scene.objects, textures.emission_number
    is_textured = textures.has(TextureSlot.EMISSION)
    lights, shining = emissive_lights(scene), emissive_objects(scene)
    near = len(lights) - sun_count(lights)
    if takes_tree(near + len(shining), sum(len(obj.mesh.faces) for obj in shining)):
        triangles = triangle_lights(scene, 1.0, number)
        if near or triangles.count:
            return _tree_tables(device, scene, lights, triangles, has_image, is_textured)
    if not lights:
        triangles = triangle_lights(scene, share_of_triangles(has_image), number)
        return LightTables.of(device, triangles, has_image, objects, is_textured)
    chosen = shares(has_image, triangle_power(scene), [weight(light) for light in lights])
    planes = shaped_planes(lights, chosen.lights, np.zeros(len(lights), np.bool_))
    shaped = ShapedLights(planes, sun_count(lights), float(chosen.lights.sum()))
    triangles = triangle_lights(scene, chosen.triangles, number)
    return LightTables.of(device, triangles, has_image, objects, is_textured, shaped)


def _tree_tables(
    device: Device,
    scene: Scene,
    lights: list[Light],
    triangles: TriangleLights,
    has_image: bool,
    is_textured: bool,
) -> LightTables:
    """Those of a scene with a light tree over lights, suns first, and triangles that were chosen with a share
    of 1."""
    suns = sun_count(lights)
    weights = [weight(light) for light in lights]
    chosen = tree_shares(has_image, triangles.emitters, weights[:suns], weights[suns:])
    tree = TreeBuffers.of(
        device, tree_lights(lights[suns:], suns), triangles.emitters.tree_lights(len(lights))
    )
    unchanged = np.zeros(len(lights), np.bool_)
    planes = shaped_planes(lights, chosen.lights, unchanged, tree.shaped_trails)
    shaped = ShapedLights(planes, suns, float(chosen.lights.sum()))
    return LightTables.of(
        device,
        triangles.in_tree(),
        has_image,
        scene.objects,
        is_textured,
        shaped,
        tree.tables(device, triangles.emitters, scene.objects, chosen.triangles),
    )


def tree_shares(has_image: bool, emitters: Emitters, suns: Sequence[float], near: Sequence[float]) -> Shares:
    """The chances of environment, light tree and suns, by the weights of suns and of lights that are near."""
    power = np.pi * float(emitters.power.sum()) + float(np.sum(near))
    return shares(has_image, power, suns)


def triangle_power(scene: Scene) -> float:
    """What all emissive triangles together weigh beside lights that are objects of their own, W."""
    found = 0.0
    for obj in emissive_objects(scene):
        material = scene.materials[obj.material]
        area, each = areas(world_corners(obj)), radiant_weight(material) * face_shares(obj.mesh, material)
        kept = (area >= SMALLEST_AREA) & (each >= SMALLEST_WEIGHT)
        found += np.pi * float((each * area)[kept].sum())
    return found


def share_of_triangles(has_image: bool) -> float:
    """The chance that light sampling turns to triangles, if there are any; `has_image`: beside an image."""
    return 0.5 if has_image else 1.0


def triangle_lights(
    scene: Scene, share: float, texture_number: Callable[[Material], int] = lambda material: 0
) -> TriangleLights:
    """Every visible emissive triangle that is large and bright enough. `share` is the chance that light
    sampling turns to triangles at all; the densities contain it. `texture_number` is that of the texture of a
    material's emission."""
    objects = emissive_objects(scene)
    if not objects:
        return TriangleLights(np.zeros((len(layout.LightPlane), 0), np.float32), {})
    materials = [scene.materials[obj.material] for obj in objects]
    corners = np.concatenate([world_corners(obj) for obj in objects])
    errors = np.concatenate([transform_errors(obj) for obj in objects])
    area = areas(corners)
    owner = np.repeat(np.arange(len(objects)), [len(obj.mesh.faces) for obj in objects])
    weights = np.array([radiant_weight(material) for material in materials])
    of_faces = [face_shares(obj.mesh, material) for obj, material in zip(objects, materials, strict=True)]
    share_of_face = np.concatenate(of_faces)
    kept = (area >= SMALLEST_AREA) & (weights[owner] * share_of_face >= SMALLEST_WEIGHT)
    face = np.concatenate([np.arange(len(obj.mesh.faces)) for obj in objects])[kept]
    owner, share_of_face = owner[kept], share_of_face[kept]
    power = weights[owner] * share_of_face * area[kept]
    if len(owner) == 0:
        return TriangleLights(np.zeros((len(layout.LightPlane), 0), np.float32), {})

    density = weights * (share / float(power.sum()))
    emission = np.array([material.emission for material in materials])
    sides = np.array([material.double_sided for material in materials]) * layout.LightFlag.DOUBLE_SIDED
    planes = light_planes(
        corners[kept], emission[owner], density[owner] * share_of_face, power, sides[owner], errors[kept]
    )
    numbers = np.array([texture_number(material) for material in materials], np.uint32)
    if numbers.any():
        places = np.concatenate([texture_places(obj, materials[i]) for i, obj in enumerate(objects)])
        set_textures(planes, numbers[owner], places[kept])
    lit = np.flatnonzero(np.bincount(owner)).tolist()
    sides = np.array([material.double_sided for material in materials], np.bool_)[owner]
    names, all_here = [obj.name for obj in objects], np.ones(len(owner), np.bool_)
    return TriangleLights(
        planes,
        {objects[i].material: float(density[i]) for i in lit},
        {obj.name: own for obj, own, number in zip(objects, of_faces, numbers, strict=True) if number},
        Emitters(corners[kept][None], power, sides, names, owner, face, all_here),
    )


def set_textures(planes: npt.NDArray[np.float32], numbers: npt.NDArray[np.uint32], places: Array) -> None:
    """Fill in the textures of lights: their numbers (N,), and texture coordinates (N, 3, 2) at the
    corners."""
    plane = layout.LightPlane
    planes[plane.TEXTURE] = numbers.view(np.float32)
    planes[plane.U : plane.V + 1] = places[:, 0].T
    planes[plane.EDGE_1_U : plane.EDGE_1_V + 1] = (places[:, 1] - places[:, 0]).T
    planes[plane.EDGE_2_U : plane.EDGE_2_V + 1] = (places[:, 2] - places[:, 0]).T


def texture_places(obj: Object, material: Material) -> Array:
    """(F, 3, 2) texture coordinates of its material's emission at `world_corners`."""
    places = corner_places(obj.mesh, material.emission_texture)
    return places[:, [0, 2, 1]] if _is_mirrored(obj) else places


def _is_mirrored(obj: Object) -> bool:
    return bool(np.linalg.det(obj.world_from_object[:, :3]) < 0)


def light_planes(
    corners: Array,
    emission: Array,
    density: Array,
    power: Array,
    flags: npt.NDArray[np.integer],
    errors: Array,
) -> npt.NDArray[np.float32]:
    """(len(LightPlane), N) of triangles (N, 3, 3), which are chosen by their power; one of them at least.
    `errors` (N, 3) are those of `transform_errors`."""
    plane = layout.LightPlane
    planes = np.zeros((len(plane), len(corners)), np.float32)
    planes[plane.VERTEX_X : plane.VERTEX_Z + 1] = corners[:, 0].T
    planes[plane.EDGE_1_X : plane.EDGE_1_Z + 1] = (corners[:, 1] - corners[:, 0]).T
    planes[plane.EDGE_2_X : plane.EDGE_2_Z + 1] = (corners[:, 2] - corners[:, 0]).T
    planes[plane.EMISSION_R : plane.EMISSION_B + 1] = emission.T
    planes[plane.PDF_AREA] = density
    planes[plane.ALIAS_PROBABILITY], alias = alias_table(power)
    planes[plane.ALIAS] = alias.view(np.float32)
    planes[plane.FLAGS] = flags.astype(np.uint32).view(np.float32)
    planes[plane.SLACK] = slack(corners, errors)
    return planes


def slack(corners: Array, errors: Array) -> Array:
    """(N,) how far a point that is chosen on triangles (N, 3, 3) may lie off them as rays meet them, in
    metres: by the rounding of their corners and of the point, of the way of a ray into the space of an object
    (`errors` (N, 3), along each axis), and of the test of a ray against them."""
    edge_1, edge_2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(edge_1, edge_2)
    length = np.linalg.norm(normal, axis=1)
    extent = np.maximum(np.abs(edge_1), np.abs(edge_2))
    error = _HALF_ULP * (_COORDINATE_ULPS * (np.abs(corners[:, 0]) + extent) + _EXTENT_ULPS * extent) + errors
    off = np.einsum("ij,ij->i", np.abs(normal), error) / length
    size = np.linalg.norm(extent, axis=1)
    return np.asarray(off + _HALF_ULP * _TEST_ULPS * size**3 / length)


def transform_errors(obj: Object) -> Array:
    """(F, 3) how far rounding may move a point of each triangle on its way from the object's space to world
    space and back, along each axis, in metres."""
    matrix = np.abs(obj.world_from_object)
    inverse = np.abs(affine.invert(obj.world_from_object))
    reach = np.abs(world_corners(obj)).max(axis=1)
    local = reach @ inverse[:, :3].T + inverse[:, 3]
    return np.asarray(_HALF_ULP * _TRANSFORM_ULPS * (local @ matrix[:, :3].T + matrix[:, 3]))


def areas(corners: Array) -> Array:
    """(N,) of triangles (N, 3, 3)."""
    edge_1, edge_2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(np.linalg.norm(np.cross(edge_1, edge_2), axis=1) / 2)


def world_corners(obj: Object) -> Array:
    """(F, 3, 3) of its triangles, in world space, counter-clockwise from outside."""
    # A mirrored face keeps its outside: two corners change places to keep it on the normal's side.
    faces = obj.mesh.faces[:, [0, 2, 1]] if _is_mirrored(obj) else obj.mesh.faces
    return np.asarray(affine.apply(obj.world_from_object, obj.mesh.vertices)[faces])


def emissive_objects(scene: Scene) -> list[Object]:
    """Those that are seen. They are few as a rule, and looking for them must be quick among thousands."""
    emissive = {name for name, material in scene.materials.items() if material.is_emissive}
    return [obj for obj in scene.objects if obj.material in emissive and obj.visible]
