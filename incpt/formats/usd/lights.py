"""Lights of UsdLux: what they emit, and what stands for those that have no counterpart.

Their intensity is a radiance, in nits there and taken for W / (m² sr) here, as that of glowing surfaces is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import UsdGeom, UsdLux

from incpt.core.affine import Vector
from incpt.core.errors import InputError
from incpt.formats import images, import_report
from incpt.formats.appearance.colored import linear_pixels
from incpt.formats.lat_long import turned_environment
from incpt.formats.placement import transform_of
from incpt.formats.primitive_shapes import cylinder
from incpt.formats.usd.textures import Bitmaps
from incpt.formats.usd.walk import Place
from incpt.scene.checks import LARGEST
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.light import LARGEST_STRENGTH, SMALLEST_SIZE, Light
from incpt.scene.material import Material
from incpt.scene.mesh import MeshSource
from incpt.scene.mesh_part import MeshPart

Matrix = npt.NDArray[np.float64]
_FLAT_ANGLE = 90.0
"""Degrees from its axis from which on a cone keeps no light back that a lamp sends forwards."""
_ALONG_X = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
_CENTERED = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -0.5], [0, 0, 0, 1]])
"""Take our cylinder, along z from 0 to 1, to one along x about the origin."""
_Z_POLE = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Turns the pole of a dome from y to z."""


class Lights:
    """Reads the lights of a stage, in the space that a matrix `ours` (4, 4) takes the stage to, whose unit
    has so many metres. `environment` is that of its dome; `parts` are lights that are meshes here."""

    def __init__(self, images_: Bitmaps, ours: Matrix, metres: float, is_z_up: bool) -> None:
        self._images, self._ours, self._metres, self._is_z_up = images_, ours, metres, is_z_up
        self._moment = images_.moment
        self.lights: list[Light] = []
        self.environment: Environment | None = None
        self.parts: list[MeshPart] = []

    def read(self, place: Place) -> None:
        """The light at a place; what cannot be read is told."""
        kind = str(place.prim.GetTypeName())
        read = _KINDS.get(kind)
        if read is None:
            import_report.left_out(f"light {place.name!r}: lights of the type {kind} are not read")
            return
        self._tell_of_unread(place)
        try:
            read(self, place)
        except (InputError, np.linalg.LinAlgError) as error:
            import_report.left_out(f"light {place.name!r}: {error}")

    def _tell_of_unread(self, place: Place) -> None:
        shaping, light = UsdLux.ShapingAPI(place.prim), UsdLux.LightAPI(place.prim)
        unread = []
        if shaping.GetShapingIesFileAttr().HasAuthoredValue():
            unread.append("its IES profile")
        if (shaping.GetShapingFocusAttr().Get(self._moment) or 0.0) != 0:
            unread.append("shaping:focus")
        for name, attribute in (("diffuse", light.GetDiffuseAttr()), ("specular", light.GetSpecularAttr())):
            if attribute.Get(self._moment) != 1:
                unread.append(name)
        if light.GetFiltersRel().GetTargets():
            unread.append("its filters")
        for collection in (light.GetLightLinkCollectionAPI(), light.GetShadowLinkCollectionAPI()):
            if collection.GetExcludesRel().GetTargets() or not collection.GetIncludeRootAttr().Get():
                unread.append(f"the collection {collection.GetName()}")
        for text in unread:
            import_report.left_out(f"{text} of light {place.name!r}: it shines everywhere alike")

    def _color(self, prim: Any) -> Vector:
        """What its surface emits, without a normalisation."""
        light = UsdLux.LightAPI(prim)
        strength = light.GetIntensityAttr().Get(self._moment) * 2.0 ** min(
            light.GetExposureAttr().Get(self._moment), 100.0
        )
        color = np.array(light.GetColorAttr().Get(self._moment), np.float64)
        if light.GetEnableColorTemperatureAttr().Get(self._moment):
            kelvin = light.GetColorTemperatureAttr().Get(self._moment)
            color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin))
        r, g, b = np.clip(np.nan_to_num(color * strength), 0, LARGEST_STRENGTH).tolist()
        return r, g, b

    def _is_normalized(self, prim: Any) -> bool:
        return bool(UsdLux.LightAPI(prim).GetNormalizeAttr().Get(self._moment))

    def _matrix(self, place: Place) -> Matrix:
        return (self._ours @ place.matrix)[:3]

    def _add(self, place: Place, kind: str, **values: Any) -> None:
        """A light whose surface has a radiance of its colour. Where it is normalised, that is divided by its
        area in units of the stage, so that its power is the same for all sizes."""
        shadow = UsdLux.ShadowAPI(place.prim).GetShadowEnableAttr().Get(self._moment)
        light = Light(
            str(place.prim.GetName()), kind, matrix=self._matrix(place), color=self._color(place.prim),
            visible=place.is_visible, casts_shadows=shadow is not False, radiance=1.0, **values,
        )  # fmt: skip
        if self._is_normalized(place.prim):
            light = replace(light, radiance=self._metres**2 / light.area)
        self.lights.append(light)

    def sphere(self, place: Place) -> None:
        sphere = UsdLux.SphereLight(place.prim)
        radius = float(sphere.GetRadiusAttr().Get(self._moment))
        shaped = self._cone(place)
        if sphere.GetTreatAsPointAttr().Get(self._moment) or radius * self._metres <= SMALLEST_SIZE:
            self._point(place, radius, shaped)
        else:
            self._add(place, "spot" if shaped else "sphere", radius=radius, **shaped)

    def _point(self, place: Place, radius: float, shaped: dict[str, Any]) -> None:
        """A ball that is too small to be seen: its intensity is its radiance times the disk that it shows."""
        if not self._is_normalized(place.prim) and radius <= 0:
            raise InputError("has no size, and is not normalised: nothing comes from it")
        # A normalised one has a power that does not depend on its radius.
        face = self._metres**2 * (0.25 if self._is_normalized(place.prim) else math.pi * radius**2)
        light = Light(
            str(place.prim.GetName()), "spot" if shaped else "point", matrix=self._matrix(place), radius=0.0,
            color=self._color(place.prim), visible=place.is_visible, power=1.0, **shaped,
        )  # fmt: skip
        self.lights.append(replace(light, power=face * light.solid_angle))

    def _cone(self, place: Place) -> dict[str, Any]:
        """What makes a spot of a ball; nothing without a cone."""
        shaping = UsdLux.ShapingAPI(place.prim)
        angle = shaping.GetShapingConeAngleAttr().Get(self._moment)
        if angle is None or angle >= _FLAT_ANGLE:
            if angle is not None and angle < 180 and shaping.GetShapingConeAngleAttr().HasAuthoredValue():
                import_report.changed(f"light {place.name!r}: a cone of {angle:g} degrees shines all around")
            return {}
        softness = min(max(shaping.GetShapingConeSoftnessAttr().Get(self._moment) or 0.0, 0.0), 1.0)
        return {"spot_angle": max(2 * float(angle), 1e-3), "spot_blend": float(softness)}

    def rectangle(self, place: Place) -> None:
        light = UsdLux.RectLight(place.prim)
        self._tell_of_cone(place)
        size = light.GetWidthAttr().Get(self._moment), light.GetHeightAttr().Get(self._moment)
        before = len(self.lights)
        self._add(place, "rectangle", size=tuple(map(float, size)))
        asset = light.GetTextureFileAttr().Get(self._moment)
        if asset and asset.path:
            import_report.changed(f"light {place.name!r}: has the mean colour of its image")
            mean = linear_pixels(self._images.bitmap(asset))[..., :3].mean(axis=(0, 1))
            color = tuple((np.array(self.lights[before].color) * mean).tolist())
            self.lights[before] = replace(self.lights[before], color=color)

    def disk(self, place: Place) -> None:
        self._tell_of_cone(place)
        radius = UsdLux.DiskLight(place.prim).GetRadiusAttr().Get(self._moment)
        self._add(place, "disk", radius=float(radius))

    def _tell_of_cone(self, place: Place) -> None:
        angle = UsdLux.ShapingAPI(place.prim).GetShapingConeAngleAttr().Get(self._moment)
        if angle is not None and angle < _FLAT_ANGLE:
            import_report.left_out(f"the cone of light {place.name!r}: only those of spheres are read")

    def cylinder(self, place: Place) -> None:
        """A mesh that shines."""
        light = UsdLux.CylinderLight(place.prim)
        radius, length = (
            float(one.Get(self._moment)) for one in (light.GetRadiusAttr(), light.GetLengthAttr())
        )
        scale = np.linalg.norm(place.matrix[:3, :3], axis=0)
        area = 2 * math.pi * radius * length * scale[0] * math.sqrt(scale[1] * scale[2])
        size = np.diag([radius, radius, length, 1.0])
        transform = transform_of(self._ours @ place.matrix @ _ALONG_X @ size @ _CENTERED)
        if transform is None or not area > 0:
            raise InputError("has no size")
        factor = 1 / area if self._is_normalized(place.prim) else 1.0
        r, g, b = (min(c * factor, LARGEST) for c in self._color(place.prim))
        import_report.changed(f"light {place.name!r}: is a cylinder, for which a mesh shines")
        material = Material(base_color=(0.0, 0.0, 0.0), specular=0.0, emission=(r, g, b))
        mesh = replace(cylinder(), source=MeshSource(geometry=place.name))
        self.parts.append(MeshPart(place.name, mesh, place.name, material, transform, place.is_visible))

    def distant(self, place: Place) -> None:
        """A sun. Its radiance times the disk that is seen of it is its irradiance; a normalised one, and one
        that is a point, has that at once."""
        light = UsdLux.DistantLight(place.prim)
        angle = min(max(float(light.GetAngleAttr().Get(self._moment)), 0.0), 180.0)
        is_whole = self._is_normalized(place.prim) or angle == 0
        irradiance = 1.0 if is_whole else math.pi * math.sin(math.radians(angle) / 2) ** 2
        self.lights.append(
            Light(
                str(place.prim.GetName()), "sun", matrix=self._matrix(place), angle=angle,
                color=self._color(place.prim), irradiance=irradiance, visible=place.is_visible,
            )
        )  # fmt: skip

    def dome(self, place: Place) -> None:
        if not place.is_visible:
            import_report.left_out(f"light {place.name!r}: is not visible")
            return
        if self.environment is not None:
            import_report.left_out(f"light {place.name!r}: a scene has one environment, and this is another")
            return
        light, is_second = UsdLux.DomeLight(place.prim), place.prim.IsA(UsdLux.DomeLight_1)
        light = UsdLux.DomeLight_1(place.prim) if is_second else light
        color = self._color(place.prim)
        self.environment = Environment(color)
        asset = light.GetTextureFileAttr().Get(self._moment)
        if not (asset and asset.path):
            return
        if str(light.GetTextureFormatAttr().Get(self._moment)) not in ("automatic", "latlong"):
            raise InputError("its image is no lat-long one; its colour alone is read")
        image = self._panorama(asset)
        turn = self._ours[:3, :3] @ place.matrix[:3, :3]
        if is_second:
            axis = str(UsdLux.DomeLight_1(place.prim).GetPoleAxisAttr().Get(self._moment))
            turn = turn @ _Z_POLE if axis == "Z" or (axis == "scene" and self._is_z_up) else turn
        self.environment = turned_environment(f"light {place.name!r}", Environment(color, image), turn)

    def _panorama(self, asset: Any) -> Image:
        bitmap = self._images.bitmap(asset)
        if bitmap.source.file is not None and bitmap.source.index is None:
            return images.load_image(Path(bitmap.source.file))
        return Image(np.maximum(linear_pixels(bitmap)[..., :3], 0).astype(np.float32))


_KINDS: dict[str, Callable[[Lights, Place], None]] = {
    "SphereLight": Lights.sphere,
    "RectLight": Lights.rectangle,
    "DiskLight": Lights.disk,
    "CylinderLight": Lights.cylinder,
    "DistantLight": Lights.distant,
    "DomeLight": Lights.dome,
    "DomeLight_1": Lights.dome,
}


def is_light(prim: Any) -> bool:
    """Whether a prim is a light of its own, and no mesh that shines as well."""
    return bool(prim.HasAPI(UsdLux.LightAPI)) and not prim.IsA(UsdGeom.Gprim)
