"""Scene files that are saved over their own text: what a person wrote there stays."""

from __future__ import annotations

import difflib
import warnings
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from incpt.formats import registry, scene_save, toml_merge
from incpt.scene import edits
from incpt.scene.camera import Camera
from incpt.scene.light import Light
from incpt.scene.model import Scene
from incpt.scene.sky import Sky

TEXT = """# The kitchen, as of May.
version = 2

# from the door
[camera]
position = [0, 1.2, 5]      # eye height
target = [
    0, 1,   # the table
    0,
]

[environment]
intensity = 0.5  # dusk
color = [1, 1, 1]

[environment.sky]
sun_elevation = 20 # low

[render]
size = [64, 32]

# ---- materials ----

[materials.red]
base_color = [0.8, 0.1, 0.1]  # measured
# roughness = 0.3

[materials."old wood"]
roughness = 0.5  # the default, said all the same

# the one in front
[[objects]]
name = "cube"  # a die
shape = "cube"
material = "red"

# behind it
[[objects]]
name = "ball"
shape = "sphere"
material = "old wood"
position = [1, 0.5, -2]

[[lights]]
# over the table
name = "lamp"
kind = "point"
power = 40.0
position = [0, 2, 0]
# the end
"""


def saved(scene: Scene, tmp_path: Path, template: str = TEXT) -> str:
    """The text after saving, which holds the scene."""
    path = tmp_path / "saved.toml"
    scene_save.save(scene, path, template=template)
    assert registry.load(path) == scene
    return path.read_text()


def loaded(tmp_path: Path, text: str = TEXT) -> Scene:
    path = tmp_path / "loaded.toml"
    path.write_text(text)
    return registry.load(path)


def changed_lines(text: str, template: str = TEXT) -> list[str]:
    """Lines that went (-) and came (+)."""
    lines = difflib.unified_diff(template.splitlines(), text.splitlines(), lineterm="", n=0)
    return [line for line in lines if line[:3] not in ("---", "+++") and not line.startswith("@@")]


def test_a_scene_that_was_not_changed_keeps_its_text(tmp_path: Path) -> None:
    assert saved(loaded(tmp_path), tmp_path) == TEXT


def test_only_what_was_changed_is_written_anew(tmp_path: Path) -> None:
    scene = loaded(tmp_path)
    assert changed_lines(saved(scene.with_object("ball", position=(2, 0.5, -2)), tmp_path)) == [
        "-position = [1, 0.5, -2]",
        "+position = [2.0, 0.5, -2.0]",
    ]
    assert changed_lines(saved(scene.with_material("red", base_color=(0, 0, 1)), tmp_path)) == [
        "-base_color = [0.8, 0.1, 0.1]  # measured",
        "+base_color = [0.0, 0.0, 1.0]  # measured",
    ]
    assert changed_lines(saved(scene.with_environment(sky=Sky(30)), tmp_path)) == [
        "-sun_elevation = 20 # low",
        "+sun_elevation = 30.0 # low",
    ]
    assert changed_lines(saved(scene.with_object("cube", rotation=(0, 45, 0)), tmp_path)) == [
        "+rotation = [0.0, 45.0, 0.0]"
    ]
    assert changed_lines(saved(scene.with_material("red", roughness=0.25), tmp_path)) == ["+roughness = 0.25"]


def test_comments_go_with_what_they_stand_above(tmp_path: Path) -> None:
    text = saved(loaded(tmp_path).without_object("cube"), tmp_path)
    assert "# a die" not in text and "# the one in front" not in text
    assert '# behind it\n[[objects]]\nname = "ball"' in text and text.endswith("# the end\n")
    scene = edits.rename(loaded(tmp_path), "cube", "box")
    assert changed_lines(saved(scene, tmp_path)) == ['-name = "cube"  # a die', '+name = "box"  # a die']
    objects = tuple(reversed(loaded(tmp_path).objects))
    text = saved(replace(loaded(tmp_path), objects=objects), tmp_path)
    assert text.index("# behind it") < text.index('name = "ball"') < text.index('name = "cube"')


def test_new_things_stand_behind_those_of_their_kind(tmp_path: Path) -> None:
    scene = edits.add_shape(loaded(tmp_path), "plane")[0]
    scene = scene.with_material("new", metallic=1.0).with_added_light(Light("spot", "spot"))
    text = saved(scene, tmp_path)
    places = [text.index(part) for part in ("old wood", "[materials.new]", "# the one in front", '"ball"')]
    places += [text.index(part) for part in ('name = "plane"', 'name = "lamp"', "# the end", 'name = "spot"')]
    assert places == sorted(places)
    assert not [line for line in changed_lines(text) if line.startswith("-")]


def test_a_second_camera_leaves_the_first_as_it_is(tmp_path: Path) -> None:
    scene = edits.add_camera(loaded(tmp_path), Camera((1, 1, 1), (0, 0, 0)), "top")[0]
    text = saved(scene, tmp_path)
    assert "# from the door\n[camera]\nposition = [0, 1.2, 5]      # eye height" in text
    assert "[cameras.top]" in text and 'active_camera = "top"' in text


def test_tables_on_one_line_stay_so(tmp_path: Path) -> None:
    template = """version = 2
camera = { position = [0, 1, 5] } # near
objects = [
    { name = "a", shape = "cube", material = "red" }, # first
    { name = "b", shape = "cube", material = "red" },
]
[materials]
red = { base_color = [1, 0, 0] } # signal
blue = { base_color = [0, 0, 1] }
"""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = loaded(tmp_path, template)
        assert saved(scene, tmp_path, template).splitlines()[:9] == template.splitlines()
        text = saved(scene.with_material("blue", roughness=0.25), tmp_path, template)
        assert "# first" in text and "# signal" in text and "# near" in text
        assert "# near" in saved(scene.with_object("a", visible=False), tmp_path, template)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "nonsense = [",
        "[[objects]]\n[objects.x]\n",
        "version = 2\n[a.b.c]\n",
        "version.a = 2\ncamera.position.x = 1\nmaterials.red.base_color = [1, 1, 1]\n",
        "[environment]\ncolor.r = 1\nsky.air = 2\n",
    ],
)
def test_a_text_of_another_form_is_written_over(tmp_path: Path, text: str) -> None:
    assert saved(loaded(tmp_path), tmp_path, text)


EDITS = st.sampled_from(
    ["move", "hide", "add", "delete", "rename", "material", "purge", "light", "camera", "sky"]
)


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.lists(EDITS, min_size=1, max_size=6))
def test_whatever_is_edited_is_saved(tmp_path: Path, made: list[str]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene, text = loaded(tmp_path), TEXT
        for number, edit in enumerate(made):
            scene = edited(scene, edit, number)
            text = saved(scene, tmp_path, text)
        assert text.startswith("# The kitchen, as of May.\n")


def edited(scene: Scene, edit: str, number: int) -> Scene:
    last = scene.objects[-1].name if scene.objects else None
    if edit == "add" or last is None:
        return edits.add_shape(scene, "cube")[0]
    return {
        "move": lambda: scene.with_object(last, position=(number, 1, 2)),
        "hide": lambda: scene.with_object(last, visible=not scene.object(last).visible),
        "delete": lambda: scene.without_object(scene.objects[0].name),
        "rename": lambda: edits.rename(scene, last, f"thing {number}"),
        "material": lambda: edits.add_material(scene, "more [odd] # name")[0],
        "purge": lambda: edits.purge_materials(scene),
        "light": lambda: edits.add_light(scene, "spot")[0],
        "camera": lambda: edits.add_camera(scene, scene.camera)[0],
        "sky": lambda: scene.with_environment(sky=None if scene.environment.sky else Sky(number)),
    }[edit]()


def test_what_does_not_hold_the_scene_is_not_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever goes wrong with a form that nobody thought of costs comments, and nothing of the scene."""
    scene, complete = loaded(tmp_path), toml_merge._completed
    monkeypatch.setattr(toml_merge, "_completed", lambda *blocks: complete(*blocks)[:-1])
    assert "# the end" not in saved(scene, tmp_path)
