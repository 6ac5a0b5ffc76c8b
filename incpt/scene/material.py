"""What surfaces and bodies are made of."""

from __future__ import annotations

from dataclasses import dataclass

from incpt.core.affine import Vector
from incpt.core.checks import require_bool, whole
from incpt.scene.checks import set_number, set_vector


@dataclass(frozen=True)
class Material:
    """Terms and ranges follow glTF 2.0; the equations stand in `cl/shading/material.cl`.

    GGX alpha is `roughness` squared. `absorption` is per metre inside a transmissive body, `priority`
    orders nested dielectrics (the higher wins, 0 is the highest of all), `emission` is radiance, from
    the front side only unless `double_sided`. `specular` scales the dielectric layer: 0 is Lambertian.
    """

    base_color: Vector = (0.8, 0.8, 0.8)
    metallic: float = 0.0
    roughness: float = 1.0
    specular: float = 1.0
    ior: float = 1.5
    transmission: float = 0.0
    absorption: Vector = (0.0, 0.0, 0.0)
    priority: int = 0
    emission: Vector = (0.0, 0.0, 0.0)
    double_sided: bool = False

    def __post_init__(self) -> None:
        set_vector(self, "base_color", low=0.0, high=1.0)
        for name in ("metallic", "roughness", "specular", "transmission"):
            set_number(self, name, 0.0, 1.0)
        set_number(self, "ior", 1.0, 100.0)
        set_vector(self, "absorption", low=0.0)
        set_vector(self, "emission", low=0.0)
        object.__setattr__(self, "priority", whole("priority", self.priority, 0, 1000))
        require_bool("double_sided", self.double_sided)

    @property
    def is_emissive(self) -> bool:
        return any(c > 0 for c in self.emission)
