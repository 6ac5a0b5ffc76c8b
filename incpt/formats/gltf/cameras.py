"""Cameras of glTF files, which look along -z of their nodes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.checks import one_of
from incpt.core.errors import in_place
from incpt.formats import import_report
from incpt.formats.camera_placement import placement, tell_of_far_plane
from incpt.formats.gltf.document import Document
from incpt.formats.gltf.nodes import Node
from incpt.scene.camera import Camera

_LARGEST_FOV_Y = 179.0


def camera_of(node: Node, document: Document, bounds: npt.NDArray[np.floating]) -> tuple[str, Camera] | None:
    """Name and camera of a node, in world space; None where it has none. `bounds` (2, 3) of what stands in
    the scene tell how far from it the point is that it looks at. Raises InputError."""
    number = node.table.index("camera")
    if number is None:
        return None
    table = document.item("cameras", number)
    name = node.table.text("name") or table.text("name") or f"camera {number}"
    if node.flattens:
        import_report.left_out(f"camera {name!r}: stands at a node that flattens space")
        return None
    with in_place(f"camera {name!r}"):
        kind = table.text("type")
        one_of("type", kind, ("perspective", "orthographic"))
        lens = table.table(kind)
        values: dict[str, Any] = {"projection": kind, "near": max(lens.number("znear", 0.0), 0.0)}
        if kind == "perspective":
            angle = math.degrees(lens.number("yfov", math.radians(40), 1e-3))
            if angle > _LARGEST_FOV_Y:
                import_report.changed(
                    f"camera {name!r}: its view of {angle:.4g} degrees, to {_LARGEST_FOV_Y:g}"
                )
            values["fov_y"] = min(angle, _LARGEST_FOV_Y)
        else:
            # `xmag` is the picture's own aspect here, as `aspectRatio` is.
            values["ortho_height"] = 2 * max(abs(lens.number("ymag", 1.0)), 1e-6)
        tell_of_far_plane(lens.number("zfar", math.inf, high=math.inf), node.world, bounds, name)
        return name, Camera(**placement(node.world, bounds), **values)
