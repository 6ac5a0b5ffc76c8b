"""The materials of a scene on the device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from incpt.core import layout
from incpt.core.layout import MaterialTrait
from incpt.device.device import Device
from incpt.scene.material import Material
from incpt.tables import albedo
from incpt.tables.textures import TextureTables

_COPIED = (
    "base_color", "metallic", "emission", "roughness", "absorption", "specular", "ior", "transmission",
    "priority", "alpha", "alpha_cutoff", "normal_scale", "specular_color", "clearcoat",
    "clearcoat_roughness", "clearcoat_normal_scale", "sheen_color", "sheen_roughness", "anisotropy",
    "anisotropy_rotation", "iridescence", "iridescence_ior", "iridescence_thickness",
    "iridescence_least_thickness", "diffuse_transmission", "diffuse_transmission_color", "dispersion",
    "bump_scale",
)  # fmt: skip
"""What rows take over from materials as it is."""

_NOT_OF_LAYERS = (
    1 << MaterialTrait.THIN_WALLED
    | 1 << MaterialTrait.CLEAR_WALL
    | 1 << MaterialTrait.DISPERSION
    | 1 << MaterialTrait.UNLIT
)
"""Traits that leave opaque surfaces as they are."""


@dataclass(frozen=True, eq=False)
class MaterialTables:
    """The buffers, by name, and what all materials have in common.

    traits           bits of MaterialTrait that some material has
    has_media        whether any lets light through
    is_matte         whether no surface that may be shaded as opaque has a specular layer or is metallic
    is_media_clear   whether none that lets light through absorbs any of it
    is_media_smooth  whether none that lets light through is rough
    has_cutouts      whether rays may go through any before it is shaded
    """

    buffers: Mapping[str, cl.Buffer]
    traits: int
    has_media: bool
    is_matte: bool
    is_media_clear: bool
    is_media_smooth: bool
    has_cutouts: bool


def traits_of(material: Material) -> set[MaterialTrait]:
    """What the kernels must know to shade it beside base, metal, dielectric layer and body."""
    if material.unlit:
        return {MaterialTrait.UNLIT}
    mirrors = material.specular > 0 or material.metallic > 0
    has_color = material.specular_color != (1.0, 1.0, 1.0) or material.specular_color_texture is not None
    has = {
        MaterialTrait.SPECULAR_COLOR: has_color and material.specular > 0 and material.metallic < 1,
        MaterialTrait.CLEARCOAT: material.clearcoat > 0,
        MaterialTrait.SHEEN: any(c > 0 for c in material.sheen_color),
        MaterialTrait.ANISOTROPY: material.anisotropy > 0 and mirrors,
        MaterialTrait.IRIDESCENCE: material.iridescence > 0 and mirrors,
        MaterialTrait.DIFFUSE_TRANSMISSION: material.diffuse_transmission > 0,
        MaterialTrait.THIN_WALLED: material.is_transmissive and material.thin_walled,
        MaterialTrait.CLEAR_WALL: material.is_clear_wall,
        MaterialTrait.DISPERSION: material.is_body and material.dispersion > 0,
    }
    return {trait for trait, holds in has.items() if holds}


def material_tables(
    device: Device,
    materials: Mapping[str, Material],
    densities: Mapping[str, float],
    textures: TextureTables,
) -> MaterialTables:
    """Those of `materials`, numbered in order. `densities` are those of LightTables; `textures` are of these
    materials."""
    # One row at least: rays that miss read material 0.
    rows = np.zeros(max(len(materials), 1), layout.MATERIAL)
    layers = np.zeros((len(rows), layout.LAYER_SIZE), np.float32)
    flags = layout.MaterialFlag
    for row, layer, (name, material) in zip(rows, layers, materials.items(), strict=False):
        for field in _COPIED:
            row[field] = getattr(material, field)
        # What covers in part is left to the rays that meet it, also where it is a lamp in the other scene.
        row["light_pdf"] = 0.0 if material.passes_rays else densities.get(name, 0.0)
        row["flags"] = (
            flags.DOUBLE_SIDED * (material.double_sided or material.unlit)
            | flags.TRANSMISSIVE * material.is_transmissive
            | flags.THIN_WALLED * material.thin_walled
            | flags.UNLIT * material.unlit
            | flags.CLEAR_WALL * material.is_clear_wall
            | flags.CUTOUT * material.is_cutout
            | flags.MASKED * (material.alpha_mode == "mask")
        )
        row["textures"] = textures.numbers_of(material)
        layer[:] = albedo.layer_row(material)
    media = [material for material in materials.values() if material.is_transmissive]
    # Of a material that lets all light through no opaque surface is ever shaded.
    opaque = [material for material in materials.values() if material.transmission < 1]
    traits = sum(1 << trait for trait in set().union(*map(traits_of, materials.values())))
    is_media_smooth = all(material.roughness**2 <= layout.MIN_ALPHA for material in media)
    is_stretched = bool(traits >> MaterialTrait.ANISOTROPY & 1)
    return MaterialTables(
        {
            "materials": device.upload(rows),
            "layers": device.upload(layers),
            "stretched": device.upload(albedo.stretched_rows() if is_stretched else np.zeros(1, np.float32)),
            # Kernels that serve rough glass too read it for smooth glass, and drop what they read.
            "glass": device.upload(
                np.zeros(albedo.GLASS_TABLE_SHAPE, np.float32) if is_media_smooth else albedo.glass_table()
            ),
        },
        traits=traits,
        has_media=bool(media),
        is_matte=all(material.unlit or material.specular == material.metallic == 0 for material in opaque)
        and traits & ~_NOT_OF_LAYERS == 0,
        is_media_clear=not any(any(material.absorption) for material in media),
        is_media_smooth=is_media_smooth,
        has_cutouts=any(material.passes_rays for material in materials.values()),
    )
