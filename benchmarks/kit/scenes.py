"""The scenes on which incpt is compared with other renderers, and larger ones to see how cost grows.

Their materials are those that every compared renderer has exactly: Lambertian, also by an image, smooth
glass, and GGX metal without a tint, whose Fresnel factor is 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
import numpy.typing as npt

from incpt.core.affine import Vector
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.texture import Bitmap, Texture

FULL_CIRCLE = 2 * np.pi


@dataclass(frozen=True)
class BenchmarkScene:
    """A scene with the bounces at which it is rendered: scattering events after the first hit, and passages
    through glass, which only incpt counts apart. `moves` is the object that is moved to time an edit."""

    make: Callable[[], Scene]
    triangles: int
    max_bounces: int
    transmission_bounces: int
    moves: str

    @property
    def scene(self) -> Scene:
        """The scene; the same one at every call, so that its meshes are built once."""
        return _made(self.make)


@cache
def _made(make: Callable[[], Scene]) -> Scene:
    return make()


def matte(r: float, g: float, b: float) -> Material:
    """Exactly Lambertian."""
    return Material((r, g, b), specular=0)


def lamp(r: float, g: float, b: float) -> Material:
    """Black, and emits from the front."""
    return Material((0, 0, 0), specular=0, emission=(r, g, b))


def metal(roughness: float) -> Material:
    """White GGX: Schlick's Fresnel factor of white is 1, as that of a metal without absorption."""
    return Material((1, 1, 1), metallic=1, roughness=roughness)


def plane(name: str, material: str, position: Vector, rotation: Vector, scale: Vector) -> Object:
    """Two triangles."""
    return Object(name, shape("plane"), material, position, rotation, scale)


def cube(name: str, material: str, position: Vector, rotation: Vector, scale: Vector) -> Object:
    """Twelve triangles."""
    return Object(name, shape("cube"), material, position, rotation, scale)


_BOX_MATERIALS = {
    "white": matte(0.73, 0.71, 0.68),
    "red": matte(0.63, 0.06, 0.05),
    "green": matte(0.14, 0.45, 0.09),
    "lamp": lamp(17, 12, 4),
}


def _box() -> list[Object]:
    """Five walls, 2 m wide, and a lamp in four panes: 18 triangles."""
    walls = [
        plane("floor", "white", (0, 0, 0), (0, 0, 0), (2, 1, 2)),
        plane("ceiling", "white", (0, 2, 0), (180, 0, 0), (2, 1, 2)),
        plane("back", "white", (0, 1, -1), (90, 0, 0), (2, 1, 2)),
        plane("left", "red", (-1, 1, 0), (0, 0, -90), (2, 1, 2)),
        plane("right", "green", (1, 1, 0), (0, 0, 90), (2, 1, 2)),
    ]
    panes = [
        plane(f"lamp {i}", "lamp", (0.13 - 0.26 * (i & 1), 1.99, 0.11 - 0.22 * (i >> 1)), (180, 0, 0),
              (0.24, 1, 0.2))
        for i in range(4)
    ]  # fmt: skip
    return walls + panes


def cornell() -> Scene:
    """A box with an open front, two blocks, a lamp."""
    blocks = [
        cube("tall", "white", (-0.35, 0.6, -0.3), (0, 18, 0), (0.6, 1.2, 0.6)),
        cube("short", "white", (0.35, 0.3, 0.3), (0, -17, 0), (0.6, 0.6, 0.6)),
    ]
    camera = Camera((0, 1, 3.6), (0, 1, 0), fov_y=39)
    return Scene(camera, Environment(), _BOX_MATERIALS, (*_box(), *blocks))


def glass() -> Scene:
    """Seven cubes of smooth glass on a dark floor, under a wide lamp and a sky."""
    materials = {
        "floor": matte(0.25, 0.24, 0.22), "lamp": lamp(4, 3.6, 3),
        "glass": Material((1, 1, 1), roughness=0, transmission=1, ior=1.5),
    }  # fmt: skip
    objects = [
        plane("floor", "floor", (0, 0, 0), (0, 0, 0), (8, 1, 8)),
        plane("lamp", "lamp", (0, 3, 0.5), (180, 0, 0), (2, 1, 2)),
    ]
    for i in range(7):
        angle = i * FULL_CIRCLE / 6
        around = 0.0 if i == 6 else 1.0
        x, z = around * float(np.cos(angle)), around * float(np.sin(angle))
        objects.append(cube(f"cube {i}", "glass", (x, 0.31, z), (0, 25.0 * i, 0), (0.55, 0.6, 0.55)))
    camera = Camera((0, 1.6, 3.8), (0, 0.3, 0), fov_y=36)
    return Scene(camera, Environment(color=(0.5, 0.6, 0.75)), materials, tuple(objects))


def sphere() -> Scene:
    """A wavy matte ball of 327,680 triangles in the box, before a board."""
    objects = [
        *_box(),
        plane("board", "white", (0.5, 0.9, -0.75), (70, 0, -25), (0.7, 1, 1.2)),
        Object("ball", wavy_sphere(7), "ball", (-0.1, 0.8, 0.05)),
    ]
    materials = {**_BOX_MATERIALS, "ball": matte(0.6, 0.6, 0.65)}
    return Scene(Camera((0, 1, 3.6), (0, 1, 0), fov_y=39), Environment(), materials, tuple(objects))


def plates() -> Scene:
    """Metal plates of rising roughness under four round lamps (after Veach 1997)."""
    roughness = (0.15, 0.22, 0.3, 0.4)
    height, depth, tilt = (0.75, 0.4, 0.15, 0.0), (-1.1, -0.3, 0.5, 1.3), (21, 13, 7, 1)
    radii = (0.05, 0.12, 0.22, 0.4)
    colours = ((1, 0.6, 0.5), (1, 1, 0.6), (0.5, 1, 0.6), (0.5, 0.7, 1))
    materials = {"wall": matte(0.4, 0.4, 0.4)}
    objects = [
        plane("floor", "wall", (0, -0.4, 0), (0, 0, 0), (8, 1, 8)),
        plane("back", "wall", (0, 1.6, -3.5), (90, 0, 0), (8, 1, 4)),
    ]
    for i, radius in enumerate(radii):
        power = 0.08 / radius**2
        red, green, blue = (power * c for c in colours[i])
        materials |= {f"plate {i}": metal(roughness[i]), f"lamp {i}": lamp(red, green, blue)}
        objects += [
            cube(f"plate {i}", f"plate {i}", (0, height[i], depth[i]), (tilt[i], 0, 0), (3, 0.05, 0.7)),
            Object(f"lamp {i}", icosphere(2), f"lamp {i}", (0.95 * i - 1.4, 2.1, -2.2), scale=(radius,) * 3),
        ]
    camera = Camera((0, 1.9, 4.6), (0, 0.8, -0.2), fov_y=42)
    return Scene(camera, Environment(color=(0.05, 0.05, 0.06)), materials, tuple(objects))


def textured() -> Scene:
    """The wavy ball, the blocks and the floor of the box, each with an image of its own."""
    colors = ((0.8, 0.5, 0.3), (0.3, 0.6, 0.8), (0.5, 0.8, 0.4))
    images = [Material(specular=0, base_color=(1, 1, 1), base_color_texture=Texture(_stripes(i, color)))
              for i, color in enumerate(colors)]  # fmt: skip
    box = {obj.name: obj for obj in _box()}
    box["floor"] = replace(box["floor"], material="image 0")
    objects = [
        *box.values(),
        cube("tall", "image 1", (-0.45, 0.6, -0.4), (0, 18, 0), (0.5, 1.2, 0.5)),
        cube("short", "image 1", (0.55, 0.2, 0.45), (0, -17, 0), (0.4, 0.4, 0.4)),
        Object("ball", wrapped(wavy_sphere(6)), "image 2", (0.2, 0.9, -0.05), scale=(0.7,) * 3),
    ]
    materials = {**_BOX_MATERIALS, **{f"image {i}": image for i, image in enumerate(images)}}
    return Scene(Camera((0, 1, 3.6), (0, 1, 0), fov_y=39), Environment(), materials, tuple(objects))


@cache
def _stripes(number: int, color: Vector, size: int = 1024) -> Bitmap:
    """Waves of a colour, and grains of it, as bytes."""
    y, x = np.mgrid[:size, :size] / size * FULL_CIRCLE
    waves = 0.5 + 0.25 * np.sin((7 + number) * x + 3 * np.sin(5 * y)) + 0.15 * np.sin(60 * y)
    grains = np.random.default_rng(number).uniform(0.8, 1.0, (size, size))
    return Bitmap(np.rint(255 * np.clip((waves * grains)[..., None] * color, 0, 1)).astype(np.uint8))


def wrapped(mesh: Mesh) -> Mesh:
    """A mesh around the origin with texture coordinates by longitude and latitude."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    x, y, z = np.moveaxis(corners / np.linalg.norm(corners, axis=2, keepdims=True), 2, 0)
    u = np.arctan2(x, z) / FULL_CIRCLE + 0.5
    # Faces across the seam go on beyond it.
    u += (np.ptp(u, axis=1, keepdims=True) > 0.5) & (u < 0.5)
    uvs = np.stack([u, 0.5 - np.arcsin(np.clip(y, -1, 1)) / np.pi], axis=2)
    return replace(mesh, uvs=(uvs.astype(np.float32),))


@cache
def lanterns(count: int) -> Scene:
    """The Cornell box with its lamp cut into `count` panes of the same power together."""
    box = cornell()
    rows = int(np.ceil(count**0.5))
    pitch = (0.5 / rows, 0.42 / rows)
    area = 4 * 0.24 * 0.2 / (count * 0.64 * pitch[0] * pitch[1])
    panes = [
        plane(
            f"pane {i}", "lamp",
            ((i % rows + 0.5) * pitch[0] - 0.25, 1.99, (i // rows + 0.5) * pitch[1] - 0.21),
            (180, 0, 0), (0.8 * pitch[0], 1, 0.8 * pitch[1]),
        )
        for i in range(count)
    ]  # fmt: skip
    rest = tuple(obj for obj in box.objects if not obj.name.startswith("lamp"))
    materials = {**box.materials, "lamp": lamp(17 * area, 12 * area, 4 * area)}
    return Scene(box.camera, box.environment, materials, (*rest, *panes))


SCENES = {
    "cornell": BenchmarkScene(cornell, 42, 2, 12, "tall"),
    # Deep enough that nothing is cut off: renderers that count every bounce alike then do the same work.
    "glass": BenchmarkScene(glass, 88, 16, 24, "cube 6"),
    "sphere": BenchmarkScene(sphere, 327_700, 2, 12, "ball"),
    "plates": BenchmarkScene(plates, 1_332, 2, 12, "plate 2"),
    "textured": BenchmarkScene(textured, 81_962, 2, 12, "ball"),
    "lanterns": BenchmarkScene(partial(lanterns, 1_000), 2_034, 2, 12, "tall"),
}


def _ball(subdivisions: int) -> Scene:
    return sphere().with_object("ball", mesh=wavy_sphere(subdivisions))


def _land(triangles: int) -> Scene:
    """Terrain under a sky."""
    land = Object("terrain", terrain(triangles), "land")
    sky = Environment(color=(0.8, 0.9, 1.0))
    return Scene(Camera((0, 1.2, 2.2), (0, 0, 0), fov_y=45), sky, {"land": matte(0.6, 0.6, 0.6)}, (land,))


LARGE_SCENES = {
    "ball-1m": BenchmarkScene(partial(_ball, 8), 1_310_740, 2, 12, "ball"),
    "ball-5m": BenchmarkScene(partial(_ball, 9), 5_242_900, 2, 12, "ball"),
    "terrain-100k": BenchmarkScene(partial(_land, 100_000), 100_352, 2, 12, "terrain"),
    "terrain-1m": BenchmarkScene(partial(_land, 1_000_000), 999_698, 2, 12, "terrain"),
    "terrain-5m": BenchmarkScene(partial(_land, 5_000_000), 4_999_122, 2, 12, "terrain"),
}
"""Meshes of rising size; the ball is that of SCENES."""


def triangle_count(scene: Scene) -> int:
    """Of all objects."""
    return sum(len(obj.mesh.faces) for obj in scene.objects)


# ------------------------------------------------------------------------------------------- meshes


@cache
def icosphere(subdivisions: int) -> Mesh:
    """A sphere of radius 1 with 20 * 4^subdivisions flat triangles."""
    import trimesh

    made = trimesh.creation.icosphere(subdivisions)
    return Mesh(made.vertices, made.faces)


@cache
def wavy_sphere(subdivisions: int) -> Mesh:
    """A sphere of radius about 0.6 with 20 * 4^subdivisions flat triangles, displaced by waves."""
    ball = icosphere(subdivisions)
    return Mesh(_displaced(ball.vertices), ball.faces)


def _displaced(directions: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    x, y, z = directions.T.astype(np.float64)
    height = 0.05 * np.sin(9 * x + 2 * z) * np.sin(8 * y) + 0.02 * np.sin(31 * x) * np.sin(29 * y + 23 * z)
    return np.asarray(directions * (0.6 + height)[:, None], np.float32)


@cache
def terrain(triangles: int) -> Mesh:
    """A wavy square of about that many triangles, 2 m wide."""
    edge = max(1, round((triangles / 2) ** 0.5))
    along = np.linspace(-1, 1, edge + 1)
    x, z = (grid.ravel() for grid in np.meshgrid(along, along))
    y = 0.1 * np.sin(7 * x + z) * np.cos(5 * z) + 0.02 * np.sin(41 * x) * np.sin(37 * z)
    corner = (np.arange(edge)[:, None] * (edge + 1) + np.arange(edge)).ravel()
    quads = np.stack([corner, corner + edge + 1, corner + edge + 2, corner + 1], axis=1)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return Mesh(np.stack([x, y, z], axis=1).astype(np.float32), faces)


@cache
def crowd(count: int, mesh: Mesh | None = None) -> Scene:
    """`count` instances of a mesh (a cube by default) on a floor, in a square of 4 m, under a sky."""
    body = mesh or shape("cube")
    edge = int(np.ceil(count**0.5))
    pitch = 4 / edge
    size = 0.6 * pitch / max(float(np.ptp(body.bounds, axis=0).max()), 1e-9)

    def place(i: int) -> Vector:
        return pitch * (i % edge + 0.5) - 2, 0.4 * pitch, pitch * (i // edge + 0.5) - 2

    objects = [
        Object(f"{i}", body, "matte", place(i), (0, 37.0 * i % 360, 0), (size, size, size))
        for i in range(count)
    ]
    floor = plane("floor", "floor", (0, 0, 0), (0, 0, 0), (8, 1, 8))
    materials = {"matte": matte(0.6, 0.5, 0.4), "floor": matte(0.5, 0.5, 0.5)}
    sky = Environment(color=(0.8, 0.9, 1.0))
    return Scene(Camera((0, 2.5, 4.5), (0, 0, 0), fov_y=45), sky, materials, (floor, *objects))
