"""Pairs of paths: what a path has to meet to bring something else in another scene, and its partner there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.pairs import check, session_of, traced_pairs
from support.renders import assert_same_mean, repeat
from support.small_scenes import mixed_scene

from incpt.benchmarks.kit.scenes import cornell, crowd, glass, icosphere, wavy_sphere
from incpt.core import layout
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.blocks import traces_in_blocks
from incpt.render.impact.pairs import PairBuffers, PairTracer
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.tables import lights
from incpt.tables.change_tables import change_tables
from incpt.tables.geometry_pool import GeometryPool
from incpt.tables.scene_tables import paired_tables

_DEVICE = Device()
SMALL = RenderSettings(size=(44, 28), tile_size=8, max_bounces=3)


def sized(scene: Scene) -> Scene:
    return replace(scene, settings=SMALL)


def bent(mesh: Mesh) -> Mesh:
    """The same faces with other vertices."""
    vertices = mesh.vertices.copy()
    vertices[:, 0] += 0.3 * vertices[:, 1]
    return Mesh(vertices, mesh.faces, mesh.normals)


def blocks_in_a_box() -> Scene:
    """Everything is tested by brute force in blocks."""
    return sized(cornell())


def glass_cubes() -> Scene:
    return sized(glass())


def mixed() -> Scene:
    """Image, lamp, media, meshes with trees."""
    return sized(mixed_scene())


def ball_in_a_box() -> Scene:
    """A ball of 1,280 triangles, which has a tree, behind matt cubes without one."""
    ball = Object("ball", wavy_sphere(3), "white", (0, 1.4, -0.4), scale=(0.7, 0.7, 0.7))
    return sized(cornell().with_added(ball))


def nested() -> Scene:
    """Bodies of glass inside each other and overlapping, some that absorb, one of them rough."""
    materials = {
        "floor": Material((0.4, 0.5, 0.3), specular=0),
        "outer": Material(
            (1, 1, 1), roughness=0, transmission=1, ior=1.5, priority=2, absorption=(0.2, 0.1, 0)
        ),
        "inner": Material(
            (1, 1, 1), roughness=0, transmission=1, ior=1.33, priority=1, absorption=(0, 0.9, 0.3)
        ),
        "frosted": Material((0.9, 1, 1), roughness=0.4, transmission=1, ior=1.4, priority=3),
        "partly": Material((0.9, 0.2, 0.1), roughness=0.1, transmission=0.5, ior=1.6, priority=3),
        "lamp": Material((0, 0, 0), emission=(9, 9, 8)),
    }
    cube = shape("cube")
    objects = [
        Object("floor", shape("plane"), "floor", scale=(9, 1, 9)),
        Object("outer", cube, "outer", (0, 0.6, 0), (0, 20, 0), (1.2, 1.0, 1.2)),
        Object("inner", cube, "inner", (0.2, 0.6, 0.1), (0, 50, 0), (0.7, 0.6, 0.7)),
        Object("frosted", cube, "frosted", (-1.1, 0.4, 0.3), (0, 10, 0), (0.6, 0.6, 0.6)),
        Object("partly", cube, "partly", (1.1, 0.5, 0.4), (0, -30, 0), (0.6, 0.7, 0.6)),
        Object("stone", cube, "floor", (0.1, 0.5, 0.1), (0, 5, 20), (0.2, 0.2, 0.2)),
        Object("lamp", shape("plane"), "lamp", (0, 3, 1), (180, 0, 0), (1.5, 1, 1.5)),
    ]
    camera = Camera((0, 1.3, 3.6), (0, 0.5, 0), fov_y=45)
    return Scene(camera, Environment((0.3, 0.35, 0.4)), materials, tuple(objects), SMALL)


@dataclass(frozen=True)
class Edit:
    """An edit of a scene, and the share of the paths that may meet it at most."""

    name: str
    scene: Callable[[], Scene]
    apply: Callable[[Scene], Scene]
    at_most: float = 1.0


EDITS = [
    Edit("move", mixed, lambda s: s.with_object("red cube", position=(0.15, 0.5, -0.1)), 0.35),
    Edit("rotate", mixed, lambda s: s.with_object("red cube", rotation=(0, 75, 10)), 0.35),
    Edit("scale", mixed, lambda s: s.with_object("grey drum", scale=(0.5, 0.9, 0.6)), 0.3),
    Edit("recolour", mixed, lambda s: s.with_material("red", base_color=(0.1, 0.2, 0.7)), 0.25),
    Edit("polish", mixed, lambda s: s.with_material("floor", roughness=0.2), 0.8),
    Edit("delete", mixed, lambda s: s.without_object("grey drum"), 0.3),
    Edit("hide", mixed, lambda s: s.with_object("glass ball", visible=False), 0.4),
    Edit("show", lambda: mixed().with_object("red cube", visible=False),
         lambda s: s.with_object("red cube", visible=True), 0.35),
    Edit("add", mixed, lambda s: s.with_added(Object("new", shape("cube"), "grey", (0.4, 0.2, 1.2),
                                                     scale=(0.3, 0.3, 0.3))), 0.3),
    Edit("swap", mixed, lambda s: s.with_object("red cube", mesh=shape("cylinder")), 0.35),
    Edit("deform", mixed, lambda s: s.with_object("glass ball", mesh=bent(shape("sphere"))), 0.45),
    Edit("reassign", mixed, lambda s: s.with_object("red cube", material="grey"), 0.25),
    Edit("glass", mixed, lambda s: s.with_object("glass ball", position=(0.9, 0.6, 0.2)), 0.45),
    Edit("ior", mixed, lambda s: s.with_material("glass", ior=1.3), 0.4),
    Edit("absorb", mixed, lambda s: s.with_material("glass", absorption=(0.1, 2.0, 0.2)), 0.4),
    Edit("glass to metal", mixed, lambda s: s.with_object("glass ball", material="floor"), 0.4),
    Edit("two", mixed, lambda s: s.with_object("red cube", position=(0.1, 0.5, 0.3)).with_material(
        "grey", roughness=0.9), 0.5),
    Edit("rename", mixed, lambda s: s.with_object("red cube", name="cube", position=(0.1, 0.5, 0)), 0.35),
    Edit("block", blocks_in_a_box, lambda s: s.with_object("short", position=(0.3, 0.3, 0.4)), 0.5),
    Edit("wall", blocks_in_a_box, lambda s: s.with_material("red", base_color=(0.1, 0.1, 0.6)), 0.5),
    Edit("many", blocks_in_a_box, lambda s: s.without_object("tall").with_object(
        "short", rotation=(10, 0, 5)).with_object("back", position=(0, 1, -0.9))),
    Edit("ball", ball_in_a_box, lambda s: s.with_object("ball", position=(0.1, 1.4, -0.4)), 0.5),
    Edit("ball bends", ball_in_a_box, lambda s: s.with_object("ball", mesh=bent(wavy_sphere(3))), 0.5),
    Edit("cube", glass_cubes, lambda s: s.with_object("cube 6", position=(0.1, 0.31, 0)), 0.6),
    Edit("tint", glass_cubes, lambda s: s.with_material("glass", base_color=(0.9, 1, 0.9))),
    Edit("crowd", lambda: sized(crowd(300)), lambda s: s.with_object("150", position=(0.1, 0.3, 0.2)), 0.1),
    Edit("inner", nested, lambda s: s.with_object("inner", position=(0.1, 0.65, 0.1)), 0.6),
    Edit("inner, out", nested, lambda s: s.with_object("inner", position=(0.9, 0.65, 0.9)), 0.7),
    Edit("priority", nested, lambda s: s.with_material("inner", priority=3), 0.5),
    Edit("liquid", nested, lambda s: s.with_material("inner", absorption=(0.9, 0, 0), ior=1.2), 0.5),
    Edit("other glass", nested, lambda s: s.with_object("inner", material="frosted"), 0.5),
    Edit("stone", nested, lambda s: s.with_object("stone", rotation=(0, 40, 0)), 0.5),
    Edit("frosted", nested, lambda s: s.with_material("frosted", roughness=0.6), 0.5),
    Edit("glow", mixed, lambda s: s.with_material("red", emission=(2, 1, 0.5))),
    Edit("fade", lambda: mixed().with_material("red", emission=(2, 1, 0.5)),
         lambda s: s.with_material("red", emission=(0, 0, 0))),
    Edit("dim", mixed, lambda s: s.with_material("lamp", emission=(3, 3, 6))),
    Edit("lamp moves", mixed, lambda s: s.with_object("lamp", position=(0.5, 2.2, 0), rotation=(160, 0, 20))),
    Edit("lamp goes", mixed, lambda s: s.without_object("lamp")),
    Edit("lamp comes", mixed, lambda s: s.with_added(
        Object("new", shape("plane"), "lamp", (2, 1, 1), (0, 0, 90), (0.5, 1, 0.5)))),
    Edit("lamp grows", mixed, lambda s: s.with_object("lamp", scale=(1.5, 1, 1.2))),
    Edit("lamp hides", mixed, lambda s: s.with_object("lamp", visible=False)),
    Edit("lamp bends", mixed, lambda s: s.with_object("lamp", mesh=bent(shape("cube")), scale=(1, 0.1, 1))),
    Edit("lamp turns to glass", mixed, lambda s: s.with_object("lamp", material="glass")),
    Edit("both sides", lambda: mixed().with_object("lamp", position=(2, 1, 0.5), rotation=(0, 0, -90)),
         lambda s: s.with_material("lamp", double_sided=True)),
    Edit("one pane", blocks_in_a_box, lambda s: s.with_object("lamp 2", position=(-0.3, 1.99, -0.4))),
    Edit("pane and block", blocks_in_a_box, lambda s: s.with_object(
        "lamp 1", scale=(0.3, 1, 0.2)).with_object("short", position=(0.3, 0.3, 0.4))),
    Edit("first lamp", lambda: blocks_in_a_box().with_material("lamp", emission=(0, 0, 0)),
         lambda s: s.with_material("lamp", emission=(17, 12, 4))),
    Edit("lamp over glass", nested, lambda s: s.with_object("lamp", position=(0.5, 2.5, 0.5))),
    Edit("glass glows", nested, lambda s: s.with_material("partly", emission=(0, 1, 2))),
    Edit("other lamps", mixed, lambda s: s.with_material("second", emission=(1, 2, 8)).with_object(
        "lamp", material="second").with_object("red cube", position=(0, 0.6, 0))),
    Edit("behind a lens", lambda: mixed().with_camera(f_stop=0.1, focus_distance=3.0),
         lambda s: s.with_object("red cube", position=(0.15, 0.5, -0.1)), 0.4),
    Edit("in parallel", lambda: mixed().with_camera(projection="orthographic", ortho_height=3.0, shift_x=0.1),
         lambda s: s.with_object("glass ball", position=(0.9, 0.6, 0.2)), 0.45),
    Edit("partly", nested, lambda s: s.with_material("partly", transmission=0.8), 0.5),
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
    pairs = traced_pairs(device, old, edit.apply(old), in_blocks)
    check(pairs, edit.at_most)
    # Without the drum there are so few triangles that blocks test them by brute force.
    assert pairs.same_kernels or edit.name == "delete"


@pytest.mark.slow
@pytest.mark.parametrize("edit", EDITS[:3], ids=lambda edit: edit.name)
def test_undo_is_an_edit_too(edit: Edit, in_blocks: bool, device: Device) -> None:
    old = edit.scene()
    check(traced_pairs(device, edit.apply(old), old, in_blocks), edit.at_most)


@pytest.mark.slow
def test_blocks_and_wavefront_touch_the_same_paths(device: Device) -> None:
    if not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    old = mixed()
    for edit in ("move", "recolour", "glass"):
        new = next(e for e in EDITS if e.name == edit).apply(old)
        wavefront, blocks = (traced_pairs(device, old, new, tracer).touched for tracer in (False, True))
        assert (wavefront != blocks).mean() < 1e-3
        assert wavefront.any()


@pytest.mark.slow
def test_slots_without_partners(in_blocks: bool, device: Device) -> None:
    """What paths of such slots met is told all the same."""
    old = mixed()
    new = EDITS[0].apply(old)
    every = traced_pairs(device, old, new, in_blocks)
    slot = np.arange(len(every.touched)) // SMALL.tile_size**2
    single = np.arange(slot.max() + 1) % 3 == 1
    some = traced_pairs(device, old, new, in_blocks, single=single)
    check(some)
    np.testing.assert_array_equal(some.touched, every.touched)
    np.testing.assert_array_equal(some.partner_place == layout.NO_PARTNER, every.touched & single[slot])
    assert 0 < len(some.partners) < len(every.partners)


@pytest.mark.slow
def test_equal_scenes_have_no_partners(in_blocks: bool, device: Device) -> None:
    """Nor do scenes whose difference no path can meet."""
    old = mixed()
    unused = old.with_material("unused", base_color=(1, 0, 0), metallic=1.0)
    alike = replace(mixed(), environment=old.environment)
    for other in (old, alike, unused, old.with_object("red cube", visible=False)):
        hidden = other.object("red cube").visible is False
        new = other.with_object("red cube", position=(1, 1, 1)) if hidden else other
        pairs = traced_pairs(device, other if hidden else old, new, in_blocks, spp=2)
        check(pairs, at_most=0.0, differs=False)


def metal_in_a_box() -> Scene:
    """A glossy block beside the lamps, so that both techniques of multiple importance sampling count."""
    scene = sized(cornell())
    steel = Material((0.9, 0.9, 0.9), metallic=1.0, roughness=0.35)
    return replace(scene, materials={**scene.materials, "white": steel})


@pytest.mark.slow
@pytest.mark.parametrize(
    "edit",
    [
        Edit("lamp grows", metal_in_a_box, lambda s: s.with_object("lamp 1", scale=(0.6, 1, 0.5))),
        Edit("lamp dims", metal_in_a_box, lambda s: s.with_material("dim", emission=(2, 3, 1)).with_object(
            "lamp 1", material="dim")),
        Edit("wall glows", metal_in_a_box, lambda s: s.with_material("red", emission=(1.5, 0.4, 0.3))),
        Edit("lamp goes", metal_in_a_box, lambda s: s.without_object("lamp 0")),
        Edit("other lamp", mixed, lambda s: s.with_material("second", emission=(3, 4, 8)).with_object(
            "lamp", material="second")),
    ],
    ids=lambda edit: edit.name,
)  # fmt: skip
def test_lights_of_two_scenes_bring_what_those_of_each_bring(
    edit: Edit, device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Choosing among the lights of both scenes changes no mean, in either of them."""
    old = edit.scene()
    new = edit.apply(old)
    pool = GeometryPool.of(device)
    differs = False
    for chosen, scene in enumerate((old, new)):
        plain = repeat(scene, 256, max_bounces=2, on=device)
        tables = paired_tables(pool, old, new)
        assert tables[chosen].lights.count >= len(lights.emissive_objects(scene))
        with monkeypatch.context() as patch:
            patch.setattr("incpt.render.session.tables_of", lambda *_, both=tables, i=chosen: both[i])
            paired = repeat(scene, 256, max_bounces=2, on=device)
        assert_same_mean(plain, paired)
        differs |= bool((plain != paired).any())
    assert differs  # in one of the scenes at least others are chosen


def far(scene: Scene, offset: tuple[float, float, float]) -> Scene:
    """The scene somewhere else, seen from there."""
    moved = tuple(
        replace(obj, position=tuple(np.add(obj.position, offset).tolist())) for obj in scene.objects
    )
    camera = scene.camera
    position, target = (tuple(np.add(v, offset).tolist()) for v in (camera.position, camera.target))
    return replace(scene, objects=moved, camera=replace(camera, position=position, target=target))


@pytest.mark.slow
@pytest.mark.parametrize("make", [mixed, blocks_in_a_box, ball_in_a_box], ids=lambda make: make.__name__)
def test_boxes_contain_rounding_errors_far_from_the_origin(
    make: Callable[[], Scene], in_blocks: bool, device: Device
) -> None:
    """At 10 km a float is a millimetre wide. What is not padded is missed."""
    old = far(make(), (8000, 100, -6000))
    name = {"mixed": "red cube", "blocks_in_a_box": "short", "ball_in_a_box": "ball"}[make.__name__]
    turned = old.with_object(name, rotation=(0, 90, 0))
    new = turned.with_object(name, scale=tuple(0.9 * s for s in turned.object(name).scale))
    check(traced_pairs(device, old, new, in_blocks, spp=64))


@pytest.mark.slow
def test_a_long_way_to_what_changed(in_blocks: bool, device: Device) -> None:
    """Through a telescope, 10 km away: rays are as inexact as their way is long."""
    old = mixed()
    direction = np.subtract(old.camera.position, old.camera.target)
    direction = 1e4 * direction / np.linalg.norm(direction)
    camera = Camera(tuple(direction.tolist()), old.camera.target, fov_y=0.018)
    old = replace(old, camera=camera)
    for name in ("red cube", "grey drum"):
        smaller = tuple(0.9 * s for s in old.object(name).scale)
        check(traced_pairs(device, old, old.with_object(name, scale=smaller), in_blocks, spp=64))


def test_more_changes_than_boxes(in_blocks: bool, device: Device) -> None:
    old = sized(crowd(100))
    new = old
    for i in range(0, 100, 9):
        obj = old.object(str(i))
        new = new.with_object(
            obj.name, rotation=(0, 10.0 * i, 20), position=tuple(np.add(obj.position, 0.02))
        )
    check(traced_pairs(device, old, new, in_blocks), at_most=0.9)


def test_a_path_buffer_that_is_larger_than_the_pairs(device: Device) -> None:
    session = session_of(device, mixed(), True)
    batch = session._batch(session.progress.planned(10).slots, session._state.path_buffer)
    changes = change_tables(device, mixed(), mixed())
    buffers = PairBuffers.of(device, 64)
    assert PairBuffers.of(device, 60, buffers) is buffers
    assert PairBuffers.of(device, 65, buffers).stride == 65
    with pytest.raises(AssertionError, match="room for each path"):
        PairTracer(session._tracer).trace(batch, batch.tables, changes, buffers)


def test_a_step_tells_how_many_partners_it_traced(device: Device) -> None:
    """As many as the film has of touched samples: in the first round all of these have partners, and no path
    lies beyond the edges of the picture."""
    old = replace(mixed(), settings=replace(SMALL, size=(64, 32), strategy="impact"))
    session = session_of(device, old, True)
    session.render(2)
    assert session.step().partners == 0
    session.edit(EDITS[0].apply(old))
    partners, report = 0, session.step(4)
    while report.queue_done < report.queue_length:
        partners += report.partners
        report = session.step(4)
    partners += report.partners
    assert partners == session._state.film.sums()["pairs"][layout.PairPlane.TOUCHED].sum() > 0


@pytest.mark.slow
def test_kernels_of_pairs_are_built_ahead(
    in_blocks: bool, device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After the idle launches of pairs, an edit builds nothing, also with auxiliary images."""
    own = Device()
    old = replace(mixed(), settings=replace(SMALL, aovs=True))
    session = session_of(own, old, in_blocks)
    path_buffer = session._state.path_buffer
    batch = session._batch(session.progress.planned(session.grid.count).slots, path_buffer)
    buffers = PairBuffers.of(own, path_buffer.stride)
    pair_tracer = PairTracer(session._tracer)
    for launch in pair_tracer.idle_launches(batch, buffers):
        launch()

    def fail(*_: object) -> None:
        raise AssertionError("a kernel is built while somebody waits")

    edited = [edit.apply(old) for edit in EDITS if edit.name in ("move", "recolour", "lamp moves", "glow")]
    pairs = [paired_tables(batch.tables.pool, old, new, batch.tables) for new in edited]
    monkeypatch.setattr(own, "build", fail)
    for before, after in pairs:
        changes = change_tables(own, before.scene, after.scene)
        assert pair_tracer.trace(replace(batch, tables=after), before, changes, buffers) > 0


Place = tuple[float, float, float]

_NUMBERS = st.floats(-1.0, 1.0, width=32)
_PLACES = st.tuples(_NUMBERS, _NUMBERS, _NUMBERS)


@st.composite
def small_scenes(draw: st.DrawFn) -> Scene:
    """A few bodies in the box, of which some are glass."""
    scene = cornell().without_object("tall").without_object("short")
    materials = {
        **scene.materials,
        "glass": Material(roughness=0.0, transmission=1.0, ior=1.5, absorption=(0.3, 0, 0.1), priority=1),
        "fluid": Material(roughness=0.0, transmission=1.0, ior=1.3, priority=draw(st.integers(0, 2))),
        "metal": Material(metallic=1.0, roughness=0.3),
    }
    bodies = []
    for i in range(draw(st.integers(1, 4))):
        x, y, z = draw(_PLACES)
        bodies.append(
            Object(
                f"body {i}",
                draw(st.sampled_from([shape("cube"), icosphere(1), wavy_sphere(3)])),
                draw(st.sampled_from(["glass", "fluid", "metal", "white", "red"])),
                (0.6 * x, 1 + 0.6 * y, 0.6 * z),
                draw(st.tuples(*[st.integers(-90, 90)] * 3)),
                # No two have a face in one plane, see "copy" below.
                (0.5 + 0.011 * i + 0.3 * draw(_NUMBERS), 0.4 + 0.013 * i, 0.5 + 0.017 * i),
            )
        )
    settings = RenderSettings(size=(24, 24), tile_size=8, max_bounces=2)
    return replace(scene, materials=materials, objects=(*scene.objects, *bodies), settings=settings)


def _copied(body: Object, number: int, place: Place) -> Object:
    """Under another name, and neither of the same size nor at the same height as any: which of two faces in
    one plane is met is a matter of rounding, which is another one in other tables."""
    scale = tuple((1 - 0.013 * number) * side for side in body.scale)
    position = (place[0], 1.21 + 0.0007 * number, place[2])
    return replace(body, name=f"body {number}", position=position, scale=scale)


BODY_EDITS: dict[str, Callable[[Scene, Object, int, float, Place], Scene]] = {
    "move": lambda s, body, n, x, p: s.with_object(body.name, position=(0.5 * p[0], 1 + 0.5 * x, 0.5 * p[2])),
    "turn": lambda s, body, n, x, p: s.with_object(body.name, rotation=(180 * p[0], 180 * p[1], 180 * p[2])),
    "hide": lambda s, body, n, x, p: s.with_object(body.name, visible=not body.visible),
    "remove": lambda s, body, n, x, p: s.without_object(body.name),
    "copy": lambda s, body, n, x, p: s.with_added(
        _copied(body, next(i for i in range(len(s.objects), 99) if f"body {i}" not in s.object_index), p)
    ),
    "assign": lambda s, body, n, x, p: s.with_object(body.name, material=("glass", "metal", "green")[n % 3]),
    "colour": lambda s, body, n, x, p: s.with_material(body.material, base_color=(x, 0.5, 1 - x)),
    "glow": lambda s, body, n, x, p: s.with_material(body.material, emission=(n, x, 1)),
    "swap": lambda s, body, n, x, p: s.with_object(body.name, mesh=bent(body.mesh)),
    "wall": lambda s, body, n, x, p: s.with_object("left", position=(-1 - 0.2 * x, 1, 0)),
    "lamp": lambda s, body, n, x, p: s.with_object(f"lamp {n}", position=(p[0], 1.5, p[2])),
    "pane": lambda s, body, n, x, p: s.with_object(f"lamp {n}", material=("white", "lamp")[x < 0.3]),
}
"""What people do to a scene: to a body, number `n`, by an amount `x`, at a place `p`."""


@st.composite
def edits(draw: st.DrawFn) -> Callable[[Scene], Scene]:
    """One of the things that people do to a scene; nothing where it has no body left."""
    kind, number, place = draw(st.sampled_from(list(BODY_EDITS))), draw(st.integers(0, 3)), draw(_PLACES)
    amount = draw(st.floats(0.05, 0.95))

    def apply(scene: Scene) -> Scene:
        bodies = [obj for obj in scene.objects if obj.name.startswith("body")]
        if not bodies:
            return scene
        return BODY_EDITS[kind](scene, bodies[number % len(bodies)], number, amount, place)

    return apply


@pytest.mark.slow
@given(scene=small_scenes(), some=st.lists(edits(), min_size=1, max_size=4))
@settings(max_examples=60)
def test_any_edits_of_any_scene(scene: Scene, some: list[Callable[[Scene], Scene]]) -> None:
    new = scene
    for edit in some:
        new = edit(new)
    for in_blocks in (False, True):
        pairs = traced_pairs(_DEVICE, scene, new, in_blocks and traces_in_blocks(_DEVICE), spp=8)
        check(pairs, differs=bool(pairs.differ.any()))
