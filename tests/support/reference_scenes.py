"""The scenes that are compared with Mitsuba 3; references/make_references.py has rendered them there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from incpt.benchmarks.kit.scenes import cube, lamp, matte, metal, plane
from incpt.formats.images import load_image
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.light import Light
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.texture import Bitmap, Texture

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


def _pattern(seed: int, height: int = 12, width: int = 16) -> Bitmap:
    """Coloured noise that is smooth over a few pixels, as 8-bit sRGB."""
    rng = np.random.default_rng(seed)
    coarse = rng.uniform(20, 250, (height // 4, width // 4, 3))
    fine = np.kron(coarse, np.ones((4, 4, 1))) + rng.uniform(-20, 5, (height, width, 3))
    return Bitmap(np.clip(fine, 0, 255).astype(np.uint8))


def _dents(height: int = 16, width: int = 16, slope: float = 0.2) -> Bitmap:
    """A normal map of dents, in floats."""
    y, x = np.mgrid[:height, :width]
    leans = np.stack([slope * np.sin(2 * np.pi * x / width), slope * np.cos(2 * np.pi * y / height)], axis=-1)
    normal = np.concatenate([leans, np.ones((height, width, 1))], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return Bitmap(((normal + 1) / 2).astype(np.float32))


def textured() -> Scene:
    """Images on matte things: interpolated and not, repeated, mirrored, turned, on flat and on round
    meshes."""
    materials = {
        "floor": replace(matte(1, 1, 1), base_color_texture=Texture(_pattern(1), scale=(3, 2), rotation=25)),
        "wall": replace(
            matte(0.9, 0.8, 1), base_color_texture=Texture(_pattern(2), wrap="mirror", scale=(2, 2))
        ),
        "cube": replace(matte(1, 1, 1), base_color_texture=Texture(_pattern(3), filter="nearest")),
        "ball": replace(matte(1, 1, 1), base_color_texture=Texture(_pattern(4), scale=(2, 1))),
        "lamp": lamp(9, 8, 7),
    }  # fmt: skip
    objects = (
        plane("floor", "floor", (0, 0, 0), (0, 0, 0), (6, 1, 6)),
        plane("wall", "wall", (0, 1, -1.5), (90, 0, 0), (6, 1, 3)),
        plane("lamp", "lamp", (0.8, 2.4, 0.8), (180, 0, 0), (0.8, 1, 0.8)),
        cube("cube", "cube", (-0.8, 0.5, 0), (0, 30, 0), (1, 1, 1)),
        Object("ball", shape("sphere"), "ball", (0.7, 0.5, 0.1), (0, 40, 0)),
    )
    sky = Environment(color=(0.3, 0.35, 0.4))
    return Scene(Camera((0, 1.2, 3.4), (0, 0.5, 0), fov_y=40), sky, materials, objects)


def embossed() -> Scene:
    """Normal maps on matte walls, and metal of which the roughness is an image, in light of a lamp that is
    one."""
    rough = np.random.default_rng(5).uniform(0.35, 0.8, (4, 4, 3)).astype(np.float32)
    rough[..., 2] = 1  # metallic everywhere
    screen = np.zeros((6, 8, 3), np.uint8)
    screen[1:3, 1:4], screen[4:, 5:7] = (255, 190, 120), (90, 160, 255)
    materials = {
        "floor": replace(matte(0.6, 0.6, 0.6), normal_texture=Texture(_dents(), scale=(4, 4))),
        "wall": replace(matte(0.5, 0.4, 0.6), normal_texture=Texture(_dents(slope=0.3), scale=(6, 3))),
        "metal": Material(
            (1, 1, 1), metallic=1, roughness=1, specular=0,
            metallic_roughness_texture=Texture(Bitmap(rough), filter="nearest"),
        ),
        "screen": replace(lamp(14, 14, 14), emission_texture=Texture(Bitmap(screen))),
    }  # fmt: skip
    objects = (
        plane("floor", "floor", (0, 0, 0), (0, 0, 0), (6, 1, 6)),
        plane("wall", "wall", (0, 1, -1.5), (90, 0, 0), (6, 1, 3)),
        plane("screen", "screen", (-1.9, 1.2, 0.3), (0, -90, 90), (1.6, 1, 1.2)),
        cube("metal", "metal", (0.5, 0.5, 0), (0, 30, 0), (1, 1, 1)),
    )
    sky = Environment(color=(0.1, 0.12, 0.15))
    return Scene(Camera((0, 1.2, 3.4), (0, 0.5, 0), fov_y=40), sky, materials, objects)


def lights() -> Scene:
    """Lights of their own over matte and metal bodies in a corner: ball, rectangle, disk, point, spot and
    sun."""
    materials = {"wall": matte(0.6, 0.6, 0.6), "block": matte(0.7, 0.3, 0.2), "metal": metal(0.3)}
    objects = (
        plane("floor", "wall", (0, 0, 0), (0, 0, 0), (4, 1, 4)),
        plane("back", "wall", (0, 1.5, -1.5), (90, 0, 0), (4, 1, 3)),
        cube("block", "block", (-0.7, 0.4, 0), (0, 25, 0), (0.5, 0.8, 0.5)),
        cube("plate", "metal", (0.6, 0.3, 0.2), (25, -30, 0), (1, 0.05, 0.8)),
    )
    lamps = (
        Light("ball", "sphere", (0.1, 0.6, -0.5), radius=0.25, radiance=2, color=(1, 0.6, 0.4)),
        Light("pane", "rectangle", (-1.2, 1.6, -1.499), (0, 180, 0), size=(0.8, 0.5), power=8),
        Light("disk", "disk", (1.2, 1.5, -1.499), (0, 180, 10), radius=0.3, power=4, color=(0.5, 0.7, 1)),
        Light("point", "point", (0.4, 1.2, 0.6), radius=0, power=4, color=(1, 1, 0.5)),
        Light("spot", "spot", (-0.5, 2, 1), (-60, 10, 0), radius=0, spot_angle=50, spot_blend=0, power=3),
        Light("sun", "sun", rotation=(-50, 40, 0), angle=0, irradiance=0.7),
    )
    camera = Camera((0.2, 1.4, 3.6), (0, 0.7, 0), fov_y=42)
    return Scene(camera, Environment(), materials, objects, lights=lamps)


def panes() -> Scene:
    """Thin walls, clear and tinted, between a lamp and a matte corner."""
    materials = {
        "wall": matte(0.6, 0.6, 0.6), "block": matte(0.7, 0.4, 0.2), "lamp": lamp(6, 5, 4),
        "clear": Material((1, 1, 1), roughness=0, transmission=1, thin_walled=True),
        "tinted": Material((0.9, 0.5, 0.3), roughness=0, transmission=1, thin_walled=True, ior=1.8),
    }  # fmt: skip
    objects = (
        plane("floor", "wall", (0, 0, 0), (0, 0, 0), (6, 1, 6)),
        plane("back", "wall", (0, 1.5, -1.5), (90, 0, 0), (6, 1, 3)),
        plane("lamp", "lamp", (0.5, 2.4, 0.3), (180, 0, 0), (1.4, 1, 1.4)),
        cube("block", "block", (-0.2, 0.35, -0.5), (0, 25, 0), (0.5, 0.7, 0.5)),
        plane("clear", "clear", (-0.7, 0.6, 0.4), (70, 10, 0), (1, 1, 1.2)),
        plane("tinted", "tinted", (0.7, 0.6, 0.2), (80, -30, 10), (0.9, 1, 1)),
        Object("bubble", shape("sphere"), "clear", (0.4, 0.3, 0.9), scale=(0.5, 0.5, 0.5)),
    )
    sky = Environment(color=(0.3, 0.35, 0.4))
    return Scene(Camera((0, 1.2, 3.6), (0, 0.5, 0), fov_y=38), sky, materials, objects)


def brushed() -> Scene:
    """Metal with stretched reflections, along and across, flat and round, that mirrors a lamp and a sky."""
    along = Material((1, 1, 1), metallic=1, roughness=0.3, anisotropy=0.4)
    materials = {
        "floor": matte(0.4, 0.4, 0.4), "lamp": lamp(8, 7, 6), "along": along,
        "across": replace(along, anisotropy_rotation=90),
        "much": replace(along, roughness=0.2, anisotropy=0.5),
    }  # fmt: skip
    objects = (
        plane("floor", "floor", (0, 0, 0), (0, 0, 0), (6, 1, 6)),
        plane("lamp", "lamp", (0.3, 2.2, -1.6), (125, 0, 0), (1, 1, 1)),
        plane("along", "along", (-0.9, 0.5, 0), (25, 20, 0), (0.9, 1, 0.9)),
        plane("across", "across", (0.1, 0.5, 0), (25, 0, 0), (0.9, 1, 0.9)),
        Object("round", shape("cylinder"), "much", (1.1, 0.5, 0), (0, 30, 10), (0.8, 1, 0.8)),
    )
    image = load_image(_ROOT / "scenes" / "courtyard.exr")
    sky = Environment((1, 1, 1), image, rotation_y=40, intensity=0.6)
    return Scene(Camera((0, 1.3, 3.6), (0, 0.5, 0), fov_y=38), sky, materials, objects)


def lens() -> Scene:
    """The box behind a lens that is wide open, of which a plane between the blocks is sharp."""
    return cornell().with_camera(f_stop=0.12, focus_distance=3.6, focal_length=30.0, sensor_fit="vertical")


def orthographic() -> Scene:
    """The box in parallel projection, from above and aside."""
    return cornell().with_camera(position=(0.5, 1.9, 3.6), projection="orthographic", ortho_height=2.6)


def shifted() -> Scene:
    """The box seen by a camera that stands higher and further left, and looks straight ahead."""
    return cornell().with_camera(
        position=(-0.3, 1.3, 3.6), target=(-0.3, 1.3, 0), shift_x=0.08, shift_y=-0.12
    )


REFERENCES = {
    "cornell": Reference(cornell, 3),
    "glass": Reference(glass, 20),
    "plates": Reference(plates, 3),
    "environment": Reference(environment, 3),
    "frosted": Reference(frosted, 20),
    "textured": Reference(textured, 3),
    "embossed": Reference(embossed, 3),
    "lights": Reference(lights, 3),
    "panes": Reference(panes, 20),
    "brushed": Reference(brushed, 3),
    "lens": Reference(lens, 3),
    "orthographic": Reference(orthographic, 3),
    "shifted": Reference(shifted, 3),
}
