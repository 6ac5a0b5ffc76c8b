"""Scenes as Mitsuba 3 describes them: what has an exact counterpart there, and nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import numpy.typing as npt

from incpt.core.layout import MIN_ALPHA
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene


def scene_dict(
    scene: Scene, size: tuple[int, int], max_depth: int, folder: Path, rr_depth: int = 1000
) -> dict[str, Any]:
    """All of a scene for `mi.load_dict`, object number i as shape_i; its meshes are written to `folder`.

    `max_depth` counts segments: our `max_bounces` scattering events after the first hit have two more, one
    before it and one to the light. Passages through glass are not counted apart. Raises ValueError for a
    material that has no counterpart.
    """
    shapes = {
        f"shape_{i}": mesh(obj, scene.materials[obj.material], folder / f"{i}.ply")
        for i, obj in enumerate(scene.objects)
    }
    integrator = {"type": "path", "max_depth": max_depth, "rr_depth": rr_depth}
    # A black environment would be given half of the light samples.
    dark = scene.environment.image is None and not any(scene.environment.radiance)
    sky = {} if dark else {"environment": emitter(scene.environment)}
    return {
        "type": "scene", "integrator": integrator, "sensor": sensor(scene.camera, size), **sky, **shapes,
    }  # fmt: skip


def bsdf(material: Material) -> dict[str, Any]:
    """What of our materials has an exact counterpart; raises ValueError for anything else."""
    alpha = max(material.roughness**2, MIN_ALPHA)
    white = material.base_color == (1, 1, 1)
    if material.transmission == 1 and white and not any(material.absorption):
        if material.roughness == 0:
            return {"type": "dielectric", "int_ior": material.ior, "ext_ior": 1.0}
        return {
            "type": "roughdielectric", "distribution": "ggx", "alpha": alpha, "int_ior": material.ior,
            "ext_ior": 1.0,
        }  # fmt: skip
    if material.metallic == 1 and white:
        metal = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha}
        return {"type": "twosided", "bsdf": metal}
    if material.metallic == material.specular == material.transmission == 0:
        reflectance = {"type": "rgb", "value": list(material.base_color)}
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}
    raise ValueError(f"{material} has no counterpart in Mitsuba")


def mesh(obj: Object, material: Material, path: Path) -> dict[str, Any]:
    """The triangles in world space by way of a PLY file."""
    write_ply(path, *world_mesh(obj))
    shape = {
        "type": "ply",
        "filename": str(path),
        "face_normals": obj.mesh.normals is None,
        "bsdf": bsdf(material),
    }
    if material.is_emissive:
        shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": list(material.emission)}}
    return shape


def world_mesh(
    obj: Object,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.float32] | None]:
    """Vertices (V, 3), faces (F, 3), and normals (V, 3) where the object has some: then every corner is a
    vertex of its own."""
    matrix = obj.world_from_object
    vertices, faces, normals = obj.mesh.vertices, obj.mesh.faces, None
    if obj.mesh.normals is not None:
        vertices = vertices[faces].reshape(-1, 3)
        faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
        turned = obj.mesh.normals.reshape(-1, 3) @ np.linalg.inv(matrix[:, :3])
        normals = (turned / np.linalg.norm(turned, axis=1, keepdims=True)).astype(np.float32)
    placed = vertices @ matrix[:, :3].T + matrix[:, 3]
    return placed.astype(np.float32), faces, normals


def write_ply(
    path: Path,
    vertices: npt.NDArray[np.float32],
    faces: npt.NDArray[np.int32],
    normals: npt.NDArray[np.float32] | None,
) -> None:
    """A binary PLY file."""
    columns = vertices if normals is None else np.hstack([vertices, normals])
    names = ["x", "y", "z", "nx", "ny", "nz"][: columns.shape[1]]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(columns)}"]
    lines += [f"property float {name}" for name in names]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    rows = np.empty(len(faces), np.dtype([("count", "u1"), ("index", "<i4", (3,))]))
    rows["count"], rows["index"] = 3, faces
    path.write_bytes("\n".join(lines).encode() + columns.astype("<f4").tobytes() + rows.tobytes())


def emitter(environment: Environment) -> dict[str, Any]:
    """Constant, or an image. Mitsuba's rows lie at v = j / (height - 1), ours at (j + 1/2) / height: twice
    the rows and one more hold exactly what we interpolate."""
    if environment.image is None:
        return {"type": "constant", "radiance": {"type": "rgb", "value": list(environment.radiance)}}
    pixels = environment.image.pixels * np.array(environment.radiance, np.float32)
    padded = np.concatenate([pixels[:1], pixels, pixels[-1:]])
    rows = np.empty((2 * len(pixels) + 1, *pixels.shape[1:]), np.float32)
    rows[1::2], rows[0::2] = pixels, (padded[:-1] + padded[1:]) / 2
    turn = mi.ScalarTransform4f().rotate([0, 1, 0], environment.rotation_y)
    return {"type": "envmap", "bitmap": mi.Bitmap(rows), "to_world": turn}


def sensor(camera: Camera, size: tuple[int, int]) -> dict[str, Any]:
    """A pinhole with a box filter as wide as a pixel."""
    to_world = mi.ScalarTransform4f().look_at(list(camera.position), list(camera.target), list(camera.up))
    film = {
        "type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"},
        "pixel_format": "rgb", "component_format": "float32",
    }  # fmt: skip
    return {
        "type": "perspective", "to_world": to_world, "fov": camera.fov_y, "fov_axis": "y", "film": film,
        "sampler": {"type": "independent"},
    }  # fmt: skip
