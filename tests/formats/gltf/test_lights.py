"""Lights of glTF files: where they stand, what they emit, and files that are damaged."""

from __future__ import annotations

import json
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from incpt.core.errors import InputError, InputWarning
from incpt.formats.import_report import Fate
from incpt.formats.registry import load, load_with_report
from incpt.scene.model import Scene

LIGHTS: list[dict[str, Any]] = [
    {"type": "point", "intensity": 100, "color": [1, 0, 0]},
    {"type": "spot", "name": "beam", "intensity": 5, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}},
    {"type": "directional", "intensity": 3},
]


def carrying(light: int, **node: Any) -> dict[str, Any]:
    return {"extensions": {"KHR_lights_punctual": {"light": light}}, **node}


NODES = [
    carrying(0, translation=[0, 0, 2]),
    {"translation": [1, 2, 3], "scale": [2, 2, 2], "children": [-1]},
    carrying(1, name="lamp", translation=[0, 1, 0], rotation=[-math.sqrt(0.5), 0, 0, math.sqrt(0.5)]),
    carrying(2, matrix=[0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1]),
    carrying(0, translation=[5, 0, 0]),
]  # fmt: skip


def scene_of(folder: Path, nodes: list[dict[str, Any]], lights: Any, generator: str = "hand") -> Scene:
    """A cube and these nodes; -1 among children means the node behind it. The last is in no scene."""
    path = folder / "model.gltf"
    for name, content in trimesh.exchange.gltf.export_gltf(trimesh.creation.box().scene()).items():
        (folder / name).write_bytes(content)
    document = json.loads(path.read_text())
    first = len(document["nodes"])
    for i, node in enumerate(nodes):
        children = [first + i + 1 for child in node.get("children", []) if child == -1]
        document["nodes"].append({**node, "children": children} if children else node)
    below = {child for node in document["nodes"] for child in node.get("children", [])}
    document["scenes"][0]["nodes"] += [first + i for i in range(len(nodes) - 1) if first + i not in below]
    document["asset"]["generator"] = generator
    document["extensionsUsed"] = ["KHR_lights_punctual"]
    document["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    path.write_text(json.dumps(document))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)
        return load(path)


def test_lights_come_with_the_meshes(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, NODES, LIGHTS)
    assert len(scene.objects) == 1
    point, spot, sun = scene.lights
    assert [light.name for light in scene.lights] == ["model/point", "model/lamp", "model/sun"]
    assert point.position == (0, 0, 2) and point.emitted == pytest.approx((100, 0, 0)) and not point.has_size
    # One node stands below another.
    np.testing.assert_allclose(spot.position, (1, 4, 3))
    np.testing.assert_allclose(-spot.axes[2], (0, -1, 0), atol=1e-12)
    assert spot.spot_angle == pytest.approx(math.degrees(1.0)) and spot.spot_blend == pytest.approx(0.6)
    assert spot.emitted[0] == pytest.approx(5)
    assert sun.irradiance == 3 and not sun.has_size
    np.testing.assert_allclose(-sun.axes[2], (-1, 0, 0), atol=1e-12)


def test_that_units_change_is_told(tmp_path: Path) -> None:
    scene_of(tmp_path, NODES, LIGHTS)
    _, report = load_with_report(tmp_path / "model.gltf")
    assert "the units of lights: candela" in report.of(Fate.CHANGED)[0].text and report.is_whole


@pytest.mark.parametrize(
    ("version", "factor"), [("4.2.70", 683), ("3.6.5", 683), ("3.3.36", 1), ("10.0.1", 683), ("x", 1)]
)
def test_lamps_of_blender_have_its_watts(tmp_path: Path, version: str, factor: float) -> None:
    """As its importer reads them. Up to 3.3 its exporter had another way."""
    scene = scene_of(tmp_path, NODES, LIGHTS, f"Khronos glTF Blender I/O v{version}")
    point, _, sun = scene.lights
    assert point.emitted[0] == pytest.approx(100 / factor) and sun.irradiance == pytest.approx(3 / factor)
    text = load_with_report(tmp_path / "model.gltf")[1].of(Fate.CHANGED)[0].text
    assert ("683" in text) == (factor > 1)


def test_names_differ(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, [carrying(0), carrying(0), {}], LIGHTS)
    assert [light.name for light in scene.lights] == ["model/point", "model/point.001"]


@pytest.mark.parametrize(
    ("lights", "message"),
    [
        ([{"type": "area"}], r"light '\d': type: 'area'"),
        ([], r"extensions\.KHR_lights_punctual\.lights: has 0 entries"),
        (3, r"extensions\.KHR_lights_punctual\.lights: 3 is no list"),
        ([{"type": "point", "intensity": "bright"}], r"light '\d': .*intensity: 'bright' is not a number"),
        ([{"type": "point", "color": [-1, 0, 0]}], r"light '\d': color: -1 is out of range"),
        (
            [{"type": "spot", "spot": {"innerConeAngle": 2, "outerConeAngle": 1}}],
            r"light '\d': spot_blend: -1 is out",
        ),
    ],
)
def test_damaged_lights_are_one_line(tmp_path: Path, lights: Any, message: str) -> None:
    with pytest.raises(InputError, match=rf"model\.gltf: {message}"):
        scene_of(tmp_path, [carrying(0), {}], lights)
