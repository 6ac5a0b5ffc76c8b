"""Renders the scenes of tests/reference_scenes.py with Mitsuba 3 and stores what tests/test_mitsuba.py reads.

    pip install mitsuba                    # 3.9 made the stored files; its LLVM variant needs libLLVM
    python tests/references/make_references.py [NAME ...]

Each NAME.npz holds `mean` (48, 64, 3) and `error` (same shape), the standard error of that mean from sixteen
independent renders, both float16.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from reference_scenes import REFERENCES, SIZE, Reference  # noqa: E402

from incpt.layout import MIN_ALPHA  # noqa: E402
from incpt.scene import Camera, Environment, Material, Object  # noqa: E402

RENDERS = 16


def bsdf(material: Material) -> dict[str, Any]:
    """What of our materials has an exact counterpart; anything else is refused."""
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
    """The triangles in world space by way of a PLY file, three corners for each."""
    matrix = obj.world_from_object
    corners = obj.mesh.vertices[obj.mesh.faces].reshape(-1, 3) @ matrix[:, :3].T + matrix[:, 3]
    columns, names = [corners], ["x", "y", "z"]
    if obj.mesh.normals is not None:
        normals = obj.mesh.normals.reshape(-1, 3) @ np.linalg.inv(matrix[:, :3])
        columns.append(normals / np.linalg.norm(normals, axis=1, keepdims=True))
        names += ["nx", "ny", "nz"]
    lines = ["ply", "format ascii 1.0", f"element vertex {len(corners)}"]
    lines += [f"property float {name}" for name in names]
    lines += [f"element face {len(corners) // 3}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(f"{x:.9g}" for x in row) for row in np.hstack(columns)]
    lines += [f"3 {i} {i + 1} {i + 2}" for i in range(0, len(corners), 3)]
    path.write_text("\n".join(lines) + "\n")
    shape = {
        "type": "ply",
        "filename": str(path),
        "face_normals": obj.mesh.normals is None,
        "bsdf": bsdf(material),
    }
    if material.is_emissive:
        shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": list(material.emission)}}
    return shape


def emitter(environment: Environment) -> dict[str, Any]:
    """Constant, or an image. Mitsuba's rows lie at v = j / (height - 1), ours at (j + 1/2) / height: twice
    the rows and one more hold exactly what we interpolate."""
    if environment.image is None:
        return {"type": "constant", "radiance": {"type": "rgb", "value": list(environment.radiance)}}
    pixels = environment.image.pixels * np.float32(environment.radiance)
    padded = np.concatenate([pixels[:1], pixels, pixels[-1:]])
    rows = np.empty((2 * len(pixels) + 1, *pixels.shape[1:]), np.float32)
    rows[1::2], rows[0::2] = pixels, (padded[:-1] + padded[1:]) / 2
    turn = mi.ScalarTransform4f().rotate([0, 1, 0], environment.rotation_y)
    return {"type": "envmap", "bitmap": mi.Bitmap(rows), "to_world": turn}


def sensor(camera: Camera) -> dict[str, Any]:
    """A pinhole with a box filter as wide as a pixel."""
    to_world = mi.ScalarTransform4f().look_at(list(camera.position), list(camera.target), list(camera.up))
    film = {
        "type": "hdrfilm", "width": SIZE[0], "height": SIZE[1], "rfilter": {"type": "box"},
        "pixel_format": "rgb", "component_format": "float32",
    }  # fmt: skip
    return {
        "type": "perspective", "to_world": to_world, "fov": camera.fov_y, "fov_axis": "y", "film": film,
        "sampler": {"type": "independent"},
    }  # fmt: skip


def render(reference: Reference) -> tuple[Any, Any]:
    """Mean and standard error of RENDERS renders. A path of our `max_bounces` has two segments more, one
    before the first hit and one to the light; passages through glass are not counted apart there."""
    scene = reference.scene()
    glassy = any(m.transmission > 0 for m in scene.materials.values())
    depth = 64 if glassy else reference.max_bounces + 2
    with tempfile.TemporaryDirectory() as folder:
        shapes = {
            f"shape_{i}": mesh(obj, scene.materials[obj.material], Path(folder) / f"{i}.ply")
            for i, obj in enumerate(scene.objects)
        }
        loaded = mi.load_dict(
            {
                "type": "scene", "integrator": {"type": "path", "max_depth": depth, "rr_depth": 1000},
                "sensor": sensor(scene.camera), "environment": emitter(scene.environment), **shapes,
            }
        )  # fmt: skip
        spp = reference.reference_spp // RENDERS
        images = np.stack([np.array(mi.render(loaded, spp=spp, seed=seed)) for seed in range(RENDERS)])
    return images.mean(axis=0), images.std(axis=0, ddof=1) / np.sqrt(RENDERS)


def main(names: list[str]) -> None:
    """Render the named scenes, or all."""
    mi.set_variant("llvm_ad_rgb")
    for name in names or list(REFERENCES):
        mean, error = render(REFERENCES[name])
        np.savez_compressed(
            HERE / f"{name}.npz", mean=mean.astype(np.float16), error=error.astype(np.float16)
        )
        print(f"{name}: mean {mean.mean(axis=(0, 1))}, median error {np.median(error) / mean.mean():.2%}")


if __name__ == "__main__":
    main(sys.argv[1:])
