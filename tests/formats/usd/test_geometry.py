"""Geometry of USD files: what stands where, beside formulas and USD's own evaluation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.usd_files import METRES, QUAD, QUAD_MESH, load_usda, placed, write_usda

from incpt.core import affine
from incpt.core.errors import InputError
from incpt.formats import mesh_files
from incpt.formats.import_report import Fate
from incpt.scene.mesh import Mesh
from incpt.scene.model import Scene

pxr = pytest.importorskip("pxr")


def area(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def face_normals(mesh: Mesh) -> Any:
    a, b, c = (mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
    found = np.cross(b - a, c - a)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def volume(mesh: Mesh) -> float:
    """Above 0 where all faces look outwards."""
    a, b, c = (mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def mesh_of(folder: Path, more: str, quad: str = QUAD) -> Mesh:
    scene, report = load_usda(folder, f'def Mesh "m" {{ {quad} {more} }}')
    assert report.is_whole, report.lines()
    return scene.objects[0].mesh


CONCAVE = """
    uniform token subdivisionScheme = "none"
    point3f[] points = [(0, 0, 0), (3, 0, 0), (3, 3, 0), (2, 3, 0), (2, 1, 0), (1, 1, 0),
        (1, 3, 0), (0, 3, 0)]
    int[] faceVertexCounts = [8]
    int[] faceVertexIndices = [0, 1, 2, 3, 4, 5, 6, 7]
"""


def test_concave_polygons_keep_their_notch(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, "", CONCAVE)
    assert len(mesh.faces) == 6 and area(mesh) == pytest.approx(7)
    np.testing.assert_allclose(face_normals(mesh), np.broadcast_to([0, 0, 1], (6, 3)), atol=1e-6)


def test_left_handed_faces_are_turned_over(tmp_path: Path) -> None:
    """With what they have at their corners."""
    st = 'texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "faceVarying")'
    mesh = mesh_of(tmp_path, f'uniform token orientation = "leftHanded"\n{st}')
    np.testing.assert_allclose(face_normals(mesh), np.broadcast_to([0, 0, -1], (2, 3)))
    corners = mesh.vertices[mesh.faces][..., :2]
    np.testing.assert_allclose(mesh.uvs[0], (corners * [1, -1] + 1) / 2, atol=1e-6)


def test_holes_are_no_faces(tmp_path: Path) -> None:
    two = QUAD.replace("[4]", "[3, 3]").replace("[0, 1, 2, 3]", "[0, 1, 2, 0, 2, 3]")
    mesh = mesh_of(tmp_path, "int[] holeIndices = [1]", two)
    np.testing.assert_allclose(mesh.vertices[mesh.faces].mean(axis=(0, 1)), (1 / 3, -1 / 3, 0), atol=1e-6)


def test_normals_of_any_interpolation(tmp_path: Path) -> None:
    tilted = 'normal3f[] normals = [(0, 0, 1), (0, 1, 1), (1, 0, 1), (0, 0, 2)] (interpolation = "{}")'
    for interpolation in ("vertex", "faceVarying"):
        mesh = mesh_of(tmp_path, tilted.format(interpolation))
        assert mesh.normals is not None
        first = mesh.faces.ravel().tolist().index(1)
        np.testing.assert_allclose(
            mesh.normals.reshape(-1, 3)[first], np.array([0, 1, 1]) / 2**0.5, atol=1e-6
        )
    indexed = """normal3f[] primvars:normals = [(0, 0, 1), (1, 0, 0)] (interpolation = "uniform")
        int[] primvars:normals:indices = [1]"""
    normals = mesh_of(tmp_path, indexed).normals
    assert normals is not None
    np.testing.assert_allclose(normals, np.broadcast_to([1, 0, 0], (2, 3, 3)))
    assert mesh_of(tmp_path, "").normals is None


def test_subdivision_is_left_out_and_said(tmp_path: Path) -> None:
    """With smooth normals: of a cube's cage those at the corners lie along its diagonals."""
    corners = ", ".join(str(tuple((i >> k & 1) * 2 - 1 for k in range(3))) for i in range(8))
    cube = f"""point3f[] points = [{corners}]
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [0,4,6,2, 1,3,7,5, 0,1,5,4, 2,6,7,3, 0,2,3,1, 4,5,7,6]"""
    scene, report = load_usda(tmp_path, f'def Mesh "m" {{ {cube} }}')
    mesh = scene.objects[0].mesh
    assert mesh.normals is not None and volume(mesh) == pytest.approx(8)
    expected = mesh.vertices[mesh.faces] / 3**0.5
    assert (np.abs(mesh.normals - expected).max(axis=2) < 1e-6).all()
    assert any("1 mesh that USD subdivides: is not" in one.text for one in report.of(Fate.CHANGED))


def test_texture_coordinates_of_any_interpolation(tmp_path: Path) -> None:
    st = "[(0, 0), (1, 0), (1, 1), (0, 1)]"
    for interpolation in ("vertex", "varying", "faceVarying"):
        mesh = mesh_of(tmp_path, f'texCoord2f[] primvars:st = {st} (interpolation = "{interpolation}")')
        corners = mesh.vertices[mesh.faces][..., :2]
        # v goes down here, and up there.
        np.testing.assert_allclose(mesh.uvs[0], (corners * [1, -1] + 1) / 2, atol=1e-6)
    indexed = """texCoord2f[] primvars:st = [(1, 1), (0, 0)] (interpolation = "faceVarying")
        int[] primvars:st:indices = [1, 1, 0, 1]"""
    mesh = mesh_of(tmp_path, indexed)
    at_third = mesh.faces.ravel() == 2
    assert {tuple(uv) for uv in mesh.uvs[0].reshape(-1, 2)[at_third]} == {(1.0, 0.0)}
    assert {tuple(uv) for uv in mesh.uvs[0].reshape(-1, 2)[~at_third]} == {(0.0, 1.0)}


def test_primvars_that_do_not_fit_are_said(tmp_path: Path) -> None:
    few = 'texCoord2f[] primvars:st = [(0, 0)] (interpolation = "vertex")'
    scene, report = load_usda(tmp_path, f'def Mesh "m" {{ {QUAD} {few} }}')
    assert not scene.objects[0].mesh.uvs[0].any() or np.ptp(scene.objects[0].mesh.uvs[0]) == 1
    assert "primvar 'st' of /m: 1 values of vertex" in report.of(Fate.LEFT_OUT)[0].text


SOLIDS = {
    'Sphere "s" { double radius = 2 }': 4 / 3 * np.pi * 8,
    'Cube "s" { double size = 3 }': 27,
    'Cylinder "s" { double radius = 1 double height = 4 token axis = "X" }': 4 * np.pi,
    'Cone "s" { double radius = 1 double height = 3 token axis = "Y" }': np.pi,
    'Capsule "s" { double radius = 1 double height = 2 }': 2 * np.pi + 4 / 3 * np.pi,
    'Cylinder_1 "s" { double radiusBottom = 2 double radiusTop = 1 double height = 3 }': 7 * np.pi,
    'Capsule_1 "s" { double radiusBottom = 1 double radiusTop = 1 double height = 2 }': 10 / 3 * np.pi,
}


@pytest.mark.parametrize("text", SOLIDS)
def test_plain_shapes(tmp_path: Path, text: str) -> None:
    """Their volumes, closed with all faces outwards, and their extents by USD's own."""
    from pxr import Usd, UsdGeom

    body = "def " + text.replace("{ ", "{\n").replace(" double", "\ndouble").replace(" token", "\ntoken")
    scene, report = load_usda(tmp_path, body.replace(" }", "\n}"))
    (shown,) = scene.objects
    inside = volume(shown.mesh) * np.linalg.det(shown.world_from_object[:, :3])
    assert inside == pytest.approx(SOLIDS[text], rel=4e-3) and report.is_whole
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    extent = UsdGeom.Boundable(stage.GetPrimAtPath("/s")).ComputeExtentFromPlugins
    if shown.mesh.normals is not None:
        outwards = (shown.mesh.normals * face_normals(shown.mesh)[:, None]).sum(axis=2)
        assert outwards.min() > 0.7
    low, high = extent(UsdGeom.Boundable(stage.GetPrimAtPath("/s")), Usd.TimeCode.Default())
    np.testing.assert_allclose(shown.world_bounds, [low, high], atol=2e-3 * inside)


@pytest.mark.parametrize(
    ("axis", "size", "normal"),
    [("X", (0, 6, 4), (1, 0, 0)), ("Y", (4, 0, 6), (0, 1, 0)), ("Z", (4, 6, 0), (0, 0, 1))],
)
def test_planes(tmp_path: Path, axis: str, size: Any, normal: Any) -> None:
    body = f'def Plane "p" {{\ndouble width = 4\ndouble length = 6\ntoken axis = "{axis}"\n}}'
    (shown,) = load_usda(tmp_path, body)[0].objects
    np.testing.assert_allclose(np.ptp(shown.world_bounds, axis=0), size, atol=1e-9)
    turned = np.linalg.inv(shown.world_from_object[:, :3]).T @ face_normals(shown.mesh)[0]
    np.testing.assert_allclose(turned / np.linalg.norm(turned), normal, atol=1e-9)


def test_shapes_without_a_size_are_said(tmp_path: Path) -> None:
    body = f'def Sphere "s" {{\ndouble radius = 0\n}}\n{QUAD_MESH}'
    scene, report = load_usda(tmp_path, body)
    assert len(scene.objects) == 1
    assert [one.text for one in report.of(Fate.LEFT_OUT)] == ["'s': has no size"]


NESTED = f"""
def Xform "a" {{
    {placed("double3 translate = (1, 2, 3)", "float3 rotateXYZ = (30, 40, 50)", "float3 scale = (1, 2, 3)")}
    def Xform "b" {{
        {placed("float rotateY = 70", "double3 translate = (0, 0, -4)")}
        def Mesh "inner" {{ {QUAD} {placed("float rotateX = 20")} }}
        def Mesh "reset" {{ {QUAD}
            double3 xformOp:translate = (5, 0, 0)
            uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:translate"]
        }}
    }}
}}
"""


def test_transforms_are_those_of_usd(tmp_path: Path) -> None:
    """Beside USD's own evaluation, and for one a formula."""
    from pxr import Usd, UsdGeom

    scene, _ = load_usda(tmp_path, NESTED)
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    for name in ("a/b/inner", "a/b/reset"):
        prim = stage.GetPrimAtPath(f"/{name}")
        expected = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default())).T
        found = next(one for one in scene.objects if one.name == f"a/{name}")
        np.testing.assert_allclose(found.world_from_object, expected[:3], atol=1e-9)
    np.testing.assert_allclose(scene.object("a/a/b/reset").world_from_object[:, 3], (5, 0, 0))


def test_units_and_up(tmp_path: Path) -> None:
    body = f'def Mesh "m" {{ {QUAD} {placed("double3 translate = (10, 20, 300)")} }}'
    scene, report = load_usda(tmp_path, body, 'metersPerUnit = 0.01\nupAxis = "Z"')
    np.testing.assert_allclose(scene.objects[0].world_bounds, [[0.09, 3, -0.21], [0.11, 3, -0.19]], atol=1e-9)
    assert not report.of(Fate.CHANGED)
    scene, report = load_usda(tmp_path, body, 'upAxis = "Y"')
    np.testing.assert_allclose(scene.objects[0].world_bounds, [[0.09, 0.19, 3], [0.11, 0.21, 3]], atol=1e-9)
    assert "centimetres" in report.of(Fate.CHANGED)[0].text
    with pytest.raises(InputError, match="says itself where up is"):
        load_usda(tmp_path, body, up="z")


def test_purpose_and_visibility(tmp_path: Path) -> None:
    quads = "\n".join(
        f'def Mesh "{name}" {{ {QUAD} {more} }}'
        for name, more in (
            ("plain", ""), ("render", 'uniform token purpose = "render"'),
            ("hidden", 'token visibility = "invisible"'), ("guide", 'uniform token purpose = "guide"'),
        )
    )  # fmt: skip
    below = f'def Xform "p" {{\nuniform token purpose = "proxy"\ntoken visibility = "invisible"\n{quads}\n}}'
    scene, report = load_usda(tmp_path, f"{quads}\n{below}")
    shown = {one.name: one.visible for one in scene.objects}
    assert shown == {
        "a/plain": True, "a/render": True, "a/hidden": False, "a/p/render": False,
    }  # fmt: skip
    said = sorted(one.text for one in report.of(Fate.LEFT_OUT))
    assert said == [f"2 prims of purpose {one!r}: not for pictures" for one in ("guide", "proxy")]


INSTANCES = f"""
class Xform "asset" {{
    def Mesh "m" {{ {QUAD} {placed("double3 translate = (0, 0, 1)")} }}
}}
def Xform "one" (instanceable = true
    references = </asset>) {{ {placed("double3 translate = (1, 0, 0)")} }}
def Xform "two" (instanceable = true
    references = </asset>) {{ {placed("double3 translate = (2, 0, 0)")} }}
"""


def test_instances_share_their_mesh(tmp_path: Path) -> None:
    scene, report = load_usda(tmp_path, INSTANCES)
    assert [one.name for one in scene.objects] == ["a/one/m", "a/two/m"]
    assert len({id(one.mesh) for one in scene.objects}) == 1
    places = [one.world_from_object[:, 3].tolist() for one in scene.objects]
    np.testing.assert_allclose(places, [(1, 0, 1), (2, 0, 1)])
    assert any(one.text.startswith("2 objects, 1 mesh") for one in report.of(Fate.READ))


POINTS = f"""
def PointInstancer "many" {{
    rel prototypes = [</many/quad>, </many/ball>]
    int[] protoIndices = [0, 1, 0, 1]
    point3f[] positions = [(0, 0, 0), (10, 0, 0), (20, 0, 0), (30, 0, 0)]
    quath[] orientations = [(1, 0, 0, 0), (1, 0, 0, 0), (0.7071, 0, 0.7071, 0), (1, 0, 0, 0)]
    float3[] scales = [(1, 1, 1), (2, 2, 2), (1, 1, 3), (1, 1, 1)]
    int64[] invisibleIds = [3]
    {placed("double3 translate = (0, 7, 0)")}
    def Mesh "quad" {{ {QUAD} {placed("double3 translate = (0, 0, 1)")} }}
    def Sphere "ball" {{
        double radius = 1
    }}
}}
"""


def test_point_instancers(tmp_path: Path) -> None:
    """Where USD's own evaluation puts them; prototypes by themselves are not shown."""
    from pxr import Usd, UsdGeom

    scene, report = load_usda(tmp_path, POINTS)
    assert report.is_whole
    assert [one.name for one in scene.objects] == ["a/many/0/quad", "a/many/1/ball", "a/many/2/quad"]
    assert scene.objects[0].mesh is scene.objects[2].mesh
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/many"))
    matrices = instancer.ComputeInstanceTransformsAtTime(0, 0)
    up = affine.compose((0, 7, 0), (0, 0, 0), (1, 1, 1))
    for number, name in ((0, "a/many/0/quad"), (2, "a/many/2/quad")):
        expected = np.vstack([up, [0, 0, 0, 1]]) @ np.array(matrices[number]).T
        np.testing.assert_allclose(scene.object(name).world_from_object, expected[:3], atol=1e-5)
    np.testing.assert_allclose(scene.object("a/many/1/ball").world_bounds, [[8, 5, -2], [12, 9, 2]])


def test_point_instancers_that_move(tmp_path: Path) -> None:
    """By their velocities, in units a second, from the last sample on."""
    still = "point3f[] positions = [(0, 0, 0), (10, 0, 0), (20, 0, 0), (30, 0, 0)]"
    moving = """point3f[] positions.timeSamples = { 0: [(0, 0, 0), (10, 0, 0), (20, 0, 0), (30, 0, 0)] }
        vector3f[] velocities.timeSamples = { 0: [(4, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)] }"""
    assert still in POINTS
    head = f"{METRES}\nstartTimeCode = 0\nendTimeCode = 24\ntimeCodesPerSecond = 24"
    for time, x in ((None, 0), (0.5, 2)):
        scene, _ = load_usda(tmp_path, POINTS.replace(still, moving), head, time=time)
        assert scene.object("a/many/0/quad").world_from_object[0, 3] == pytest.approx(x)


def test_point_instancers_within_each_other(tmp_path: Path) -> None:
    inner = POINTS.replace("many", "outer/group/many")
    inner = inner.replace('def PointInstancer "outer/group/many"', 'def PointInstancer "many"')
    outer = f"""def PointInstancer "outer" {{
        rel prototypes = </outer/group>
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 0, 0), (0, 0, 50)]
        def Xform "group" {{ {inner} }}
    }}"""
    scene, _ = load_usda(tmp_path, outer)
    assert len(scene.objects) == 6 and len({id(one.mesh) for one in scene.objects}) == 2
    np.testing.assert_allclose(
        scene.object("a/outer/1/group/many/1/ball").world_bounds.mean(axis=0), (10, 7, 50)
    )


def test_damaged_point_instancers_are_said(tmp_path: Path) -> None:
    scene, report = load_usda(tmp_path, POINTS.replace("[0, 1, 0, 1]", "[0, 1, 5, 1]") + QUAD_MESH)
    assert len(scene.objects) == 1
    assert "many: its arrays do not fit together" in report.of(Fate.LEFT_OUT)[0].text


SUBSETS = """def Mesh "m" {
    uniform token subdivisionScheme = "none"
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0), (3, 0, 0)]
    int[] faceVertexCounts = [4, 4, 3]
    int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 5, 2, 4, 6, 5]
    def GeomSubset "red" {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1, 9]
    }
}"""


def test_subsets_are_objects_of_their_own(tmp_path: Path) -> None:
    scene, _ = load_usda(tmp_path, SUBSETS)
    assert [one.name for one in scene.objects] == ["a/m", "a/m/red"]
    rest, red = scene.objects
    assert area(rest.mesh) == pytest.approx(1.5) and area(red.mesh) == pytest.approx(1)
    np.testing.assert_allclose(red.world_bounds, [[1, 0, 0], [2, 1, 0]])


def test_what_has_no_area_is_said(tmp_path: Path) -> None:
    body = f'{QUAD_MESH}\ndef BasisCurves "c" {{\n}}\ndef Points "p" {{\n}}\ndef Points "q" {{\n}}'
    scene, report = load_usda(tmp_path, body)
    assert len(scene.objects) == 1
    said = {one.text.split(":")[0] for one in report.of(Fate.LEFT_OUT)}
    assert said == {"1 prim of the type BasisCurves", "2 prims of the type Points"}


def test_damaged_meshes_are_said(tmp_path: Path) -> None:
    bad = QUAD.replace("[4]", "[5]")
    scene, report = load_usda(tmp_path, f'{QUAD_MESH}\ndef Mesh "bad" {{ {bad} }}')
    assert len(scene.objects) == 1
    assert "'bad': has 4 corners for faces of 5" in report.of(Fate.LEFT_OUT)[0].text
    out = QUAD.replace("[0, 1, 2, 3]", "[0, 1, 2, 77]")
    scene, report = load_usda(tmp_path, f'{QUAD_MESH}\ndef Mesh "bad" {{ {out} }}')
    assert len(scene.objects) == 1 and "with an index out of range" in report.of(Fate.LEFT_OUT)[0].text
    with pytest.raises(InputError, match="has no usable face"):
        load_usda(tmp_path, 'def Xform "x" {\n}')


@pytest.mark.parametrize(
    ("text", "other", "said"),
    [
        ("point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]", "int[] points = [1]",
         "'bad': points: have not three numbers each"),
        ("int[] faceVertexCounts = [4]", 'string[] faceVertexCounts = ["a"]',
         "'bad': faceVertexCounts: hold no numbers"),
        ("int[] faceVertexCounts = [4]", "int2[] faceVertexCounts = [(4, 4)]",
         "'bad': faceVertexCounts: is no list of numbers"),
    ],
)  # fmt: skip
def test_attributes_of_other_types_are_said(tmp_path: Path, text: str, other: str, said: str) -> None:
    bad = QUAD.replace(text, other)
    assert bad != QUAD
    scene, report = load_usda(tmp_path, f'{QUAD_MESH}\ndef Mesh "bad" {{ {bad} }}')
    assert len(scene.objects) == 1 and report.of(Fate.LEFT_OUT)[0].text.startswith(said)


def test_points_of_another_precision(tmp_path: Path) -> None:
    assert area(mesh_of(tmp_path, "", QUAD.replace("point3f", "double3"))) == pytest.approx(4)


def test_placements_that_flatten_are_said(tmp_path: Path) -> None:
    body = f'{QUAD_MESH}\ndef Mesh "flat" {{ {QUAD} {placed("float3 scale = (1, 0, 1)")} }}'
    scene, report = load_usda(tmp_path, body)
    assert len(scene.objects) == 1
    assert [one.text for one in report.of(Fate.LEFT_OUT)] == ["'flat': its placement flattens it"]
    with pytest.raises(InputError, match="has no mesh that can stand where the file places it"):
        load_usda(tmp_path, body.replace(QUAD_MESH, ""))


def test_parts_are_found_by_their_names(tmp_path: Path) -> None:
    """As scene files name them: parts as the file places them, geometries in their own space."""
    write_usda(tmp_path / "a.usda", INSTANCES)
    part = mesh_files.load_mesh(tmp_path / "a.usda", "two/m")
    np.testing.assert_allclose(part.bounds, [[1, -1, 1], [3, 1, 1]])
    parts = mesh_files.load_file(tmp_path / "a.usda").parts
    geometry = mesh_files.choose_geometry(tmp_path / "a.usda", parts, "one/m")
    np.testing.assert_allclose(geometry.bounds, [[-1, -1, 0], [1, 1, 0]])


SKINNED = """
def SkelRoot "root" (prepend apiSchemas = ["SkelBindingAPI"]) {
    def Skeleton "skel" (prepend apiSchemas = ["SkelBindingAPI"]) {
        uniform token[] joints = ["a", "b"]
        uniform matrix4d[] bindTransforms = [%(one)s, %(one)s]
        uniform matrix4d[] restTransforms = [%(one)s, %(one)s]
        rel skel:animationSource = </root/skel/anim>
        def SkelAnimation "anim" {
            uniform token[] joints = ["a"]
            float3[] translations.timeSamples = { 0: [(0, 0, 0)], 24: [(0, 0, 4)] }
            quatf[] rotations = [(1, 0, 0, 0)]
            half3[] scales = [(1, 1, 1)]
            uniform token[] blendShapes = ["wide"]
            float[] blendShapeWeights = [0.5]
        }
    }
    def Mesh "m" (prepend apiSchemas = ["SkelBindingAPI"]) {
        %(quad)s
        rel skel:skeleton = </root/skel>
        int[] primvars:skel:jointIndices = [0, 0, 1, 1] (elementSize = 1
            interpolation = "vertex")
        float[] primvars:skel:jointWeights = [1, 1, 1, 1] (elementSize = 1
            interpolation = "vertex")
        uniform token[] skel:blendShapes = ["wide"]
        rel skel:blendShapeTargets = </root/m/wide>
        double3 xformOp:translate = (0, 0, 10)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def BlendShape "wide" {
            uniform vector3f[] offsets = [(1, 0, 0)]
            uniform int[] pointIndices = [1]
        }
    }
}
""" % {"quad": QUAD, "one": "((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1))"}  # noqa: UP031 (its text is full of braces)


def test_skeletons_bend_meshes(tmp_path: Path) -> None:
    head = f"{METRES}\nstartTimeCode = 0\nendTimeCode = 24\ntimeCodesPerSecond = 24"
    bent = load_usda(tmp_path, SKINNED, head, time=0.5)[0].objects[0]
    # Half of the way of the one joint, half of the blend shape, wherever the mesh itself stands.
    expected = [(-1, -1, 2), (1.5, -1, 2), (1, 1, 0), (-1, 1, 0)]
    np.testing.assert_allclose(affine.apply(bent.world_from_object, bent.mesh.vertices), expected, atol=1e-5)
    scene, report = load_usda(tmp_path, SKINNED, head)
    np.testing.assert_allclose(scene.objects[0].world_bounds[:, 2], 0, atol=1e-5)
    assert [one.text for one in report.of(Fate.LEFT_OUT)] == [
        "animation: nothing moves without --time (`time` in Python)"
    ]
    posed = SKINNED.replace(
        "translations.timeSamples = { 0: [(0, 0, 0)], 24: [(0, 0, 4)] }", "translations = [(0, 0, 4)]"
    )
    scene, report = load_usda(tmp_path, posed, head)
    assert report.is_whole and scene.objects[0].world_bounds[1, 2] == pytest.approx(4)


def moving(folder: Path, time: float | None) -> tuple[Scene, list[str]]:
    move = """double3 xformOp:translate.timeSamples = { 10: (0, 0, 0), 34: (6, 0, 0) }
        uniform token[] xformOpOrder = ["xformOp:translate"]"""
    head = f"{METRES}\nstartTimeCode = 10\nendTimeCode = 34\ntimeCodesPerSecond = 12"
    scene, report = load_usda(folder, f'def Mesh "m" {{ {QUAD} {move} }}', head, time=time)
    return scene, [one.text for one in report.of(Fate.LEFT_OUT)]


def test_time_is_in_seconds_from_the_first_time_code(tmp_path: Path) -> None:
    for time, x in ((0.0, 0), (1.0, 3), (2.0, 6), (9.0, 6)):
        scene, said = moving(tmp_path, time)
        np.testing.assert_allclose(scene.objects[0].world_from_object[:, 3], (x, 0, 0), atol=1e-9)
        assert not said
    scene, said = moving(tmp_path, None)
    assert scene.objects[0].world_from_object[0, 3] == 0
    assert said == ["animation: nothing moves without --time (`time` in Python)"]
