"""Every field of every panel, used as a user does: it changes exactly what it says and nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pytest
from support.parameters import A_TEXTURE, TEXTURES
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, changes, desk, places, state

from incpt.core.layout import TextureSlot
from incpt.formats import bitmaps
from incpt.picture import denoise
from incpt.picture.color import linear_from_srgb
from incpt.scene.material import Material
from incpt.scene.model import Scene
from incpt.scene.selection import Selection
from incpt.scene.sky import Sky
from incpt.ui.commands import files
from incpt.ui.dialogs.path_dialog import PathDialog
from incpt.ui.preferences import DisplaySettings, Preferences, SnapSettings
from incpt.viewer.renderer import Pin, Restart

SCENE = mixed_scene(size=(48, 32), strategy="spiral").with_material(
    "red", normal_texture=A_TEXTURE, clearcoat_normal_texture=A_TEXTURE, alpha_mode="mask", clearcoat=0.5,
    sheen_color=(0.5, 0.5, 0.5), anisotropy=0.5, iridescence=0.5, diffuse_transmission=0.5,
    clearcoat_roughness=0.5,
)  # fmt: skip
LENS = SCENE.with_camera(focal_length=35.0, f_stop=2.8, focus_distance=2.0, blades=5, near=0.1)
TALL = LENS.with_camera(sensor_fit="vertical")
PARALLEL = SCENE.with_camera(projection="orthographic").with_camera("top", position=(0, 9, 0.1))
SKIED = SCENE.with_environment(sky=Sky(20, sun_size=2, altitude=10, dust=2, ground=0.5))
PREFERENCES = Preferences(
    display=DisplaySettings(overlay="spp"), snap=SnapSettings(enabled=True), navigation="blender"
)
RED, GREEN, BLUE = 0.12, 0.40, 0.66
"""Where the components of a colour stand, of its width."""


@dataclass(frozen=True)
class Field:
    """A number: `place` is what changes, to `value` where `typed` is typed; `dragged` pixels to drag it."""

    panel: str
    label: str
    place: str
    typed: str
    value: float
    selected: str = "red cube"
    dragged: float = 30.0
    across: float = 0.5
    scene: Scene | None = None

    def __str__(self) -> str:
        return f"{self.panel}: {self.label} {self.place[-1]}"


def vector(panel: str, label: str, place: str, selected: str = "red cube", names: str = "XYZ") -> list[Field]:
    return [
        Field(panel, f"{label} {name}", f"{place}.{i}", "0.625", 0.625, selected)
        for i, name in enumerate(names)
    ]


def colour(panel: str, label: str, place: str, selected: str = "red cube") -> list[Field]:
    # Of the lamp and the sky the greatest components are full, so they are dragged down.
    return [
        Field(panel, label, f"{place}.{i}", "0.25", float(linear_from_srgb(0.25)), selected, -30.0, across)
        for i, across in enumerate((RED, GREEN, BLUE))
    ]


CUBE, BALL, LAMP = "scene.objects.red cube", "glass ball", "lamp"
FIELDS = [
    *vector("Object", "Position", f"{CUBE}.position"),
    *vector("Object", "Rotation", f"{CUBE}.rotation"),
    *vector("Object", "Scale", f"{CUBE}.scale"),
    *colour("Object", "Base colour", "scene.materials.red.base_color"),
    Field("Object", "Metallic", "scene.materials.red.metallic", "0.25", 0.25),
    Field("Object", "Roughness", "scene.materials.red.roughness", "0.25", 0.25, dragged=-30),
    Field("Object", "Specular", "scene.materials.red.specular", "0.25", 0.25, dragged=-30),
    Field("Object", "IOR", "scene.materials.red.ior", "2.5", 2.5),
    Field("Object", "Transmission", "scene.materials.glass.transmission", "0.5", 0.5, BALL, -30),
    *vector("Object", "Absorption", "scene.materials.glass.absorption", BALL, "RGB"),
    Field("Object", "Priority", "scene.materials.glass.priority", "7", 7, BALL, 60),
    Field("Object", "Alpha", "scene.materials.red.alpha", "0.25", 0.25, dragged=-30),
    Field("Object", "Cutoff", "scene.materials.red.alpha_cutoff", "0.25", 0.25),
    Field("Object", "Normal strength", "scene.materials.red.normal_scale", "0.5", 0.5),
    Field("Object", "Bump height", "scene.materials.red.bump_scale", "0.5", 0.5),
    Field("Object", "Coat strength", "scene.materials.red.clearcoat_normal_scale", "0.5", 0.5),
    *colour("Object", "Specular tint", "scene.materials.red.specular_color"),
    Field("Object", "Clearcoat", "scene.materials.red.clearcoat", "0.25", 0.25),
    Field("Object", "Coat roughness", "scene.materials.red.clearcoat_roughness", "0.25", 0.25),
    *colour("Object", "Sheen", "scene.materials.red.sheen_color"),
    Field("Object", "Sheen rough", "scene.materials.red.sheen_roughness", "0.25", 0.25),
    Field("Object", "Anisotropy", "scene.materials.red.anisotropy", "0.25", 0.25),
    Field("Object", "Direction", "scene.materials.red.anisotropy_rotation", "45", 45),
    Field("Object", "Iridescence", "scene.materials.red.iridescence", "0.25", 0.25),
    Field("Object", "Film IOR", "scene.materials.red.iridescence_ior", "1.5", 1.5),
    Field("Object", "Thickness", "scene.materials.red.iridescence_thickness", "250", 250),
    Field("Object", "Least thickness", "scene.materials.red.iridescence_least_thickness", "50", 50),
    Field("Object", "Translucency", "scene.materials.red.diffuse_transmission", "0.25", 0.25),
    *colour("Object", "Through colour", "scene.materials.red.diffuse_transmission_color"),
    Field("Object", "Dispersion", "scene.materials.glass.dispersion", "0.5", 0.5, BALL),
    *vector("Scene", "Camera", "scene.camera.position"),
    *vector("Scene", "Target", "scene.camera.target"),
    Field("Scene", "Field of view", "scene.camera.fov_y", "60", 60),
    Field("Scene", "Shift X", "scene.camera.shift_x", "0.25", 0.25),
    Field("Scene", "Shift Y", "scene.camera.shift_y", "-0.25", -0.25),
    Field("Scene", "Near", "scene.camera.near", "0.25", 0.25),
    Field("Scene", "Focal length", "scene.camera.focal_length", "50", 50, scene=LENS),
    Field("Scene", "Sensor", "scene.camera.sensor_width", "24", 24, scene=LENS),
    Field("Scene", "Sensor", "scene.camera.sensor_height", "18", 18, scene=TALL),
    Field("Scene", "F-stop", "scene.camera.f_stop", "1.4", 1.4, scene=LENS),
    Field("Scene", "Focus distance", "scene.camera.focus_distance", "3.5", 3.5, scene=LENS),
    Field("Scene", "Blades", "scene.camera.blades", "7", 7, scene=LENS, dragged=60),
    Field("Scene", "Blade turn", "scene.camera.blade_rotation", "-15", -15, scene=LENS),
    Field("Scene", "View height", "scene.camera.ortho_height", "3.5", 3.5, scene=PARALLEL),
    *colour("Scene", "Colour", "scene.environment.color"),
    Field("Scene", "Intensity", "scene.environment.intensity", "2.5", 2.5),
    Field("Scene", "Turn", "scene.environment.rotation_y", "-90", -90),
    *(
        Field("Scene", label, f"scene.environment.sky.{place}", "0.75", 0.75, dragged=30, scene=SKIED)
        for label, place in (
            ("Sun size", "sun_size"),
            ("Sun strength", "sun_intensity"),
            ("Air", "air"),
            ("Dust", "dust"),
            ("Ozone", "ozone"),
            ("Ground", "ground"),
        )
    ),
    Field("Scene", "Sun elevation", "scene.environment.sky.sun_elevation", "-2.5", -2.5, scene=SKIED),
    Field("Scene", "Altitude", "scene.environment.sky.altitude", "1500", 1500, scene=SKIED),
    Field("Render", "NoR", "scene.settings.nor", "64", 64, dragged=60),
    Field("Render", "Base NoR", "scene.settings.base_nor", "4", 4, dragged=60),
    Field("Render", "Sample rate", "scene.settings.sample_rate", "4", 4, dragged=60),
    Field("Render", "Bounces", "scene.settings.max_bounces", "9", 9, dragged=60),
    Field("Render", "Glass bounces", "scene.settings.transmission_bounces", "3", 3, dragged=60),
    Field("Render", "Clamp indirect", "scene.settings.clamp_indirect", "2.5", 2.5),
    Field("Render", "Texture limit", "scene.settings.texture_limit", "2048", 2048, dragged=60),
    Field("Render", "Seed", "scene.settings.seed", "12345", 12345, dragged=60),
    Field("Render", "Width", "scene.settings.size.0", "100", 100, dragged=60),
    Field("Render", "Height", "scene.settings.size.1", "70", 70, dragged=60),
    Field("Render", "Target spp", "control.target_spp", "128", 128),
    Field("Render", "Resolution", "preferences.resolution_scale", "50", 0.5),
    Field("Render", "Step time", "preferences.step_ms", "20", 20),
    Field("Render", "NoR in a drag", "preferences.drag_nor", "32", 32, dragged=60),
    Field("Method", "Exposure", "preferences.display.exposure", "-1.5", -1.5),
    Field("Method", "Opacity", "preferences.display.overlay_opacity", "0.25", 0.25),
    Field("Object", "Step of moves", "preferences.snap.move_m", "0.5", 0.5),
    Field("Object", "Step of turns", "preferences.snap.rotate_deg", "45", 45),
    Field("Object", "Step of scale", "preferences.snap.scale", "0.5", 0.5),
]

CHOICES = [
    ("Object", "Material", "Glass", "glass", f"{CUBE}.material"),
    ("Object", "Alpha mode", "Blend", "blend", "scene.materials.red.alpha_mode"),
    ("Object", "Gizmo", "Rotate", "rotate", "tool.operation"),
    ("Object", "Axes", "The object's axes", "local", "tool.space"),
    ("Object", "Snap to", "Vertices", "vertex", "preferences.snap.target"),
    ("Object", "Pivot", "Own origins", "individual", "tool.pivot"),
    ("Render", "Strategy", "Restart", "restart", "scene.settings.strategy"),
    ("Render", "Strategy", "Impact", "impact", "scene.settings.strategy"),
    ("Render", "Tile size", "32 × 32", 32, "scene.settings.tile_size"),
    ("Method", "Shading", "Solid", "solid", "preferences.display.shading"),
    ("Method", "Curve", "Filmic", "filmic", "preferences.display.curve"),
    ("Method", "Overlay", "Normals", "normals", "preferences.display.overlay"),
]

CHECKBOXES = [
    ("Object", "Double sided", "scene.materials.lamp.double_sided"),
    ("Object", "Unlit", "scene.materials.lamp.unlit"),
    ("Object", "Thin walled", "scene.materials.lamp.thin_walled"),
    ("Object", "Snap", "preferences.snap.enabled"),
    ("Render", "NoR adapts", "scene.settings.nor_adapts"),
    ("Render", "Transparent", "scene.settings.transparent"),
    ("Method", "Denoise", "preferences.display.denoise"),
    ("Method", "Tile grid", "preferences.display.tile_grid"),
    ("Method", "Outline", "preferences.display.outline"),
    ("Method", "Floor grid", "preferences.display.floor_grid"),
    ("Method", "Axes", "preferences.display.axes"),
    ("Method", "Split view", "preferences.display.split"),
]

BUTTONS = [
    ("Object", "Position", {f"{CUBE}.position.1"}),
    ("Object", "Rotation", {f"{CUBE}.rotation.1"}),
    ("Object", "Scale", {f"scene.objects.floor.scale.{i}" for i in (0, 2)}),
    ("Object", "Rename…##material", {"dialog"}),
    ("Object", "Delete##material", {"dialog"}),
    *(("Object", f"Choose…##{name}", {"dialog"}) for name in TEXTURES),
    ("Scene", "Remove##image", {"scene.environment.image"}),
    ("Scene", "Choose…##image", {"dialog"}),
    ("Render", "Pause", {"control.paused"}),
    ("Render", "Restart", set()),
]

SECTIONS = {
    "Views",
    "Transform",
    "Gizmo",
    "Material",
    "Textures",
    "Cut-out",
    "Transmission",
    "Emission",
    "Camera",
    "Environment",
}
SECTIONS |= {"Settings of the scene", "Display", "Measurements"}
SHOWN_ONLY = {"Image", "Step time plot", "Device"}
SHOWN_ONLY |= {"Textures"}
MAPPED = ("normal_texture", "clearcoat_normal_texture")
NOT_AT_FIRST = {f"Remove##{name}" for name in TEXTURES if name not in MAPPED}
"""Buttons that have nothing to do."""
ELSEWHERE = {
    "Name", "Uniform scale", "Emission colour", "Emission strength", "New##material", "Duplicate##material",
    "Frame selected##camera", "Reset##camera", "Pin this picture", "Remove##normal_texture",
    "Remove##clearcoat_normal_texture", "Active camera", "New from view##camera",
    "Rename…##camera", "Delete##camera", "Lens", "Sensor fit", "Projection", "Depth of field",
    "Focus on selected##camera", "Sky", "Sun disc", "Look through##camera", "Camera to view##camera",
    "Lock to view",
}  # fmt: skip
"""Tested below, one by one."""


def test_every_parameter_of_a_material_has_a_row() -> None:
    used = [field.place for field in FIELDS] + [place for _, _, place in CHECKBOXES]
    used += [place for _, _, _, _, place in CHOICES]
    material = {place.split(".")[3] for place in used if place.startswith("scene.materials.")}
    # Emission has two widgets of its own, tested below.
    assert material | {"emission", *TEXTURES} == {field.name for field in fields(Material)}
    buttons = {label.partition("##")[2] for _, label, _ in BUTTONS}
    assert buttons >= set(TEXTURES)
    assert "emission" not in material and {"Emission colour", "Emission strength"} <= ELSEWHERE


@pytest.fixture
def user(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    monkeypatch.setattr(denoise, "is_available", lambda: True)
    field = getattr(request.node, "callspec", None) and request.node.callspec.params.get("field")
    with desk(getattr(field, "scene", None) or SCENE, PREFERENCES) as made:
        made.editor.select(Selection(("red cube",)))
        made.frames(2)
        yield made


def turn_to(user: Desk, panel: str, selected: str = "red cube") -> None:
    user.panel(panel)
    user.editor.select(Selection((selected,)))
    user.frames(2)
    if panel == "Object":
        if not user.shows("Axes"):
            user.click("Gizmo")
        for section, field in (("Transmission", "Priority"), ("Emission", "Double sided")):
            if not user.shows(field):
                user.click(section)
        if user.shows("Uniform scale") and user.editor.tool.is_uniform:
            user.click("Uniform scale")


def is_scene(place: str) -> bool:
    return place.startswith("scene.")


def assert_one_edit(user: Desk, before: Scene) -> None:
    """The change is one entry of the history, and undo and redo lead from one to the other."""
    after = user.scene
    assert user.undo_count == 1
    user.key("Ctrl+Z")
    assert user.scene == before and user.null.views[-1].scene == before
    user.key("Ctrl+Shift+Z")
    assert user.scene == after and user.null.views[-1].scene == after


@pytest.mark.slow
@pytest.mark.parametrize("field", FIELDS, ids=str)
def test_a_number_is_typed(user: Desk, field: Field) -> None:
    turn_to(user, field.panel, field.selected)
    before, scene = state(user.editor), user.scene
    user.type(field.label, field.typed, across=field.across)
    after = state(user.editor)
    assert changes(before, after) == {field.place}
    assert after[field.place] == pytest.approx(field.value, rel=1e-6)
    if is_scene(field.place):
        assert_one_edit(user, scene)
    else:
        assert user.scene is scene and user.undo_count == 0


@pytest.mark.slow
@pytest.mark.parametrize("field", FIELDS, ids=str)
def test_a_number_is_dragged(user: Desk, field: Field) -> None:
    turn_to(user, field.panel, field.selected)
    before, scene = state(user.editor), user.scene
    user.hold_at(user.place(field.label, field.across), (field.dragged, 0.0))
    during = state(user.editor)
    assert changes(before, during) == {field.place}
    assert (during[field.place] > (before[field.place] or 0)) == (field.dragged > 0)
    if is_scene(field.place):
        assert user.editor.view.before == scene
    user.release()
    user.frame()
    assert user.editor.view.before is None and changes(during, state(user.editor)) == set()
    if is_scene(field.place):
        assert_one_edit(user, scene)
    else:
        assert user.scene is scene and user.undo_count == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    "field", [f for f in FIELDS if is_scene(f.place) and f.across in (0.5, RED)], ids=str
)
def test_a_drag_is_given_up_by_escape(user: Desk, field: Field) -> None:
    turn_to(user, field.panel, field.selected)
    before, scene, (x, y) = state(user.editor), user.scene, user.place(field.label, field.across)
    user.hold_at((x, y), (field.dragged, 0.0))
    assert user.scene != scene
    user.key("Escape")
    assert changes(before, state(user.editor)) == set()
    user.move(x + 2 * field.dragged, y)
    user.move(x + 3 * field.dragged, y)
    user.release()
    user.frames(2)
    assert changes(before, state(user.editor)) == set() and user.undo_count == 0


@pytest.mark.slow
@pytest.mark.parametrize("field", FIELDS, ids=str)
def test_typing_is_given_up_by_escape(user: Desk, field: Field) -> None:
    turn_to(user, field.panel, field.selected)
    before = state(user.editor)
    user.type(field.label, field.typed, end="Escape", across=field.across)
    assert changes(before, state(user.editor)) == set() and user.undo_count == 0


@pytest.mark.slow
@pytest.mark.parametrize("typed", ["nan", "inf", "-inf", "abc", "--", "", "."])
@pytest.mark.parametrize("field", FIELDS[:2] + FIELDS[-8:], ids=str)
def test_what_is_no_number_changes_nothing(user: Desk, field: Field, typed: str) -> None:
    turn_to(user, field.panel, field.selected)
    before = state(user.editor)
    user.type(field.label, typed, across=field.across)
    is_remarked = typed in ("nan", "inf", "-inf") and not isinstance(before[field.place], int)
    assert changes(before, state(user.editor)) == ({"notices"} if is_remarked else set())
    assert user.undo_count == 0


@pytest.mark.slow
@pytest.mark.parametrize("typed", ["1e999", "-1e999", "-1e12", "1e12"])
@pytest.mark.parametrize(
    "field",
    [
        f
        for f in FIELDS
        if f.panel in ("Object", "Scene") and is_scene(f.place) and f.label not in ("Priority", "Blades")
    ],
    ids=str,
)
def test_a_number_out_of_range_is_refused_with_a_remark(user: Desk, field: Field, typed: str) -> None:
    turn_to(user, field.panel, field.selected)
    before = state(user.editor)
    user.type(field.label, typed, across=field.across)
    after = state(user.editor)
    assert changes(before, after) == {"notices"} and user.undo_count == 0
    (remark,) = after["notices"]
    assert remark.startswith(f"{field.label}: "), "as the panel calls it"
    user.rest(1.0)
    assert user.texts() == [remark]  # long enough to be read
    user.rest(30.0)
    assert user.texts() == []


@pytest.mark.parametrize(
    ("label", "typed"), [("Scale X", "0"), ("Roughness", "1.01"), ("Metallic", "-0.01"), ("IOR", "0.9")]
)
def test_just_outside_is_outside(user: Desk, label: str, typed: str) -> None:
    turn_to(user, "Object")
    before = state(user.editor)
    user.type(label, typed)
    assert changes(before, state(user.editor)) == {"notices"}


@pytest.mark.parametrize("typed", ["1e999", "-1e999", "99999999999", "-99999999999"])
@pytest.mark.parametrize("field", [f for f in FIELDS if f.panel in ("Render", "Method")], ids=str)
def test_settings_stay_in_their_range(user: Desk, field: Field, typed: str) -> None:
    turn_to(user, field.panel, field.selected)
    before = state(user.editor)
    user.type(field.label, typed, across=field.across)
    changed = changes(before, state(user.editor))
    if before[field.place] is None or isinstance(before[field.place], int):
        # Brought into its range: scene and preferences refuse to be made with another value.
        # What is beyond the bounds of the field is said.
        assert changed <= {field.place, "notices"}
    else:
        assert changed == {"notices"}


@pytest.mark.parametrize(("panel", "label", "text", "value", "place"), CHOICES)
def test_a_choice_is_made(user: Desk, panel: str, label: str, text: str, value: object, place: str) -> None:
    turn_to(user, panel)
    before, scene = state(user.editor), user.scene
    user.choose(label, text if label != "Material" else "glass")
    after = state(user.editor)
    assert changes(before, after) == {place} and after[place] == value
    if is_scene(place):
        assert_one_edit(user, scene)
    else:
        assert user.scene is scene and user.undo_count == 0


@pytest.mark.parametrize(("panel", "label", "place"), CHECKBOXES)
def test_a_box_is_checked(user: Desk, panel: str, label: str, place: str) -> None:
    turn_to(user, panel, "lamp")
    before, scene = state(user.editor), user.scene
    user.click(label)
    after = state(user.editor)
    assert changes(before, after) == {place} and after[place] is not before[place]
    if is_scene(place):
        assert_one_edit(user, scene)
    user.click(label)
    assert changes(before, state(user.editor)) == set()


@pytest.mark.parametrize(("panel", "label", "changed"), BUTTONS)
def test_a_button_does_one_thing(user: Desk, panel: str, label: str, changed: set[str]) -> None:
    turn_to(user, panel, "floor" if label == "Scale" else "red cube")
    before, scene = state(user.editor), user.scene
    user.click(label)
    assert changes(before, state(user.editor)) == changed
    if any(map(is_scene, changed)):
        assert_one_edit(user, scene)
    assert [type(r) for r in user.null.requests] == ([Restart] if label == "Restart" else [])


def test_every_widget_of_the_panels_is_tested(user: Desk) -> None:
    tested = {f.label for f in FIELDS} | {label for _, label, *_ in (*CHOICES, *CHECKBOXES, *BUTTONS)}
    shown: set[str] = set()
    for panel, selected, scene in (
        ("Object", "red cube", SCENE), ("Object", "glass ball", SCENE), ("Object", "lamp", SCENE),
        ("Scene", "lamp", SCENE), ("Scene", "lamp", LENS), ("Scene", "lamp", PARALLEL),
        ("Scene", "lamp", SKIED),
        ("Render", "lamp", SCENE), ("Method", "lamp", SCENE),
    ):  # fmt: skip
        user.editor.propose(scene, "Scene")
        turn_to(user, panel, selected)
        shown |= {
            name
            for name in places.names()
            if not name.startswith(("menu ", "object ", "visible ", "slot ", "thumbnail ", "axis "))
            and name not in ("Search", "status", "picture", "gizmo")
        }
    assert shown - tested - SECTIONS - SHOWN_ONLY - NOT_AT_FIRST == ELSEWHERE
    assert tested - shown == set()


# --------------------------------------------------------------------------------- what is special in some


def test_a_texture_is_taken_away(user: Desk) -> None:
    turn_to(user, "Object")
    scene = user.scene
    user.click("Remove##normal_texture")
    assert user.scene == scene.with_material("red", normal_texture=None)
    assert_one_edit(user, scene)


def test_an_image_is_chosen_for_a_texture(user: Desk, tmp_path: Path) -> None:
    """An emission that is black would hide it."""
    bitmaps.write_bitmap(tmp_path / "sign.png", A_TEXTURE.bitmap)
    files.choose_texture(user.editor, "red", TextureSlot.EMISSION)
    dialog = user.editor.dialog
    assert isinstance(dialog, PathDialog)
    dialog.then(tmp_path / "sign.png")
    user.frames(2)
    red = user.scene.materials["red"]
    assert red.emission_texture is not None and red.emission == (1, 1, 1)
    np.testing.assert_array_equal(red.emission_texture.bitmap.pixels, A_TEXTURE.bitmap.pixels)


@pytest.mark.parametrize("strategy", ["restart", "impact"])
def test_repetitions_are_not_asked_for_where_they_mean_nothing(user: Desk, strategy: str) -> None:
    turn_to(user, "Render", "lamp")
    user.choose("Strategy", strategy.capitalize())
    before = state(user.editor)
    for label in ("NoR", "NoR in a drag"):
        user.drag(label, 60)
    assert changes(before, state(user.editor)) == set()
    user.drag("Base NoR", 60)
    assert changes(before, state(user.editor)) == {"scene.settings.base_nor"}


def test_a_uniform_scale_keeps_proportions(user: Desk) -> None:
    user.editor.select(Selection(("floor",)))
    user.frames(2)
    assert user.scene.object("floor").scale == (8, 1, 8)
    user.type("Scale Y", "0.5")
    assert user.scene.object("floor").scale == (4, 0.5, 4)
    user.drag("Scale Y", 30)
    x, y, z = user.scene.object("floor").scale
    assert y > 0.5 and (x, z) == pytest.approx((8 * y, 8 * y))
    user.click("Uniform scale")
    user.type("Scale Y", "3")
    assert user.scene.object("floor").scale == (x, 3, z) and user.undo_count == 3


def test_a_radiance_is_a_colour_and_a_strength(user: Desk) -> None:
    user.editor.select(Selection(("lamp",)))
    user.frames(2)
    before, scene = state(user.editor), user.scene
    user.type("Emission strength", "24")
    places_of = {f"scene.materials.lamp.emission.{i}" for i in range(3)}
    assert changes(before, state(user.editor)) == places_of
    assert user.scene.materials["lamp"].emission == pytest.approx((24, 22, 20))
    user.type("Emission colour", "0.735357", across=BLUE)  # in sRGB: 0.5
    assert user.scene.materials["lamp"].emission == pytest.approx((24, 22, 12))
    user.drag("Emission strength", 30)
    r, g, b = user.scene.materials["lamp"].emission
    assert r > 24 and (g / r, b / r) == pytest.approx((22 / 24, 0.5)) and user.undo_count == 3
    for _ in range(3):
        user.key("Ctrl+Z")
    assert user.scene == scene
    user.type("Emission strength", "1e999")
    assert user.scene is scene and user.texts()[0].startswith("Emission strength: ")
    user.type("Emission strength", "-3")
    assert user.scene == scene


def test_tabbing_makes_two_entries(user: Desk) -> None:
    user.open_field("Position X")
    user.key("Ctrl+A")
    user.write("2.5")
    assert user.scene == SCENE  # before it is ended
    user.key("Tab")
    assert user.scene.object("red cube").position == (2.5, 0.5, 0)
    user.key("Ctrl+A")
    user.write("1.25")
    user.key("Enter")
    assert user.scene.object("red cube").position == (2.5, 1.25, 0) and user.undo_count == 2
    user.key("Ctrl+Z")
    assert user.scene.object("red cube").position == (2.5, 0.5, 0)


def test_typing_ends_by_a_click_elsewhere(user: Desk) -> None:
    user.open_field("Position X")
    user.key("Ctrl+A")
    user.write("2.5")
    user.click("Position Z")
    assert user.scene.object("red cube").position == (2.5, 0.5, 0) and user.undo_count == 1


def test_letters_that_are_typed_are_no_commands(user: Desk) -> None:
    before = state(user.editor)
    user.open_field("Position X")
    for keys in ("G", "R", "S", "A", "H", "Delete", "F6"):
        user.key(keys)
    user.key("Escape")
    assert changes(before, state(user.editor)) == set()


def test_two_drags_of_one_field_are_two_entries(user: Desk) -> None:
    user.drag("Position X", 30)
    user.drag("Position X", 30)
    user.drag("Position Y", 30)
    assert user.undo_count == 3


def test_a_drag_back_to_the_start_is_no_entry(user: Desk) -> None:
    x, y = user.place("Position X")
    user.hold_at((x, y), (40, 0))
    user.move(x, y)
    user.release()
    user.frame()
    assert user.scene == SCENE and user.undo_count == 0


def test_undo_in_a_drag_ends_it(user: Desk) -> None:
    x, y = user.place("Position X")
    user.hold_at((x, y), (40, 0))
    user.key("Ctrl+Z")
    assert user.scene == SCENE
    user.move(x + 90, y)
    user.release()
    user.frame()
    assert user.scene == SCENE


def test_the_name_is_typed(user: Desk) -> None:
    before = state(user.editor)
    user.type("Name", "  a   cube ")
    assert user.editor.selection.names == ("a cube",) and user.undo_count == 1
    assert user.scene.object("a cube") == replace(SCENE.object("red cube"), name="a cube")
    user.key("Ctrl+Z")
    assert changes(before, state(user.editor)) == set()
    for name, said in (("lamp", "taken"), ("  ", "empty")):
        user.type("Name", name)
        assert user.scene == SCENE and said in user.texts()[-1]
    user.type("Name", "grün")
    assert user.editor.selection.names == ("grün",)


def test_materials_of_the_selection(user: Desk) -> None:
    user.editor.select(Selection(("lamp", "red cube")))
    user.frames(2)
    user.click("New##material")
    assert {user.scene.object(n).material for n in ("lamp", "red cube")} == {"material"}
    user.choose("Material", "glass")
    assert {user.scene.object(n).material for n in ("lamp", "red cube")} == {"glass"}
    user.click("Duplicate##material")
    assert user.scene.materials["glass.001"] == SCENE.materials["glass"]
    assert user.scene.object("red cube").material == "glass.001" and user.undo_count == 3
    assert user.scene.object("glass ball").material == "glass"
    user.type("Roughness", "0.5")
    assert user.scene.materials["glass"] == SCENE.materials["glass"]
    user.click("Delete##material")
    user.key("Escape")
    assert "glass.001" in user.scene.materials and user.editor.dialog is None
    while user.editor.document.history.can_undo:
        user.key("Ctrl+Z")
    assert user.scene == SCENE


def test_a_material_is_renamed(user: Desk) -> None:
    user.click("Rename…##material")
    user.key("Ctrl+A")
    user.write("paint")
    user.key("Enter")
    assert user.editor.dialog is None and user.scene.object("red cube").material == "paint"
    assert user.scene.materials["paint"] == SCENE.materials["red"] and "red" not in user.scene.materials


def test_camera_buttons(user: Desk) -> None:
    turn_to(user, "Scene")
    user.click("Frame selected##camera")
    assert user.editor.shown.camera.target == pytest.approx((0, 0.5, 0)) and user.scene is SCENE
    user.click("Look through##camera")
    assert user.editor.shown is SCENE
    user.click("Frame selected##camera")
    user.click("Camera to view##camera")
    assert user.scene.camera.target == pytest.approx((0, 0.5, 0)) and not user.editor.viewing.is_free
    user.type("Field of view", "70")
    user.click("Reset##camera")
    assert user.scene == SCENE and user.undo_count == 3
    user.click("Lock to view")
    assert user.editor.viewing.is_locked and user.undo_count == 3


def test_a_number_that_no_widget_offers_stays(user: Desk) -> None:
    settings = replace(SCENE.settings, seed=(1 << 32) - 1, base_nor=1 << 16, sample_rate=4096, tile_size=24)
    scene = replace(SCENE, settings=settings)
    user.editor.propose(scene, "x")
    turn_to(user, "Render")
    assert user.scene == scene
    user.type("Bounces", "1")
    assert user.scene.settings == replace(settings, max_bounces=1)


def test_a_resolution_that_a_percentage_would_round_stays(user: Desk) -> None:
    scale = next(i / 1000 for i in range(50, 4000) if i / 1000 * 100 / 100 != i / 1000)
    user.editor.preferences = replace(user.editor.preferences, resolution_scale=scale)
    turn_to(user, "Render")
    user.click("Pause")
    assert user.editor.preferences.resolution_scale == scale and user.editor.control.paused


def test_pinning_asks_the_renderer(user: Desk) -> None:
    turn_to(user, "Method")
    user.click("Pin this picture")
    assert not user.editor.rendering.is_pinned and user.null.requests == []  # there is no picture yet
    user.run("Pin reference")
    assert user.null.requests == [] and Pin(True) not in user.null.requests


def test_the_field_of_view_is_said_in_two_ways(user: Desk) -> None:
    turn_to(user, "Scene")
    before, scene = state(user.editor), user.scene
    width, height = scene.settings.size
    user.choose("Lens", "Focal length")
    camera = user.scene.camera
    assert camera.focal_length > 0 and camera.fov_y_at(width / height) == pytest.approx(scene.camera.fov_y)
    assert changes(before, state(user.editor)) == {"scene.camera.focal_length"}
    assert user.shows("Sensor") and not user.shows("Field of view")
    user.choose("Sensor fit", "Height")
    assert user.scene.camera == replace(camera, sensor_fit="vertical")
    user.type("Focal length", "50")
    camera = user.scene.camera
    user.type("Focal length", "0")  # which would stand for the angle
    assert user.scene.camera == camera and camera.focal_length == 50
    user.choose("Lens", "Angle")
    assert user.scene.camera.focal_length == 0
    assert user.scene.camera.fov_y == pytest.approx(camera.fov_y_at(width / height))
    assert user.undo_count == 4


def test_another_projection_keeps_the_size_of_the_target(user: Desk) -> None:
    turn_to(user, "Scene")
    scene = user.scene
    width, height = scene.settings.size
    user.choose("Projection", "Orthographic")
    camera = user.scene.camera
    right, up, _ = scene.camera.image_plane(width / height)
    point = np.array(scene.camera.target) + 0.3 * (right + up)
    for place in (camera.target, point):
        seen = [c.project(np.array([place]), width / height)[0] for c in (camera, scene.camera)]
        assert seen[0][0] == pytest.approx(seen[1][0], abs=1e-6)
    assert_one_edit(user, scene)
    user.choose("Projection", "Perspective")
    assert user.scene.camera == replace(scene.camera, ortho_height=camera.ortho_height)


def test_depth_of_field_is_opened_and_focused(user: Desk) -> None:
    turn_to(user, "Scene")
    scene = user.scene
    assert not user.shows("F-stop")
    user.click("Depth of field")
    assert user.scene.camera == replace(scene.camera, f_stop=2.8) and user.undo_count == 1
    user.click("Focus on selected##camera")
    camera, cube = user.scene.camera, user.scene.object("red cube")
    depth = (cube.world_bounds.mean(axis=0) - camera.position) @ camera.image_plane(1.0)[2]
    assert camera.focus_distance == pytest.approx(depth) and user.undo_count == 2
    user.editor.propose(user.scene.with_camera(target=(0, 1.4, 9)), "Turn")
    user.frame()
    before = user.scene
    user.click("Focus on selected##camera")
    assert user.scene is before and "lies behind the camera" in user.texts()[0]
    user.click("Depth of field")
    assert user.scene.camera.f_stop == 0


@pytest.mark.parametrize(("start", "dragged", "lands"), [(0, 15.0, 3), (3, -15.0, 0)])
def test_there_is_no_aperture_of_one_or_two_blades(
    user: Desk, start: int, dragged: float, lands: int
) -> None:
    turn_to(user, "Scene")
    seen = set()
    for step in range(1, 8):
        user.editor.propose(user.scene.with_camera(f_stop=2.0, blades=start), "Lens")
        user.frames(2)
        user.hold_at(user.place("Blades", 0.5), (dragged * step, 0.0))
        seen.add(user.scene.camera.blades)
        user.release()
        user.frame()
    assert lands in seen and not seen & {1, 2} and user.texts() == []


def test_cameras_are_made_chosen_renamed_and_deleted(user: Desk) -> None:
    turn_to(user, "Scene")
    scene = user.scene
    user.click("Delete##camera")  # it is the only one
    assert user.scene is scene
    user.click("New from view##camera")
    assert user.scene.camera_name == "camera.001" and user.scene.camera == scene.camera
    user.type("Camera X", "2.5")
    assert user.scene.cameras["camera"] == scene.camera and user.scene.camera.position[0] == 2.5
    user.choose("Active camera", "camera")
    assert user.scene.camera == scene.camera and user.null.views[-1].scene.camera == scene.camera
    user.run("Next camera")
    assert user.scene.camera_name == "camera.001"
    user.click("Reset##camera")  # it was not there at first
    assert user.scene.camera == scene.camera
    user.click("Rename…##camera")
    assert user.editor.dialog is not None
    user.key("Escape")
    user.frames(2)
    user.click("Delete##camera")
    assert dict(user.scene.cameras) == {"camera": scene.camera} and user.scene == scene
    assert user.undo_count == 6


def test_a_sky_takes_the_place_of_an_image(user: Desk) -> None:
    turn_to(user, "Scene")
    scene = user.scene
    assert scene.environment.image is not None and not user.shows("Sun elevation")
    user.click("Sky")
    environment = user.scene.environment
    assert environment.sky == Sky() and environment.image is None and environment.color == (1, 1, 1)
    assert 0 < environment.intensity < 1
    assert_one_edit(user, scene)
    before = state(user.editor)
    user.click("Sun disc")
    assert changes(before, state(user.editor)) == {"scene.environment.sky.sun_disc"}
    user.click("Sky")
    assert user.scene.environment.sky is None and not user.shows("Sun elevation")


def test_without_a_denoiser_a_line_says_how_to_get_one(user: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(denoise, "is_available", lambda: False)
    turn_to(user, "Method")
    user.click("Denoise")
    assert not user.editor.preferences.display.denoise
    assert 'pip install "incpt[denoise]"' in user.editor.notices.said[-1].text


def test_a_number_that_is_held_within_its_bounds_says_so(user: Desk) -> None:
    turn_to(user, "Render", "red cube")
    user.type("Bounces", "5000")
    assert user.scene.settings.max_bounces == 200
    assert user.texts() == ["Bounces: 5,000 is out of range; 200 is taken, of 0 to 200"]
    user.type("Bounces", "7")
    assert user.scene.settings.max_bounces == 7 and len(user.texts()) == 1
    user.drag("Bounces", -3000)
    assert user.scene.settings.max_bounces == 0 and len(user.texts()) == 1, "a drag ends there"
