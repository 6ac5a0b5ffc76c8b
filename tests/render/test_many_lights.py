"""Many lights by the light tree: the pictures are those that loops and tables of chances give, with less
noise; both techniques know the same densities; and edits keep the law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support.kernels import device as the_device
from support.pairs import assert_choice_changes_no_mean, check, traced_pairs
from support.renders import assert_same_mean, render, repeat
from support.small_scenes import mixed_scene

from incpt.benchmarks.kit.scenes import cornell, icosphere
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.blocks import traces_in_blocks
from incpt.render.session import Session
from incpt.render.wavefront import Wavefront
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.light import KINDS, Light
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.texture import Bitmap, Texture
from incpt.tables import tree_tables
from incpt.tables.geometry_pool import GeometryPool
from incpt.tables.scene_tables import paired_tables, tables_of

SMALL = RenderSettings(size=(44, 28), tile_size=8, max_bounces=3)
NEAR = [kind for kind in KINDS if kind != "sun"]


def lamps(count: int, seed: int = 1, radius: float = 0.05, power: float = 60.0) -> tuple[Light, ...]:
    """Of every kind but suns, over a floor of 3 x 3 m, with all that lights may have."""
    random = np.random.default_rng(seed)
    return tuple(
        Light(
            f"bulb {i}",
            NEAR[i % len(NEAR)],
            tuple(random.uniform((-1.4, 0.2, -1.2), (1.4, 2.2, 1.6)).tolist()),
            tuple(random.uniform(-180, 180, 3).tolist()),
            color=tuple(random.uniform(0.2, 1, 3).tolist()),
            power=power / count * float(random.lognormal()),
            radius=radius * (i % 7 != 3 or NEAR[i % len(NEAR)] in ("disk", "sphere")),
            size=(2 * radius, 3 * radius),
            spot_angle=float(random.uniform(30, 150)),
            double_sided=i % 4 == 0,
            camera_visible=i % 5 != 1,
            casts_shadows=i % 9 != 5,
        )
        for i in range(count)
    )


def mixed(count: int = 40) -> Scene:
    """Lights of every kind, a sun, emissive triangles, an image of the environment, and media."""
    sun = Light("sun", "sun", rotation=(-40, 30, 0), angle=4, irradiance=1)
    ball = Object("ball", icosphere(1), "lamp", (-1.2, 1.6, 0.6), scale=(0.3, 0.2, 0.2))
    glow = Material((0.2, 0.2, 0.2), emission=(0.5, 1, 2), double_sided=True, roughness=0.3)
    scene = mixed_scene().with_material("glow", **vars(glow)).with_added(ball)
    sheet = Object("sheet", shape("plane"), "glow", (1.3, 1.4, -0.5), (50, 0, 0), (0.5, 1, 0.5))
    return replace(scene.with_added(sheet), settings=SMALL, lights=(*lamps(count), sun))


def lit_by_lamps_alone(count: int = 60) -> Scene:
    scene = mixed(count)
    dark = {name: replace(one, emission=(0, 0, 0)) for name, one in scene.materials.items()}
    return replace(scene, materials=dark, environment=Environment(), lights=scene.lights[:-1])


def lit_by_triangles_alone() -> Scene:
    """Forty panes of two triangles, and a ball."""
    random = np.random.default_rng(3)
    panes = tuple(
        Object(
            f"pane {i}",
            shape("plane"),
            "glow" if i % 3 else "lamp",
            tuple(random.uniform((-1.4, 0.2, -1.2), (1.4, 2.2, 1.6)).tolist()),
            tuple(random.uniform(-180, 180, 3).tolist()),
            (0.1, 1, 0.15 * (-1) ** i),
        )
        for i in range(40)
    )
    scene = mixed(0)
    scene = replace(scene.with_material("glow", emission=(1, 2, 4)), environment=Environment(), lights=())
    return scene.with_added(*panes)


def in_a_box(count: int = 60) -> Scene:
    """All is tested by brute force in blocks."""
    return replace(cornell(), settings=SMALL, lights=lamps(count, radius=0.02, power=20))


SCENES: dict[str, Callable[[], Scene]] = {
    "mixed": mixed,
    "lamps": lit_by_lamps_alone,
    "triangles": lit_by_triangles_alone,
    "box": in_a_box,
}


@pytest.fixture
def trees(monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], None]:
    """Says whether scenes that are met from now on have a light tree."""

    def choose(wanted: bool) -> None:
        monkeypatch.setattr(tree_tables, "LEAST_LAMPS", 1 if wanted else 10**9)
        monkeypatch.setattr(tree_tables, "LEAST_TRIANGLES", 10**9)

    return choose


@pytest.fixture(params=[False, True], ids=["wavefront", "blocks"])
def in_blocks(request: pytest.FixtureRequest, device: Device) -> bool:
    if request.param and not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    return bool(request.param)


def has_tree(scene: Scene, device: Device) -> bool:
    return "LIGHT_TREE" in tables_of(GeometryPool.of(device), scene).variant


def test_few_lights_have_no_tree(device: Device) -> None:
    few = replace(mixed(tree_tables.LEAST_LAMPS - 6), lights=lamps(tree_tables.LEAST_LAMPS - 6))
    assert not has_tree(few, device) and has_tree(mixed(tree_tables.LEAST_LAMPS), device)
    suns = tuple(Light(f"sun {i}", "sun") for i in range(tree_tables.LEAST_LAMPS))
    assert not has_tree(replace(few, lights=suns), device)


@pytest.mark.parametrize(
    "name",
    ["mixed", *(pytest.param(name, marks=pytest.mark.statistics) for name in SCENES if name != "mixed")],
)
def test_the_tree_changes_no_mean(name: str, trees: Callable[[bool], None]) -> None:
    images = []
    for wanted in (False, True):
        trees(wanted)
        scene = SCENES[name]()
        assert has_tree(scene, the_device()) == wanted
        images.append(repeat(scene, 256, max_bounces=2))
    assert_same_mean(*images, relative=0.01)


@pytest.mark.statistics
@pytest.mark.parametrize("technique", ["MIS_ONLY_LIGHT", "MIS_ONLY_BSDF"])
@pytest.mark.parametrize("name", ["mixed", "triangles"])
def test_both_techniques_find_the_same(name: str, technique: str, trees: Callable[[bool], None]) -> None:
    """Of lights that rays can find: each technique alone has the mean of both together."""
    trees(True)
    scene = SCENES[name]()
    lights = tuple(
        replace(light, radius=0.3, size=(0.5, 0.5), casts_shadows=True) if not light.is_far else light
        for light in scene.lights[:24]
    )
    # Neither technique alone gets along with narrow lobes, and light sampling does not see through glass.
    rough = {
        key: replace(one, roughness=max(one.roughness, 0.6), transmission=0.0)
        for key, one in scene.materials.items()
    }
    scene = replace(scene, lights=lights, materials=rough)
    both = repeat(scene, 128, max_bounces=1)
    alone = repeat(scene, 512, max_bounces=1, on=Device(features=(technique,)))
    assert_same_mean(both, alone, relative=0.02)


def wall_of_lights(roughness: float, metallic: float) -> Scene:
    """A floating floor before a wall of a hundred panes, half of them below the floor: large and near, so
    that both techniques find them, and the normal of the floor says much of their chances."""
    panes = tuple(
        Light(f"pane {i}", "rectangle", (0.2 * (i % 10) - 0.9, 0.2 * (i // 10) - 0.9, -0.8), (0, 180, 0),
              size=(0.2, 0.2), radiance=1 + i % 3, camera_visible=False)
        for i in range(100)
    )  # fmt: skip
    floor = Material((0.7, 0.7, 0.7), roughness=roughness, metallic=metallic, specular=0)
    plane = Object("floor", shape("plane"), "floor", scale=(1.5, 1, 1.4))
    camera = Camera((0, 1.2, 1.2), (0, 0, 0), fov_y=50)
    return Scene(camera, Environment(), {"floor": floor}, (plane,), lights=panes)


@pytest.mark.parametrize(
    ("roughness", "metallic"),
    [
        pytest.param(1.0, 0.0, id="matte"),
        pytest.param(0.4, 1.0, id="glossy", marks=pytest.mark.statistics),
    ],
)
def test_weights_of_large_lights(
    roughness: float, metallic: float, trees: Callable[[bool], None], device: Device
) -> None:
    """What a ray knows of the density of a light is what the sample knew, else their weights miss 1."""
    images = []
    for wanted in (False, True):
        trees(wanted)
        images.append(repeat(wall_of_lights(roughness, metallic), 256, max_bounces=0))
    assert_same_mean(*images, relative=0.002)
    session = Session(wall_of_lights(roughness, metallic), (32, 32), RenderSettings(max_bounces=0), device)
    session._tracer = Wavefront(device)
    session.render(512)
    assert session.image().mean() == pytest.approx(images[0].mean(), rel=0.005)


def test_what_passes_through_a_sheet_is_lit_from_behind(trees: Callable[[bool], None]) -> None:
    """Lights below a leaf count as those above it do: with its normal they would have the least chance."""
    leaf = Material((0.5, 0.5, 0.5), specular=0, diffuse_transmission=0.5)
    noise = []
    scene = replace(wall_of_lights(1.0, 0.0), materials={"floor": leaf})
    for wanted in (False, True):
        trees(wanted)
        noise.append(repeat(replace(scene), 64, max_bounces=0))
    assert_same_mean(*noise, relative=0.005)
    assert noise[1].var(axis=0).mean() < 1.2 * noise[0].var(axis=0).mean()


@pytest.mark.parametrize("name", SCENES)
def test_schedules_agree(name: str, device: Device, trees: Callable[[bool], None]) -> None:
    if not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    trees(True)
    images = []
    for wavefront in (False, True):
        settings = replace(SMALL, base_nor=8, roulette_depth=1)
        session = Session(SCENES[name](), (53, 37), settings, device)
        session._tracer = Wavefront(device) if wavefront else session._tracer
        session.render(8)
        images.append(session.image())
    assert np.median(np.abs(images[0] - images[1])) < 1e-5
    assert images[0].mean() == pytest.approx(images[1].mean(), rel=1e-3)


def test_rays_meet_the_lights_that_loops_find(trees: Callable[[bool], None]) -> None:
    """Seen by the camera, in a mirror, and as what stands before other lights; to the bit."""
    mirror = Material((1, 1, 1), metallic=1, roughness=0)
    images = []
    for wanted in (False, True):
        trees(wanted)
        scene = lit_by_lamps_alone(300)
        scene = scene.with_material("grey", **vars(mirror)).with_material("floor", base_color=(0, 0, 0))
        black = {
            name: one if name == "grey" else Material((0, 0, 0), specular=0)
            for name, one in scene.materials.items()
        }
        images.append(render(replace(scene, materials=black), 16, (64, 40), max_bounces=2))
    assert (images[0] > 1).mean() > 0.03
    # What light sampling adds to a mirror is next to nothing.
    np.testing.assert_allclose(images[0], images[1], rtol=1e-5, atol=0.01)


def test_shadows_of_lights(trees: Callable[[bool], None]) -> None:
    """A panel of dark lights keeps the light of a lamp from the floor, wherever the tree has them."""
    panel = tuple(
        Light(f"dark {i}", "rectangle", (0.1 * (i % 12) - 0.55, 1.0, 0.1 * (i // 12) - 0.55), (-90, 0, 0),
              size=(0.1002, 0.1002), radiance=1e-6)
        for i in range(144)
    )  # fmt: skip
    lamp = Light("bulb", "sphere", (0, 1.3, 0), radius=0.05, power=50)
    base = replace(lit_by_lamps_alone(), lights=(lamp, *panel))
    camera = replace(base.camera, position=(0.0, 0.8, 0.0), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, -1.0))
    floor = base.objects[:1]
    matte = {name: Material((0.5, 0.5, 0.5), specular=0) for name in base.materials}
    scene = replace(base, camera=camera, objects=floor, materials=matte)
    images = []
    for wanted in (False, True):
        trees(wanted)
        images.append(render(replace(scene), 256, max_bounces=0))
        assert images[-1][14:18, 14:18].max() < 1e-3 < render(replace(scene, lights=(lamp,)), 4).min()
    np.testing.assert_allclose(images[0].mean(), images[1].mean(), rtol=0.05, atol=1e-5)


@pytest.mark.slow
def test_far_from_the_origin(trees: Callable[[bool], None]) -> None:
    """Ten kilometres away, where a float is a millimetre wide, the picture is that without a tree."""
    offset = (8000.0, 100.0, -6000.0)

    def moved(position: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(np.add(position, offset).tolist())

    scene = lit_by_lamps_alone()
    camera = replace(scene.camera, position=moved(scene.camera.position), target=moved(scene.camera.target))
    far = replace(
        scene,
        camera=camera,
        objects=tuple(replace(one, position=moved(one.position)) for one in scene.objects),
        lights=tuple(replace(one, position=moved(one.position)) for one in scene.lights),
    )
    images = []
    for wanted in (False, True):
        trees(wanted)
        images.append(repeat(replace(far), 256, max_bounces=2))
    assert_same_mean(*images, relative=0.02)


@pytest.mark.parametrize("count", [100, 1000])
def test_there_is_less_noise(count: int, trees: Callable[[bool], None]) -> None:
    """At the same number of samples; with many lamps in a room the table of chances is lost."""
    noise = []
    for wanted in (False, True):
        trees(wanted)
        scene = in_a_box(count)
        # Pixels at the edges of lamps have noise that no choice of lights changes.
        unseen = tuple(replace(light, camera_visible=False) for light in scene.lights)
        images = repeat(replace(scene, lights=unseen), 16, 4, max_bounces=0)
        noise.append(np.sqrt(images.var(axis=0, ddof=1).mean()))
    assert noise[1] < 0.7 * noise[0], noise


def sign() -> Scene:
    """Many faces over a floor, of which few shine, by a texture."""
    edge = np.linspace(-0.5, 0.5, 7)
    vertices = np.array([(x, 0, z) for z in edge for x in edge])
    i = (7 * np.arange(6)[:, None] + np.arange(6)).ravel()
    faces = np.concatenate([np.stack([i, i + 7, i + 1], 1), np.stack([i + 1, i + 7, i + 8], 1)])
    mesh = Mesh(vertices, faces, uvs=(vertices[faces][..., [0, 2]] + 0.5,))
    pixels = np.zeros((8, 8, 3), np.uint8)
    pixels[2:4, 5:7], pixels[6, 1] = (255, 200, 100), (0, 120, 255)
    texture = Texture(Bitmap(pixels), filter="nearest")
    lamp = Material((0.2, 0.2, 0.2), specular=0, emission=(8, 8, 8), emission_texture=texture)
    objects = (
        Object("floor", shape("plane"), "floor", scale=(4, 1, 4)),
        Object("sign", mesh, "lamp", (0, 0.6, -0.6), (60, 0, 0), (1.5, 1, 1)),
        Object("other", mesh, "lamp", (0.5, 0.4, 0.3), (-120, 0, 40), (0.5, 1, -0.5)),
    )
    materials = {"floor": Material((0.6, 0.6, 0.6), metallic=1, roughness=0.6), "lamp": lamp}
    return Scene(Camera((0, 0.8, 2.5), (0, 0.2, 0), fov_y=45), Environment(), materials, objects)


def test_emission_textures_keep_their_shares(trees: Callable[[bool], None]) -> None:
    """A face that shines with a share of its material is chosen with its share, and known when it is met."""
    images = []
    for wanted in (False, True):
        trees(wanted)
        images.append(repeat(sign(), 256, max_bounces=1))
    assert_same_mean(*images, relative=0.01)
    alone = repeat(sign(), 512, max_bounces=1, on=Device(features=("MIS_ONLY_BSDF",)))
    assert_same_mean(images[1], alone, relative=0.02)


NEW = Light("new", "disk", (0.3, 1.4, 0.6), (-90, 0, 0), radius=0.2, power=15)
EDITS: dict[str, tuple[Callable[[], Scene], Callable[[Scene], Scene]]] = {
    "move": (mixed, lambda s: s.with_light("bulb 2", position=(0.7, 1.0, 0.9))),
    "brighten": (mixed, lambda s: s.with_light("bulb 4", power=30)),
    "turn a spot": (mixed, lambda s: s.with_light("bulb 6", rotation=(-60, 0, 0))),
    "grow": (mixed, lambda s: s.with_light("bulb 5", radius=0.3)),
    "add": (mixed, lambda s: s.with_added_light(NEW)),
    "remove": (mixed, lambda s: s.without_light("bulb 9")),
    "another kind": (mixed, lambda s: s.with_light("bulb 3", kind="rectangle")),
    "triangles move": (mixed, lambda s: s.with_object("sheet", position=(0.5, 2.2, 0))),
    "triangles go": (mixed, lambda s: s.without_object("ball")),
    "triangles deform": (mixed, lambda s: s.with_object("ball", scale=(0.1, 0.3, 0.3))),
    "recolour": (mixed, lambda s: s.with_material("glow", emission=(3, 1, 0))),
    "both sides": (mixed, lambda s: s.with_material("lamp", double_sided=True)),
    "reorder": (mixed, lambda s: replace(s, objects=s.objects[::-1]).with_object("ball", position=(0, 2, 0))),
    "object": (mixed, lambda s: s.with_object("red cube", position=(0.15, 0.5, -0.1))),
    "box: move": (in_a_box, lambda s: s.with_light("bulb 0", position=(0.2, 1.1, 0.3))),
    "panes: move": (lit_by_triangles_alone, lambda s: s.with_object("pane 7", position=(0, 1, 1))),
}


@pytest.mark.parametrize("name", EDITS)
def test_a_path_that_met_nothing_that_changed_brings_the_same(
    name: str, in_blocks: bool, device: Device, trees: Callable[[bool], None]
) -> None:
    trees(True)
    make, edit = EDITS[name]
    old = make()
    check(traced_pairs(device, old, edit(old), in_blocks))


@pytest.mark.parametrize("name", ["move", "turn a spot", "box: move"])
def test_most_paths_do_not_ask_for_one_of_many(
    name: str, device: Device, trees: Callable[[bool], None]
) -> None:
    trees(True)
    make, edit = EDITS[name]
    old = make()
    assert traced_pairs(device, old, edit(old), traces_in_blocks(device)).touched.mean() < 0.4


@pytest.mark.parametrize("name", ["add", "remove"])
def test_an_edit_that_brings_or_ends_the_tree(
    name: str, in_blocks: bool, device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both scenes have it while they are compared, as the one with more lamps has."""
    make, edit = EDITS[name]
    old = make()
    new = edit(old)
    shining = sum(old.materials[obj.material].is_emissive for obj in old.objects)
    monkeypatch.setattr(tree_tables, "LEAST_LAMPS", max(len(old.lights), len(new.lights)) - 1 + shining)
    assert has_tree(old, device) != has_tree(new, device)
    pair = paired_tables(GeometryPool.of(device), old, new)
    assert all("LIGHT_TREE" in tables.variant for tables in pair)
    check(traced_pairs(device, old, new, in_blocks))


@pytest.mark.parametrize("name", ["move", "add", "remove", "triangles go", "recolour"])
def test_pairs_have_one_tree(name: str, device: Device, trees: Callable[[bool], None]) -> None:
    trees(True)
    make, edit = EDITS[name]
    old = make()
    first, second = paired_tables(GeometryPool.of(device), old, edit(old))
    assert first.buffer("light_nodes") is second.buffer("light_nodes")
    assert first.lights.tree.probability == second.lights.tree.probability


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "move",
        "add",
        "triangles go",
        *(pytest.param(name, marks=pytest.mark.statistics) for name in ("brighten", "remove", "recolour")),
    ],
)
def test_lights_of_two_scenes_bring_what_those_of_each_bring(
    name: str, device: Device, trees: Callable[[bool], None]
) -> None:
    trees(True)
    make, edit = EDITS[name]
    old = make()
    assert_choice_changes_no_mean(device, old, edit(old))


@pytest.mark.parametrize("name", ["move", "add", "remove", "triangles move", "box: move"])
def test_edits_then_convergence_equal_a_fresh_render(
    name: str, device: Device, trees: Callable[[bool], None]
) -> None:
    trees(True)
    make, edit = EDITS[name]
    old = make()
    settings = replace(SMALL, size=(20, 14), base_nor=16, strategy="impact")
    session = Session(old, settings=settings, device=device)
    session.render(64)
    session.edit(edit(old))
    session.step()
    session.render(256)
    fresh = repeat(edit(old), 128, 4, size=session.size, max_bounces=3)
    noise = np.sqrt(fresh.var(axis=0, ddof=1).mean())
    difference = session.image() - fresh.mean(axis=0)
    assert np.sqrt((difference**2).mean()) < 1.5 * noise
    assert abs(difference.mean()) < 6 * noise / np.sqrt(difference.size)
