"""Lights in scene files, in edit scripts, and in what `check` tells of a scene."""

from __future__ import annotations

import warnings
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from incpt.core.errors import InputError, InputWarning
from incpt.formats import registry, scene_save
from incpt.formats.edit_script import load_edits
from incpt.scene import summary
from incpt.scene.light import LARGEST_STRENGTH, Light
from incpt.scene.model import Scene
from incpt.scene.transform import Transform

LAMPS = """version = 1
[[lights]]
name = "window"
kind = "rectangle"
position = [0, 2, 1]
rotation = [-90, 0, 0]
size = [2, 1]
power = 40
color = [1, 0.9, 0.8]
camera_visible = false
[[lights]]
name = "sun"
kind = "sun"
irradiance = 800
"""


def load_text(folder: Path, text: str) -> Scene:
    path = folder / "a.toml"
    path.write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)
        return registry.load(path)


def test_a_scene_file_gives_the_lights_that_it_says(tmp_path: Path) -> None:
    scene = load_text(tmp_path, LAMPS)
    assert scene.lights == (
        Light("window", "rectangle", (0, 2, 1), (-90, 0, 0), color=(1, 0.9, 0.8), power=40, size=(2, 1),
              camera_visible=False),
        Light("sun", "sun", irradiance=800),
    )  # fmt: skip
    text = "\n".join(summary.describe(scene))
    assert "lights: 2 (1 sun, 1 rectangle)" in text and "no light" not in text
    assert "lights: 2 (1 sun, 1 rectangle), 1 hidden" in summary.describe(
        scene.with_light("sun", visible=False)
    )
    dark = scene.with_light("sun", visible=False).with_light("window", power=0)
    assert any("no light" in line for line in summary.describe(dark))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("version = 1\n[lights]\n", r"lights: is one table; write \[\[lights\]\] with double brackets"),
        ("version = 1\nlights = [3]\n", r"\[\[lights\]\] 1: is not a table"),
        (LAMPS.replace('kind = "sun"', ""), r".* 2 \(.sun.\): kind: is missing; choose one of point"),
        (LAMPS.replace('kind = "sun"', 'kind = "moon"'), r"\[\[lights\]\] 2 .*: kind: 'moon' is not known"),
        (LAMPS.replace('name = "sun"', ""), r"\[\[lights\]\] 2: name: is missing"),
        (LAMPS.replace("size", "sizes"), r"\[\[lights\]\] 1 .*: sizes: is no known key; did you mean 'size'"),
        (LAMPS.replace("irradiance", "power"), r".* 2 .*: power: a sun has none; give its irradiance"),
        (LAMPS.replace("power = 40", "power = nan"), r".* 1 .*: power: nan is not a finite number"),
        (LAMPS.replace('"sun"\nkind', '"window"\nkind'), "lights: two are named 'window'"),
    ],
)  # fmt: skip
def test_bad_lights_are_told_with_their_place(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=rf"a\.toml: {message}"):
        load_text(tmp_path, text)


def test_edits_of_lights(tmp_path: Path) -> None:
    scene = load_text(tmp_path, LAMPS)
    path = tmp_path / "edits.toml"
    path.write_text(
        "[[edits]]\nlight = 'window'\nradiance = 3\n[[edits]]\nlight = 'sun'\nrotation = [1, 2, 3]\n"
    )
    script = load_edits(path, scene)
    first, second = script.scenes(scene)
    assert first.light("window").strength == ("radiance", 3.0) and script[0].label == "window"
    assert second.light("sun").rotation == (1, 2, 3) and second.light("window") is first.light("window")
    for text, message in (
        ("light = 'moon'\npower = 1\n", "light 'moon' is not in the scene; it has sun, window"),
        ("light = 'sun'\nwatt = 1\n", "watt: is no known key of an edit of a light"),
        ("light = 'sun'\n", "changes nothing; give new values"),
        ("light = 'sun'\nobject = 'a'\nangle = 1\n", "has object and light; give one of object, "),
    ):  # fmt: skip
        path.write_text(f"[[edits]]\n{text}")
        with pytest.raises(InputError, match=message):
            load_edits(path, scene)


numbers = st.floats(-1e9, 1e9)
sizes = st.floats(1e-6, 1e9)
angles = st.floats(0, 180)
VALUES: dict[str, st.SearchStrategy[Any]] = {
    "name": st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=9),
    "kind": st.sampled_from(["point", "spot", "rectangle", "disk", "sphere"]),
    "transform": st.builds(
        Transform, *[st.tuples(numbers, numbers, numbers)] * 2, st.tuples(sizes, sizes, sizes)
    )
    | st.just(Transform.from_matrix([[1, 0.5, 0, 1], [0, 2, 0, 2], [0, 0, 1, 3]])),
    "color": st.tuples(*[st.floats(0, 1e9)] * 3),
    "radius": sizes,
    "size": st.tuples(sizes, sizes),
    "angle": angles,
    "spot_angle": st.floats(1e-3, 180),
    "spot_blend": st.floats(0, 1),
    "double_sided": st.booleans(),
    "visible": st.booleans(),
    "camera_visible": st.booleans(),
    "casts_shadows": st.booleans(),
}
strengths = st.floats(0, LARGEST_STRENGTH)


def test_files_are_tried_with_every_value_of_lights() -> None:
    assert {*VALUES, "power", "radiance", "irradiance"} == {field.name for field in fields(Light)}


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    lamp=st.builds(Light, power=strengths, **VALUES) | st.builds(Light, radiance=strengths, **VALUES),
    sun=st.builds(Light, irradiance=strengths, **{**VALUES, "kind": st.just("sun")}),
)
def test_any_lights_survive_a_file(tmp_path: Path, lamp: Light, sun: Light) -> None:
    lights = (lamp, sun) if lamp.name != sun.name else (lamp,)
    scene_save.save(Scene(lights=lights), tmp_path / "random.toml")
    assert load_text(tmp_path, (tmp_path / "random.toml").read_text()).lights == lights
