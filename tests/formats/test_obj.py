"""OBJ and MTL files: what of them becomes of objects and materials, and what is said of the rest."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from hypothesis import given
from hypothesis import strategies as st

from incpt.core.errors import InputError, InputWarning
from incpt.formats import mesh_files, polygons, registry
from incpt.formats.import_report import Fate
from incpt.formats.obj import lines
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.mesh_part import MeshPart

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def written(folder: Path, obj: str, mtl: str = "", name: str = "a.obj") -> Path:
    if mtl:
        (folder / "a.mtl").write_text(mtl)
        obj = f"mtllib a.mtl\n{obj}"
    (folder / name).write_text(obj)
    return folder / name


def parts_of(path: Path) -> dict[str | None, MeshPart]:
    return {part.name: part for part in mesh_files.load_parts(path)}


def material_of(folder: Path, mtl: str) -> Material:
    path = written(folder, f"{SQUARE}usemtl m\nf 1 2 3 4\n", f"newmtl m\n{mtl}\n")
    (part,) = mesh_files.load_parts(path)
    assert part.material is not None and part.material_name == "m"
    return part.material


def area(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]].astype(float) for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def told(path: Path, fate: Fate = Fate.LEFT_OUT, **options: bool) -> list[str]:
    return [remark.text for remark in registry.load_with_report(path, **options)[1].of(fate)]


# ------------------------------------------------------------------------------------------- geometry


def test_each_group_and_material_is_an_object(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        f"{SQUARE}g left\nusemtl red\nf 1 2 3\ng right\nusemtl lamp\nf 1 3 4\ng left\nusemtl lamp\nf 1 2 4\n"
        "g right\nf 2 3 4\n",
        "newmtl red\nKd 1 0 0\nnewmtl lamp\nKd 0 0 0\nKe 5 5 5\n",
    )
    parts = parts_of(path)
    assert set(parts) == {"left/red", "right", "left/lamp"}
    assert len(parts["right"].mesh.faces) == 2
    red, lamp = parts["left/red"].material, parts["right"].material
    assert red is not None and lamp is not None
    assert red.base_color == (1, 0, 0) and lamp.emission == (5, 5, 5)
    assert mesh_files.load_mesh(path, "left/lamp").source.part == "left/lamp"
    # An object counts more than its groups.
    path = written(tmp_path, f"o box\n{SQUARE}g a\nf 1 2 3\ng b\nf 1 3 4\n", name="b.obj")
    assert set(parts_of(path)) == {None}


def test_concave_faces_keep_their_notches(tmp_path: Path) -> None:
    u = "v 0 0 0\nv 3 0 0\nv 3 3 0\nv 2 3 0\nv 2 1 0\nv 1 1 0\nv 1 3 0\nv 0 3 0\n"
    mesh = mesh_files.load_mesh(written(tmp_path, u + "f 1 2 3 4 5 6 7 8\n"))
    assert area(mesh) == pytest.approx(7) and len(mesh.faces) == 6
    arrow = "v 0 0 0\nv 2 2 0\nv 0 1 0\nv -2 2 0\n"
    for order in ("1 2 3 4", "2 3 4 1", "3 4 1 2", "4 3 2 1"):
        mesh = mesh_files.load_mesh(written(tmp_path, f"{arrow}f {order}\n", name=f"{order}.obj"))
        assert area(mesh) == pytest.approx(2)
        a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
        sides = np.cross(b - a, c - a)[:, 2]
        assert (sides > 0).all() or (sides < 0).all()


@given(
    radii=st.lists(st.floats(0.2, 1), min_size=4, max_size=12),
    turned=st.floats(0, 6.28),
    tilted=st.floats(-1, 1),
    scale=st.sampled_from([1e-4, 1.0, 1e5]),
)
def test_triangles_cover_a_star_once(radii: list[float], turned: float, tilted: float, scale: float) -> None:
    """A polygon around a point that sees all of it, in any plane."""
    angles = turned + np.linspace(0, 2 * np.pi, len(radii), endpoint=False)
    flat = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
    expected = 0.5 * abs(
        np.cross(np.pad(flat, ((0, 0), (0, 1))), np.roll(np.pad(flat, ((0, 0), (0, 1))), -1, 0))[:, 2].sum()
    )
    plane = np.column_stack([flat, flat @ [tilted, 0.5]]) * scale + 3 * scale
    sizes = np.array([3, len(radii), 2])
    positions = np.concatenate([np.eye(3), plane, np.zeros((2, 3))])
    triangles = polygons.triangulated(sizes, positions, np.arange(len(positions)))
    assert triangles[0].tolist() == [0, 1, 2] and len(triangles) == len(radii) - 1
    a, b, c = (positions[triangles[1:, i]] for i in range(3))
    normals = np.cross(b - a, c - a) / scale**2 / 2
    total = np.linalg.norm(normals.sum(axis=0))
    assert total == pytest.approx(expected * np.sqrt(1 + tilted**2 + 0.25), rel=1e-6)
    assert np.linalg.norm(normals, axis=1).sum() == pytest.approx(total, rel=1e-6)


def test_a_bad_vertex_loses_its_faces(tmp_path: Path) -> None:
    path = written(tmp_path, f"v 1.#IND 0 0\n{SQUARE}f 2 3 4\nf 1 2 3\nf 2 3 4 99\n")
    with pytest.warns(InputWarning) as caught:
        mesh = mesh_files.load_mesh(path)
    assert len(mesh.faces) == 1 and np.isfinite(mesh.vertices).all()
    (warning,) = caught
    assert str(warning.message) == (
        f"{path}: left out 3 of 4 faces: 2 with an index out of range, "
        "1 with a vertex that is not finite or too far away"
    )


def test_smoothing_groups_have_normals_of_their_own(tmp_path: Path) -> None:
    """Two squares that meet at a right angle, once in one group, once in two, once in none."""
    bent = SQUARE + "v 1 0 -1\nv 1 1 -1\n"
    smooth = mesh_files.load_mesh(written(tmp_path, f"{bent}s 1\nf 1 2 3 4\nf 2 5 6 3\n", name="1.obj"))
    assert smooth.normals is not None
    edge = smooth.normals[(smooth.vertices[smooth.faces] == [1, 0, 0]).all(axis=2)]
    np.testing.assert_allclose(edge, np.broadcast_to([0.5**0.5, 0, 0.5**0.5], edge.shape), atol=1e-6)
    parted = mesh_files.load_mesh(written(tmp_path, f"{bent}s 1\nf 1 2 3 4\ns 2\nf 2 5 6 3\n", name="2.obj"))
    assert parted.normals is not None
    np.testing.assert_allclose(np.sort(parted.normals.reshape(-1, 3), axis=0)[:6], [[0, 0, 0]] * 6, atol=1e-6)
    for off in ("", "s off\n", "s 0\n"):
        assert (
            mesh_files.load_mesh(written(tmp_path, f"{bent}{off}f 1 2 3 4\n", name="3.obj")).normals is None
        )
    # What the file has is taken as it is.
    given_normals = f"{bent}vn 0 1 0\ns 1\nf 1//1 2//1 3//1\nf 1 3 4\n"
    mixed = mesh_files.load_mesh(written(tmp_path, given_normals, name="4.obj"))
    assert mixed.normals is not None
    np.testing.assert_allclose(mixed.normals, [[[0, 1, 0]] * 3, [[0, 0, 1]] * 3], atol=1e-6)


def test_colours_of_vertices(tmp_path: Path) -> None:
    path = written(tmp_path, "v 0 0 0 1 0.5 0\nv 1 0 0 1 0.5 0\nv 0 1 0 1 0.5 0\nf 1 2 3\n")
    mesh = mesh_files.load_mesh(path)
    assert mesh.colors is not None
    np.testing.assert_allclose(mesh.colors[0, 0], [1, 0.21404, 0, 1], atol=1e-4)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "latin-1"])
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_encodings_and_ends_of_lines(tmp_path: Path, encoding: str, newline: str) -> None:
    text = f"# Größe\n{SQUARE}o Würfel\nf 1 2 \\\n3 4\no b\nf 1 2 3\n".replace("\n", newline)
    mark = b"\xfe\xff" if encoding == "utf-16-be" else b""
    path = tmp_path / "e.obj"
    path.write_bytes(mark + text.encode(encoding))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert {name: len(part.mesh.faces) for name, part in parts_of(path).items()} == {"Würfel": 2, "b": 1}


def test_all_ways_to_write_a_corner(tmp_path: Path) -> None:
    extra = "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n"
    faces = {
        "f 1 2 3": (False, False), "f 1/1 2/2 3/3": (True, False), "f 1//1 2//1 3//1": (False, True),
        "f 1/1/1 2/2/1 3/3/1": (True, True), "f 1/1 2//1 3": (True, True),
        "f -4/-3 -3/-2 -2/-1": (True, False), "f 1/77 2/2 3/3": (True, False),
    }  # fmt: skip
    for number, (line, (has_uvs, has_normals)) in enumerate(faces.items()):
        mesh = mesh_files.load_mesh(written(tmp_path, f"{SQUARE}{extra}{line}\n", name=f"{number}.obj"))
        assert (bool(mesh.uvs), mesh.normals is not None) == (has_uvs, has_normals)
        if has_uvs and "77" not in line and "//" not in line:
            np.testing.assert_allclose(mesh.uvs[0], [[[0, 1], [1, 1], [1, 0]]])


@pytest.mark.parametrize(
    "text",
    [
        """v 0 0 0\nvn 0 0 1\nv 1 0 0\nvn 0 0 1\nv 1 1 0\nvn 0 1 1\nv 0 1 0
        f 1//1 2//2 3//3\nf 1//1 3//3 4//1""",
        """vn 0 0 1\nv 0 0 0\n\n\tvn 0 0 1\n  v 1 0 0\nvn 0 1 1\nv 1 1 0\ng
        f 1//1 2//2 3//3\n v 0 1 0\nf -4//-3 -2//-1 -1//-3""",
    ],
    ids=["vertices in turn", "faces in between"],
)  # fmt: skip
def test_vertices_may_stand_in_any_order(tmp_path: Path, text: str) -> None:
    plain = f"{SQUARE}vn 0 0 1\nvn 0 0 1\nvn 0 1 1\nf 1//1 2//2 3//3\nf 1//1 3//3 4//1\n"
    expected = mesh_files.load_mesh(written(tmp_path, plain, name="plain.obj"))
    mesh = mesh_files.load_mesh(written(tmp_path, text))
    for name in ("vertices", "faces", "normals"):
        np.testing.assert_array_equal(getattr(mesh, name), getattr(expected, name))


def test_corners_without_a_normal_have_that_of_their_face(tmp_path: Path) -> None:
    mesh = mesh_files.load_mesh(written(tmp_path, f"{SQUARE}vn 0 1 0\nf 1//1 2 3\n"))
    np.testing.assert_array_equal(mesh.normals, [[[0, 1, 0], [0, 0, 1], [0, 0, 1]]])


def test_a_vertex_without_numbers_counts(tmp_path: Path) -> None:
    path = written(tmp_path, f"v\n{SQUARE}f 2 3 4\nf 1 2 3\nf\n")
    assert told(path) == [
        "2 of 3 faces: 1 with fewer than three corners, 1 with a vertex that is not finite or too far away"
    ]
    assert area(mesh_files.load_mesh(path)) == 0.5


def test_thousands_of_parts_are_read_in_one_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither parts nor vertices in turn make as many small pieces."""
    calls: list[int] = []
    numbers = lines._numbers
    monkeypatch.setattr(lines, "_numbers", lambda *given: calls.append(1) or numbers(*given))
    blocks = [
        f"v {i} 0 0\nvn 0 0 1\nv {i} 1 0\nvn 0 0 1\nv {i} 0 1\nvn 0 0 1\ng part {i}\nf -3//-3 -2//-2 -1//-1\n"
        for i in range(2000)
    ]
    parts = mesh_files.load_parts(written(tmp_path, "".join(blocks)))
    assert [part.name for part in parts[:2]] == ["part 0", "part 1"] and len(calls) == 2
    assert [len(part.mesh.vertices) for part in parts] == [3] * 2000
    assert [part.mesh.vertices[:, 0].tolist() for part in parts] == [[i] * 3 for i in range(2000)]


def test_what_has_no_area_is_told(tmp_path: Path) -> None:
    path = written(
        tmp_path, f"{SQUARE}f 1 2 3\nl 1 2\np 1\ncurv 0 1 1 2\nend\nteapot 7\nusemtl none\nf 1 3 4\n"
    )
    assert told(path) == [
        "1 materials: the file names no file of materials",
        "1 line without area",
        "1 point without area",
        "curves and surfaces: only polygons are read; export them as polygons",
        "1 line with 'teapot': the keyword is not known",
    ]


def test_corners_that_are_no_indices_lose_their_faces(tmp_path: Path) -> None:
    path = written(tmp_path, f"{SQUARE}f 1 2 3\nf foo bar 3\nf 1 3 4 1/2.5\nf 1 3 4\n")
    assert told(path) == [
        "3 of 5 faces: 3 with an index out of range",
        "faces at a corner 'foo' and 2 more: it is no index",
    ]
    assert mesh_files.load_mesh(path).faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    with pytest.raises(InputError, match="has no usable face"):
        mesh_files.load_file(written(tmp_path, f"{SQUARE}f a b c\n", name="none.obj"))


def test_what_corners_name_and_the_file_does_not_have_is_told(tmp_path: Path) -> None:
    path = written(
        tmp_path, f"{SQUARE}vt 0 0\nvt nan 1\nvn 0 0 1\nvn 0 nan 0\nvn 0 0 0\nf 1/9/1 2/1/-7 3/-3/2\n"
    )
    assert told(path) == [
        "texture coordinates of 2 corners: are not in the file",
        "normals of 1 corner: are not in the file",
    ]
    assert told(path, Fate.READ) == ["1 object"]
    assert told(path, Fate.CHANGED) == [
        "2 normals: without direction, for which faces have their own",
        "1 pair of texture coordinates: no numbers, which count as 0",
    ]


# ------------------------------------------------------------------------------------------- materials


def test_colours_and_shares(tmp_path: Path) -> None:
    plain = material_of(tmp_path, "Kd 0.5 0.25 1\nKs 0.5 0.5 0.5\nNs 250\nNi 1.33\nKe 0 2 0\nillum 2")
    assert plain.base_color == (0.5, 0.25, 1) and plain.emission == (0, 2, 0)
    assert (plain.specular, plain.roughness, plain.ior) == (1, 0.5, 1.33)
    matte = material_of(tmp_path, "Kd 0.5 0.5 0.5")
    assert (matte.specular, matte.roughness) == (0, 1)
    gold = material_of(tmp_path, "Kd 1 0.8 0.2\nPr 0.3\nPm 1\nPc 0.5\nPcr 0.1\naniso 0.4\nPs 0.2")
    assert (gold.metallic, gold.roughness, gold.clearcoat, gold.clearcoat_roughness) == (1, 0.3, 0.5, 0.1)
    assert (gold.anisotropy, gold.sheen_color, gold.specular) == (0.4, (0.2, 0.2, 0.2), 1)
    mirror = material_of(tmp_path, "Kd 0 0 0\nKs 0.9 0.9 0.8\nNs 1000\nillum 3")
    assert (mirror.metallic, mirror.roughness, mirror.base_color) == (1, 0, (0.9, 0.9, 0.8))


def test_colours_out_of_range_are_told(tmp_path: Path) -> None:
    material = material_of(tmp_path, "Kd 1.5 0.5 -0.25\nKe 7 8 9")
    assert material.base_color == (1, 0.5, 0) and material.emission == (7, 8, 9)
    path = next(tmp_path.glob("*.obj"))
    (said,) = told(path, Fate.CHANGED)
    assert said.startswith("Kd of material 'm' in ") and said.endswith(": 1.5 does not lie from 0 to 1")


@pytest.mark.parametrize(
    ("mtl", "expected"),
    [
        ("d 0.25", {"alpha": 0.25, "alpha_mode": "blend", "transmission": 0}),
        ("Tr 0.25", {"alpha": 0.75, "alpha_mode": "blend"}),
        ("d -halo 0.5", {"alpha": 0.5}),
        ("d 1", {"alpha_mode": "opaque"}),
        (
            "illum 7\nNi 1.5\nTf 1 0.5 0.5\nNs 1000",
            {"transmission": 1, "base_color": (1, 0.5, 0.5), "roughness": 0},
        ),
        ("illum 4\nd 0.1", {"transmission": 0.9, "thin_walled": True, "alpha": 1}),
    ],
)
def test_what_lets_light_through(tmp_path: Path, mtl: str, expected: dict[str, object]) -> None:
    material = material_of(tmp_path, mtl)
    for name, value in expected.items():
        assert getattr(material, name) == pytest.approx(value) if name != "alpha_mode" else True
        assert name != "alpha_mode" or material.alpha_mode == value


def image(path: Path, *color: int, size: tuple[int, int] = (4, 4)) -> None:
    pixels = (
        np.broadcast_to(np.uint8(color), (*size, len(color)))
        if len(color) > 1
        else np.full(size, color[0], np.uint8)
    )
    PIL.Image.fromarray(np.ascontiguousarray(pixels)).save(path)


def test_images(tmp_path: Path) -> None:
    image(tmp_path / "wood grain.png", 200, 100, 50)
    image(tmp_path / "mask.png", 64, size=(8, 2))
    image(tmp_path / "rough.png", 128)
    image(tmp_path / "metal.png", 255)
    image(tmp_path / "bumps.png", 128, 128, 255)
    image(tmp_path / "glow.png", 10, 20, 30)
    material = material_of(
        tmp_path,
        "Kd 0 0 0\nmap_Kd -s 2 3 1 -o 0.25 0.5 -clamp on wood grain.png\nmap_d mask.png\nmap_Pr rough.png\n"
        "map_Pm metal.png\nmap_Bump -bm 0.5 bumps.png\nmap_Ke glow.png",
    )
    color = material.base_color_texture
    assert color is not None and material.base_color == (1, 1, 1) and material.alpha_mode == "blend"
    assert color.bitmap.pixels.shape == (8, 4, 4) and color.bitmap.pixels[3, 2].tolist() == [200, 100, 50, 64]
    assert (color.wrap, color.scale) == (("clamp", "clamp"), (2, 3))
    # (0, 0) at the bottom left goes to (0.25, 0.5) there.
    np.testing.assert_allclose(color.matrix @ [0, 1, 1], [0.25, 1 - 0.5])
    np.testing.assert_allclose(color.matrix @ [1, 0, 1], [2.25, 1 - 3.5])
    packed = material.metallic_roughness_texture
    assert packed is not None and packed.bitmap.pixels[0, 0, 1:].tolist() == [128, 255]
    assert (material.roughness, material.metallic) == (1, 1)
    assert material.normal_texture is not None and material.normal_scale == 0.5
    assert material.emission == (1, 1, 1) and material.emission_texture is not None


def test_heights_and_normals_are_told_apart(tmp_path: Path) -> None:
    image(tmp_path / "heights.png", 90)
    image(tmp_path / "normals.png", 128, 128, 255)
    bumpy = material_of(tmp_path, "bump -bm 2 heights.png\nnorm normals.png")
    assert bumpy.bump_texture is not None and bumpy.bump_texture.bitmap.channels == 1
    assert bumpy.bump_scale == pytest.approx(2 * Material().bump_scale)
    assert bumpy.normal_texture is not None and bumpy.normal_texture.bitmap.channels == 3
    assert told(tmp_path / "a.obj", Fate.CHANGED) == [
        "a bump map: from black to white it is taken for 0.02 m high"
    ]


def test_what_a_material_loses_is_told(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        f"mtllib gone.mtl\n{SQUARE}usemtl m\nf 1 2 3\nusemtl other\nf 1 3 4\n",
        "newmtl m\nKa 1 1 1\nmap_Kd C:\\textures\\gone.png\nmap_Ns shiny.png\nfoo 1\n",
    )
    assert told(path) == [
        "foo in a.mtl: nothing here is like it",
        "map_ns in a.mtl: roughness has a map of its own, map_Pr",
        f"image C:/textures/gone.png: {tmp_path / 'gone.png'}: no such file; check the path",
        f"materials of gone.mtl: {tmp_path / 'gone.mtl'}: no such file; check the path",
        "material 'other': is in none of the files of materials",
    ]


def test_numbers_out_of_their_range_are_told(tmp_path: Path) -> None:
    path = written(
        tmp_path, f"{SQUARE}usemtl m\nf 1 2 3\n", "newmtl m\nNs 5000\nd -1\nNi 1.5\nPr 1\naniso 0\n"
    )
    assert told(path, Fate.CHANGED) == [
        "Ns of material 'm' in a.mtl: 5000 does not lie from 0 to 1000",
        "d of material 'm' in a.mtl: -1 does not lie from 0 to 1",
    ]


def test_a_missing_file_with_spaces_in_its_name_is_told_as_one(tmp_path: Path) -> None:
    (tmp_path / "b.mtl").write_text("newmtl m\nKd 1 0 0\n")
    path = written(tmp_path, f"mtllib my old model.mtl\nmtllib b.mtl c.mtl\n{SQUARE}usemtl m\nf 1 2 3\n")
    assert told(path) == [
        f"materials of {name}: {tmp_path / name}: no such file; check the path"
        for name in ("my old model.mtl", "c.mtl")
    ]


def test_files_outside_of_the_folder_are_not_opened(tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    image(tmp_path / "secret.png", 1, 2, 3)
    path = written(inner, f"{SQUARE}usemtl m\nf 1 2 3\n", "newmtl m\nmap_Kd ../secret.png\n")
    (text,) = told(path)
    assert "leads out of the folder" in text and "--allow-outside" in text
    scene, report = registry.load_with_report(path, allow_outside=True)
    assert report.is_whole and scene.materials["m"].base_color_texture is not None
    (tmp_path / "b.mtl").write_text("newmtl m\nKd 1 0 0\n")
    (inner / "b.obj").write_text(f"mtllib ../b.mtl\n{SQUARE}usemtl m\nf 1 2 3\n")
    assert "leads out of the folder" in told(inner / "b.obj")[0]


@pytest.mark.parametrize("line", ["Ns abc", "Kd", "Kd red 0 0", "Pr", "map_Kd"])
def test_a_damaged_line_is_told_and_the_others_count(tmp_path: Path, line: str) -> None:
    path = written(tmp_path, f"{SQUARE}usemtl m\nf 1 2 3\n", f"newmtl m\nPm 1\n{line}\nPc 0.5\n")
    (text,) = told(path)
    assert text.startswith(f"{line.split()[0]} of material 'm' in a.mtl: ") and "\n" not in text
    (part,) = mesh_files.load_parts(path)
    assert part.material is not None and (part.material.metallic, part.material.clearcoat) == (1, 0.5)


def test_control_characters_are_no_blanks(tmp_path: Path) -> None:
    path = written(tmp_path, f"{SQUARE}v 0 0 \0 1\nf 1 2 \1 3\nf 1 2 3\nf 1 3 4\nf 1 2 5\n")
    assert told(path) == [
        "3 of 5 faces: 2 with an index out of range, 1 with a vertex that is not finite or too far away",
        "faces at a corner '\\x01': it is no index",
    ]


def test_names_with_spaces(tmp_path: Path) -> None:
    for number, line in enumerate(("my colours.mtl", "my\\ colours.mtl gone.mtl")):
        (tmp_path / "my colours.mtl").write_text("newmtl bright red\nKd 1 0 0\n")
        path = tmp_path / f"{number}.obj"
        path.write_text(f"mtllib {line}\n{SQUARE}usemtl bright red\nf 1 2 3\n")
        (part,) = mesh_files.load_file(path).parts
        assert part.material is not None and part.material.base_color == (1, 0, 0)


def test_faces_without_vertices_are_no_crash(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no usable face .1 with an index out of range"):
        mesh_files.load_file(written(tmp_path, "f -1 -2 -3\n"))


def test_a_changed_material_file_is_read_again(tmp_path: Path) -> None:
    path = written(tmp_path, f"{SQUARE}usemtl m\nf 1 2 3\n", "newmtl m\nKd 1 0 0\n")
    first = mesh_files.load_parts(path)
    assert mesh_files.load_parts(path)[0].mesh is first[0].mesh
    (tmp_path / "a.mtl").write_text("newmtl m\nKd 0 1 0\nKs 1 1 1\n")
    material = mesh_files.load_parts(path)[0].material
    assert material is not None and material.base_color == (0, 1, 0)
