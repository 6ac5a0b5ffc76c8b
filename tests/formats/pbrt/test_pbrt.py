"""Scenes of pbrt-v4: what of their statements stands where, and what is said of the rest."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from support.mitsuba_files import told, write_image

from incpt.core.errors import InputError
from incpt.formats import images, registry
from incpt.formats.import_report import Fate, ImportReport
from incpt.picture.color import linear_from_srgb
from incpt.picture.spectra import blackbody_color
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene

Array = npt.NDArray[np.float64]
CAMERA = 'Scale -1 1 1 LookAt 0 0 9  0 0 0  0 1 0 Camera "perspective" "float fov" 40 WorldBegin\n'
"""In a world that is right-handed, as most files have it."""
SPHERE = 'Shape "sphere"\n'


def read(folder: Path, body: str, head: str = CAMERA) -> tuple[Scene, ImportReport]:
    path = folder / "a.pbrt"
    path.write_text(head + body)
    return registry.load_with_report(path)


def material_of(folder: Path, body: str) -> Material:
    """That of a sphere behind a body, of which nothing is left out."""
    scene, report = read(folder, f"{body}\n{SPHERE}")
    assert not told(report), told(report)
    return scene.materials[scene.objects[0].material]


def facing(obj: Object) -> Array:
    """(F, 3) unit normals of its faces in the world, on the side that is outside."""
    corners = obj.mesh.vertices[obj.mesh.faces] @ obj.world_from_object[:, :3].T
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals *= np.sign(np.linalg.det(obj.world_from_object[:, :3]))
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


# ----------------------------------------------------------------------------------------- the camera


PLACES = np.array([[0.5, 0.5], [0.0, 0.0], [0.75, 0.5]])


def rays_of_pbrt(camera_from_world: Array, fov: float, places: Array, aspect: float) -> Array:
    """(N, 3) directions in pbrt's world: x to the right, y up, z along the view; the field of view is that of
    the shorter side."""
    tangent = math.tan(math.radians(fov) / 2)
    x, y = (2 * places[:, 0] - 1) * max(aspect, 1.0), (1 - 2 * places[:, 1]) * max(1 / aspect, 1.0)
    ways = np.column_stack([x * tangent, y * tangent, np.ones(len(places))])
    return np.asarray(ways @ np.linalg.inv(camera_from_world[:3, :3]).T)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("size", [(200, 100), (100, 200)])
def test_pictures_are_not_mirrored(mirrored: bool, size: tuple[int, int], tmp_path: Path) -> None:
    scale = "Scale -1 1 1 " if mirrored else ""
    head = (
        f'Film "rgb" "integer xresolution" {size[0]} "integer yresolution" {size[1]}\n'
        f'{scale}LookAt 1 2 9  0 0 0  0 1 0 Camera "perspective" "float fov" 50 WorldBegin\n'
    )
    scene, report = read(tmp_path, "Translate 1 0 2 " + SPHERE, head)
    view = np.array([-1.0, -2, -9]) / math.sqrt(86)
    right = np.cross([0, 1, 0], view)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right * (-1 if mirrored else 1), np.cross(view, right), view])
    # Where the sphere's middle is seen, by way of the rays of both.
    aspect = size[0] / size[1]
    expected = rays_of_pbrt(matrix, 50, PLACES, aspect)
    origins, ways = scene.camera.rays(PLACES, aspect)
    flip = np.array([1, 1, 1 if mirrored else -1])
    np.testing.assert_allclose(
        ways / np.linalg.norm(ways, axis=1)[:, None],
        expected * flip / np.linalg.norm(expected, axis=1)[:, None],
        atol=1e-9,
    )
    np.testing.assert_allclose(origins[0], np.array([1, 2, 9]) * flip)
    np.testing.assert_allclose(
        scene.objects[0].world_bounds.mean(axis=0), np.array([1, 0, 2]) * flip, atol=1e-6
    )
    assert scene.settings.size == size
    assert any("left-handed" in text for text in told(report, Fate.CHANGED)) is not mirrored
    assert _faces_outwards(scene.objects[0])


def _faces_outwards(obj: Object) -> bool:
    middles = (obj.mesh.vertices[obj.mesh.faces] @ obj.world_from_object[:, :3].T).mean(axis=1)
    return bool(((facing(obj) * middles).sum(axis=1) > 0).all())


def test_a_part_of_the_film_and_a_screen_window(tmp_path: Path) -> None:
    film = 'Film "rgb" "integer xresolution" 200 "integer yresolution" 100 '
    place = "Scale -1 1 1 LookAt 0 0 9  0 0 0  0 1 0 "
    whole, _ = read(tmp_path, SPHERE, f'{film}{place}Camera "perspective" "float fov" 40 WorldBegin\n')
    crop = film + '"float cropwindow" [.25 .5 .5 1] '
    part, _ = read(tmp_path, SPHERE, f'{crop}{place}Camera "perspective" "float fov" 40 WorldBegin\n')
    assert part.settings.size == (50, 50)
    within = np.array([0.25, 0.5]) + PLACES * [0.25, 0.5]
    np.testing.assert_allclose(part.camera.rays(PLACES, 1.0)[1], whole.camera.rays(within, 2.0)[1], atol=1e-9)
    window = f'{film}{place}Camera "orthographic" "float screenwindow" [-1 3 -2 0] WorldBegin\n'
    flat, _ = read(tmp_path, SPHERE, window)
    origins, ways = flat.camera.rays(PLACES, 2.0)
    np.testing.assert_allclose(origins[:, :2], [[1, -1], [-1, 0], [2, -1]], atol=1e-9)
    np.testing.assert_allclose(ways, [[0, 0, -1]] * 3, atol=1e-12)


def test_a_lens(tmp_path: Path) -> None:
    lens = '"float lensradius" .2 "float focaldistance" 3'
    head = f'LookAt 0 0 9  0 0 0  0 1 0 Camera "perspective" {lens} WorldBegin\n'
    scene, _ = read(tmp_path, SPHERE, head)
    assert scene.camera.lens_radius(16 / 9) == pytest.approx(0.2) and scene.camera.sharp_distance == 3


def test_how_it_is_rendered(tmp_path: Path) -> None:
    for depth, bounces in (("", 4), ('"integer maxdepth" 20', 19), ('"integer maxdepth" 1', 0)):
        scene, _ = read(tmp_path, SPHERE, f'Integrator "volpath" {depth}\n{CAMERA}')
        assert scene.settings.max_bounces == bounces and not scene.settings.multiple_scattering


# -------------------------------------------------------------------------------------------- places


def test_transforms_follow_each_other(tmp_path: Path) -> None:
    scene, _ = read(
        tmp_path,
        f"AttributeBegin Translate 1 2 3 Rotate 90 0 1 0 Scale 2 1 1 {SPHERE}AttributeEnd\n"
        f"AttributeBegin Transform [2 0 0 0  0 1 0 0  0 0 1 0  5 6 7 1] {SPHERE}AttributeEnd\n"
        f'TransformBegin Translate 9 9 9 Material "conductor" TransformEnd {SPHERE}\n'
        f'CoordSysTransform "camera" Translate 0 0 4 {SPHERE}',
        CAMERA.replace("LookAt 0 0 9  0 0 0", "LookAt 1 2 9  1 2 0"),
    )
    first, second, unmoved, seen = (one.world_bounds for one in scene.objects)
    np.testing.assert_allclose(first, [[0, 1, 1], [2, 3, 5]], atol=1e-2)
    np.testing.assert_allclose(second, [[3, 5, 6], [7, 7, 8]], atol=1e-2)
    np.testing.assert_allclose(unmoved.mean(axis=0), [0, 0, 0], atol=1e-6)
    # Of a transform's own attributes only the place ends with it.
    assert [scene.materials[one.material].metallic for one in scene.objects] == [0, 0, 1, 1]
    np.testing.assert_allclose(seen.mean(axis=0), [1, 2, 5], atol=1e-6)


def test_objects_are_shared_by_their_instances(tmp_path: Path) -> None:
    scene, report = read(
        tmp_path,
        f'ObjectBegin "o" Scale 2 2 2 {SPHERE}ObjectEnd\n'
        'AttributeBegin Translate 5 0 0 ObjectInstance "o" AttributeEnd ObjectInstance "o"',
    )
    assert [one.name for one in scene.objects] == ["o/sphere", "o/sphere.2"] and report.is_whole
    assert scene.objects[0].mesh is scene.objects[1].mesh
    np.testing.assert_allclose(scene.objects[0].world_bounds, [[3, -2, -2], [7, 2, 2]], atol=1e-2)


def test_files_are_included(tmp_path: Path) -> None:
    (tmp_path / "b.pbrt").write_text(SPHERE)
    scene, _ = read(tmp_path, 'Translate 1 0 0 Include "b.pbrt"')
    assert scene.objects[0].position == (1, 0, 0)


def test_attributes_hold_for_what_follows(tmp_path: Path) -> None:
    scene, report = read(
        tmp_path,
        f'Attribute "shape" "float radius" 2\n{SPHERE}Shape "sphere" "float radius" 3\n'
        'Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0]',
    )
    assert [round(float(one.world_bounds[1, 0])) for one in scene.objects] == [2, 3, 1]
    # A mesh has no radius.
    assert report.is_whole


# -------------------------------------------------------------------------------------------- shapes


def test_meshes_in_the_file(tmp_path: Path) -> None:
    scene, _ = read(
        tmp_path,
        'Shape "trianglemesh" "point3 P" [0 0 0  1 0 0  1 1 0  0 1 0] "integer indices" [0 1 2  0 2 3]\n'
        '"normal N" [0 0 1  0 0 1  0 1 0  0 0 1] "point2 uv" [0 0  1 0  1 1  0 1]\n'
        'Shape "bilinearmesh" "point3 P" [0 0 0  1 0 0  0 1 0  1 1 0]',
    )
    mesh, patch = (one.mesh for one in scene.objects)
    assert mesh.normals is not None
    np.testing.assert_array_equal(mesh.normals[0, 2], [0, 1, 0])
    # (0, 0) is at the bottom left of an image there.
    np.testing.assert_array_equal(mesh.uvs[0][0], [[0, 1], [1, 1], [1, 0]])
    for obj in scene.objects:
        np.testing.assert_allclose(facing(obj), [[0, 0, 1]] * 2, atol=1e-6)
    assert len(patch.faces) == 2


@pytest.mark.parametrize(
    ("shape", "low", "high"),
    [
        ('"sphere" "float radius" 2', (-2, -2, -2), (2, 2, 2)),
        ('"disk" "float radius" 2 "float height" 1', (-2, -2, 1), (2, 2, 1)),
        ('"cylinder" "float radius" 2 "float zmin" -1 "float zmax" 3', (-2, -2, -1), (2, 2, 3)),
    ],
)
def test_round_shapes(shape: str, low: tuple[int, ...], high: tuple[int, ...], tmp_path: Path) -> None:
    scene, _ = read(tmp_path, f"Shape {shape} ReverseOrientation Shape {shape}")
    outside, inside = scene.objects
    np.testing.assert_allclose(outside.world_bounds, [low, high], atol=1e-2)
    np.testing.assert_allclose(facing(outside), -facing(inside)[:, :], atol=1e-6)
    if "disk" in shape:
        np.testing.assert_allclose(facing(outside)[0], [0, 0, 1])


def test_shapes_of_files_and_their_alpha(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    write_image(tmp_path / "m.png", [[0, 255], [255, 255]])
    scene, report = read(
        tmp_path,
        'Texture "m" "float" "imagemap" "string filename" "m.png"\n'
        'Shape "plymesh" "string filename" "a.ply" "texture alpha" "m"\n'
        'Shape "plymesh" "string filename" "none.ply"  Shape "curve" "point3 P" [0 0 0]',
    )
    (obj,) = scene.objects
    material = scene.materials[obj.material]
    assert obj.name == "a" and obj.mesh.normals is None and material.alpha_mode == "blend"
    assert material.base_color_texture is not None
    np.testing.assert_allclose(material.base_color_texture.bitmap.pixels[..., 3], [[0, 1], [1, 1]])
    assert [("none.ply" in text, "curve" in text) for text in told(report)] == [(True, False), (False, True)]


# ----------------------------------------------------------------------------------------- materials


def test_materials(tmp_path: Path) -> None:
    assert material_of(tmp_path, "") == Material((0.5, 0.5, 0.5), specular=0)
    assert material_of(tmp_path, 'Material "diffuse" "rgb reflectance" [.1 .2 .3]').base_color == (
        0.1,
        0.2,
        0.3,
    )
    glass = material_of(tmp_path, 'Material "dielectric" "float eta" 1.3 "float roughness" .0625')
    # Alpha is the root of roughness there, and the square of it here.
    assert (glass.transmission, glass.ior, glass.roughness) == (1, 1.3, pytest.approx(0.5))
    exact = material_of(tmp_path, 'Material "dielectric" "float roughness" .25 "bool remaproughness" false')
    assert exact.roughness == 0.5
    bk7 = material_of(tmp_path, 'Material "dielectric" "spectrum eta" "glass-BK7"')
    assert bk7.ior == pytest.approx(1.5168) and bk7.dispersion == pytest.approx(20 / 64.17)
    copper = material_of(tmp_path, 'Material "conductor"')
    assert copper.metallic == 1 and copper.base_color[0] > 0.9 > copper.base_color[1] > copper.base_color[2]
    brass = material_of(
        tmp_path, 'Material "conductor" "spectrum eta" "metal-CuZn-eta" "spectrum k" "metal-CuZn-k"'
    )
    assert brass.base_color == (0.9097, 0.7781, 0.423)
    pairs = material_of(
        tmp_path, 'Material "conductor" "spectrum eta" [300 .2 900 .2] "spectrum k" [300 3 900 3]'
    )
    np.testing.assert_allclose(pairs.base_color, (0.8**2 + 9) / (1.2**2 + 9))
    coated = material_of(tmp_path, 'Material "coateddiffuse" "float roughness" 0 "float eta" 1.4')
    assert (coated.ior, coated.roughness, coated.specular) == (1.4, 0, 1)
    wall = material_of(tmp_path, 'Material "thindielectric"')
    assert wall.thin_walled and wall.transmission == 1
    leaf = material_of(
        tmp_path, 'Material "diffusetransmission" "rgb reflectance" [.3 .2 .1] "rgb transmittance" [.1 .05 0]'
    )
    share = leaf.diffuse_transmission
    np.testing.assert_allclose(np.array(leaf.base_color) * (1 - share), [0.3, 0.2, 0.1])
    np.testing.assert_allclose(np.array(leaf.diffuse_transmission_color) * share, [0.1, 0.05, 0])


def test_mixed_materials(tmp_path: Path) -> None:
    made = (
        'MakeNamedMaterial "a" "string type" "diffuse" "rgb reflectance" [.8 .2 .2]\n'
        'MakeNamedMaterial "b" "string type" "diffuse" "rgb reflectance" [.2 .4 .2]\n'
        'MakeNamedMaterial "m" "string type" "mix" "string materials" ["a" "b"] "float amount" .25\n'
    )
    mixed = material_of(tmp_path, f'{made}NamedMaterial "m"')
    np.testing.assert_allclose(mixed.base_color, [0.65, 0.25, 0.2])


def test_textures(tmp_path: Path) -> None:
    write_image(tmp_path / "c.png", np.full((2, 2, 3), 128))
    image = (
        'Texture "t" "spectrum" "imagemap" "string filename" "c.png" {}\n'
        'Material "diffuse" "texture reflectance" "t"'
    )
    texture = material_of(
        tmp_path, image.format('"float uscale" 2 "float vscale" 3 "float udelta" .1 "float vdelta" .2')
    ).base_color_texture
    assert texture is not None and texture.bitmap.source.file == str(tmp_path / "c.png")
    # At u = v = 0, the bottom left, (0.1, 0.2) of the image are read, which is at 0.1 and 0.8 from its top.
    np.testing.assert_allclose(texture.matrix @ [0, 1, 1], [0.1, 0.8])
    np.testing.assert_allclose(texture.matrix @ [1, 0, 1], [2.1, -2.2])
    linear = material_of(tmp_path, image.format('"string encoding" "linear"')).base_color_texture
    assert linear is not None
    np.testing.assert_allclose(linear.bitmap.pixels, 128 / 255, atol=1e-6)
    inverted = material_of(tmp_path, image.format('"bool invert" true "float scale" .5'))
    assert inverted.base_color_texture is not None
    shown = inverted.base_color_texture.bitmap.pixels * np.array(inverted.base_color)
    np.testing.assert_allclose(shown, 0.5 * (1 - linear_from_srgb(128 / 255)), atol=1e-6)
    board = material_of(
        tmp_path,
        'Texture "b" "spectrum" "checkerboard" "rgb tex1" [1 0 0] "rgb tex2" [0 0 1] "float uscale" 4\n'
        '"float vscale" 4 Material "diffuse" "texture reflectance" "b"',
    ).base_color_texture
    assert board is not None
    place = board.matrix @ [0.1, 1 - 0.3, 1]  # u = 0.1, v = 0.3: the first field along u, the second along v
    row, column = (int(c % 1 * 2) for c in (place[1], place[0]))
    np.testing.assert_array_equal(board.bitmap.pixels[row, column], [0, 0, 1])


# -------------------------------------------------------------------------------------------- lights


def test_lights(tmp_path: Path) -> None:
    scene, _ = read(
        tmp_path,
        'LightSource "point" "rgb I" [1 2 3] "float scale" 2 "point3 from" [1 2 3]\n'
        'LightSource "spot" "rgb I" [1 1 1] "point3 from" [0 5 0] "point3 to" [3 1 0] "float coneangle" 40\n'
        '"float conedeltaangle" 10\n'
        'LightSource "distant" "blackbody L" 3000 "float scale" 4 "point3 from" [0 1 0] "point3 to" [0 0 0]\n'
        'LightSource "infinite" "rgb L" [.1 .2 .3]',
    )
    point, spot, sun = scene.lights
    assert point.position == (1, 2, 3)
    np.testing.assert_allclose(point.emitted, [2, 4, 6])
    np.testing.assert_allclose(-spot.axes[2], [0.6, -0.8, 0], atol=1e-9)
    assert (spot.spot_angle, spot.spot_blend) == (80, 0.25)
    np.testing.assert_allclose(spot.emitted, 1)
    np.testing.assert_allclose(-sun.axes[2], [0, -1, 0], atol=1e-9)
    # Of a spectrum only the colour counts: its luminance is the scale.
    color = blackbody_color(3000)
    np.testing.assert_allclose(sun.emitted, 4 * color / (color @ [0.2126, 0.7152, 0.0722]))
    np.testing.assert_allclose(scene.environment.radiance, [0.1, 0.2, 0.3])


def test_shapes_that_shine(tmp_path: Path) -> None:
    scene, _ = read(
        tmp_path,
        'AttributeBegin AreaLightSource "diffuse" "rgb L" [1 2 3] "float scale" 2 "bool twosided" true\n'
        f"{SPHERE} AttributeEnd {SPHERE}",
    )
    lamp, ball = (scene.materials[one.material] for one in scene.objects)
    assert lamp.emission == (2, 4, 6) and lamp.double_sided and not ball.is_emissive


@pytest.mark.parametrize("place", ["", "Rotate 90 1 0 0", "Scale 1 1 -1"])
def test_square_environments(place: str, tmp_path: Path) -> None:
    # In each of five directions the pixel of the mapping has a colour of its own.
    pixels = np.zeros((64, 64, 3), np.float32)
    spots = {
        (32, 32): (0, 0, 1), (32, 63): (1, 0, 0), (63, 32): (0, 1, 0), (32, 0): (-1, 0, 0),
        (0, 32): (0, -1, 0),
    }  # fmt: skip
    for number, (row, column) in enumerate(spots):
        pixels[max(row - 3, 0) : row + 3, max(column - 3, 0) : column + 3] = number + 1
    images.write_exr(tmp_path / "e.exr", {"RGB": pixels})
    scene, _ = read(tmp_path, f'{place} LightSource "infinite" "string filename" "e.exr" "float scale" 2')
    steps, _ = read(tmp_path, f"{place} {SPHERE}")
    matrix = steps.objects[0].world_from_object[:, :3] @ np.linalg.inv(
        read(tmp_path, SPHERE)[0].objects[0].world_from_object[:, :3]
    )
    picture = scene.environment.picture
    assert picture is not None
    for number, direction in enumerate(spots.values()):
        x, y, z = matrix @ direction
        height, width = picture.pixels.shape[:2]
        column = int((0.5 - math.atan2(x, z) / (2 * math.pi)) * width) % width
        row = min(int(math.acos(np.clip(y, -1, 1)) / math.pi * height), height - 1)
        assert picture.pixels[row, column, 0] == pytest.approx(number + 1, rel=1e-5), direction
    assert scene.environment.radiance == (2, 2, 2)


# ------------------------------------------------------------------------------------ what is wrong


WRONG = {
    "Sphere": "line 2: 'Sphere' is no directive",
    'Shape "sphere" "float radius" x': "line 2: radius: 'x' is not a number",
    'Shape "sphere" "float radius" [1 2]': "radius: holds 2 numbers; write 1",
    'Shape "sphere" "radius" 1': "'radius' is no parameter; write a type and a name",
    'Shape "sphere" "string radius" "1"': "radius: is of type string; use float",
    'Shape "sphere': "line 2: a quotation mark has no end",
    "Translate 1 2": "the file ends too soon",
    "Translate 1 2 nan": "not finite",
    "AttributeEnd": "AttributeEnd has no AttributeBegin",
    "AttributeBegin": "an AttributeBegin has no AttributeEnd",
    'NamedMaterial "a"': "'a' is not made before",
    'ObjectInstance "a"': "'a' is not begun before",
    'Include "a.pbrt"': "includes itself",
    'Include "../b.pbrt"': "leads out of the folder",
    'Material "diffuse" "texture reflectance" "t" Shape "sphere"': "the texture 't' is not made",
    'Material "conductor" "spectrum eta" "metal-Xx-eta" Shape "sphere"': "'Xx' is not known",
    'Shape "trianglemesh" "integer indices" [0 1 2]': "P: is missing",
    'Transform [1 0 0]': "needs 16 numbers",
    'Texture "a" "float" "scale" "texture tex" "a" Material "diffuse" "texture reflectance" "a" Shape "disk"':
        "in a circle",
    'MakeNamedMaterial "m" "string type" "mix" "string materials" ["m" "m"] NamedMaterial "m" Shape "sphere"':
        "in a circle",
}  # fmt: skip


@pytest.mark.parametrize("body", WRONG)
def test_what_is_wrong_is_said_in_a_line(body: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        read(tmp_path, body)
    text = str(error.value)
    assert text.startswith(str(tmp_path / "a.pbrt")) and WRONG[body] in text and "\n" not in text


def test_a_part_of_a_scene_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no Camera"):
        read(tmp_path, SPHERE, "")


def test_what_is_not_read_is_told(tmp_path: Path) -> None:
    _, report = read(
        tmp_path,
        'Shape "sphere" "float raduis" 2\nMaterial "hair" Shape "sphere"\nLightSource "goniometric"\n'
        'MakeNamedMedium "m" "string type" "homogeneous" MediumInterface "m" "" Shape "sphere"',
    )
    assert [text.partition(":")[0] for text in told(report)] == [
        "Material 'hair' (line 3)", "media", "LightSource 'goniometric' (line 4)",
        "raduis of Shape 'sphere' (line 2)",
    ]  # fmt: skip


def test_damaged_files_are_refused_in_a_line(tmp_path: Path) -> None:
    write_image(tmp_path / "c.png", np.full((2, 2, 3), 128))
    good = (
        CAMERA + 'Texture "t" "spectrum" "imagemap" "string filename" "c.png"\nAttributeBegin\n'
        'Material "coateddiffuse" "texture reflectance" "t" "float roughness" [ 0.1 ]\nRotate 20 0 1 0\n'
        'Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2]\nAttributeEnd\n'
        'LightSource "spot" "blackbody I" 3000 "float coneangle" 20\n'
        'ObjectBegin "o"\nShape "disk"\nObjectEnd\nObjectInstance "o"\n'
    ).encode()
    random = np.random.default_rng(2)
    path = tmp_path / "a.pbrt"
    read_whole = 0
    for _ in range(400):
        damaged = bytearray(good)
        for place in random.integers(0, len(good), random.integers(1, 4)):
            damaged[place] = random.integers(32, 127)
        path.write_bytes(damaged)
        try:
            registry.load_with_report(path)
            read_whole += 1
        except InputError:
            pass
    assert 0 < read_whole < 400
