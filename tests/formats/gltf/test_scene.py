"""glTF: the scene that a file shows: nodes, cameras, instances, animations, and what is told of the rest."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.gltf_files import GltfBuilder

from incpt.core.errors import InputError, InputWarning
from incpt.formats import insert, mesh_files, registry, scene_save
from incpt.formats.import_report import Fate, ImportReport
from incpt.scene.model import Scene

HALF = math.sqrt(0.5)


def write(path: Path, nodes: list[dict[str, Any]], **more: Any) -> Path:
    builder = GltfBuilder()
    return builder.write(path, [builder.quad()], nodes=nodes, **more)


def read(path: Path, **options: Any) -> tuple[Scene, ImportReport]:
    return registry.load_with_report(path, **options)


def lost(report: ImportReport) -> list[str]:
    return [remark.text for remark in report.of(Fate.LEFT_OUT)]


def saved_and_loaded(scene: Scene, folder: Path) -> Scene:
    scene_save.save(scene, folder / "saved.toml")
    return registry.load(folder / "saved.toml")


# ------------------------------------------------------------------------------------------ nodes, scenes

NODES = [
    {"name": "left", "mesh": 0, "translation": [-3, 0, 0], "children": [1]},
    {"name": "above", "mesh": 0, "translation": [0, 4, 0], "rotation": [0, 0, HALF, HALF]},
    {"name": "above", "mesh": 0, "scale": [2, 2, 2]},
    {"name": "in no scene", "mesh": 0},
]


def test_a_mesh_of_several_nodes_is_one_mesh(tmp_path: Path) -> None:
    scene, report = read(write(tmp_path / "a.gltf", NODES, scenes=[{"nodes": [0, 2]}]))
    assert [o.name for o in scene.objects] == ["a/left", "a/above", "a/above_1"]
    assert len({id(o.mesh) for o in scene.objects}) == 1
    left, above, large = scene.objects
    assert left.position == (-3, 0, 0) and above.position == (-3, 4, 0)
    assert above.transform.matrix is None and above.rotation == pytest.approx((0, 0, 90))
    assert large.scale == pytest.approx((2, 2, 2))
    assert report.is_whole and [r.text for r in report.of(Fate.READ)] == ["3 objects, 1 mesh"]
    assert saved_and_loaded(scene, tmp_path) == scene
    text = (tmp_path / "saved.toml").read_text()
    assert text.count('geometry = "mesh 0"') == 3 and not list(tmp_path.glob("*.npz"))


def test_parts_are_named_as_before_and_stand_where_they_stood(tmp_path: Path) -> None:
    """Scene files name parts of glTF files by their nodes, with the placement in the vertices."""
    path = write(tmp_path / "a.gltf", NODES, scenes=[{"nodes": [0, 2]}])
    mesh = mesh_files.load_mesh(path, "above")
    np.testing.assert_allclose(mesh.bounds, [[-4, 3, 0], [-2, 5, 0]], atol=1e-6)
    assert mesh_files.load_mesh(path, "above") is mesh and mesh.source.part == "above"
    (tmp_path / "b.toml").write_text(
        "version = 2\n[materials.m]\n[[objects]]\nname = 'o'\nmesh = 'a.gltf'\nmaterial = 'm'\n"
        "[[objects]]\nname = 'p'\nmesh = 'a.gltf'\npart = 'above'\nmaterial = 'm'\nposition = [0, 0, 1]\n"
        "[[objects]]\nname = 'q'\nmesh = 'a.gltf'\ngeometry = 'mesh 0'\nmaterial = 'm'\n"
    )
    scene = registry.load(tmp_path / "b.toml")
    assert [o.name for o in scene.objects] == ["o/left", "o/above", "o/above_1", "p", "q"]
    assert scene.object("p").mesh is mesh and scene.object("o/above").mesh is mesh
    np.testing.assert_allclose(scene.object("q").world_bounds, [[-1, -1, 0], [1, 1, 0]])
    for key, message in (
        ("geometry = 'mash 0'", "did you mean 'mesh 0'"),
        ("geometry = 'mesh 0'\npart = 'left'", "both `part` and `geometry`"),
    ):
        (tmp_path / "c.toml").write_text(
            f"version = 2\n[materials.m]\n[[objects]]\nname = 'o'\nmaterial = 'm'\nmesh = 'a.gltf'\n{key}\n"
        )
        with pytest.raises(InputError, match=message):
            registry.load(tmp_path / "c.toml")


def test_shear_is_kept_and_what_is_flattened_stands_in_vertices(tmp_path: Path) -> None:
    nodes = [
        {"name": "stretched", "scale": [1, 3, 1], "children": [1]},
        {"name": "sheared", "mesh": 0, "rotation": [0, 0, math.sin(0.3), math.cos(0.3)]},
        {"name": "flat", "mesh": 0, "scale": [2, 1, 0]},
    ]
    scene, report = read(write(tmp_path / "a.gltf", nodes, scenes=[{"nodes": [0, 2]}]))
    sheared, flat = scene.objects
    assert sheared.transform.matrix is not None
    c, s = math.cos(0.6), math.sin(0.6)
    expected = [[c, -s, 0, 0], [3 * s, 3 * c, 0, 0], [0, 0, 1, 0]]
    np.testing.assert_allclose(sheared.transform.matrix, expected, atol=1e-12)
    np.testing.assert_allclose(flat.world_bounds, [[-2, -1, 0], [2, 1, 0]])
    assert [r.text for r in report.of(Fate.CHANGED)] == [
        "the placement of 'flat': flattens it, so it stands in the vertices"
    ]
    assert saved_and_loaded(scene, tmp_path) == scene


def test_a_mirrored_part_is_turned_over(tmp_path: Path) -> None:
    builder = GltfBuilder()
    quad = builder.quad()
    quad["attributes"] |= {"NORMAL": builder.accessor(np.float32([[0, 0, 1]] * 4))}
    path = builder.write(tmp_path / "a.gltf", [quad], nodes=[{"mesh": 0, "scale": [-1, 1, 1]}])
    (object_,) = read(path)[0].objects
    assert object_.scale[0] * object_.scale[1] * object_.scale[2] == pytest.approx(-1)
    mesh = mesh_files.load_mesh(path)
    a, b, c = mesh.vertices[mesh.faces[0]]
    assert np.cross(b - a, c - a)[2] > 0
    assert mesh.normals is not None and (mesh.normals[..., 2] == 1).all()


@pytest.mark.parametrize(
    ("nodes", "message"),
    [
        ([{"mesh": 0}, {"children": [2]}, {"children": [1]}], "one stands below itself"),
        ([{"mesh": 0, "children": [0]}], "one stands below itself"),
        ([{"mesh": 0}, {"children": [0]}, {"children": [0]}], "one stands below two others"),
        ([{"mesh": 0, "children": [9]}], r"nodes\[0\]: names node 9 of 1"),
        ([{"mesh": 0, "children": [-1]}], r"nodes\[0\]\.children\[0\]: -1 is out of range"),
        ([{"mesh": 0, "children": ["a"]}], "'a' is no whole number"),
        ([{"mesh": 0, "rotation": [0, 0, 1]}], "rotation: has 3 numbers; 4 are needed"),
        ([{"mesh": 0, "translation": [0, 0, "z"]}], "translation: 'z' is not a number"),
        ([{"mesh": 0, "matrix": [float("nan")] * 16}], "matrix: nan is not a finite number"),
    ],
)
def test_damaged_nodes_are_one_line(tmp_path: Path, nodes: list[dict[str, Any]], message: str) -> None:
    path = write(tmp_path / "a.gltf", nodes)
    with pytest.raises(InputError, match=rf"^{path}: [^\n]*{message}[^\n]*$"):
        read(path)


def test_a_rotation_of_zeros_is_told(tmp_path: Path) -> None:
    scene, report = read(write(tmp_path / "a.gltf", [{"mesh": 0, "rotation": [0, 0, 0, 0]}]))
    assert scene.objects[0].rotation == (0, 0, 0)
    (remark,) = (one for one in report.of(Fate.CHANGED) if "rotation" in one.text)
    assert "is all zeros" in remark.text and "0" in remark.text


def test_hidden_nodes_hide_what_is_below_them(tmp_path: Path) -> None:
    hidden = {"extensions": {"KHR_node_visibility": {"visible": False}}}
    nodes = [{"children": [1], **hidden}, {"mesh": 0, "name": "below"}, {"mesh": 0, "name": "seen"}]
    scene, report = read(write(tmp_path / "a.gltf", nodes, scenes=[{"nodes": [0, 2]}]))
    assert [(o.name, o.visible) for o in scene.objects] == [("a/below", False), ("a/seen", True)]
    assert report.is_whole and saved_and_loaded(scene, tmp_path) == scene


def test_instances(tmp_path: Path) -> None:
    builder = GltfBuilder()
    attributes = {
        "TRANSLATION": builder.accessor(np.float32([[0, 0, 0], [3, 0, 0], [6, 0, 0]])),
        "ROTATION": builder.accessor(np.int8([[0, 0, 0, 127], [0, 0, 127, 0], [0, 0, 0, 127]]),
                                     normalized=True),
        "_ID": builder.accessor(np.uint8([1, 2, 3])),
    }  # fmt: skip
    extension = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    path = builder.write(
        tmp_path / "a.glb", [builder.quad()], extensionsRequired=["EXT_mesh_gpu_instancing"],
        nodes=[{"mesh": 0, "name": "n", "translation": [0, 1, 0], "extensions": extension}],
    )  # fmt: skip
    scene, _ = read(path)
    assert [o.name for o in scene.objects] == ["a/n.1", "a/n.2", "a/n.3"]
    assert len({id(o.mesh) for o in scene.objects}) == 1
    assert [o.position for o in scene.objects] == [(0, 1, 0), (3, 1, 0), (6, 1, 0)]
    assert np.abs(scene.objects[1].rotation) == pytest.approx((0, 0, 180))
    assert max(o.world_bounds[1, 0] for o in scene.objects) == pytest.approx(7)


def test_too_many_parts_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("incpt.formats.gltf.reader.MOST_PARTS", 2)
    path = write(tmp_path / "a.gltf", [{"mesh": 0}] * 3, scenes=[{"nodes": [0, 1, 2]}])
    with pytest.raises(InputError, match="shows more than 2 meshes; split it"):
        read(path)
    assert (
        len(read(write(tmp_path / "b.gltf", [{"mesh": 0}] * 2, scenes=[{"nodes": [0, 1]}]))[0].objects) == 2
    )


def test_meshes_of_a_file_are_added_where_they_stand(tmp_path: Path) -> None:
    path = write(tmp_path / "a.gltf", NODES, scenes=[{"nodes": [0, 2]}], cameras=[CAMERA])
    scene, names = insert.add_mesh(Scene(), path, at=(10.0, 0.0, 0.0))
    left, above, _ = (scene.object(name) for name in names)
    assert np.subtract(above.position, left.position) == pytest.approx((0, 4, 0))
    bounds = np.stack([o.world_bounds for o in scene.objects])
    assert bounds[:, 0, 1].min() == pytest.approx(0) and len({id(o.mesh) for o in scene.objects}) == 1
    assert bounds[:, :, 0].mean() != 0 and (bounds[:, 0, 0].min() + bounds[:, 1, 0].max()) / 2 == 10


def test_names_that_are_no_text_can_be_saved(tmp_path: Path) -> None:
    scene, _ = read(write(tmp_path / "a.gltf", [{"mesh": 0, "name": "\ud800 x"}, {"mesh": 0, "name": "a\nb"}],
                          scenes=[{"nodes": [0, 1]}]))  # fmt: skip
    assert [o.name for o in scene.objects] == ["a/? x", "a/a\nb"]
    assert saved_and_loaded(scene, tmp_path) == scene


# ------------------------------------------------------------------------------------------ cameras, lamps

CAMERA = {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.01, "zfar": 3.0}}
PLAN = {"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 1.5, "znear": 0, "zfar": 100}}


def test_cameras_and_lamps_are_used_as_they_are(tmp_path: Path) -> None:
    lamp = {"type": "point", "color": [1, 0, 0], "intensity": 10}
    nodes = [
        {"mesh": 0},
        {"camera": 0, "name": "front", "translation": [0, 0, 5]},
        {"camera": 1, "name": "plan", "translation": [0, 9, 0], "rotation": [-HALF, 0, 0, HALF]},
        {"camera": 0, "name": "front"},
        {"translation": [0, 3, 3], "extensions": {"KHR_lights_punctual": {"light": 0}}},
    ]
    path = write(
        tmp_path / "a.gltf", nodes, scenes=[{"nodes": [0, 1, 2, 3, 4]}], cameras=[CAMERA, PLAN],
        extensions={"KHR_lights_punctual": {"lights": [lamp]}}, extensionsUsed=["KHR_lights_punctual"],
    )  # fmt: skip
    scene, report = read(path)
    assert list(scene.cameras) == ["front", "plan", "front.2"] and scene.camera_name == "front"
    assert scene.camera.position == (0, 0, 5) and scene.camera.target == pytest.approx((0, 0, 0))
    assert scene.camera.fov_y == pytest.approx(math.degrees(0.5)) and scene.camera.near == 0.01
    plan = scene.cameras["plan"]
    assert plan.is_orthographic and plan.ortho_height == 3
    np.testing.assert_allclose(np.subtract(plan.target, plan.position), (0, -9, 0), atol=1e-9)
    np.testing.assert_allclose(plan.up, (0, 0, -1), atol=1e-9)
    assert [light.color for light in scene.lights] == [(1, 0, 0)]
    assert scene.environment.radiance == (0, 0, 0)
    assert lost(report) == ["the far plane of camera 'front': what is behind it is seen"]
    assert saved_and_loaded(scene, tmp_path) == scene


def test_a_view_that_is_too_wide_is_told(tmp_path: Path) -> None:
    wide = {"type": "perspective", "perspective": {"yfov": 3.14159, "znear": 0.01}}
    nodes = [{"mesh": 0}, {"camera": 0, "name": "wide", "translation": [0, 0, 5]}]
    scene, report = read(write(tmp_path / "a.gltf", nodes, scenes=[{"nodes": [0, 1]}], cameras=[wide]))
    assert scene.camera.fov_y == 179
    assert [one.text for one in report.of(Fate.CHANGED)] == ["camera 'wide': its view of 180 degrees, to 179"]


def test_what_stands_at_a_flattened_node_is_left_out(tmp_path: Path) -> None:
    lamp = {"extensions": {"KHR_lights_punctual": {"light": 0}}}
    nodes = [
        {"mesh": 0},
        {"name": "gone", "scale": [0, 0, 0], "children": [2, 3]},
        {"camera": 0, "name": "eye"},
        {"name": "lamp", **lamp},
    ]
    path = write(
        tmp_path / "a.gltf", nodes, scenes=[{"nodes": [0, 1]}], cameras=[CAMERA],
        extensions={"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
    )  # fmt: skip
    scene, report = read(path)
    assert not scene.lights and list(scene.cameras) == ["camera"] and scene.environment.image is not None
    assert lost(report) == [
        "light 'lamp': stands at a node that flattens space",
        "camera 'eye': stands at a node that flattens space",
    ]


def test_without_light_and_camera_it_stands_in_a_studio_and_is_framed(tmp_path: Path) -> None:
    scene, _ = read(write(tmp_path / "a.gltf", [{"mesh": 0, "translation": [5, 0, 0]}]))
    assert scene.environment.image is not None and not scene.lights
    assert scene.camera.target == pytest.approx((5, 0, 0))
    x, y, z = np.subtract(scene.camera.position, scene.camera.target)
    assert z > x > 0 and y > 0
    places, in_front = scene.camera.project(scene.objects[0].world_bounds, 1.0)
    assert in_front.all() and (places > 0).all() and (places < 1).all()


# ------------------------------------------------------------------------------------------ told


def test_what_is_left_out_is_told(tmp_path: Path) -> None:
    builder = GltfBuilder()
    quad = builder.quad(extensions={"EXAMPLE_of_primitives": {}})
    quad["attributes"]["TEXCOORD_5"] = builder.accessor(np.zeros((4, 2), np.float32))
    path = builder.write(
        tmp_path / "a.gltf", [quad], extensionsUsed=["EXAMPLE_listed", "KHR_materials_variants"],
        scenes=[{"nodes": [0]}, {"nodes": [0]}], animations=[{"channels": [], "samplers": []}],
        extensions={"KHR_materials_variants": {"variants": [{"name": "day"}, {"name": "night"}]}},
    )  # fmt: skip
    scene, report = read(path)
    assert lost(report) == [
        "the extension EXAMPLE_listed: is unknown here",
        "the extension EXAMPLE_of_primitives: is unknown here",
        "1 animation: nothing moves without --time (`time` in Python)",
        "1 of 2 scenes: only the default is read",
        "TEXCOORD_5 of mesh 'mesh 0': is a set of values more than are read",
        "variants of materials ('day', 'night'): the default is used",
    ]
    with pytest.warns(InputWarning) as caught:
        assert registry.load(path) == scene
    assert [str(w.message) for w in caught] == [f"{path}: left out {text}" for text in lost(report)]
    assert read(path)[1] == report, "also when it is known already"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"extensionsRequired": ["EXAMPLE_unknown"]}, "requires the extension 'EXAMPLE_unknown'"),
        ({"asset": {"version": "1.0"}}, "says glTF 1.0; convert the file to glTF 2.0"),
        ({"asset": {"version": "2.1", "minVersion": "2.1"}}, "asks for glTF 2.1"),
        ({"asset": {}}, "says no version of glTF"),
        ({"asset": {"version": 1}}, "says glTF 1; convert"),
    ],
)
def test_other_versions_and_unknown_requirements_are_refused(
    tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    path = write(tmp_path / "a.gltf", [{"mesh": 0}], **change)
    with pytest.raises(InputError, match=message):
        read(path)


# ------------------------------------------------------------------------------------------ files beside it


def test_files_outside_the_folder_are_not_read(tmp_path: Path) -> None:
    inside = tmp_path / "inside"
    inside.mkdir()
    builder = GltfBuilder()
    quad = builder.quad()
    (tmp_path / "a.bin").write_bytes(builder.content)
    (inside / "link.bin").symlink_to(tmp_path / "a.bin")
    absolute = (tmp_path / "a.bin").as_posix()
    outside = [
        "../a.bin",
        "%2e%2e/a.bin",
        "..\\a.bin",
        absolute,
        f"file://{absolute}",
        "link.bin",
        "x/../../a.bin",
    ]
    for number, uri in enumerate(outside):
        document = builder.document([quad])
        document["buffers"][0]["uri"] = uri
        path = inside / f"{number}.gltf"
        path.write_text(json.dumps(document))
        with pytest.raises(InputError, match="leads out of the folder of the file; --allow-outside lets it"):
            read(path)
        if uri != "x/../../a.bin":
            assert len(read(path, allow_outside=True)[0].objects) == 1
    for uri in ("http://example.org/a.bin", "https://example.org/a.bin", "ftp://example.org/a.bin"):
        document["buffers"][0]["uri"] = uri
        path.write_text(json.dumps(document))
        with pytest.raises(InputError, match="is not a file; get it, and name it relative to this one"):
            read(path, allow_outside=True)


@pytest.mark.parametrize(("node", "least"), [({}, [-1, -1, 0]), ({"translation": [5, 0, 0]}, [4, -1, 0])])
def test_a_file_beside_it_that_changed_is_read_again(
    tmp_path: Path, node: dict[str, Any], least: list[float]
) -> None:
    builder = GltfBuilder()
    quad = builder.quad()
    document = builder.document([quad], nodes=[{"mesh": 0, **node}])
    document["buffers"][0]["uri"] = "b%20c.bin"
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    (tmp_path / "b c.bin").write_bytes(builder.content)
    mesh = mesh_files.load_mesh(tmp_path / "a.gltf")
    assert mesh_files.load_mesh(tmp_path / "a.gltf") is mesh
    assert mesh.bounds[0].tolist() == least
    (tmp_path / "b c.bin").write_bytes(builder.content.replace(np.float32(-1).tobytes(), bytes(4)) + bytes(4))
    assert mesh_files.load_mesh(tmp_path / "a.gltf").bounds[0].tolist() == [least[0] + 1, 0, 0]


# ------------------------------------------------------------------------------------------ animations


def animated(
    path: Path, channels: list[tuple[int, str, str, Any, Any]], pointers: list[str] | None = None
) -> Path:
    """A quad below a node; channels are (node, property, interpolation, times, values), or lead to what
    `pointers` say."""
    builder = GltfBuilder()
    quad = builder.quad(material=0, targets=[{"POSITION": builder.accessor(np.float32([[0, 0, 1]] * 4))}])
    samplers, wanted = [], []
    for number, name, kind, times, values in channels:
        samplers.append({
            "input": builder.accessor(np.float32(times)), "output": builder.accessor(np.float32(values)),
            "interpolation": kind,
        })  # fmt: skip
        wanted.append({"sampler": len(samplers) - 1, "target": {"node": number, "path": name}})
    for channel, pointer in zip(wanted, pointers or (), strict=False):
        channel["target"] = {
            "path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}
        }  # fmt: skip
    animations = [{"name": "move", "samplers": samplers, "channels": wanted}]
    nodes = [{"children": [1]}, {"mesh": 0, "weights": [0.0]}]
    return builder.write(path, [quad], nodes=nodes, animations=animations, materials=[{}])


@pytest.mark.parametrize(
    ("kind", "time", "x"),
    [
        ("LINEAR", 0.0, 2.0), ("LINEAR", 1.5, 3.0), ("LINEAR", 3.0, 6.0), ("LINEAR", 99.0, 6.0),
        ("STEP", 1.99, 2.0), ("STEP", 2.0, 4.0),
    ],
)  # fmt: skip
def test_animated_positions(tmp_path: Path, kind: str, time: float, x: float) -> None:
    moves = [(0, "translation", kind, [1, 2, 3], [[2, 0, 0], [4, 0, 0], [6, 0, 0]])]
    path = animated(tmp_path / "a.gltf", moves)
    scene, report = read(path, time=time)
    assert scene.objects[0].position == pytest.approx((x, 0, 0)) and report.is_whole
    assert read(path)[0].objects[0].position == (0, 0, 0)


def test_animated_rotations_scales_and_weights(tmp_path: Path) -> None:
    moves = [
        # The second quaternion is minus a quarter turn about z: the way there is the shorter one.
        (0, "rotation", "LINEAR", [0, 2], [[0, 0, 0, 1], [0, 0, -HALF, -HALF]]),
        (1, "scale", "CUBICSPLINE", [0, 2], [[0] * 3, [1] * 3, [3] * 3, [0] * 3, [5] * 3, [0] * 3]),
        (1, "weights", "LINEAR", [0, 2], [[0], [8]]),
    ]
    scene, _ = read(animated(tmp_path / "a.gltf", moves), time=1.0)
    (quad,) = scene.objects
    assert quad.rotation == pytest.approx((0, 0, 45))
    # Hermite: (1 + 5) / 2 and an eighth of 2 s times the slope of 3 that leaves the first key.
    assert quad.scale == pytest.approx((3.75, 3.75, 3.75))
    assert quad.mesh.vertices[0, 2] == pytest.approx(4)


def test_one_of_several_animations_runs(tmp_path: Path) -> None:
    moves = [(0, "translation", "LINEAR", [0, 2], [[1] * 3, [4] * 3])]
    path = animated(tmp_path / "a.gltf", moves)
    document = json.loads(path.read_text())
    (first,) = document["animations"]
    still = {**first, "name": "still", "channels": [{**first["channels"][0], "sampler": 0}]}
    still["channels"][0]["target"] = {"node": 0, "path": "scale"}
    path.write_text(json.dumps({**document, "animations": [first, {**still, "name": ""}]}))
    both, _ = read(path, time=1.0)
    moved, report = read(path, time=1.0, clip="move")
    scaled, _ = read(path, time=2.0, clip="1")
    assert [one.objects[0].position[0] for one in (both, moved, scaled)] == [2.5, 2.5, 0]
    assert moved.objects[0].scale == (1, 1, 1) and scaled.objects[0].scale[0] == 4 and report.is_whole
    with pytest.raises(InputError, match=r"clip: 'run' is not known; choose one of move, 1"):
        read(path, time=1.0, clip="run")
    with pytest.raises(InputError, match="clip: says what moves, and no time is given"):
        read(path, clip="move")


def test_animated_pointers(tmp_path: Path) -> None:
    """To what there is, to what has a default only, and into a list; one leads to what cannot be moved."""
    wanted = [
        ("/nodes/0/translation", [[0, 0, 0], [2, 0, 0]]),
        ("/nodes/1/weights/0", [[0], [4]]),
        ("/materials/0/pbrMetallicRoughness/baseColorFactor", [[1, 0, 0, 1], [0, 1, 0, 1]]),
        ("/materials/0/extensions/KHR_materials_ior/ior", [[1], [2]]),
        ("/nodes/1/extensions/KHR_node_visibility/visible", [[0], [0]]),
        ("/accessors/0/count", [[1], [1]]),
    ]
    path = animated(
        tmp_path / "a.gltf",
        [(0, "pointer", "LINEAR", [0, 2], values) for _, values in wanted],
        pointers=[pointer for pointer, _ in wanted],
    )
    scene, report = read(path, time=1.0)
    (quad,) = scene.objects
    assert quad.position == (1, 0, 0) and quad.mesh.vertices[0, 2] == 2 and not quad.visible
    material = scene.materials[quad.material]
    assert material.base_color == (0.5, 0.5, 0) and material.ior == 1.5
    assert lost(report) == ["part of animation 'move': moves what cannot be moved"]
    wrong = animated(
        tmp_path / "b.gltf", [(0, "pointer", "LINEAR", [0], [[1]])], pointers=["/materials/9/alphaCutoff"]
    )
    with pytest.raises(InputError, match="pointer '/materials/9/alphaCutoff': leads to nothing"):
        read(wrong, time=1.0)


def test_scenes_at_a_time_are_saved_as_they_are(tmp_path: Path) -> None:
    path = animated(tmp_path / "a.gltf", [(1, "weights", "LINEAR", [0, 2], [[0], [8]])])
    scene, _ = read(path, time=1.0)
    again = saved_and_loaded(scene, tmp_path)
    np.testing.assert_array_equal(again.objects[0].mesh.vertices, scene.objects[0].mesh.vertices)
    assert again.objects[0].mesh.vertices[0, 2] == 4


def test_only_the_last_time_of_a_file_is_kept(tmp_path: Path) -> None:
    path = animated(tmp_path / "a.gltf", [(1, "weights", "LINEAR", [0, 2], [[0], [8]])])
    at_rest, early, late = (read(path, time=time)[0] for time in (None, 0.5, 1.0))
    assert read(path)[0] == at_rest and read(path, time=1.0)[0] == late
    assert read(path, time=0.5)[0] != early, "it is read again"


@pytest.mark.parametrize(
    ("channel", "message"),
    [
        ((0, "translation", "LINEAR", [1, 1], [[0] * 3] * 2), "holds times that do not grow"),
        ((0, "translation", "LINEAR", [1, np.nan], [[0] * 3] * 2), "not finite"),
        ((0, "translation", "LINEAR", [1, 2], [[0] * 3] * 3), "has 3 values for 2 times"),
        ((0, "translation", "CUBICSPLINE", [1, 2], [[0] * 3] * 2), "has 2 values for 2 times"),
        ((0, "translation", "BOUNCE", [1, 2], [[0] * 3] * 2), "'BOUNCE'"),
        ((7, "translation", "LINEAR", [1, 2], [[0] * 3] * 2), "7 is not among 2 nodes"),
    ],
)
def test_damaged_animations_are_one_line(tmp_path: Path, channel: Any, message: str) -> None:
    path = animated(tmp_path / "a.gltf", [channel])
    assert not read(path)[1].is_whole
    with pytest.raises(InputError, match=rf"^{path}: [^\n]*{message}[^\n]*$"):
        read(path, time=1.5)
