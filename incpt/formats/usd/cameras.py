"""Cameras of USD, which look along -z; apertures and focal lengths are in tenths of the stage's unit."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Gf, UsdGeom

from incpt.core.errors import in_place
from incpt.formats import import_report
from incpt.formats.camera_placement import placement, tell_of_far_plane
from incpt.formats.usd.walk import Place
from incpt.scene.camera import Camera

_TENTHS_IN_MM = 100.0
"""Millimetres of a tenth of a metre."""


def camera_of(
    place: Place, ours: npt.NDArray[np.float64], metres: float, moment: Any, bounds: npt.NDArray[np.floating]
) -> Camera | None:
    """The camera at a place, in the space that a matrix `ours` (4, 4) takes the stage to, whose unit has so
    many metres. None, where its placement flattens space. `bounds` (2, 3) of the scene tell what it looks at.
    Raises InputError."""
    matrix = ours @ place.matrix
    name = str(place.prim.GetName())
    with np.errstate(all="ignore"):
        axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    if not (np.isfinite(axes).all() and abs(np.linalg.det(axes)) > 1e-6):
        import_report.left_out(f"camera {name!r}: stands at a prim that flattens space")
        return None
    seen = UsdGeom.Camera(place.prim).GetCamera(moment)
    with in_place(f"camera {name!r}"):
        larger = max(seen.horizontalAperture, seen.verticalAperture)
        mm = metres * _TENTHS_IN_MM
        values: dict[str, Any] = {
            # As usdview shows them: a picture of another aspect has the same height of view.
            "sensor_fit": "vertical",
            "focal_length": seen.focalLength * mm,
            "sensor_width": seen.horizontalAperture * mm,
            "sensor_height": seen.verticalAperture * mm,
            "shift_x": seen.horizontalApertureOffset / larger if larger > 0 else 0.0,
            "shift_y": seen.verticalApertureOffset / larger if larger > 0 else 0.0,
            "near": max(seen.clippingRange.min, 0.0) * metres,
            "f_stop": max(seen.fStop, 0.0),
            "focus_distance": max(seen.focusDistance, 0.0) * metres,
        }
        if seen.projection == Gf.Camera.Orthographic:
            values |= {"projection": "orthographic", "ortho_height": seen.verticalAperture * metres / 10}
            del values["focal_length"]
        tell_of_far_plane(seen.clippingRange.max * metres, matrix, bounds, name)
        return Camera(**placement(matrix, bounds), **values)
