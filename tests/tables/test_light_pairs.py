"""One choice of lights for two scenes: the same entries, and in each scene the densities that it needs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from support.small_scenes import mixed_scene

from incpt.benchmarks.kit.scenes import icosphere
from incpt.core.layout import LightFlag, LightPlane
from incpt.device.device import Device
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.tables import light_pairs, lights
from incpt.tables.geometry_pool import GeometryPool
from incpt.tables.light_pairs import has_same_emitters, paired_lights
from incpt.tables.lights import TriangleLights
from incpt.tables.scene_tables import paired_tables, tables_of

Planes = npt.NDArray[np.float32]
SHARE = 0.5


def lamps() -> Scene:
    """Two panes of one material, a ball of another, a cube that might glow."""
    ball = Object("ball", icosphere(1), "sun", (1, 2, 0), scale=(0.2, 0.2, 0.2))
    pane = Object("pane", shape("plane"), "lamp", (-1, 2.5, 0.5), (180, 0, 0), (0.5, 1, 0.5))
    return mixed_scene().with_material("sun", emission=(2, 2, 9)).with_added(ball, pane)


def sheared(mesh: Mesh) -> Mesh:
    vertices = mesh.vertices.copy()
    vertices[0, 0] -= 1
    return Mesh(vertices, mesh.faces, mesh.normals)


EDITS: dict[str, Callable[[Scene], Scene]] = {
    "move": lambda s: s.with_object("lamp", position=(0.3, 2.0, 0.1), rotation=(150, 33, 20)),
    "mirror": lambda s: s.with_object("lamp", scale=(-1, 1, 1)),
    "grow": lambda s: s.with_object("lamp", scale=(2, 1, 1)),
    "grow a ball": lambda s: s.with_object("ball", scale=(0.3, 0.2, 0.2)),
    "recolour": lambda s: s.with_material("lamp", emission=(1, 20, 1)),
    "both sides": lambda s: s.with_material("lamp", double_sided=True),
    "off": lambda s: s.with_material("lamp", emission=(0, 0, 0)),
    "glow": lambda s: s.with_material("red", emission=(0.5, 0, 0)),
    "remove": lambda s: s.without_object("pane"),
    "hide": lambda s: s.with_object("ball", visible=False),
    "add": lambda s: s.with_added(Object("new", shape("cube"), "sun", (3, 3, 3))),
    "reassign": lambda s: s.with_object("pane", material="sun"),
    "reassign to matt": lambda s: s.with_object("pane", material="red"),
    "rename": lambda s: s.with_object("pane", name="window"),
    "reorder": lambda s: Scene(s.camera, s.environment, s.materials, s.objects[::-1], s.settings),
    "deform": lambda s: s.with_object("pane", mesh=sheared(shape("plane"))),
    "two": lambda s: s.with_object("pane", position=(0, 3, 0)).without_object("lamp"),
    "all off": lambda s: s.with_material("lamp", emission=(0, 0, 0)).with_material("sun", emission=(0, 0, 0)),
}


def emission(table: TriangleLights) -> Planes:
    return table.planes[LightPlane.EMISSION_R : LightPlane.EMISSION_B + 1]


def flags(table: TriangleLights) -> npt.NDArray[np.uint32]:
    return table.planes[LightPlane.FLAGS].view(np.uint32)


def area(table: TriangleLights) -> npt.NDArray[np.float64]:
    a, b = (table.planes[i : i + 3].astype(np.float64) for i in (LightPlane.EDGE_1_X, LightPlane.EDGE_2_X))
    return np.asarray(np.linalg.norm(np.cross(a.T, b.T), axis=1) / 2)


def chances(table: TriangleLights) -> npt.NDArray[np.float64]:
    """Of choosing each entry, by the alias table."""
    kept = table.planes[LightPlane.ALIAS_PROBABILITY].astype(np.float64)
    alias = table.planes[LightPlane.ALIAS].view(np.uint32)
    count = table.count
    return np.asarray((kept + np.bincount(alias, 1 - kept, count)) / count)


@pytest.mark.parametrize("edit", EDITS.values(), ids=EDITS)
def test_both_scenes_choose_the_same_with_the_densities_of_their_materials(
    edit: Callable[[Scene], Scene],
) -> None:
    old = lamps()
    new = edit(old)
    for scenes in ((old, new), (new, old)):
        tables = paired_lights(*scenes, SHARE)
        first, second = tables
        assert first.count == second.count and first.densities == second.densities
        choice = [LightPlane.ALIAS_PROBABILITY, LightPlane.ALIAS]
        np.testing.assert_array_equal(first.planes[choice], second.planes[choice])
        for scene, table in zip(scenes, tables, strict=True):
            check_scene(scene, table)
        # What is the same in both scenes is not marked, and all else is.
        marked = [LightPlane.ALIAS_PROBABILITY, LightPlane.ALIAS, LightPlane.FLAGS]
        geometry = np.delete(np.arange(len(LightPlane)), marked)
        differs = (first.planes[geometry] != second.planes[geometry]).any(axis=0)
        differs |= (flags(first) ^ flags(second)) != 0
        for table in tables:
            np.testing.assert_array_equal((flags(table) & LightFlag.CHANGED) != 0, differs)


def check_scene(scene: Scene, table: TriangleLights) -> None:
    """Every emissive triangle of the scene is an entry, and has the density of its material; there are no
    others that shine."""
    shining = emission(table).any(axis=0)
    density = table.planes[LightPlane.PDF_AREA]
    assert (density[~shining] == 0).all()
    # A point of an entry is chosen with its chance, spread over its area.
    np.testing.assert_allclose(density[shining], (SHARE * chances(table) / area(table))[shining], rtol=1e-4)
    corner = table.planes[LightPlane.VERTEX_X : LightPlane.VERTEX_Z + 1]
    entries = sorted(zip(*corner[:, shining], density[shining], *emission(table)[:, shining], strict=True))
    expected = []
    for obj in lights.emissive_objects(scene):
        for corners in lights.world_corners(obj).astype(np.float32):
            pdf = np.float32(table.densities[obj.material])
            color = np.float32(scene.materials[obj.material].emission)
            expected.append((*corners[0], pdf, *color))
    np.testing.assert_array_equal(np.array(entries).reshape(-1, 7), np.array(sorted(expected)).reshape(-1, 7))
    sided = (flags(table) & LightFlag.DOUBLE_SIDED) != 0
    assert sided[shining].any() == any(
        scene.materials[obj.material].double_sided for obj in lights.emissive_objects(scene)
    )


def test_a_lamp_is_one_light_where_its_area_is_the_same() -> None:
    old = lamps()
    count = lights.triangle_lights(old, SHARE).count
    more_lights = {
        "move": 0, "recolour": 0, "off": 0, "both sides": 0, "remove": 0, "grow": 2, "grow a ball": 80,
        "glow": 12, "add": 12, "reassign": 2, "rename": 2, "deform": 1,
    }  # fmt: skip
    for name, more in more_lights.items():
        assert paired_lights(old, EDITS[name](old), SHARE)[0].count == count + more, name


def test_what_leaves_the_lights_alone_is_no_pair(device: Device) -> None:
    """Both scenes have what they have alone then, at no cost."""
    old = lamps()
    pool = GeometryPool(device)
    for new in (old, old.with_object("red cube", position=(1, 1, 1)), old.with_material("red", roughness=0.1),
                old.with_object("lamp", name="renamed"), old.without_object("glass ball")):  # fmt: skip
        assert has_same_emitters(old, new)
        tables = paired_tables(pool, old, new)
        assert tables == (tables_of(pool, old), tables_of(pool, new))
        np.testing.assert_array_equal(*(lights.triangle_lights(scene, 1.0).planes for scene in (old, new)))
    for name, edit in EDITS.items():
        assert name == "rename" or not has_same_emitters(old, edit(old)), name


def test_pairs_of_tables_leave_those_of_a_scene_alone(device: Device) -> None:
    """After a pair, a scene has its own lights again, and all but lights and materials is shared."""
    old = lamps()
    pool = GeometryPool(device)
    new = EDITS["grow"](old)
    before, after = paired_tables(pool, old, new)
    for tables, scene in ((before, old), (after, new)):
        alone = tables_of(pool, scene, tables)
        assert alone is tables.unpaired and alone.scene is scene and alone.light_count < tables.light_count
        for part in ("meshes", "objects", "top_level", "environment"):
            assert getattr(alone, part) is getattr(tables, part)
    seen_from_elsewhere = tables_of(pool, new.with_camera(position=(1, 2, 3)), after)
    assert seen_from_elsewhere.lights is tables_of(pool, new).lights
    assert seen_from_elsewhere.unpaired is None
    again = paired_tables(pool, old, old.with_object("red cube", position=(1, 1, 1)), after)
    assert again[0] is before.unpaired and again[1].light_count == again[0].light_count
    # From pair to pair, as in a drag.
    third = paired_tables(pool, old, new.with_object("lamp", scale=(3, 1, 1)), after)
    assert third[0].light_count == third[1].light_count == before.light_count


def test_a_scene_without_lights_beside_one_with_some(device: Device) -> None:
    old = EDITS["all off"](lamps())
    before, after = paired_tables(GeometryPool(device), old, lamps())
    assert "TRIANGLE_LIGHTS" in before.features and before.light_count == after.light_count > 0
    assert before.environment_probability == after.environment_probability == 0.5
    nothing = light_pairs.paired_lights(Scene(), Scene(), 1.0)
    assert [table.count for table in nothing] == [0, 0]
