"""3MF files: units, placements, colours and images, and archives that are meant to do harm."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from incpt.core import affine
from incpt.core.errors import InputError
from incpt.formats import mesh_files, registry
from incpt.formats.import_report import Fate
from incpt.formats.threemf import package, reader
from incpt.scene.mesh_part import MeshPart

CORE = 'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"'
OTHERS = (
    'xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02" '
    'xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06" xmlns:b="http://example.org/beams"'
)
RELATIONSHIPS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" Target="/3D/3dmodel.model"/>'
    "</Relationships>"
)
CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
VERTICES = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in CORNERS)
FACES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]


def solid(number: int = 1, *looks: str, given: str = "") -> str:
    """A tetrahedron; the faces have these attributes."""
    looks = looks or ("",) * 4
    triangles = "".join(
        f'<triangle v1="{a}" v2="{b}" v3="{c}" {look}/>'
        for (a, b, c), look in zip(FACES, looks, strict=False)
    )
    mesh = f"<mesh><vertices>{VERTICES}</vertices><triangles>{triangles}</triangles></mesh>"
    return f'<object id="{number}" {given}>{mesh}</object>'


def model(resources: str, build: str = '<item objectid="1"/>', given: str = "") -> str:
    return (
        f'<?xml version="1.0"?><model {given} {CORE} {OTHERS}><resources>{resources}</resources>'
        f"<build>{build}</build></model>"
    )


def written(folder: Path, text: str, **others: str | bytes) -> Path:
    path = folder / "a.3mf"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("_rels/.rels", RELATIONSHIPS)
        archive.writestr("3D/3dmodel.model", text)
        for name, content in others.items():
            archive.writestr(f"3D/{name}", content)
    return path


def parts_of(path: Path) -> dict[str | None, MeshPart]:
    return {part.name: part for part in mesh_files.load_file(path).parts}


def told(path: Path, fate: Fate = Fate.LEFT_OUT) -> list[str]:
    return [remark.text for remark in registry.load_with_report(path)[1].of(fate)]


def bounds(part: MeshPart) -> list[list[float]]:
    vertices = affine.apply(part.transform.world_from_object, part.mesh.vertices)
    return np.round([vertices.min(axis=0), vertices.max(axis=0)], 9).tolist()


@pytest.mark.parametrize(
    ("given", "metres"), [("", 0.001), ('unit="inch"', 0.0254), ('unit="micron"', 1e-6), ('unit="meter"', 1)]
)
def test_units_and_the_way_up(tmp_path: Path, given: str, metres: float) -> None:
    move = '<item objectid="1" transform="1 0 0 0 2 0 0 0 3 0 0 5"/>'
    path = written(tmp_path, model(solid(), move, given))
    (part,) = parts_of(path).values()
    assert part.name is None and part.mesh.vertices.tolist() == [list(corner) for corner in CORNERS]
    # What is up in the file, from 5 to 8, is y; what is away from the front, to 2, is -z.
    expected = np.array([[0, 5, -2], [1, 8, 0]]) * metres
    np.testing.assert_allclose(bounds(part), expected, atol=1e-9)
    with pytest.raises(InputError, match="says itself where up is"):
        registry.load(path, unit=1.0)


def test_components_share_their_mesh(tmp_path: Path) -> None:
    quarter = "0 1 0 -1 0 0 0 0 1 0 0 0"
    pair = (
        '<object id="2" name="pair"><components><component objectid="1"/>'
        f'<component objectid="1" transform="{quarter}"/></components></object>'
    )
    build = '<item objectid="2" transform="1 0 0 0 1 0 0 0 1 10 0 0"/><item objectid="1"/>'
    path = written(tmp_path, model(solid(given='name="corner"') + pair, build, 'unit="meter"'))
    parts = parts_of(path)
    assert list(parts) == ["corner", "corner.2", "corner.3"]
    assert len({id(part.mesh) for part in parts.values()}) == 1
    # Turned by a quarter about what is up, before it is moved.
    assert bounds(parts["corner.2"]) == [[9, 0, -1], [10, 1, 0]]
    again = mesh_files.load_mesh(path, "corner.2")
    np.testing.assert_allclose(again.bounds, bounds(parts["corner.2"]), atol=1e-6)
    assert parts["corner"].mesh.source.geometry == "corner"
    assert told(path) == []


COLORS = '<m:colorgroup id="5"><m:color color="#FF0000"/><m:color color="#00FF0033"/></m:colorgroup>'
BASES = (
    '<basematerials id="6"><base name="steel" displaycolor="#808080"/>'
    '<base name="glass" displaycolor="#0000FF80"/></basematerials>'
)


MIXTURE = (
    '<m:compositematerials id="7" matid="6" matindices="0"><m:composite values="{}"/></m:compositematerials>'
)


def test_colours(tmp_path: Path) -> None:
    looks = ('pid="5" p1="0" p2="1" p3="0"', 'pid="5" p1="1"', 'pid="6" p1="0"', "")
    text = model(COLORS + BASES + solid(1, *looks, given='pid="6" pindex="1"'))
    (part,) = parts_of(written(tmp_path, text)).values()
    assert part.mesh.colors is not None and part.material is not None
    red, green, grey = [1, 0, 0, 1], [0, 1, 0, 0.2], [0.21586, 0.21586, 0.21586, 1]
    blue = [0, 0, 1, 128 / 255]
    expected = [[red, green, red], [green] * 3, [grey] * 3, [blue] * 3]
    np.testing.assert_allclose(part.mesh.colors, expected, atol=1e-4)
    assert part.material.alpha_mode == "blend" and part.material.base_color == (1, 1, 1)


def test_an_object_of_one_material_has_it(tmp_path: Path) -> None:
    objects = solid(1, given='pid="6" pindex="1"') + solid(2, given='pid="6" pindex="0"') + solid(3)
    build = "".join(f'<item objectid="{number}"/>' for number in (1, 2, 3))
    parts = [*parts_of(written(tmp_path, model(BASES + objects, build))).values()]
    assert [part.material_name for part in parts] == ["glass", "steel", None]
    glass, steel = parts[0].material, parts[1].material
    assert glass is not None and steel is not None and parts[0].mesh.colors is None
    assert glass.base_color == (0, 0, 1) and glass.alpha == 128 / 255 and glass.alpha_mode == "blend"
    np.testing.assert_allclose(steel.base_color, [0.21586] * 3, atol=1e-4)
    # A scene knows materials by their names.
    twins = parts_of(written(tmp_path, model(BASES.replace("steel", "glass") + objects, build)))
    assert [part.material_name for part in twins.values()] == ["glass", "glass.2", None]


def test_mixtures_and_layers(tmp_path: Path) -> None:
    mixtures = (
        '<m:compositematerials id="11" matid="6" matindices="1 0 7"><m:composite values="1 3 9"/>'
        '</m:compositematerials><m:multiproperties id="12" pids="6 5 99"><m:multi pindices="0 1"/>'
        '<m:multi pindices="0"/><m:multi pindices="0 9"/></m:multiproperties>'
    )
    looks = ('pid="11" p1="0"', 'pid="12" p1="0"', 'pid="12" p1="1"', 'pid="12" p1="2"')
    path = written(tmp_path, model(COLORS + BASES + mixtures + solid(1, *looks)))
    (part,) = parts_of(path).values()
    assert part.mesh.colors is not None
    grey = 0.75 * 0.21586
    expected = [
        [grey, grey, grey + 0.25, 0.75 + 0.25 * 128 / 255],
        [0, 1, 0, 0.2],
        [1, 0, 0, 1],
        [0.8] * 3 + [1],
    ]
    np.testing.assert_allclose(part.mesh.colors[:, 0], expected, atol=1e-4)
    assert told(path) == []
    layers = "layers of properties 12 of /3D/3dmodel.model: only the topmost is used"
    assert told(path, Fate.CHANGED) == [layers]


def test_images(tmp_path: Path) -> None:
    stream = io.BytesIO()
    PIL.Image.new("RGB", (1, 1), (255, 0, 0)).save(stream, "PNG")
    resources = (
        '<m:texture2d id="7" path="/3D/red.png" tilestyleu="mirror" tilestylev="none"/>'
        '<m:texture2dgroup id="8" texid="7"><m:tex2coord u="0.25" v="0"/><m:tex2coord u="1" v="1"/>'
        "</m:texture2dgroup>"
        '<m:texture2d id="9" path="/3D/gone.png"/><m:texture2dgroup id="10" texid="9"/>'
    )
    looks = ('pid="8" p1="0" p2="1" p3="0"', 'pid="5" p1="0"', 'pid="10" p1="3"', 'pid="5" p1="1"')
    path = written(tmp_path, model(COLORS + resources + solid(1, *looks)), **{"red.png": stream.getvalue()})
    colored, shown, without = parts_of(path).values()
    assert shown.material is not None and shown.material.base_color_texture is not None
    texture = shown.material.base_color_texture
    assert texture.bitmap.pixels.tolist() == [[[255, 0, 0]]] and texture.wrap == ("mirror", "clamp")
    assert shown.mesh.uvs[0].tolist() == [[[0.25, 1], [1, 0], [0.25, 1]]]
    assert len(colored.mesh.faces) == 2 and colored.mesh.colors is not None and colored.mesh.uvs == ()
    assert without.material is None
    (lost,) = told(path)
    assert lost.startswith("image 9 of /3D/3dmodel.model: '/3D/gone.png' is not in the archive")
    assert told(path, Fate.CHANGED) == ["an image that ends at its edges: goes on with the colours there"]


def test_several_model_parts(tmp_path: Path) -> None:
    other = model(solid(4, given='name="far"'), "", 'unit="inch"')
    text = model("", '<item objectid="4" p:path="/3D/other.model"/>', 'unit="meter"')
    path = written(tmp_path, text, **{"other.model": other})
    (part,) = parts_of(path).values()
    assert part.mesh.source.geometry == "far"
    assert bounds(part) == [[0, 0, -1], [1, 1, 0]], "the unit is that of the root"


def test_what_is_not_read_is_told(tmp_path: Path) -> None:
    build = '<item objectid="1"/><item objectid="9"/><item objectid="1" transform="1 0 0 0 1 0 0 0 0 0 0 0"/>'
    group = '<m:multiproperties id="3" pids="1"><m:multi pindices="0"/></m:multiproperties><b:beam/>'
    path = written(tmp_path, model(group + solid(1, 'pid="3" p1="0"', "", "", ""), build))
    assert told(path) == [
        "1 element <beam> of /3D/3dmodel.model: nothing here is like them",
        "object 9 of /3D/3dmodel.model: is not in the file",
        "properties 3 of /3D/3dmodel.model: are no colours, materials or images",
        "object 'object 1': its placement flattens it",
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            model(solid()).replace("<model", "<!DOCTYPE a [<!ENTITY b 'b'>]><model"),
            "line 1: declares a document",
        ),
        (model(solid())[:-20], "3dmodel.model: is no XML, or damaged"),
        (model(solid()).replace(CORE, 'xmlns="http://example.org"'), "<model>: is no model of 3MF"),
        (
            model(solid(), given='requiredextensions="m b"'),
            "requires the extension 'http://example.org/beams', which",
        ),
        (model(solid(), given='unit="yard"'), "unit 'yard' is none of micron"),
        (model(solid()).replace(' x="1"', ""), "<vertex>: lacks 'x'"),
        (model(solid()).replace('x="1"', 'x="one"'), "<vertex>: has a number that is none"),
        (model(solid(), ""), "has no usable face"),
        (
            model(solid(), '<item objectid="1" transform="1 2 3"/>'),
            "transform '1 2 3' has not twelve numbers",
        ),
        (model(BASES.replace("#808080", "grey") + solid()), "colour 'grey' is not like #RRGGBB"),
        (
            model('<object id="1"><components><component objectid="1"/></components></object>'),
            "one of itself",
        ),
    ],
)
def test_damage_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        parts_of(written(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_a_small_file_that_builds_a_great_many(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "MOST_OBJECTS", 1000)
    double = "<components>{0}{0}</components>"
    objects = "".join(
        f'<object id="{i}">{double.format(f"<component objectid={chr(34)}{i - 1}{chr(34)}/>")}</object>'
        for i in range(2, 40)
    )
    path = written(tmp_path, model(solid() + objects, '<item objectid="39"/>'))
    with pytest.raises(InputError, match="builds more than 1,000 objects"):
        parts_of(path)


def test_what_an_archive_unpacks_to_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path, model(solid()) + " " * 3_000_000)
    with pytest.raises(InputError, match=r"'/3D/3dmodel.model' is too large for its archive"):
        parts_of(path)
    monkeypatch.setattr(package, "MOST_GROWTH", 3000)
    assert len(parts_of(path)) == 1
    for content, message in (
        (b"PK\3\4 no archive", "is no 3MF file"),
        (path.read_bytes()[:-99], "is no 3MF"),
    ):
        path.write_bytes(content)
        with pytest.raises(InputError, match=message):
            parts_of(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("_rels/.rels", RELATIONSHIPS.replace("3dmodel", "2dmodel"))
    with pytest.raises(InputError, match="names no model"):
        parts_of(path)


def test_a_damaged_file_is_closed_at_once(tmp_path: Path) -> None:
    """Though what was being read of it is held by the error."""
    path = tmp_path / "a.3mf"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("_rels/.rels", "<a><b>" + "x" * (3 << 20))
    with pytest.raises(InputError), package.Package(path) as damaged:
        damaged.model()
    assert damaged._file.closed
