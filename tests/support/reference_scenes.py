"""The scenes that are compared with Mitsuba 3; references/make_references.py has rendered them there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from incpt.core.affine import Vector
from incpt.formats.images import load_image
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

SIZE = (64, 48)
_ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Reference:
    """A scene, its number of scattering events after the first hit, and the samples a pixel of the
    reference and of the test."""

    scene: Callable[[], Scene]
    max_bounces: int
    reference_spp: int = 8192
    spp: int = 1024


def _matt(r: float, g: float, b: float) -> Material:
    return Material((r, g, b), specular=0)


def _lamp(r: float, g: float, b: float) -> Material:
    return Material((0, 0, 0), specular=0, emission=(r, g, b))


def _metal(roughness: float) -> Material:
    # White, because Schlick's Fresnel term then is exactly 1, as that of Mitsuba's metal "none".
    return Material((1, 1, 1), metallic=1, roughness=roughness)


def _plane(name: str, material: str, position: Vector, rotation: Vector, scale: Vector) -> Object:
    return Object(name, shape("plane"), material, position, rotation, scale)


def _cube(name: str, material: str, position: Vector, rotation: Vector, scale: Vector) -> Object:
    return Object(name, shape("cube"), material, position, rotation, scale)


def cornell() -> Scene:
    """A closed box but for its front, two blocks, one lamp."""
    materials = {
        "white": _matt(0.73, 0.71, 0.68), "red": _matt(0.63, 0.06, 0.05), "green": _matt(0.14, 0.45, 0.09),
        "lamp": _lamp(17, 12, 4),
    }  # fmt: skip
    objects = (
        _plane("floor", "white", (0, 0, 0), (0, 0, 0), (2, 1, 2)),
        _plane("ceiling", "white", (0, 2, 0), (180, 0, 0), (2, 1, 2)),
        _plane("back", "white", (0, 1, -1), (90, 0, 0), (2, 1, 2)),
        _plane("left", "red", (-1, 1, 0), (0, 0, -90), (2, 1, 2)),
        _plane("right", "green", (1, 1, 0), (0, 0, 90), (2, 1, 2)),
        _plane("lamp", "lamp", (0, 1.99, 0), (180, 0, 0), (0.5, 1, 0.4)),
        _cube("tall", "white", (-0.35, 0.6, -0.3), (0, 18, 0), (0.6, 1.2, 0.6)),
        _cube("short", "white", (0.35, 0.3, 0.3), (0, -17, 0), (0.6, 0.6, 0.6)),
    )
    return Scene(Camera((0, 1, 3.6), (0, 1, 0), fov_y=39), Environment(), materials, objects)


def glass() -> Scene:
    """A smooth ball and a smooth block on a matt floor under two wide lamps and a faint sky."""
    materials = {
        "floor": _matt(0.5, 0.5, 0.45), "wall": _matt(0.3, 0.4, 0.6), "above": _lamp(3, 3, 3),
        "side": _lamp(4, 2.5, 1), "glass": Material((1, 1, 1), roughness=0, transmission=1, ior=1.5),
        "dense": Material((1, 1, 1), roughness=0, transmission=1, ior=1.8),
    }  # fmt: skip
    objects = (
        _plane("floor", "floor", (0, 0, 0), (0, 0, 0), (6, 1, 6)),
        _plane("wall", "wall", (0, 1, -2), (90, 0, 0), (6, 1, 3)),
        _plane("above", "above", (0, 3, 0.5), (180, 0, 0), (2, 1, 2)),
        _plane("side", "side", (-2.5, 1.2, 0.5), (0, 0, -90), (1.5, 1, 1.5)),
        Object("ball", shape("sphere"), "glass", (-0.55, 0.55, 0.1), (0, 0, 0), (1, 1, 1)),
        _cube("block", "dense", (0.65, 0.45, 0), (0, 30, 0), (0.7, 0.8, 0.7)),
    )
    environment = Environment(color=(0.2, 0.25, 0.3))
    return Scene(Camera((0, 1.2, 3.6), (0, 0.5, 0), fov_y=36), environment, materials, objects)


def plates() -> Scene:
    """Metal plates of rising roughness that reflect lamps of four sizes (after Veach 1997)."""
    roughness = (0.15, 0.22, 0.3, 0.4)
    height, depth, tilt = (0.75, 0.4, 0.15, 0.0), (-1.1, -0.3, 0.5, 1.3), (21, 13, 7, 1)
    sizes, colours = (0.06, 0.15, 0.35, 0.7), ((1, 0.6, 0.5), (1, 1, 0.6), (0.5, 1, 0.6), (0.5, 0.7, 1))
    materials = {"floor": _matt(0.4, 0.4, 0.4)}
    objects = [_plane("floor", "floor", (0, -0.4, 0), (0, 0, 0), (8, 1, 8))]
    for i in range(4):
        power = 0.3 / sizes[i] ** 2
        materials |= {
            f"plate {i}": _metal(roughness[i]),
            f"lamp {i}": _lamp(*(power * c for c in colours[i])),
        }
        plate, lamp = (0, height[i], depth[i]), (0.9 * i - 1.35, 2.2, -2.2)
        objects += [
            _cube(f"plate {i}", f"plate {i}", plate, (tilt[i], 0, 0), (3, 0.05, 0.7)),
            _plane(f"lamp {i}", f"lamp {i}", lamp, (130, 0, 0), (sizes[i], 1, sizes[i])),
        ]
    camera = Camera((0, 1.9, 4.6), (0, 0.8, -0.2), fov_y=42)
    return Scene(camera, Environment(color=(0.05, 0.05, 0.06)), materials, tuple(objects))


def environment() -> Scene:
    """Matt and metal bodies under a turned panorama, some of which is seen."""
    materials = {
        "floor": _matt(0.4, 0.4, 0.4), "matt": _matt(0.8, 0.4, 0.2), "polished": _metal(0.2),
        "brushed": _metal(0.45),
    }  # fmt: skip
    objects = (
        _plane("floor", "floor", (0, 0, 0), (0, 0, 0), (8, 1, 8)),
        _cube("matt", "matt", (0, 0.5, 0), (0, 25, 0), (0.8, 1, 0.8)),
        _cube("polished", "polished", (-1.2, 0.4, 0.2), (0, -35, 0), (0.8, 0.8, 0.8)),
        _cube("brushed", "brushed", (1.2, 0.4, 0.2), (0, 50, 0), (0.8, 0.8, 0.8)),
    )
    image = load_image(_ROOT / "scenes" / "courtyard.exr")
    sky = Environment((1.0, 0.9, 0.8), image, rotation_y=110, intensity=1.5)
    return Scene(Camera((0.3, 1.3, 4), (0, 0.5, 0), fov_y=38), sky, materials, objects)


def frosted() -> Scene:
    """Rough glass between a lamp and a matt floor."""
    materials = {
        "floor": _matt(0.5, 0.5, 0.5), "lamp": _lamp(5, 4, 3),
        "frosted": Material((1, 1, 1), roughness=0.45, transmission=1, ior=1.5),
    }  # fmt: skip
    objects = (
        _plane("floor", "floor", (0, 0, 0), (0, 0, 0), (6, 1, 6)),
        _plane("lamp", "lamp", (0.5, 2.2, -1.8), (120, 0, 0), (1.2, 1, 1.2)),
        _cube("pane", "frosted", (-0.5, 0.7, 0), (0, 20, 0), (1.2, 1.2, 0.15)),
        _cube("block", "frosted", (0.9, 0.4, 0.3), (0, 40, 0), (0.7, 0.7, 0.7)),
    )
    sky = Environment(color=(0.3, 0.3, 0.35))
    return Scene(Camera((0, 1.2, 3.6), (0, 0.5, 0), fov_y=38), sky, materials, objects)


REFERENCES = {
    "cornell": Reference(cornell, 3),
    "glass": Reference(glass, 20),
    "plates": Reference(plates, 3),
    "environment": Reference(environment, 3),
    "frosted": Reference(frosted, 20),
}
