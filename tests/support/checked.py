"""Runs the kernels of small scenes on a device that checks every access to memory: the simulator Oclgrind.

    oclgrind ... python -m support.checked simulator SCHEDULE SCENE

Or, as `memory` in place of `simulator`, on the device of the tests, with buffers that end where memory ends.
Oclgrind takes no intrinsics of processors and none of some operations on bits, so that these are spelled out
here; all other text is what devices get.
"""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from typing import Any

import numpy as np

from incpt.benchmarks.kit.scenes import icosphere
from incpt.core.layout import TextureSlot
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.session import Session
from incpt.render.wavefront import Wavefront
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.light import Light
from incpt.scene.material import Material, texture_name
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.sky import Sky
from incpt.scene.texture import Bitmap, Texture
from support.guarded import GuardedDevice
from support.small_scenes import mixed_scene

_BITS = """
uint plain_reverse(uint x) {
    uint r = 0;
    for (volatile int i = 0; i < 32; i++) { r = r << 1 | (x & 1u); x >>= 1; }
    return r;
}
uint plain_count(uint x) {
    uint n = 0;
    for (volatile int i = 0; i < 32; i++) { n += x & 1u; x >>= 1; }
    return n;
}
uint plain_first(uint x) {
    uint n = 32;
    for (volatile int i = 31; i >= 0; i--)
        n = x >> i & 1u ? i : n;
    return n;
}
uint plain_clear(uint x) {
    volatile uint y = x;
    return y & (y - 1u);
}
"""
_SPELLED_OUT = (
    (r"INLINE uint reverse_bits\(uint x\) \{.*?\n\}", ""),
    (r"#define REVERSE_BITS\(x\) \S+", "#define REVERSE_BITS(x) plain_reverse(x)"),
    (r"#define (COUNT_BITS|BVH_FIRST_BIT)\(x\).*?\n", ""),
    (r"(\w+) &= \1 - 1", r"\1 = plain_clear(\1)"),
    (r"__builtin_(sqrt|fabs|floor)f\(", r"\1("),
    (r"__builtin_prefetch\(", "(void)("),
)
_DEFINED = "#define COUNT_BITS(x) plain_count(x)\n#define BVH_FIRST_BIT(x) plain_first(x)\n"


class CheckedDevice(Device):
    """The simulator; `in_blocks`: it is taken for a CPU under clang without AVX-512."""

    def __init__(self, in_blocks: bool) -> None:
        self._in_blocks = in_blocks
        super().__init__("oclgrind")

    @property
    def is_clang_cpu(self) -> bool:
        return self._in_blocks

    def program_text(self, file: str, features: tuple[str, ...] = ()) -> str:
        text = super().program_text(file, features)
        for pattern, plain in _SPELLED_OUT:
            text = re.sub(pattern, plain, text, flags=re.DOTALL)
        return _BITS + _DEFINED + text


def empty_glass() -> Scene:
    """No object, and a material that lets light through."""
    return Scene(
        environment=Environment((1, 1, 1)), materials={"glass": Material(roughness=0, transmission=1)}
    )


def flat_box() -> Scene:
    """A box without normals of its own, a lamp of one material, and sky in nearly all pixels."""
    materials = {"box": Material(), "lamp": Material(emission=(1, 1, 1))}
    objects = (
        Object("box", shape("cube"), "box", scale=(0.1, 0.1, 0.1)),
        Object("lamp", shape("plane"), "lamp", (0, 1, 0), (180, 0, 0)),
    )
    return Scene(Camera((0, 0, 3), (0, 0, 0)), Environment((1, 1, 1)), materials, objects)


def smooth_box() -> Scene:
    """A box of glass that is smooth: the wavefront has no kernels of its own for that, and asks as for rough
    glass."""
    materials = {"glass": Material(roughness=0, transmission=1)}
    return Scene(
        Camera((0, 0, 3), (0, 0, 0)),
        Environment((1, 1, 1)),
        materials,
        (Object("box", shape("cube"), "glass"),),
    )


def everything() -> Scene:
    """What kernels can be asked for, at once: walls and rough glass that absorbs, every layer, textures,
    holes, colours of vertices, lights of every kind beside those of triangles, a sky and its sun, and a lens.

    Each scene has kernels of its own to be built and simulated, so that one for each of these would take long
    and run through no more code. Its ball has not the twenty thousand triangles of the built-in sphere, from
    which the simulator would make a tree for as long as all the rest takes.
    """
    scene = mixed_scene()
    image = Texture(Bitmap(np.full((4, 4, 4), 128, np.uint8)))
    slots = {texture_name(slot): image for slot in TextureSlot}
    materials = {
        **scene.materials,
        "glass": replace(scene.material("glass"), roughness=0.5, transmission=0.5, dispersion=1.0),
        "smooth": replace(scene.material("glass"), thin_walled=True),
        "red": Material(
            base_color=(0.8, 0.1, 0.1),
            alpha_mode="blend",
            emission=(0.1, 0.1, 0.1),
            clearcoat=1.0,
            sheen_color=(1.0, 1.0, 1.0),
            sheen_roughness=1.0,
            anisotropy=1.0,
            iridescence=1.0,
            diffuse_transmission=1.0,
            **slots,
        ),
        "grey": replace(scene.material("grey"), unlit=True),
    }
    kinds = ("point", "spot", "sun", "rectangle", "disk", "sphere")
    lights = [Light(kind, kind, (0.5 * i - 1, 1, 1), (-50, 0, 0), radius=0.2) for i, kind in enumerate(kinds)]
    pane = Object("pane", shape("cube"), "smooth", (0, 0.5, 1.5), scale=(2, 1, 0.1))
    scene = replace(
        scene,
        materials=materials,
        objects=(*scene.objects, pane),
        lights=(*lights, Light("star", "point", (0, 1, 2), radius=0)),
    )
    scene = scene.with_object("glass ball", mesh=coloured_ball())
    return scene.with_camera(f_stop=0.1, blades=5, near=0.1).with_environment(sky=Sky())


def coloured_ball() -> Mesh:
    """Radius 0.5, with normals and colours at its corners; large enough for a tree of its own."""
    ball = icosphere(3)
    corners = ball.vertices[ball.faces]
    return Mesh(0.5 * ball.vertices, ball.faces, corners, colors=np.full((*corners.shape[:2], 4), 0.5))


SCENES: dict[str, Any] = {
    "empty": empty_glass,
    "flat": flat_box,
    "smooth": smooth_box,
    "everything": everything,
}


def check(by: str, schedule: str, name: str) -> None:
    """Renders a scene, what its rays meet first, and an edit of each kind."""
    device = CheckedDevice(schedule == "blocks") if by == "simulator" else GuardedDevice()
    # Each variant of the large scene's kernels takes seconds to build: passes beside the picture, and paths
    # after the last of a kind went, are left to the small scenes.
    is_large = name == "everything"
    settings = RenderSettings(
        size=(5, 4), tile_size=4, nor=1, aovs=not is_large, strategy="impact", max_bounces=2
    )
    scene = replace(SCENES[name](), settings=settings)
    session = Session(scene, device=device)
    if schedule == "wavefront":
        session._tracer = Wavefront(device)
    session.render(1)
    session.first_hits()
    if scene.objects:
        first = scene.objects[0]
        session.edit(scene.with_object(first.name, position=(0.1, 0.2, 0)))
        session.step()
        session.image()
        session.edit(session.scene.with_material(first.material, base_color=(0.3, 0.3, 0.3)))
        session.step()
        for going in ("grey drum",) if is_large else [obj.name for obj in scene.objects]:
            session.edit(session.scene.without_object(going))
        session.step()
    for light in scene.lights[:2]:
        session.edit(session.scene.without_light(light.name))
        session.step()
    if settings.aovs:
        session.pass_image("albedo")


if __name__ == "__main__":
    check(*sys.argv[1:])
