"""Edits of lights that are objects of their own: what paths meet of them, and the picture after them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from support.law import LARGE_STEPS
from support.pairs import assert_choice_changes_no_mean, check, traced_pairs
from support.renders import repeat
from support.small_scenes import mixed_scene, sky

from incpt.benchmarks.kit.scenes import cornell
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.blocks import traces_in_blocks
from incpt.render.modes import Mode
from incpt.render.session import Session
from incpt.scene.change import diff
from incpt.scene.edits import unique_name
from incpt.scene.light import Light
from incpt.scene.model import Scene
from incpt.scene.sky import Sky

SMALL = RenderSettings(size=(44, 28), tile_size=8, max_bounces=3)
DOWN = (-90, 0, 0)
LAMPS = (
    Light("bulb", "point", (0.8, 1.2, 0.8), radius=0.15, power=20),
    Light("pane", "rectangle", (-0.6, 1.5, 0.4), (-60, 0, 0), size=(0.8, 0.4), radiance=6),
    Light("disk", "disk", (-1, 0.8, 1), (0, 150, 0), radius=0.2, power=10, camera_visible=False),
    Light("spot", "spot", (0.2, 1.8, 1), DOWN, radius=0, power=30, spot_angle=70),
    Light("star", "point", (-0.3, 0.9, 1.2), radius=0, power=5, casts_shadows=False),
    Light("sun", "sun", rotation=(-40, 30, 0), angle=4, irradiance=1),
)


def mixed() -> Scene:
    """Image, triangles, media, and lights of every kind."""
    return replace(mixed_scene(), settings=SMALL, lights=LAMPS)


def room() -> Scene:
    """All is tested by brute force in blocks."""
    lights = (
        Light("bulb", "sphere", (0.3, 1.2, 0.3), radius=0.1, power=5),
        Light("pane", "rectangle", (-0.4, 1.8, 0), DOWN, size=(0.5, 0.3), radiance=5),
    )
    return replace(cornell(), settings=SMALL, lights=lights)


def alone() -> Scene:
    """Nothing else shines."""
    dark = {name: replace(one, emission=(0, 0, 0)) for name, one in cornell().materials.items()}
    return replace(room(), materials=dark)


@dataclass(frozen=True)
class Edit:
    """An edit of a scene, and the share of the paths that may meet it at most."""

    name: str
    scene: Callable[[], Scene]
    apply: Callable[[Scene], Scene]
    at_most: float = 1.0


NEW = Light("new", "disk", (0.3, 1.4, 0.6), DOWN, radius=0.2, power=15)
EDITS = [
    Edit("move a ball", mixed, lambda s: s.with_light("bulb", position=(0.7, 1.0, 0.9))),
    Edit("dim a ball", mixed, lambda s: s.with_light("bulb", power=10)),
    Edit("grow a ball", mixed, lambda s: s.with_light("bulb", radius=0.25)),
    Edit("turn a pane", mixed, lambda s: s.with_light("pane", rotation=(-30, 20, 0))),
    Edit("resize a pane", mixed, lambda s: s.with_light("pane", size=(0.4, 0.9))),
    Edit("both sides", mixed, lambda s: s.with_light("pane", double_sided=True)),
    Edit("colour", mixed, lambda s: s.with_light("disk", color=(1, 0.2, 0.1))),
    Edit("show a disk", mixed, lambda s: s.with_light("disk", camera_visible=True)),
    Edit("hide a ball", mixed, lambda s: s.with_light("bulb", camera_visible=False), 0.4),
    Edit("remove a ball", mixed, lambda s: s.without_light("bulb")),
    Edit("switch a ball off", mixed, lambda s: s.with_light("bulb", visible=False)),
    Edit("no power", mixed, lambda s: s.with_light("bulb", power=0)),
    Edit("add", mixed, lambda s: s.with_added_light(NEW)),
    Edit("turn a spot", mixed, lambda s: s.with_light("spot", rotation=(-60, 0, 0)), 0.4),
    Edit("narrow a spot", mixed, lambda s: s.with_light("spot", spot_angle=50, spot_blend=0.6), 0.4),
    Edit("a spot gets a size", mixed, lambda s: s.with_light("spot", radius=0.1)),
    Edit("shadows", mixed, lambda s: s.with_light("star", casts_shadows=True), 0.3),
    Edit("no shadows", mixed, lambda s: s.with_light("bulb", casts_shadows=False)),
    Edit("another kind", mixed, lambda s: s.with_light("bulb", kind="rectangle", rotation=DOWN)),
    Edit("rename", mixed, lambda s: s.with_light("bulb", name="ball", position=(0.7, 1.1, 0.7))),
    Edit("lamp of triangles", mixed, lambda s: s.with_object("lamp", position=(0.5, 2.2, 0))),
    Edit("lamp of triangles goes", mixed, lambda s: s.without_object("lamp")),
    Edit("object", mixed, lambda s: s.with_object("red cube", position=(0.15, 0.5, -0.1)), 0.45),
    Edit("object and light", mixed, lambda s: s.with_object("red cube", rotation=(0, 75, 0)).with_light(
        "pane", position=(-0.5, 1.4, 0.3))),
    Edit("room: ball", room, lambda s: s.with_light("bulb", position=(0.2, 1.1, 0.3))),
    Edit("room: pane", room, lambda s: s.with_light("pane", radiance=9)),
    Edit("room: block", room, lambda s: s.with_object("short", position=(0.3, 0.3, 0.4)), 0.6),
    Edit("room: all go", room, lambda s: replace(s, lights=())),
    Edit("turn a sun", mixed, lambda s: s.with_light("sun", rotation=(-60, -50, 0))),
    Edit("brighter sun", mixed, lambda s: s.with_light("sun", irradiance=3)),
    Edit("sun goes", mixed, lambda s: s.without_light("sun")),
    Edit("turn the image", mixed, lambda s: s.with_environment(rotation_y=70)),
    Edit("dim the image", mixed, lambda s: s.with_environment(intensity=0.2)),
    Edit("image goes", mixed, lambda s: s.with_environment(image=None, color=(0.2, 0.3, 0.4))),
    Edit("dark image", mixed, lambda s: s.with_environment(intensity=0.0)),
    Edit("a sky", mixed, lambda s: s.with_environment(image=None, sky=Sky(35.0), intensity=0.05)),
    Edit("room: image", room, lambda s: s.with_environment(image=sky(), color=(1, 1, 1))),
    Edit("alone: ball", alone, lambda s: s.with_light("bulb", position=(0.2, 1.1, 0.3), power=7)),
    Edit("alone: first triangles", alone, lambda s: s.with_material("lamp", emission=(17, 12, 4))),
]  # fmt: skip


@pytest.fixture(params=[False, True], ids=["wavefront", "blocks"])
def in_blocks(request: pytest.FixtureRequest, device: Device) -> bool:
    if request.param and not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    return bool(request.param)


@pytest.mark.slow
@pytest.mark.parametrize("edit", EDITS, ids=lambda edit: edit.name)
def test_a_path_that_met_nothing_that_changed_brings_the_same(
    edit: Edit, in_blocks: bool, device: Device
) -> None:
    old = edit.scene()
    check(traced_pairs(device, old, edit.apply(old), in_blocks), edit.at_most)


@pytest.mark.slow
@pytest.mark.parametrize("edit", EDITS[:4], ids=lambda edit: edit.name)
def test_undo_is_an_edit_too(edit: Edit, in_blocks: bool, device: Device) -> None:
    old = edit.scene()
    check(traced_pairs(device, edit.apply(old), old, in_blocks), edit.at_most)


@pytest.mark.slow
def test_far_from_the_origin(in_blocks: bool, device: Device) -> None:
    """Where a float is a millimetre wide, boxes around lights hold what rays meet of them."""
    scene, offset = mixed(), (8000.0, 100.0, -6000.0)

    def moved(position: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(np.add(position, offset).tolist())

    camera = replace(scene.camera, position=moved(scene.camera.position), target=moved(scene.camera.target))
    old = replace(
        scene,
        camera=camera,
        objects=tuple(replace(one, position=moved(one.position)) for one in scene.objects),
        lights=tuple(replace(one, position=moved(one.position)) for one in scene.lights),
    )
    for name in ("bulb", "pane"):
        new = old.with_light(name, position=moved((0.5, 1.1, 0.7)))
        check(traced_pairs(device, old, new, in_blocks))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["dim a ball", "add", "lamp of triangles goes", "room: all go", "alone: first triangles"]
)
def test_lights_of_two_scenes_bring_what_those_of_each_bring(name: str, device: Device) -> None:
    edit = next(one for one in EDITS if one.name == name)
    old = edit.scene()
    assert_choice_changes_no_mean(device, old, edit.apply(old))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        *("move a ball", "turn a spot", "add", "room: pane", "another kind", "turn a sun", "sun goes"),
        *("turn the image", "image goes", "dark image", "a sky"),
    ],
)
def test_edits_then_convergence_equal_a_fresh_render(name: str, device: Device) -> None:
    edit = next(one for one in EDITS if one.name == name)
    old = edit.scene()
    new = edit.apply(old)
    settings = replace(SMALL, size=(20, 14), base_nor=16, strategy="impact")
    session = Session(old, settings=settings, device=device)
    session.render(64)
    assert not diff(old, new).camera
    session.edit(new)
    assert session.mode is Mode.INCREMENTAL
    session.step()
    assert_converges(session, new)


def assert_converges(session: Session, scene: Scene) -> None:
    """The picture becomes that of fresh renders with other random numbers, within their noise."""
    session.configure(replace(session.settings, slots_per_step=LARGE_STEPS))
    session.render(256)
    fresh = repeat(replace(scene), 128, 4, size=session.size, max_bounces=3)
    noise = np.sqrt(fresh.var(axis=0, ddof=1).mean())
    difference = session.image() - fresh.mean(axis=0)
    assert np.sqrt((difference**2).mean()) < 1.5 * noise
    assert abs(difference.mean()) < 6 * noise / np.sqrt(difference.size)


unit = st.floats(0, 1)
places = st.tuples(st.floats(-1.2, 1.2), st.floats(0.3, 2.2), st.floats(-0.5, 1.5))
changes = st.one_of(
    st.fixed_dictionaries({"position": places}),
    st.fixed_dictionaries({"rotation": st.tuples(*[st.floats(-180, 180)] * 3)}),
    st.fixed_dictionaries({"scale": st.tuples(*[st.floats(0.3, 2)] * 3)}),
    st.fixed_dictionaries({"power": st.floats(0, 30)}),
    st.fixed_dictionaries({"color": st.tuples(unit, unit, unit)}),
    st.fixed_dictionaries({"radius": st.floats(0.05, 0.4), "size": st.tuples(*[st.floats(0.1, 1)] * 2)}),
    st.fixed_dictionaries({"spot_angle": st.floats(10, 170), "spot_blend": unit}),
    st.fixed_dictionaries(
        {
            "kind": st.sampled_from(["point", "spot", "rectangle", "disk", "sphere"]),
            "radius": st.floats(0.05, 0.4),
        }
    ),
    st.fixed_dictionaries(
        {name: st.booleans() for name in ("visible", "camera_visible", "casts_shadows", "double_sided")}
    ),
)
light_edits = st.builds(
    lambda name, values: lambda s: s.with_light(name, **values) if name in s.light_index else s,
    st.sampled_from(["bulb", "pane", "disk", "spot"]),
    changes,
)
comings = st.builds(
    lambda at: lambda s: s.with_added_light(replace(NEW, name=unique_name("new", s.names), position=at)),
    places,
)
goings = st.builds(
    lambda name: lambda s: s.without_light(name) if name in s.light_index else s,
    st.sampled_from(["bulb", "pane"]),
)
surroundings = st.builds(
    lambda values: lambda s: s.with_environment(**values),
    st.fixed_dictionaries({"rotation_y": st.floats(-180, 180), "intensity": st.floats(0.1, 1)}),
)
suns = st.builds(
    lambda values: lambda s: s.with_light("sun", **values),
    st.fixed_dictionaries({"rotation": st.tuples(*[st.floats(-90, 90)] * 3), "irradiance": st.floats(0, 2)}),
)
moves = st.builds(lambda at: lambda s: s.with_object("red cube", position=at), places)


@pytest.mark.slow
@hypothesis_settings(
    max_examples=6,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(
    st.lists(
        st.tuples(
            st.one_of(light_edits, light_edits, comings, goings, moves, surroundings, suns),
            st.integers(0, 4),
        ),
        min_size=1,
        max_size=4,
    )
)
def test_any_edits_then_convergence_equal_a_fresh_render(
    device: Device, sequence: list[tuple[Callable[[Scene], Scene], int]]
) -> None:
    scene = mixed().with_light("star", power=1.0)
    settings = replace(SMALL, size=(20, 14), base_nor=16, strategy="impact")
    session = Session(scene, settings=settings, device=device)
    session.render(16)
    for edit, steps in sequence:
        scene = edit(scene)
        session.edit(scene)
        for _ in range(steps):
            session.step()
    assert_converges(session, scene)


@pytest.mark.parametrize("name", ["dim the image", "brighter sun"])
def test_another_intensity_is_found_at_once(device: Device, name: str) -> None:
    """Both scenes bring the same but for a factor."""
    scene = replace(mixed(), lights=(LAMPS[-1],)) if name == "brighter sun" else replace(mixed(), lights=())
    scene = scene.with_material("lamp", emission=(0, 0, 0))
    scene = scene.with_environment(intensity=0.0) if name == "brighter sun" else scene
    edited = next(edit for edit in EDITS if edit.name == name).apply(scene)
    settings = replace(SMALL, strategy="impact", base_nor=16)
    session = Session(scene, settings=settings, device=device)
    session.render(512)
    truth = repeat(replace(edited), 256, 4, size=SMALL.size, max_bounces=3).mean(axis=0)
    once = replace(settings, strategy="restart", base_nor=1)
    fresh = Session(replace(edited), settings=once, device=device)
    fresh.render(1)
    before = session.image()
    session.edit(edited)
    spent = 0
    while spent < 2 * SMALL.size[0] * SMALL.size[1]:
        report = session.step()
        spent += report.paths + report.partners
    errors = [
        float(np.sqrt(((image - truth) ** 2).mean())) for image in (session.image(), before, fresh.image())
    ]
    assert errors[0] < 0.25 * min(errors[1:])


def test_another_image_around_does_not_wait(device: Device) -> None:
    scene = mixed()
    session = Session(scene, settings=replace(SMALL, strategy="impact"), device=device)
    session.render(4)
    session.edit(scene.with_environment(rotation_y=70))
    assert session.mode is Mode.INCREMENTAL and session.error_left() == 1.0
    turned = session.scene
    session.step()
    session.edit(turned.with_environment(rotation_y=90))
    anchor = session.progress.anchor
    assert anchor is not None and anchor.scene is scene, "turned on and on it keeps the anchor"
    session.step()
    session.edit(session.scene.with_object("red cube", position=(0.2, 0.5, 0.1)))
    anchor = session.progress.anchor
    assert anchor is not None and anchor.scene is not scene, "another edit folds the picture"
    session.edit(session.scene.with_camera(fov_y=30.0))
    assert session.mode is Mode.BASE


def test_an_edit_back_is_the_kept_picture(device: Device) -> None:
    scene = mixed()
    session = Session(scene, device=device)
    session.render(4)
    before = session.image()
    session.edit(scene.with_light("bulb", power=90))
    session.edit(scene.with_light("bulb", power=20))
    np.testing.assert_array_equal(session.image(), before)
