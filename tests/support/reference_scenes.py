"""The scenes that are compared with Mitsuba 3; references/make_references.py has rendered them there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from incpt.benchmarks.kit.scenes import cube, lamp, matte, metal, plane
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


def cornell() -> Scene:
    """A closed box but for its front, two blocks, one lamp."""
    materials = {
        "white": matte(0.73, 0.71, 0.68), "red": matte(0.63, 0.06, 0.05), "green": matte(0.14, 0.45, 0.09),
        "lamp": lamp(17, 12, 4),
    }  # fmt: skip
    objects = (
        plane("floor", "white", (0, 0, 0), (0, 0, 0), (2, 1, 2)),
        plane("ceiling", "white", (0, 2, 0), (180, 0, 0), (2, 1, 2)),
        plane("back", "white", (0, 1, -1), (90, 0, 0), (2, 1, 2)),
        plane("left", "red", (-1, 1, 0), (0, 0, -90), (2, 1, 2)),
        plane("right", "green", (1, 1, 0), (0, 0, 90), (2, 1, 2)),
        plane("lamp", "lamp", (0, 1.99, 0), (180, 0, 0), (0.5, 1, 0.4)),
        cube("tall", "white", (-0.35, 0.6, -0.3), (0, 18, 0), (0.6, 1.2, 0.6)),
        cube("short", "white", (0.35, 0.3, 0.3), (0, -17, 0), (0.6, 0.6, 0.6)),
    )
    return Scene(Camera((0, 1, 3.6), (0, 1, 0), fov_y=39), Environment(), materials, objects)


def glass() -> Scene:
    """A smooth ball and a smooth block on a matte floor under two wide lamps and a faint sky."""
    materials = {
        "floor": matte(0.5, 0.5, 0.45), "wall": matte(0.3, 0.4, 0.6), "above": lamp(3, 3, 3),
        "side": lamp(4, 2.5, 1), "glass": Material((1, 1, 1), roughness=0, transmission=1, ior=1.5),
        "dense": Material((1, 1, 1), roughness=0, transmission=1, ior=1.8),
    }  # fmt: skip
    objects = (
        plane("floor", "floor", (0, 0, 0), (0, 0, 0), (6, 1, 6)),
        plane("wall", "wall", (0, 1, -2), (90, 0, 0), (6, 1, 3)),
        plane("above", "above", (0, 3, 0.5), (180, 0, 0), (2, 1, 2)),
        plane("side", "side", (-2.5, 1.2, 0.5), (0, 0, -90), (1.5, 1, 1.5)),
        Object("ball", shape("sphere"), "glass", (-0.55, 0.55, 0.1), (0, 0, 0), (1, 1, 1)),
        cube("block", "dense", (0.65, 0.45, 0), (0, 30, 0), (0.7, 0.8, 0.7)),
    )
    environment = Environment(color=(0.2, 0.25, 0.3))
    return Scene(Camera((0, 1.2, 3.6), (0, 0.5, 0), fov_y=36), environment, materials, objects)


def plates() -> Scene:
    """Metal plates of rising roughness that reflect lamps of four sizes (after Veach 1997)."""
    roughness = (0.15, 0.22, 0.3, 0.4)
    height, depth, tilt = (0.75, 0.4, 0.15, 0.0), (-1.1, -0.3, 0.5, 1.3), (21, 13, 7, 1)
    sizes, colours = (0.06, 0.15, 0.35, 0.7), ((1, 0.6, 0.5), (1, 1, 0.6), (0.5, 1, 0.6), (0.5, 0.7, 1))
    materials = {"floor": matte(0.4, 0.4, 0.4)}
    objects = [plane("floor", "floor", (0, -0.4, 0), (0, 0, 0), (8, 1, 8))]
    for i in range(4):
        power = 0.3 / sizes[i] ** 2
        materials |= {
            f"plate {i}": metal(roughness[i]),
            f"lamp {i}": lamp(*(power * c for c in colours[i])),
        }
        above = (0.9 * i - 1.35, 2.2, -2.2)
        objects += [
            cube(f"plate {i}", f"plate {i}", (0, height[i], depth[i]), (tilt[i], 0, 0), (3, 0.05, 0.7)),
            plane(f"lamp {i}", f"lamp {i}", above, (130, 0, 0), (sizes[i], 1, sizes[i])),
        ]
    camera = Camera((0, 1.9, 4.6), (0, 0.8, -0.2), fov_y=42)
    return Scene(camera, Environment(color=(0.05, 0.05, 0.06)), materials, tuple(objects))


def environment() -> Scene:
    """Matte and metal bodies under a turned panorama, some of which is seen."""
    materials = {
        "floor": matte(0.4, 0.4, 0.4), "matte": matte(0.8, 0.4, 0.2), "polished": metal(0.2),
        "brushed": metal(0.45),
    }  # fmt: skip
    objects = (
        plane("floor", "floor", (0, 0, 0), (0, 0, 0), (8, 1, 8)),
        cube("matte", "matte", (0, 0.5, 0), (0, 25, 0), (0.8, 1, 0.8)),
        cube("polished", "polished", (-1.2, 0.4, 0.2), (0, -35, 0), (0.8, 0.8, 0.8)),
        cube("brushed", "brushed", (1.2, 0.4, 0.2), (0, 50, 0), (0.8, 0.8, 0.8)),
    )
    image = load_image(_ROOT / "scenes" / "courtyard.exr")
    sky = Environment((1.0, 0.9, 0.8), image, rotation_y=110, intensity=1.5)
    return Scene(Camera((0.3, 1.3, 4), (0, 0.5, 0), fov_y=38), sky, materials, objects)


def frosted() -> Scene:
    """Rough glass between a lamp and a matte floor."""
    materials = {
        "floor": matte(0.5, 0.5, 0.5), "lamp": lamp(5, 4, 3),
        "frosted": Material((1, 1, 1), roughness=0.45, transmission=1, ior=1.5),
    }  # fmt: skip
    objects = (
        plane("floor", "floor", (0, 0, 0), (0, 0, 0), (6, 1, 6)),
        plane("lamp", "lamp", (0.5, 2.2, -1.8), (120, 0, 0), (1.2, 1, 1.2)),
        cube("pane", "frosted", (-0.5, 0.7, 0), (0, 20, 0), (1.2, 1.2, 0.15)),
        cube("block", "frosted", (0.9, 0.4, 0.3), (0, 40, 0), (0.7, 0.7, 0.7)),
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
