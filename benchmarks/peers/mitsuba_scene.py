"""Scenes as Mitsuba 3 describes them: what has an exact counterpart there, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import numpy.typing as npt

from incpt.core.layout import MIN_ALPHA, MaterialTrait, TextureSlot
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.light import Light
from incpt.scene.material import Material, texture_of
from incpt.scene.model import Object, Scene
from incpt.scene.texture import Bitmap, Texture
from incpt.tables.materials import traits_of
from incpt.tables.texels import linear_colors

_COUNTERPARTS = (
    TextureSlot.BASE_COLOR, TextureSlot.METALLIC_ROUGHNESS, TextureSlot.EMISSION, TextureSlot.NORMAL,
)  # fmt: skip
"""Slots of which something has a counterpart."""


def scene_dict(
    scene: Scene, size: tuple[int, int], max_depth: int, folder: Path, rr_depth: int = 1000
) -> dict[str, Any]:
    """All of a scene for `mi.load_dict`, object number i as shape_i; its meshes are written to `folder`.

    `max_depth` counts segments: our `max_bounces` scattering events after the first hit have two more, one
    before it and one to the light. Passages through glass are not counted apart. Raises ValueError for a
    material or light that has no counterpart.
    """
    shapes = {
        f"shape_{i}": mesh(obj, scene.materials[obj.material], folder / f"{i}.ply")
        for i, obj in enumerate(scene.objects)
    }
    integrator = {"type": "path", "max_depth": max_depth, "rr_depth": rr_depth}
    shapes |= {f"light_{i}": light(one) for i, one in enumerate(scene.lights) if one.is_emissive}
    # A black environment would be given half of the light samples.
    dark = scene.environment.picture is None and not any(scene.environment.radiance)
    sky = {} if dark else {"environment": emitter(scene.environment)}
    return {
        "type": "scene", "integrator": integrator, "sensor": sensor(scene.camera, size), **sky, **shapes,
    }  # fmt: skip


def bsdf(material: Material) -> dict[str, Any]:
    """What of our materials has an exact counterpart; raises ValueError for anything else."""
    if material.normal_texture is not None and material.normal_scale == 1:
        plain = bsdf(replace(material, normal_texture=None))
        nested = plain["bsdf"] if plain["type"] == "twosided" else plain
        shading = {"use_shadowing_function": False, "bsdf": nested}
        mapped = {
            "type": "normalmap",
            "normalmap": bitmap(material.normal_texture, is_color=False),
            **shading,
        }
        return {**plain, "bsdf": mapped} if plain["type"] == "twosided" else mapped
    used = [texture_of(material, slot) for slot in TextureSlot if slot not in _COUNTERPARTS]
    if any(texture is not None for texture in used) or material.normal_texture is not None:
        raise ValueError(f"{material} has textures that have no counterpart in Mitsuba")
    traits = traits_of(material)
    if MaterialTrait.THIN_WALLED in traits:
        return thin_wall(material)
    if traits - {MaterialTrait.ANISOTROPY} or (traits and material.metallic < 1):
        raise ValueError(f"{material} has layers that have no counterpart in Mitsuba")
    alpha: Any = max(material.roughness**2, MIN_ALPHA)
    rough = material.metallic_roughness_texture
    if rough is not None:
        # Squares are not interpolated as their roots are.
        if rough.filter != "nearest" or rough.bitmap.pixels.dtype != np.float32:
            raise ValueError(f"{material} interpolates roughness, which Mitsuba does for its square")
        squared = (material.roughness * rough.bitmap.pixels[..., 1:2]) ** 2
        alpha = bitmap(replace(rough, bitmap=Bitmap(np.maximum(squared, MIN_ALPHA))), is_color=False)
    white = material.base_color == (1, 1, 1) and material.base_color_texture is None
    if material.transmission == 1 and white and not any(material.absorption):
        return body(material, alpha)
    if material.metallic == 1 and white:
        metal = {"type": "roughconductor", "material": "none", "distribution": "ggx"}
        return {"type": "twosided", "bsdf": {**metal, **stretched(material, alpha)}}
    if material.metallic == material.specular == material.transmission == 0:
        reflectance = colored(material.base_color, material.base_color_texture)
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}
    raise ValueError(f"{material} has no counterpart in Mitsuba")


def body(material: Material, alpha: Any) -> dict[str, Any]:
    """The boundary of a clear body in air."""
    iors = {"int_ior": material.ior, "ext_ior": 1.0}
    if material.roughness == 0:
        return {"type": "dielectric", **iors}
    return {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha, **iors}


def thin_wall(material: Material) -> dict[str, Any]:
    """A wall without a thickness; raises ValueError where it is rough or has other layers."""
    if len(traits_of(material)) > 1 or material.roughness > 0 or material.transmission < 1:
        raise ValueError(f"{material} is a wall that has no counterpart in Mitsuba")
    tint = {"type": "rgb", "value": list(material.base_color)}
    return {"type": "thindielectric", "int_ior": material.ior, "specular_transmittance": tint}


def stretched(material: Material, alpha: Any) -> dict[str, Any]:
    """The roughness of metal along u and v. Raises ValueError where it lies between them."""
    if material.anisotropy == 0:
        return {"alpha": alpha}
    if material.anisotropy_rotation not in (0, 90):
        raise ValueError(f"{material} is turned, which has no counterpart in Mitsuba")
    along = alpha + (1 - alpha) * material.anisotropy**2
    first, second = (along, alpha) if material.anisotropy_rotation == 0 else (alpha, along)
    return {"alpha_u": first, "alpha_v": second}


def colored(factor: tuple[float, float, float], texture: Texture | None) -> dict[str, Any]:
    """A colour, or a texture of which it is the factor."""
    if texture is None:
        return {"type": "rgb", "value": list(factor)}
    pixels = linear_colors(texture.bitmap) * np.asarray(factor, np.float32)
    return bitmap(replace(texture, bitmap=Bitmap(pixels)), is_color=True)


def bitmap(texture: Texture, is_color: bool) -> dict[str, Any]:
    """A texture of linear floats, or of plain numbers. Raises ValueError where both axes are wrapped
    otherwise."""
    if texture.wrap[0] != texture.wrap[1] or texture.uv_set != 0:
        raise ValueError(f"{texture} has no counterpart in Mitsuba")
    pixels = texture.bitmap.pixels
    if pixels.dtype != np.float32:
        if is_color:
            raise ValueError(f"{texture} is encoded")
        pixels = (pixels / np.iinfo(pixels.dtype).max).astype(np.float32)
    rows = np.vstack([texture.matrix, [0, 0, 1]])
    return {
        "type": "bitmap", "bitmap": mi.Bitmap(np.array(pixels)), "raw": True, "wrap_mode": texture.wrap[0],
        "filter_type": texture.filter, "to_uv": mi.ScalarTransform3f(rows.tolist()), "format": "variant",
    }  # fmt: skip


def mesh(obj: Object, material: Material, path: Path) -> dict[str, Any]:
    """The triangles in world space by way of a PLY file."""
    vertices, faces, normals, uvs = world_mesh(obj, bool(_textures(material)) or material.anisotropy > 0)
    write_ply(path, vertices, faces, normals, uvs)
    shape = {
        "type": "ply",
        "filename": str(path),
        "face_normals": obj.mesh.normals is None,
        "bsdf": bsdf(material),
    }
    if material.is_emissive:
        shape["emitter"] = {"type": "area", "radiance": colored(material.emission, material.emission_texture)}
    return shape


def light(one: Light) -> dict[str, Any]:
    """What of our lights has a counterpart. Flat ones reflect nothing, but hide what is behind them on both
    sides there. Raises ValueError for any other."""
    x, y, z = one.axes
    matrix = np.eye(4)
    # Flat lights shine along +z there.
    matrix[:3] = np.column_stack([x * one.half_size[0], -y * one.half_size[1], -z, one.position])
    if not (one.casts_shadows and one.camera_visible) or one.double_sided:
        raise ValueError(f"light {one.name!r}: has no counterpart")
    color = {"type": "rgb", "value": list(one.emitted)}
    if not one.has_size:
        if one.kind == "sun":
            return {"type": "directional", "direction": (-z).tolist(), "irradiance": color}
        if one.kind == "point":
            return {"type": "point", "position": list(one.position), "intensity": color}
        if one.spot_blend > 0:  # what falls off linearly with the angle there
            raise ValueError(f"light {one.name!r}: its cone has no counterpart")
        matrix[:3] = np.column_stack([x, -y, -z, one.position])
        half = one.spot_angle / 2
        return {
            "type": "spot", "to_world": mi.ScalarTransform4f(matrix), "intensity": color,
            "cutoff_angle": half, "beam_width": 0.9999 * half,
        }  # fmt: skip
    if one.kind in ("sun", "spot"):
        raise ValueError(f"light {one.name!r}: has no counterpart")
    emission = {
        "emitter": {"type": "area", "radiance": color},
        "bsdf": {"type": "diffuse", "reflectance": 0.0},
    }
    if one.kind in ("rectangle", "disk"):
        return {"type": one.kind, "to_world": mi.ScalarTransform4f(matrix), **emission}
    return {"type": "sphere", "center": list(one.position), "radius": one.half_size[0], **emission}


def _textures(material: Material) -> list[Texture]:
    return [texture for slot in TextureSlot if (texture := texture_of(material, slot)) is not None]


Floats = npt.NDArray[np.float32]


def world_mesh(
    obj: Object, with_uvs: bool = False
) -> tuple[Floats, npt.NDArray[np.int32], Floats | None, Floats | None]:
    """Vertices (V, 3), faces (F, 3), and normals (V, 3) and texture coordinates (V, 2) where the object has
    some: then every corner is a vertex of its own."""
    matrix = obj.world_from_object
    vertices, faces, normals, uvs = obj.mesh.vertices, obj.mesh.faces, None, None
    if with_uvs and obj.mesh.uvs:
        uvs = obj.mesh.uvs[0].reshape(-1, 2)
    if obj.mesh.normals is not None or uvs is not None:
        vertices = vertices[faces].reshape(-1, 3)
        faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    if obj.mesh.normals is not None:
        turned = obj.mesh.normals.reshape(-1, 3) @ np.linalg.inv(matrix[:, :3])
        normals = (turned / np.linalg.norm(turned, axis=1, keepdims=True)).astype(np.float32)
    placed = vertices @ matrix[:, :3].T + matrix[:, 3]
    return placed.astype(np.float32), faces, normals, uvs


def write_ply(
    path: Path,
    vertices: npt.NDArray[np.float32],
    faces: npt.NDArray[np.int32],
    normals: npt.NDArray[np.float32] | None,
    uvs: npt.NDArray[np.float32] | None = None,
) -> None:
    """A binary PLY file."""
    columns = np.hstack([part for part in (vertices, normals, uvs) if part is not None])
    names = [
        "x",
        "y",
        "z",
        *(["nx", "ny", "nz"] if normals is not None else []),
        *(["u", "v"] if uvs is not None else []),
    ]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(columns)}"]
    lines += [f"property float {name}" for name in names]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    rows = np.empty(len(faces), np.dtype([("count", "u1"), ("index", "<i4", (3,))]))
    rows["count"], rows["index"] = 3, faces
    path.write_bytes("\n".join(lines).encode() + columns.astype("<f4").tobytes() + rows.tobytes())


def emitter(environment: Environment) -> dict[str, Any]:
    """Constant, or an image. Mitsuba's rows lie at v = j / (height - 1), ours at (j + 1/2) / height: twice
    the rows and one more hold exactly what we interpolate."""
    if environment.has_sun:
        raise ValueError("the sun of a sky has no counterpart in Mitsuba")
    picture = environment.picture
    if picture is None:
        return {"type": "constant", "radiance": {"type": "rgb", "value": list(environment.radiance)}}
    pixels = picture.pixels * np.array(environment.radiance, np.float32)
    padded = np.concatenate([pixels[:1], pixels, pixels[-1:]])
    rows = np.empty((2 * len(pixels) + 1, *pixels.shape[1:]), np.float32)
    rows[1::2], rows[0::2] = pixels, (padded[:-1] + padded[1:]) / 2
    turn = mi.ScalarTransform4f().rotate([0, 1, 0], environment.rotation_y)
    return {"type": "envmap", "bitmap": mi.Bitmap(rows), "to_world": turn}


def sensor(camera: Camera, size: tuple[int, int]) -> dict[str, Any]:
    """The camera with a box filter as wide as a pixel. Raises ValueError for one that has no counterpart."""
    width, height = size
    aspect = width / height
    shifted, bladed = camera.shift_x or camera.shift_y, camera.has_lens and camera.blades
    if camera.near or bladed or (shifted and (camera.has_lens or camera.is_orthographic)):
        raise ValueError(f"{camera} has no counterpart in Mitsuba")
    to_world = mi.ScalarTransform4f().look_at(list(camera.position), list(camera.target), list(camera.up))
    film = {
        "type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"},
        "pixel_format": "rgb", "component_format": "float32",
    }  # fmt: skip
    common = {"film": film, "sampler": {"type": "independent"}}
    if camera.is_orthographic:
        if camera.has_lens:
            raise ValueError(f"{camera} has no counterpart in Mitsuba")
        half_width = camera.ortho_height * aspect / 2
        to_world = to_world @ mi.ScalarTransform4f().scale([half_width, half_width, 1])
        return {"type": "orthographic", "to_world": to_world, **common}
    common |= {"to_world": to_world, "fov": camera.fov_y_at(aspect), "fov_axis": "y"}
    if camera.has_lens:
        radius = camera.lens_radius(aspect)
        return {
            "type": "thinlens", "aperture_radius": radius, "focus_distance": camera.sharp_distance, **common,
        }  # fmt: skip
    across, up = (shift / 2 for shift in camera.shift_at(aspect))
    return {
        "type": "perspective", "principal_point_offset_x": across, "principal_point_offset_y": -up, **common,
    }  # fmt: skip
