"""Materials: every parameter is checked, and known to the kernels."""

from __future__ import annotations

from typing import Any

import pytest
from support.parameters import NAMES, TEXTURES

from incpt.core.errors import InputError
from incpt.core.layout import MATERIAL
from incpt.scene.material import Material

DERIVED = {
    **dict.fromkeys(("double_sided", "alpha_mode", "thin_walled", "unlit"), "flags"),
    **dict.fromkeys(TEXTURES, "textures"),
}
"""Parameters that kernels see in another form, and the field of the struct that holds it."""


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", ["much", None, float("nan"), -1.0, [1.0, 2.0]])
def test_every_parameter_is_checked(name: str, value: Any) -> None:
    if value is None and name in TEXTURES:
        return  # no texture
    if (
        name in ("normal_scale", "clearcoat_normal_scale", "bump_scale", "anisotropy_rotation")
        and value == -1.0
    ):
        return  # dents for bumps, and angles
    with pytest.raises(InputError, match=f"^{name}: "):
        Material(**{name: value})


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_reaches_the_kernels(name: str) -> None:
    assert DERIVED.get(name, name) in (MATERIAL.names or ())
