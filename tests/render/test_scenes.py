"""The scenes that are shipped: they load, hold what they promise, and give a picture."""

from __future__ import annotations

import warnings
from collections import Counter
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from incpt.core.layout import MaterialTrait
from incpt.device.device import Device
from incpt.formats.edit_script import load_edits
from incpt.formats.registry import load
from incpt.picture.tone_mapping import tone_map
from incpt.render.session import Session
from incpt.scene.change import diff
from incpt.scene.light import KINDS
from incpt.scene.model import Scene
from incpt.scenes import make_city, make_many_lamps
from incpt.tables.materials import traits_of

FOLDER = Path(str(resources.files("incpt.scenes")))
NAMES = (
    "editing", "nested_dielectrics", "cornell", "mis", "bunny", "city", "textured", "lamps", "many_lamps",
    "cameras", "materials",
)  # fmt: skip
FLOOR_TOLERANCE = 0.01
"""Metres that an object may stand above or in its floor."""


@pytest.fixture(scope="module")
def scenes() -> dict[str, Scene]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return {name: load(FOLDER / f"{name}.toml") for name in NAMES}


@pytest.fixture(scope="module")
def device() -> Device:
    return Device()


def test_every_scene_file_is_tested() -> None:
    found = {path.stem for path in FOLDER.glob("*.toml") if not path.name.endswith(".edits.toml")}
    assert found == set(NAMES)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_scene_gives_a_picture(name: str, scenes: dict[str, Scene], device: Device) -> None:
    """No sample is lost, and the tone-mapped picture is neither black nor blown out, and not flat."""
    session = Session(scenes[name], size=(64, 36), device=device)
    reports = []
    session.render(8, reports.append)
    assert sum(report.nonfinite for report in reports) == 0
    image = session.image()
    assert np.isfinite(image).all() and image.min() >= 0
    grey = tone_map(image).mean(axis=2)
    assert 25 < np.median(grey) < 215
    assert (grey > 250).mean() < 0.1
    assert (grey < 3).mean() < 0.1 or name == "cornell"  # beside the box there is nothing
    assert grey.std() > 15


@pytest.mark.parametrize("name", NAMES)
def test_no_material_is_left_over(name: str, scenes: dict[str, Scene]) -> None:
    scene = scenes[name]
    assert {obj.material for obj in scene.objects} == set(scene.materials)


@pytest.mark.parametrize(("name", "floor"), [("editing", "floor"), ("bunny", "table")])
def test_objects_stand_on_the_floor(name: str, floor: str, scenes: dict[str, Scene]) -> None:
    for obj in scenes[name].objects:
        if obj.name not in (floor, "light panel"):
            vertices = obj.mesh.vertices @ obj.world_from_object[:, :3].T + obj.world_from_object[:, 3]
            assert abs(vertices[:, 1].min()) < FLOOR_TOLERANCE, obj.name


@pytest.mark.parametrize("name", ["editing", "bunny"])
def test_the_panel_shines_on_what_is_there(name: str, scenes: dict[str, Scene]) -> None:
    panel = scenes[name].object("light panel")
    towards_objects = np.array([0.0, 0.5, 0.0]) - panel.position
    front = panel.world_from_object[:, 1]
    assert front @ towards_objects > 0.8 * np.linalg.norm(towards_objects)


def test_editing_has_the_objects_of_the_thesis(scenes: dict[str, Scene]) -> None:
    scene = scenes["editing"]
    floor = scene.material(scene.object("floor").material)
    assert floor.metallic == 1 and floor.roughness == pytest.approx(0.15)
    assert scene.material(scene.object("large translucent cube").material).transmission == 1
    small, red, large = (scene.object(n) for n in ("small grey cube", "red cube", "large translucent cube"))
    assert small.mesh is red.mesh is large.mesh
    assert small.position[0] < -1 and abs(red.position[0]) < 0.5 and abs(large.position[0]) < 0.5
    assert large.scale[0] > 2 * max(small.scale[0], red.scale[0])
    assert scene.environment.image is not None
    assert sum(scene.material(o.material).is_emissive for o in scene.objects) == 1


def test_the_red_cube_is_seen(scenes: dict[str, Scene], device: Device) -> None:
    """Each of the cubes to edit covers a fair part of the picture, the red one nothing hides."""
    scene = scenes["editing"]
    session = Session(scene, size=(96, 54), device=device)
    seen = Counter(session.first_hits().object_id.ravel().tolist())
    shares = {obj.name: seen[i] / (96 * 54) for i, obj in enumerate(scene.objects)}
    assert shares["small grey cube"] > 0.015
    assert shares["large translucent cube"] > 0.06
    alone = Session(scene.without_object("large translucent cube"), size=(96, 54), device=device)
    red = [o.name for o in alone.scene.objects].index("red cube")
    seen_alone = np.sum(alone.first_hits().object_id == red)
    assert seen_alone == round(shares["red cube"] * 96 * 54) > 0.015 * 96 * 54


def test_edits_are_those_of_the_thesis(scenes: dict[str, Scene]) -> None:
    scene = scenes["editing"]
    script = load_edits(FOLDER / "editing.edits.toml", scene)
    assert not script.cumulative
    assert [edit.capture for edit in script] == [(0, 2, 5, 10), (0, 2, 5, 10), (0, 5, 15, 30)]
    names = ["small grey cube", "red cube", "large translucent cube"]
    after = script.scenes(scene)
    assert [diff(scene, new).moved for new in after] == [{name} for name in names]
    assert [diff(scene, new).is_global for new in after] == [False] * 3
    small, red, large = (new.object(name) for new, name in zip(after, names, strict=True))
    assert small.scale[0] < scene.object(names[0]).scale[0]
    for obj in (small, red, large):
        assert obj.world_bounds[0, 1] == pytest.approx(0.0, abs=FLOOR_TOLERANCE)
    turned = np.subtract(red.rotation, scene.object(names[1]).rotation)
    assert turned[2] != 0 and not turned[:2].any()
    moved = np.subtract(large.position, scene.object(names[2]).position)
    assert moved[0] != 0 and not moved[1:].any()


def test_nested_dielectrics_is_falcors(scenes: dict[str, Scene]) -> None:
    scene = scenes["nested_dielectrics"]
    assert scene.camera.position == (0.0, 0.2, 2.5) and scene.camera.target == (0.0, 0.2, 0.0)
    assert np.tan(np.radians(scene.camera.fov_y / 2)) == pytest.approx(12 / 20, abs=1e-5)
    assert not any(material.is_emissive for material in scene.materials.values())
    glass = scene.material("glass")
    assert (glass.ior, glass.priority, glass.absorption) == (1.52, 2, (2.0, 1.0, 1.5))
    large = [o for o in scene.objects if o.scale == (0.6, 1.0, 0.2)]
    small = [o for o in scene.objects if o.scale == (0.5, 0.1, 0.15)]
    assert [o.position for o in large] == [(x, 0.55, 0.0) for x in range(-2, 3)]
    assert len(small) == 25 and len(scene.objects) == 31
    liquids = [scene.material(o.material) for o in small if o.position[0] > -0.5]
    assert Counter(liquid.priority for liquid in liquids) == {1: 5, 2: 5, 3: 5}
    assert {(liquid.ior, liquid.absorption) for liquid in liquids} == {(1.333, (10.0, 20.0, 30.0))}


def test_cornell_box_is_closed_but_for_its_front(scenes: dict[str, Scene], device: Device) -> None:
    scene = scenes["cornell"]
    session = Session(scene, size=(64, 64), device=device)
    seen = session.first_hits().object_id
    assert (seen[3:-3, 3:-3] >= 0).all()
    assert {scene.objects[i].name for i in np.unique(seen[seen >= 0])} == {o.name for o in scene.objects}
    low, high = np.stack([o.world_bounds for o in scene.objects]).T.reshape(3, 2, -1).transpose(1, 0, 2)
    np.testing.assert_allclose(high.max(axis=1) - low.min(axis=1), (0.556, 0.5488, 0.5592), atol=1e-4)


def test_lights_of_mis_have_equal_power(scenes: dict[str, Scene]) -> None:
    scene = scenes["mis"]
    plates = [scene.material(f"plate {i}").roughness for i in range(1, 5)]
    assert plates == sorted(plates) and plates[-1] > 4 * plates[0]
    lights = [scene.light(f"light {i}") for i in range(1, 5)]
    powers = [np.array([0.2126, 0.7152, 0.0722]) @ light.watts for light in lights]
    assert lights[-1].radius > 20 * lights[0].radius
    np.testing.assert_allclose(powers, powers[0], rtol=0.01)


def test_lamps_has_every_kind(scenes: dict[str, Scene]) -> None:
    assert {light.kind for light in scenes["lamps"].lights} == set(KINDS)


def test_many_lamps_are_what_their_script_makes(tmp_path: Path, scenes: dict[str, Scene]) -> None:
    assert len(scenes["many_lamps"].lights) > 3000
    make_many_lamps.main(tmp_path)
    made, shipped = ((folder / "many_lamps.toml").read_text("utf-8") for folder in (tmp_path, FOLDER))
    assert made.splitlines()[:9] == shipped.splitlines()[:9]
    # Sine and cosine may differ in the last bit, and with it the last digit.
    new, old = load(tmp_path / "many_lamps.toml"), scenes["many_lamps"]
    assert [light.name for light in new.lights] == [light.name for light in old.lights]
    places = [[light.position for light in scene.lights] for scene in (new, old)]
    np.testing.assert_allclose(*places, rtol=2e-3, atol=1e-6)


def test_materials_has_every_trait(scenes: dict[str, Scene]) -> None:
    shown = set().union(*map(traits_of, scenes["materials"].materials.values()))
    assert shown == set(MaterialTrait) - {
        MaterialTrait.SPECULAR_COLOR, MaterialTrait.UNLIT, MaterialTrait.CLEAR_WALL,
    }  # fmt: skip


def test_city_is_large(scenes: dict[str, Scene]) -> None:
    scene = scenes["city"]
    meshes = {id(obj.mesh): obj.mesh for obj in scene.objects}
    assert len(scene.object("tower").mesh.faces) >= 300_000
    assert len(scene.objects) > 500 and len(meshes) < 20
    assert max(Counter(id(obj.mesh) for obj in scene.objects).values()) > 100


@pytest.mark.slow
def test_city_is_what_its_script_makes(tmp_path: Path) -> None:
    """Compressed bytes differ between versions of zlib, so what is in them is compared."""
    make_city.main(tmp_path)
    assert (tmp_path / "city.toml").read_bytes() == (FOLDER / "city.toml").read_bytes()
    made = sorted(path.name for path in tmp_path.glob("*.npz"))
    assert made == sorted(path.name for path in FOLDER.glob("city_*.npz"))
    for name in made:
        with np.load(tmp_path / name) as new, np.load(FOLDER / name) as shipped:
            np.testing.assert_array_equal(new["faces"], shipped["faces"])
            # Sine and cosine may differ in the last bit, and with it what is rounded to the grid.
            np.testing.assert_allclose(new["vertices"], shipped["vertices"], atol=make_city.GRID * 1.01)


def test_assets_are_small() -> None:
    files = [path for path in FOLDER.iterdir() if path.is_file()]
    assert max(path.stat().st_size for path in files) < 2_000_000
    assert sum(path.stat().st_size for path in files) < 4_000_000
