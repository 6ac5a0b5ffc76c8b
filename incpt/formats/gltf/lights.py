"""Lights of glTF files: points, spots and suns of the extension KHR_lights_punctual.

It measures intensity in candela and illuminance in lux. Here they are taken for W / sr and W / m² as they
are, like its emission, which is in nits there and a radiance here: so lamps and glowing surfaces of a file
keep their proportions, and an exposure is all that is between its numbers and ours. Blender's exporter makes
candela of its watts by a factor, and leaves glowing surfaces as they are; in its files that is taken back.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

from incpt.core import affine
from incpt.core.checks import one_of
from incpt.core.errors import in_place
from incpt.formats import import_report
from incpt.formats.gltf.document import Document
from incpt.formats.gltf.nodes import Node
from incpt.formats.gltf.table import Table
from incpt.scene.light import LARGEST_STRENGTH, Light

EXTENSION = "KHR_lights_punctual"
_BLENDER = re.compile(r"Khronos glTF Blender I/O v(\d+)\.(\d+)")
_BLENDER_SINCE = (3, 6)
"""The version from which on it does so by default."""
_LUMENS_PER_WATT = 683
"""Of light at 555 nm, which Blender takes for all light."""
_KINDS = {"point": "point", "spot": "spot", "directional": "sun"}


def watts_of(document: Document) -> float:
    """What a candela of a file counts for in W / sr, and a lux in W / m². Raises InputError."""
    made_by = _BLENDER.match(document.root.table("asset").text("generator"))
    is_blender = made_by is not None and tuple(map(int, made_by.groups())) >= _BLENDER_SINCE
    return 1 / _LUMENS_PER_WATT if is_blender else 1.0


def light_of(node: Node, document: Document) -> Light | None:
    """The light that a node carries, in world space, without a size; it need not have a name of its own. None
    where there is none, or where the node flattens space. Raises InputError."""
    carried = node.table.extension(EXTENSION)
    number = carried.index("light")
    if number is None:
        return None
    table = document.root.table("extensions").table(EXTENSION).item("lights", number)
    if node.flattens:
        import_report.left_out(f"light {node.name!r}: stands at a node that flattens space")
        return None
    with in_place(f"light {node.name!r}"):
        if "range" in table:
            import_report.left_out(f"the range of light {node.name!r}: light has none")
        return replace(_light(table, node, watts_of(document)), visible=node.is_visible)


def _light(table: Table, node: Node, watts: float) -> Light:
    kind = table.text("type")
    one_of("type", kind, _KINDS)
    kind = _KINDS[kind]
    position, rotation, _ = affine.decompose(node.world[:3])
    intensity = watts * table.number("intensity", 1.0, 0.0, LARGEST_STRENGTH)
    values: dict[str, Any] = {
        "color": table.numbers("color", (1.0, 1.0, 1.0), -math.inf),
        "radius": 0.0,
        "angle": 0.0,
    }
    if kind == "spot":
        cone = table.table("spot")
        outer = cone.number("outerConeAngle", math.pi / 4, 1e-3)
        inner = cone.number("innerConeAngle", 0.0)
        values |= {"spot_angle": min(math.degrees(2 * outer), 180.0), "spot_blend": 1 - inner / outer}
    name = node.table.text("name") or table.text("name") or kind
    light = Light(name, kind, position, rotation, **values)
    if kind == "sun":
        return replace(light, irradiance=intensity)
    return replace(light, power=intensity * light.solid_angle)
