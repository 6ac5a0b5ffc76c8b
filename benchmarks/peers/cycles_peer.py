"""Cycles, Blender's path tracer, by way of the Python module bpy.

Set up to do what the others do: no denoising, no adaptive sampling, no clamping, no filtered glossiness, a
light threshold of 0, and a box filter as wide as a pixel. Cycles compiles, synchronises and builds its trees
in every render: its time for samples is the difference of two renders that differ in nothing else.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from incpt.benchmarks.peers.peer import FloatImage, Job, MissingPeer
from incpt.core.affine import Vector
from incpt.core.layout import MIN_ALPHA, TextureSlot
from incpt.formats.images import load_image
from incpt.scene.camera import Camera
from incpt.scene.material import Material, texture_of

_OVERHEAD_SPP = 2
_ATTEMPTS = 3
_SENSOR_MM = 36.0
_MOST_BOUNCES = 1024


class CyclesPeer:
    """Cycles on the processor, with its light tree (its default) or without."""

    def __init__(self, light_tree: bool) -> None:
        try:
            with _silence():
                import bpy
        except ImportError:
            raise MissingPeer(
                'bpy is not installed; run pip install "incpt[cycles]" (wheels for one Python version each)'
            ) from None
        self._bpy: Any = bpy
        self._light_tree = light_tree
        self._job: Job | None = None

    def load(self, job: Job) -> None:
        bpy = self._bpy
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self._job = job
        scene = bpy.context.scene
        self._set_up(scene, job)
        materials = {name: self._material(name, m) for name, m in job.scene.materials.items()}
        if job.scene.lights:
            raise ValueError("lights of their own are not translated for Cycles")
        for obj in job.scene.objects:
            if not obj.visible:
                continue
            assert obj.mesh.normals is None, "only flat meshes are compared"
            mesh = bpy.data.meshes.new(obj.name)
            _fill(mesh, obj.mesh.vertices, obj.mesh.faces)
            mesh.materials.append(materials[obj.material])
            placed = bpy.data.objects.new(obj.name, mesh)
            placed.matrix_world = _columns(obj.world_from_object)
            scene.collection.objects.link(placed)
        self._place_camera(scene, job.scene.camera, job.size[0] / job.size[1])
        if job.scene.environment.picture is not None:
            raise ValueError("only constant environments are compared with Cycles")
        self._set_sky(scene, job.scene.environment.radiance)

    def time(self, spp: int, seed: int) -> float:
        # Both with the same seed; whatever a render takes beside its samples cancels.
        for _ in range(_ATTEMPTS):
            least = self._render(_OVERHEAD_SPP, seed)
            seconds = self._render(_OVERHEAD_SPP + spp, seed) - least
            if seconds > 0:
                return seconds
        raise RuntimeError(f"{spp} samples cannot be told from its start; use more --seconds")

    def image(self, spp: int, seed: int) -> FloatImage:
        self._render(spp, seed)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "picture.exr"
            self._bpy.data.images["Render Result"].save_render(str(path))
            return np.asarray(load_image(path).pixels)

    def move(self, name: str, position: Vector, seed: int) -> float:
        placed = self._bpy.data.objects[name]
        began = time.perf_counter()
        placed.location = position
        self._render(1, seed)
        return time.perf_counter() - began

    def _render(self, spp: int, seed: int) -> float:
        scene = self._bpy.context.scene
        scene.cycles.samples = spp
        scene.cycles.seed = seed % (1 << 31)
        began = time.perf_counter()
        self._bpy.ops.render.render(write_still=False)
        return time.perf_counter() - began

    def _set_up(self, scene: Any, job: Job) -> None:
        scene.render.engine = "CYCLES"
        scene.render.resolution_x, scene.render.resolution_y = job.size
        scene.render.resolution_percentage = 100
        scene.render.threads_mode = "FIXED"
        scene.render.threads = job.threads
        scene.render.use_persistent_data = False
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.render.image_settings.color_depth = "32"
        scene.view_settings.view_transform = "Raw"
        cycles = scene.cycles
        cycles.device = "CPU"
        cycles.use_adaptive_sampling = cycles.use_denoising = False
        cycles.use_auto_tile = False
        cycles.pixel_filter_type = "BOX"
        cycles.filter_width = 1.0
        cycles.blur_glossy = cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
        cycles.light_sampling_threshold = 0.0
        cycles.use_light_tree = self._light_tree
        cycles.caustics_reflective = cycles.caustics_refractive = True
        bounces = min(job.all_bounces, _MOST_BOUNCES)
        for kind in ("max", "diffuse", "glossy", "transmission"):
            setattr(cycles, f"{kind}_bounces", bounces)
        cycles.volume_bounces = 0
        cycles.transparent_max_bounces = 0

    def _material(self, name: str, material: Material) -> Any:
        made = self._bpy.data.materials.new(name)
        made.use_nodes = True
        nodes, links = made.node_tree.nodes, made.node_tree.links
        nodes.clear()
        output = nodes.new("ShaderNodeOutputMaterial")
        links.new(_shader(nodes, links, made, material).outputs[0], output.inputs["Surface"])
        return made

    def _place_camera(self, scene: Any, camera: Camera, aspect: float) -> None:
        from mathutils import Matrix

        lens = self._bpy.data.cameras.new("camera")
        larger = max(aspect, 1.0)
        lens.sensor_fit, lens.sensor_width = "AUTO", _SENSOR_MM
        if camera.is_orthographic:
            length_m = 1.0
            lens.type, lens.ortho_scale = "ORTHO", camera.ortho_height * larger
        else:
            half = math.tan(math.radians(camera.fov_y_at(aspect)) / 2)
            lens.lens = _SENSOR_MM / larger / (2 * half)
            length_m = lens.lens * 1e-3
        lens.shift_x, lens.shift_y = camera.shift_x, camera.shift_y
        lens.clip_start, lens.clip_end = max(camera.near, 1e-3), 1e6
        if camera.has_lens:
            lens.dof.use_dof = True
            lens.dof.aperture_fstop = length_m / (2 * camera.lens_radius(aspect))
            lens.dof.focus_distance = camera.sharp_distance
            lens.dof.aperture_blades = camera.blades
            lens.dof.aperture_rotation = math.radians(camera.blade_rotation)
        placed = self._bpy.data.objects.new("camera", lens)
        back = np.subtract(camera.position, camera.target)
        back = back / np.linalg.norm(back)
        right = np.cross(camera.up, back)
        right /= np.linalg.norm(right)
        matrix = np.eye(4)
        matrix[:3] = np.stack([right, np.cross(back, right), back, camera.position], axis=1)
        placed.matrix_world = Matrix(matrix.tolist())
        scene.collection.objects.link(placed)
        scene.camera = placed

    def _set_sky(self, scene: Any, radiance: Vector) -> None:
        world = self._bpy.data.worlds.new("sky")
        scene.world = world
        world.use_nodes = True
        background = world.node_tree.nodes["Background"]
        background.inputs["Color"].default_value = (*radiance, 1.0)
        background.inputs["Strength"].default_value = 1.0


@contextmanager
def _silence() -> Iterator[None]:
    """Blender's audio module, made for numpy 1, complains at length on stderr, and is not needed."""
    sys.stderr.flush()
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(nowhere)
        os.close(kept)


def _fill(mesh: Any, vertices: Any, faces: Any) -> None:
    count = len(faces)
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(vertices, np.float32).ravel())
    mesh.loops.add(3 * count)
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(faces, np.int32).ravel())
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.zeros(count, bool))
    mesh.update(calc_edges=True)


def _columns(matrix: Any) -> Any:
    from mathutils import Matrix

    return Matrix([*matrix.tolist(), [0.0, 0.0, 0.0, 1.0]])


def _shader(nodes: Any, links: Any, made: Any, material: Material) -> Any:
    """What of our materials has an exact counterpart; raises ValueError for anything else."""
    alpha = max(material.roughness**2, MIN_ALPHA)
    white = material.base_color == (1, 1, 1)
    if any(texture_of(material, slot) is not None for slot in TextureSlot):
        raise ValueError("textures are not translated for Cycles")
    if material.is_emissive:
        return _emission(nodes, links, made, material)
    if material.transmission == 1 and white and not any(material.absorption) and material.roughness == 0:
        shader = nodes.new("ShaderNodeBsdfGlass")
        shader.inputs["IOR"].default_value = material.ior
        shader.inputs["Roughness"].default_value = 0.0
    elif material.metallic == 1 and white:
        shader = nodes.new("ShaderNodeBsdfAnisotropic")
        shader.distribution = "GGX"
        shader.inputs["Roughness"].default_value = math.sqrt(alpha)
    elif material.metallic == material.specular == material.transmission == 0:
        shader = nodes.new("ShaderNodeBsdfDiffuse")
        shader.inputs["Roughness"].default_value = 0.0
    else:
        raise ValueError(f"{material} has no counterpart in Cycles")
    shader.inputs["Color"].default_value = (*material.base_color, 1.0)
    return shader


def _emission(nodes: Any, links: Any, made: Any, material: Material) -> Any:
    shader = nodes.new("ShaderNodeEmission")
    shader.inputs["Color"].default_value = (*material.emission, 1.0)
    if material.double_sided:
        made.cycles.emission_sampling = "FRONT_BACK"
        return shader
    made.cycles.emission_sampling = "FRONT"
    geometry, front = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeMath")
    front.operation = "SUBTRACT"
    front.inputs[0].default_value = 1.0
    links.new(geometry.outputs["Backfacing"], front.inputs[1])
    links.new(front.outputs[0], shader.inputs["Strength"])
    return shader
