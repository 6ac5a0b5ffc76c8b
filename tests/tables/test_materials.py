"""Materials as the kernels read them: incpt/tables/materials.py."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from support.parameters import A_TEXTURE, NAMES, TEXTURES, unlike_default

from incpt.core import layout
from incpt.core.layout import MaterialFlag, MaterialTrait
from incpt.device.device import Device
from incpt.scene.material import Material
from incpt.tables.materials import MaterialTables, material_tables
from incpt.tables.textures import texture_tables

IN_FLAGS = {"double_sided": MaterialFlag.DOUBLE_SIDED, "transmission": MaterialFlag.TRANSMISSIVE,
            "alpha_mode": MaterialFlag.CUTOUT, "thin_walled": MaterialFlag.THIN_WALLED,
            "unlit": MaterialFlag.UNLIT | MaterialFlag.DOUBLE_SIDED}  # fmt: skip
"""Parameters that set a flag, `transmission` beside its own field."""


def tables(device: Device, *materials: Material) -> MaterialTables:
    named = {f"material {i}": material for i, material in enumerate(materials)}
    return material_tables(device, named, {"material 1": 0.5}, texture_tables(device, named))


def row(device: Device, made: MaterialTables, index: int) -> dict[str, Any]:
    """A row of the table as it is on the device."""
    rows = np.zeros(index + 1, layout.MATERIAL)
    device.read(made.buffers["materials"], rows)
    return {name: rows[name][index] for name in layout.MATERIAL.names or ()}


def layer(device: Device, made: MaterialTables, index: int) -> npt.NDArray[np.float32]:
    layers = np.zeros((index + 1, layout.LAYER_SIZE), np.float32)
    device.read(made.buffers["layers"], layers)
    return layers[index]


@pytest.mark.parametrize("name", NAMES)
def test_a_parameter_reaches_its_field_of_the_table_and_no_other(device: Device, name: str) -> None:
    value = unlike_default(name)
    made = tables(device, Material(), Material(), Material(**{name: value}))
    default, other = row(device, made, 0), row(device, made, 2)
    changed = {key for key in default if not np.array_equal(default[key], other[key])}
    if name in TEXTURES:
        assert changed == {"textures"}
        assert other["textures"].tolist() == [int(name == slot) for slot in TEXTURES]
        return
    assert changed == {name} & set(default) | ({"flags"} if name in IN_FLAGS else set())
    if name in default:
        np.testing.assert_array_equal(other[name], np.asarray(value, default[name].dtype))
        np.testing.assert_array_equal(
            default[name], np.asarray(getattr(Material(), name), default[name].dtype)
        )
    assert int(default["flags"]) == 0 and int(other["flags"]) == int(IN_FLAGS.get(name, 0))


def test_light_sampling_finds_the_materials_that_have_a_density(device: Device) -> None:
    shining = Material(emission=(1, 1, 1))
    made = tables(device, shining, shining)
    assert [row(device, made, i)["light_pdf"] for i in range(2)] == [0.0, 0.5]


def test_layers_follow_what_their_albedo_depends_on(device: Device) -> None:
    for name in NAMES:
        made = tables(device, Material(), Material(**{name: unlike_default(name)}))
        is_other = not np.array_equal(layer(device, made, 0), layer(device, made, 1))
        assert is_other == (name in ("roughness", "specular", "specular_color", "ior", "metallic")), name


def test_there_is_a_row_without_any_material(device: Device) -> None:
    made = material_tables(device, {}, {}, texture_tables(device, {}))
    assert made.buffers["materials"].size == layout.MATERIAL.itemsize
    assert made.is_matte and not made.has_media


MATTE, GLASS = Material(specular=0.0), Material(transmission=1.0, roughness=0.0)


@pytest.mark.parametrize(
    ("materials", "is_matte"),
    [
        ((MATTE,), True),
        ((MATTE, Material(specular=0.0, roughness=0.3, ior=2.0, emission=(1, 2, 3))), True),
        ((MATTE, Material(specular=1e-3)), False),
        ((MATTE, Material(specular=0.0, metallic=1e-3)), False),
        ((Material(), MATTE), False),
        # Of what lets all light through no opaque surface is shaded, of what lets some through one is.
        ((MATTE, GLASS), True),
        ((MATTE, Material(transmission=0.999)), False),
        ((MATTE, Material(transmission=0.999, specular=0.0)), True),
        ((MATTE, Material(transmission=0.999, specular=0.0, metallic=1.0)), False),
        ((MATTE, Material(specular=0.0, clearcoat=0.1)), False),
        ((MATTE, Material(specular=0.0, diffuse_transmission=0.1)), False),
        ((MATTE, Material(specular=0.0, anisotropy=0.5)), True),
        ((MATTE, Material(unlit=True, clearcoat=1.0)), True),
        ((MATTE, Material(transmission=1.0, thin_walled=True, dispersion=1.0)), True),
    ],
)
def test_scenes_are_matte_where_no_opaque_surface_has_a_layer_or_is_metallic(
    device: Device, materials: tuple[Material, ...], is_matte: bool
) -> None:
    assert tables(device, *materials).is_matte == is_matte


@pytest.mark.parametrize(
    ("materials", "has_media", "is_clear", "is_smooth"),
    [
        ((MATTE, Material(absorption=(1, 1, 1))), False, True, True),
        ((MATTE, GLASS), True, True, True),
        ((GLASS, Material(transmission=0.1, roughness=0.5)), True, True, False),
        ((GLASS, Material(transmission=0.1, roughness=0.0, absorption=(0, 0, 1))), True, False, True),
    ],
)
def test_what_all_media_have_in_common(
    device: Device, materials: tuple[Material, ...], has_media: bool, is_clear: bool, is_smooth: bool
) -> None:
    made = tables(device, *materials)
    assert (made.has_media, made.is_media_clear, made.is_media_smooth) == (has_media, is_clear, is_smooth)


@pytest.mark.parametrize("trait", MaterialTrait)
def test_traits_are_those_of_some_material(device: Device, trait: MaterialTrait) -> None:
    values: dict[MaterialTrait, dict[str, Any]] = {
        MaterialTrait.SPECULAR_COLOR: {"specular_color": (1, 0.5, 1)},
        MaterialTrait.CLEARCOAT: {"clearcoat": 0.1},
        MaterialTrait.SHEEN: {"sheen_color": (0, 0.1, 0)},
        MaterialTrait.ANISOTROPY: {"anisotropy": 0.1},
        MaterialTrait.IRIDESCENCE: {"iridescence": 0.1},
        MaterialTrait.DIFFUSE_TRANSMISSION: {"diffuse_transmission": 0.1},
        MaterialTrait.THIN_WALLED: {"thin_walled": True, "transmission": 0.5},
        MaterialTrait.CLEAR_WALL: {
            "thin_walled": True,
            "transmission": 0.5,
            "roughness": 0,
            "base_color": (1, 1, 1),
        },
        MaterialTrait.DISPERSION: {"dispersion": 0.1, "transmission": 0.5},
        MaterialTrait.UNLIT: {"unlit": True, "transmission": 1.0},
    }
    made = tables(device, MATTE, Material(**values[trait]))
    with_it = 1 << MaterialTrait.THIN_WALLED if trait is MaterialTrait.CLEAR_WALL else 0
    assert made.traits == 1 << trait | with_it and tables(device, MATTE, Material()).traits == 0
    media = (MaterialTrait.THIN_WALLED, MaterialTrait.CLEAR_WALL, MaterialTrait.DISPERSION)
    assert made.has_media == (trait in media)
    assert made.has_cutouts == (trait is MaterialTrait.CLEAR_WALL)


@pytest.mark.parametrize(
    "values",
    [
        {"roughness": 0.3}, {"base_color": (1, 1, 0.9)}, {"thin_walled": False}, {"iridescence": 0.5},
        {"specular_color": (1, 0.5, 1)}, {"emission": (1, 0, 0)}, {"alpha_mode": "blend"}, {"unlit": True},
        {"normal_texture": A_TEXTURE}, {"transmission_texture": A_TEXTURE}, {"transmission": 0.0},
    ],
    ids=lambda values: next(iter(values)),
)  # fmt: skip
def test_rays_go_straight_through_clear_walls_only(values: dict[str, Any]) -> None:
    clear = Material((1, 1, 1), roughness=0, transmission=0.8, thin_walled=True)
    assert clear.is_clear_wall and clear.passes_rays
    assert not replace(clear, **values).is_clear_wall
