"""What of a scene file stands where: parameters, files, references, names of old versions; and what is
refused in one line."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.mitsuba_files import SENSOR, read, told, written

from incpt.core.errors import InputError
from incpt.formats import registry

RED = '<bsdf type="diffuse" id="red"><rgb name="reflectance" value=".5, .1 .1"/></bsdf>'


def test_parameters_take_the_longest_name(tmp_path: Path) -> None:
    scene, _ = read(
        tmp_path,
        '<default name="r" value="2"/><default name="red" value="0.$r"/><default name="r" value="9"/>'
        '<shape type="rectangle"><bsdf type="diffuse"><rgb name="reflectance" value="$red 0.$r1 0"/></bsdf>'
        "</shape>",
    )
    assert scene.materials["rectangle"].base_color == (0.2, 0.21, 0)


def test_given_parameters_take_the_place_of_defaults(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        '<default name="red" value="0.5"/><shape type="rectangle"><bsdf type="diffuse">'
        '<rgb name="reflectance" value="$red $green 0"/></bsdf></shape>',
    )
    given = {"red": "0.25", "green": "0.75", "blue": "1"}
    scene, report = registry.load_with_report(path, parameters=given)
    assert scene.materials["rectangle"].base_color == (0.25, 0.75, 0)
    assert told(report) == ["the parameter 'blue': nothing in the scene asks for it"]
    with pytest.raises(InputError, match="parameters: 3 is not a text"):
        registry.load(path, parameters={"red": 3})  # type: ignore[dict-item]


def test_references_by_ids_and_aliases(tmp_path: Path) -> None:
    scene, _ = read(
        tmp_path,
        f'<shape type="sphere"><ref name="bsdf" id="red"/></shape>{RED}<alias id="red" as="rouge"/>'
        '<shape type="cube"><ref id="rouge"/></shape>',
    )
    assert {one.material for one in scene.objects} == {"red"}
    assert scene.materials["red"].base_color == (0.5, 0.1, 0.1)


def test_files_are_included(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    written(tmp_path / "parts", f'{RED}<shape type="sphere"><ref id="red"/></shape>', name="balls.xml")
    (tmp_path / "parts" / "one.xml").write_text('<bsdf version="3.0.0" type="conductor"/>')
    scene, report = read(
        tmp_path,
        '<path value="parts"/><include filename="balls.xml"/>'
        '<shape type="cube"><include filename="one.xml"/></shape>',
    )
    assert [(one.name, scene.materials[one.material].metallic) for one in scene.objects] == [
        ("sphere", 0), ("cube", 1),
    ]  # fmt: skip
    assert report.is_whole


def test_old_versions_have_other_names(tmp_path: Path) -> None:
    body = """<shape type="sphere">
        <transform name="toWorld"><scale value="2"/><translate x="1"/></transform>
        <bsdf type="dielectric"><float name="intIOR" value="1.5"/><float name="extIOR" value="1"/></bsdf>
        </shape>
        <sensor type="perspective"><float name="fov" value="30"/><string name="fovAxis" value="y"/>
        <transform name="toWorld"><lookAt origin="0 0 9" target="0 0 0" up="0 1 0"/></transform></sensor>"""
    scene, report = read(tmp_path, body, "0.5.0")
    assert report.is_whole
    np.testing.assert_allclose(scene.objects[0].world_bounds, [[-1, -2, -2], [3, 2, 2]], atol=1e-3)
    assert scene.materials["sphere"].ior == 1.5 and scene.camera.fov_y == pytest.approx(30)
    left_out = told(read(tmp_path, body, "3.0.0".replace("3", "2"))[1])
    assert any("toWorld of sphere shape (line 2)" in text for text in left_out)


def test_what_nobody_has_read_is_told(tmp_path: Path) -> None:
    _, report = read(
        tmp_path,
        '<shape type="sphere">\n<float name="raduis" value="2"/><bsdf type="diffuse">\n'
        '<texture type="bitmap" name="reflectence"/></bsdf></shape>',
    )
    assert told(report) == [
        "raduis of sphere shape (line 2): not read",
        "reflectence of diffuse bsdf (line 3): not read",
    ]


SHAPE = '<shape type="sphere">{}</shape>'
WRONG = {
    '<shape type="sphere"': "line 3: is no XML",
    "<sphere/>": "line 2: <sphere> is no element of a scene",
    '<shape id="a"/>': "line 2: <shape> has no type",
    SHAPE.format('<ref id="red"/>'): "line 2: no object has the id 'red'",
    '<shape type="sphere" id="a"/><bsdf type="diffuse" id="a"/>': "id: 'a' is that of sphere shape 'a'",
    '<alias id="a" as="b"/>': "<alias>: 'a' is not the id",
    SHAPE.format('<float name="radius" value="x"/>'): "line 2: radius: 'x' is not a finite number",
    SHAPE.format('<float name="radius" value="nan"/>'): "line 2: radius: 'nan' is not a finite number",
    SHAPE.format('<string name="radius" value="1"/>'): "line 2: radius: is not a number",
    SHAPE.format('<float name="radius" value="$r"/>'): "line 2: the parameter $r has no value",
    SHAPE.format('<boolean name="flip_normals" value="1"/>'): "'1' is neither true nor false",
    SHAPE.format('<point name="center" value="1 2"/>'): "center: '1 2' holds 2 numbers",
    SHAPE.format('<float value="1"/>'): "line 2: <float> has no name",
    SHAPE.format('<float name="a" value="1"/>' * 2): "line 2: a: is given twice",
    SHAPE.format('<transform name="to_world"><turn/></transform>'): "<turn> is no step of a transform",
    SHAPE.format('<transform name="to_world"><rotate angle="9"/></transform>'): "<rotate> has no length",
    SHAPE.format('<transform name="to_world"><matrix value="1 2"/></transform>'): "write 9 or 16",
    '<bsdf type="mask" id="a"><ref id="a"/></bsdf><shape type="cube"><ref id="a"/></shape>': "part of itself",
    '<include filename="a.xml"/>': "includes itself",
    '<include filename="../b.xml"/>': "leads out of the folder",
    '<include filename="b.xml"/>': "b.xml: no such file",
    '<integrator type="path"><integer name="max_depth" value="x"/></integrator>':
        "max_depth: 'x' is not a whole number",
    SHAPE.format('<bsdf type="conductor"><string name="material" value="Xx"/></bsdf>'): "'Xx' is not known",
    SHAPE.format('<bsdf type="dielectric"><string name="int_ior" value="xx"/></bsdf>'): "int_ior: 'xx'",
    SHAPE.format('<bsdf type="twosided"/>'): "a twosided needs a <bsdf>",
    SHAPE.format('<bsdf type="diffuse"><spectrum name="reflectance" value="500:1, 400:1"/></bsdf>'):
        "do not ascend",
}  # fmt: skip


@pytest.mark.parametrize("body", WRONG)
def test_what_is_wrong_is_said_with_its_line(body: str, tmp_path: Path) -> None:
    path = written(tmp_path, body)
    with pytest.raises(InputError) as error:
        registry.load_with_report(path)
    text = str(error.value)
    assert text.startswith(f"{path}: ") and WRONG[body] in text and "\n" not in text
    assert "line" in text


def test_a_file_without_a_version_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text("<scene/>")
    with pytest.raises(InputError, match=r'line 1: version: .* write version="3\.0\.0"'):
        registry.load_with_report(tmp_path / "a.xml")


def test_entities_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(
        '<!DOCTYPE scene [<!ENTITY a SYSTEM "/etc/passwd">]>\n<scene version="3.0.0">&a;</scene>'
    )
    with pytest.raises(InputError, match="line 1: has a DOCTYPE"):
        registry.load_with_report(tmp_path / "a.xml")


def test_neither_parameters_nor_files_nor_objects_grow_without_bounds(tmp_path: Path) -> None:
    names = [f"p{i}" for i in range(60)]
    doubled = "".join(
        f'<default name="{name}x" value="${before}x${before}x"/>' for before, name in pairwise(names)
    )
    for body, message in (
        (f'<default name="p0x" value="xxxxxxxx"/>{doubled}', "longer than"),
        ("<a>" * 100 + "</a>" * 100, "within each other"),
        (f'<default name="a" value="1"/><default name="b" value="${"x" * 300_000}"/>', "has no value"),
        (
            "".join(f'<bsdf type="mask" id="b{i}"><ref id="b{i + 1}"/></bsdf>' for i in range(100))
            + '<bsdf type="diffuse" id="b100"/><shape type="sphere"><ref id="b0"/></shape>',
            "deep",
        ),
    ):
        with pytest.raises(InputError, match=message):
            read(tmp_path, body)
    for i in range(12):
        written(tmp_path, f'<include filename="i{i + 1}.xml"/>' * 2, name=f"i{i}.xml")
    written(tmp_path, "", name="i12.xml")
    with pytest.raises(InputError, match="more than 1000 files"):
        read(tmp_path, '<include filename="i0.xml"/>')


def test_files_elsewhere_need_leave(tmp_path: Path) -> None:
    (tmp_path / "scene").mkdir()
    written(tmp_path, '<shape type="sphere"/>', name="ball.xml")
    scene, _ = read(tmp_path / "scene", f'<include filename="../ball.xml"/>{SENSOR}', allow_outside=True)
    assert [one.name for one in scene.objects] == ["sphere"]
