"""Files with coordinates of maps: they keep millimetres, and say where they have gone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.gltf_files import GltfBuilder

from incpt.core.errors import InputError
from incpt.formats import far_origin
from incpt.formats.import_report import Fate
from incpt.formats.registry import load_with_report

# Of a place in zone 33: east, height, and north that goes along -z.
CORNERS = np.array([[500_123.001, 300.002, -5_300_456.003], [500_133.001, 300.002, -5_300_456.003],
                    [500_133.001, 310.002, -5_300_456.006]])  # fmt: skip
OFFSET = np.array([500_000.0, 0.0, -5_300_000.0])


def obj() -> str:
    return "".join(f"v {x:.3f} {y:.3f} {z:.3f}\n" for x, y, z in CORNERS) + "f 1 2 3\n"


def ply() -> str:
    head = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property double {one}\n" for one in "xyz")
    rows = "".join(f"{x:.3f} {y:.3f} {z:.3f}\n" for x, y, z in CORNERS)
    return head + f"element face 1\nproperty list uchar int vertex_indices\nend_header\n{rows}3 0 1 2\n"


def off() -> str:
    return "OFF\n3 1 0\n" + "".join(f"{x:.3f} {y:.3f} {z:.3f}\n" for x, y, z in CORNERS) + "3 0 1 2\n"


def stl() -> str:
    rows = "".join(f"vertex {x:.3f} {y:.3f} {z:.3f}\n" for x, y, z in CORNERS)
    return f"solid a\nfacet normal 0 0 1\nouter loop\n{rows}endloop\nendfacet\nendsolid a\n"


@pytest.mark.parametrize("make", [obj, ply, off, stl])
def test_millimetres_are_kept(tmp_path: Path, make: object) -> None:
    path = tmp_path / f"a.{make.__name__}"  # type: ignore[attr-defined]
    path.write_text(make())  # type: ignore[operator]
    scene, report = load_with_report(path)
    mesh = scene.objects[0].mesh
    np.testing.assert_allclose(mesh.vertices[mesh.faces[0]], CORNERS - OFFSET, atol=1e-4)
    (said,) = [one.text for one in report.of(Fate.CHANGED) if "origin" in one.text]
    assert said.startswith("the origin: is moved to (500000, 0, -5300000) of the file")


def test_what_a_file_places_is_moved_as_a_whole(tmp_path: Path) -> None:
    """Objects, a camera and a lamp of a glTF file; light from far away has no place."""
    builder = GltfBuilder()
    x, y, z = CORNERS[0].tolist()
    lamp = {"extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [x, y + 2, z]}
    sun = {"extensions": {"KHR_lights_punctual": {"light": 1}}}
    path = builder.write(
        tmp_path / "a.gltf",
        [builder.quad()],
        nodes=[{"mesh": 0, "translation": [x, y, z]}, lamp, sun, {"camera": 0, "translation": [x, y, z + 5]}],
        scenes=[{"nodes": [0, 1, 2, 3]}],
        cameras=[{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}],
        extensions={"KHR_lights_punctual": {"lights": [{"type": "point"}, {"type": "directional"}]}},
    )
    scene, _ = load_with_report(path)
    near = CORNERS[0] - OFFSET
    np.testing.assert_allclose(scene.objects[0].position, near, atol=1e-9)
    np.testing.assert_allclose(scene.lights[0].position, np.add(near, (0, 2, 0)), atol=1e-9)
    np.testing.assert_allclose(scene.camera.position, np.add(near, (0, 0, 5)), atol=1e-9)
    np.testing.assert_allclose(scene.camera.target, near, atol=1e-9)
    assert scene.lights[1].position == (0, 0, 0)


@pytest.mark.parametrize("scale", [1.0, 1e4])
def test_what_is_near_stays_where_it_is(scale: float) -> None:
    """Also what is as large as it is far."""
    assert far_origin.far_offset(scale * np.array([[10.0, 0, 0], [9.0, 1, 0], [np.nan, 0, 0]])) is None
    assert far_origin.far_offset(np.zeros((0, 3))) is None


def test_what_is_too_far_is_refused_as_before(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 1e30 0 0\nv 1e30 1 0\nv 1e30 0 1\nf 1 2 3\n")
    with pytest.raises(InputError, match="not finite or too far away"):
        load_with_report(tmp_path / "a.obj")
