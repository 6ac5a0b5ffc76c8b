"""What is in a scene, as lines of text, and what makes its picture empty or black."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Collection

import numpy as np

from incpt.core.layout import TextureSlot
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.light import KINDS
from incpt.scene.material import Material, texture_of
from incpt.scene.model import Scene


def scene_problems(scene: Scene) -> list[str]:
    """What makes the picture of a valid scene empty or black, a line each."""
    problems = []
    if not scene.objects and not scene.lights:
        problems.append("the scene has no objects: the picture shows the environment only")
    if not has_light(scene):
        problems.append(
            "the scene has no light: the picture will be black; "
            "add a light, an environment or an emissive material"
        )
    needed = {name: _needed_uv_sets(material) for name, material in scene.materials.items()}
    bare = [o.name for o in scene.objects if o.visible and len(o.mesh.uvs) < needed[o.material]]
    if bare:
        others = f" and {len(bare) - 1:,} more" if len(bare) > 1 else ""
        problems.append(
            f"object {bare[0]!r}{others}: has textures, but no texture coordinates of their set; "
            "one pixel of each image covers all, unwrap the mesh"
        )
    return problems


def has_light(scene: Scene) -> bool:
    """Whether anything shines that is shown: the environment, a light, or a material of an object."""
    picture = scene.environment.picture
    is_bright = picture is None or bool(picture.pixels.any()) or scene.environment.has_sun
    if any(c > 0 for c in scene.environment.radiance) and is_bright:
        return True
    if any(light.visible and light.is_emissive for light in scene.lights):
        return True
    shining = {name for name, one in scene.materials.items() if one.is_emissive or one.unlit}
    return any(obj.visible and obj.material in shining for obj in scene.objects)


def _needed_uv_sets(material: Material) -> int:
    """How many sets of texture coordinates its textures ask a mesh for."""
    textures = (texture_of(material, slot) for slot in TextureSlot)
    return max((one.uv_set + 1 for one in textures if one is not None), default=0)


def describe(scene: Scene) -> list[str]:
    """What is in a scene, as lines of text: counts, bounds, lights, problems."""
    meshes = {id(o.mesh): o.mesh for o in scene.objects}
    lights = [o for o in scene.objects if o.visible and scene.materials[o.material].is_emissive]
    hidden = sum(not o.visible for o in scene.objects)
    placed = sum(len(o.mesh.faces) for o in scene.objects)
    stored = sum(len(mesh.faces) for mesh in meshes.values())
    lines = [
        f"objects: {len(scene.objects):,}" + (f" ({hidden:,} hidden)" if hidden else ""),
        f"meshes: {len(meshes):,} with {stored:,} triangles; {placed:,} triangles placed",
        f"materials: {len(scene.materials):,}",
        f"textures: {described_textures(scene)}",
        f"lights: {_described_lights(scene)}",
        f"emissive objects: {len(lights):,} with {sum(len(o.mesh.faces) for o in lights):,} triangles",
        f"environment: {_described_environment(scene.environment)}",
    ]
    if scene.objects:
        bounds = np.stack([o.world_bounds for o in scene.objects])
        low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
        lines.append(f"bounds: {_described_point(low)} to {_described_point(high)} metres")
    others = len(scene.cameras) - 1
    count = f" ({scene.camera_name}, the active one of {others + 1})" if others else ""
    lines.append(f"camera{count}: {_described_camera(scene.camera, scene.settings.size)}")
    return lines + [f"warning: {problem}" for problem in scene_problems(scene)]


def described_textures(scene: Scene) -> str:
    """How many images the materials read, and what they take on a device; "none"."""
    found = {
        texture.bitmap
        for material in scene.materials.values()
        for slot in TextureSlot
        if (texture := texture_of(material, slot)) is not None
    }
    size = sum(bitmap.device_bytes(scene.settings.texture_limit) for bitmap in found) / 2**20
    images = f"{len(found):,} image{'s' if len(found) != 1 else ''}"
    return f"{images}, {size:.1f} MiB on a device" if found else "none"


def _described_lights(scene: Scene) -> str:
    kinds = Counter(light.kind for light in scene.lights)
    hidden = sum(not light.visible for light in scene.lights)
    listed = ", ".join(f"{kinds[kind]:,} {kind}" for kind in KINDS if kinds[kind])
    return (
        f"{len(scene.lights):,}"
        + (f" ({listed})" if listed else "")
        + (f", {hidden:,} hidden" if hidden else "")
    )


def _described_environment(environment: Environment) -> str:
    colour = f"radiance {_described_point(environment.radiance)}"
    if environment.sky is not None:
        return f"{colour} times a sky with the sun at {environment.sky.sun_elevation:g} degrees"
    if environment.image is None:
        return colour if any(environment.radiance) else "none"
    height, width = environment.image.pixels.shape[:2]
    name = os.path.basename(environment.image.source or "made in Python")
    return f"{colour} times {name}, {width} x {height} pixels"


def _described_camera(camera: Camera, size: tuple[int, int]) -> str:
    aspect = size[0] / size[1]
    if camera.is_orthographic:
        seen = f"orthographic, {camera.ortho_height:g} metres high"
    elif camera.focal_length:
        seen = f"{camera.focal_length:g} mm, {camera.fov_y_at(aspect):.3g} degrees high"
    else:
        seen = f"{camera.fov_y:g} degrees high"
    place = f"at {_described_point(camera.position)}, looks at {_described_point(camera.target)}"
    sharp = f", f/{camera.f_stop:g}, sharp at {camera.sharp_distance:.4g} metres" if camera.has_lens else ""
    return f"{place}, {seen}{sharp}"


def _described_point(point: Collection[float]) -> str:
    # What turning leaves of a 0 is none that anybody wants to read.
    return "(" + ", ".join(f"{round(x, 12) + 0.0:.4g}" for x in point) + ")"
