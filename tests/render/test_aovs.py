"""Auxiliary images from the samples of the picture: passes of the film that blocks and wavefront write."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.small_scenes import mixed_scene, small_settings

from incpt.core import layout
from incpt.core.errors import InputError
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.formats import registry, scene_save
from incpt.render.film import ALBEDO, ALPHA, AOVS, NORMAL, RADIANCE, plane_count
from incpt.render.modes import Mode
from incpt.render.session import Session
from incpt.render.strategies import passes_of
from incpt.render.wavefront import Wavefront
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

NAMES = ("albedo", "normal", "alpha")


def session_of(device: Device, scene: Scene, in_blocks: bool = True, **settings: object) -> Session:
    session = Session(scene, settings=replace(scene.settings, **{"aovs": True, **settings}), device=device)
    if not in_blocks:
        session._tracer = Wavefront(device)
    return session


def rendered(device: Device, scene: Scene, spp: int, in_blocks: bool = True, **settings: object) -> Session:
    session = session_of(device, scene, in_blocks, **settings)
    session.render(spp)
    return session


def edge_scene() -> Scene:
    """A square that faces the camera and ends in the seventh of eight columns, of which it covers 30 %."""
    # The picture is 2 m high and 4 m wide where the square stands.
    camera = Camera(position=(0, 0, 1), target=(0, 0, 0), fov_y=90)
    square = Object(
        "square", shape("plane"), "red", position=(-3.85, 0, 0), rotation=(90, 0, 0), scale=(10, 1, 10)
    )
    return Scene(
        camera,
        materials={"red": Material(base_color=(0.8, 0.4, 0.2))},
        objects=[square],
        settings=RenderSettings(size=(8, 4), tile_size=4, max_bounces=0),
    )


def test_planes_lie_as_the_passes_of_a_film_follow_each_other() -> None:
    settings = RenderSettings(aovs=True)
    assert passes_of(settings) == (RADIANCE, ALBEDO, NORMAL, ALPHA) == (RADIANCE, *AOVS)
    assert passes_of(RenderSettings()) == (RADIANCE,)
    assert plane_count(passes_of(settings)) == len(layout.SamplePlane)
    assert plane_count((RADIANCE,)) == layout.SamplePlane.ALBEDO_R
    assert plane_count((RADIANCE, ALBEDO)) == layout.SamplePlane.NORMAL_X
    assert plane_count((RADIANCE, ALBEDO, NORMAL)) == layout.SamplePlane.ALPHA


@pytest.mark.parametrize("in_blocks", [True, False])
def test_an_edge_is_as_bright_as_its_share_of_the_pixel(device: Device, in_blocks: bool) -> None:
    session = rendered(device, edge_scene(), 2048, in_blocks, sample_rate=64)
    coverage = np.float32([1, 1, 1, 1, 1, 1, 0.3, 0])
    for name, value in (("albedo", (0.8, 0.4, 0.2)), ("normal", (0, 0, 1)), ("alpha", (1,))):
        image = session.pass_image(name)
        assert image.shape == (4, 8, len(value)) and image.dtype == np.float32
        whole = coverage != np.float32(0.3)
        expected = np.broadcast_to(coverage[:, None] * np.float32(value), image.shape)
        np.testing.assert_allclose(image[:, whole], expected[:, whole], atol=1e-6)
        # The samples of a pixel are spread evenly over it.
        np.testing.assert_allclose(image, expected, atol=3e-3)


def test_values_are_those_of_the_same_rays_as_radiance(device: Device) -> None:
    """Of a surface that emits its base colour and reflects nothing to be seen, radiance is the albedo."""
    scene = edge_scene()
    materials = {"red": Material(base_color=(0.5, 0.25, 0.125), emission=(0.5, 0.25, 0.125))}
    scene = replace(scene, materials=materials, environment=Environment((0, 0, 0)))
    for in_blocks in (True, False):
        session = rendered(device, scene, 3, in_blocks)
        np.testing.assert_allclose(session.pass_image("albedo"), session.image(), rtol=1e-6)
        assert 0 < session.image()[:, 6, 0].mean() < 0.5


@pytest.mark.parametrize("in_blocks", [True, False])
def test_inside_of_objects_they_are_those_of_pixel_centres(device: Device, in_blocks: bool) -> None:
    session = rendered(device, mixed_scene(), 8, in_blocks)
    expected = session.first_hits()
    ids, inside = expected.object_id, np.zeros((28, 44), bool)
    inside[2:-2, 2:-2] = True
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            inside &= np.roll(ids, (dy, dx), (0, 1)) == ids
    albedo, normal = session.pass_image("albedo"), session.pass_image("normal")
    assert len(np.unique(ids[inside])) >= 4
    np.testing.assert_allclose(albedo[inside], expected.albedo[inside], atol=1e-6)
    flat = inside & np.isin(ids, [-1, 0])  # sky and floor
    np.testing.assert_allclose(normal[flat], expected.normal[flat], atol=1e-5)
    ball = inside & (ids == 2)
    assert np.abs(normal[ball] - expected.normal[ball]).max() < 0.3
    assert not albedo[ids == -1][0].any()


def test_blocks_and_wavefront_agree(device: Device) -> None:
    blocks = rendered(device, mixed_scene(), 4)
    wavefront = session_of(device, mixed_scene())
    wavefront._tracer = tracer = Wavefront(device)
    tracer.chunk_paths = 320
    wavefront.render(4)
    for name in NAMES:
        found, expected = blocks.pass_image(name), wavefront.pass_image(name)
        assert np.mean(np.abs(found - expected).max(axis=2) > 1e-5) < 0.005
        assert found.any()


@pytest.mark.parametrize("in_blocks", [True, False])
def test_radiance_is_the_same_with_and_without(device: Device, in_blocks: bool) -> None:
    images = []
    for aovs in (False, True):
        session = rendered(device, mixed_scene(), 4, in_blocks, aovs=aovs)
        images.append(session.image())
        assert session._state.path_buffer.planes == (10 if aovs else 3)
    np.testing.assert_array_equal(*images)


def test_what_paths_of_the_step_before_left_is_overwritten(device: Device) -> None:
    """Also where rays of the next step leave the scene."""
    for in_blocks in (True, False):
        session = rendered(device, mixed_scene(), 1, in_blocks)
        assert session.pass_image("albedo").any()
        session.edit(replace(session.scene, objects=()))
        session.render(1)
        assert not any(session.pass_image(name).any() for name in NAMES)


def test_an_edit_replaces_all_passes_together(device: Device) -> None:
    session = rendered(device, mixed_scene(), 3, slots_per_step=40, strategy="spiral", nor_adapts=False)
    before = {name: session.pass_image(name) for name in ("radiance", *NAMES)}
    edited = session.scene.with_object("red cube", position=(0.3, 0.8, 0.2), rotation=(20, 50, 0))
    session.edit(edited)
    assert session.mode is Mode.INCREMENTAL
    session.step()
    fresh = rendered(device, edited, 16, strategy="restart")
    done = session.spp() == 16
    assert done.any() and not done.all()
    for name, old in before.items():
        image = session.pass_image(name)
        np.testing.assert_allclose(image[done], fresh.pass_image(name)[done], rtol=1e-3, atol=1e-4)
        np.testing.assert_array_equal(image[~done], old[~done])
    counts = {name: sums[-1] for name, sums in session._state.film.sums().items()}
    assert list(counts) == ["radiance", *NAMES]
    for count in counts.values():
        np.testing.assert_array_equal(count, session.spp())


def test_a_snapshot_holds_them(device: Device) -> None:
    session = rendered(device, mixed_scene(), 2)
    snapshot, before = session.snapshot(), {name: session.pass_image(name) for name in NAMES}
    other = Session(Scene(settings=small_settings()), device=device)
    other.restore(snapshot)
    assert other.settings.aovs
    for name, image in before.items():
        np.testing.assert_array_equal(other.pass_image(name), image)
    session.render(3)
    other.render(3)
    for name in NAMES:
        np.testing.assert_array_equal(other.pass_image(name), session.pass_image(name))


def test_the_setting_starts_another_film(device: Device) -> None:
    session = Session(mixed_scene(), device=device)
    session.render(2)
    session.configure(replace(session.settings, aovs=True))
    assert session.mode is Mode.BASE and not session.spp().any()
    session.render(1)
    assert session.pass_image("normal").any()
    session.configure(replace(session.settings, aovs=False))
    assert session.mode is Mode.BASE and session._state.path_buffer.planes == 3


def test_a_pass_that_there_is_not_is_an_error_with_the_names(device: Device) -> None:
    session = Session(mixed_scene(), device=device)
    session.step()
    np.testing.assert_array_equal(session.pass_image("radiance"), session.image())
    with pytest.raises(InputError, match=r"pass 'albedo': .*one of radiance; the setting aovs adds albedo"):
        session.pass_image("albedo")
    with pytest.raises(InputError, match=r"pass 'depth': .*one of radiance, albedo, normal, alpha$"):
        session_of(device, mixed_scene()).pass_image("depth")


@pytest.mark.parametrize("value", [1, None, "yes"])
def test_the_setting_is_true_or_false(value: object) -> None:
    with pytest.raises(InputError, match=r"aovs: .* is not true or false"):
        RenderSettings(aovs=value)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("in_blocks", [True, False])
def test_build_leaves_no_kernel_to_be_built(monkeypatch: pytest.MonkeyPatch, in_blocks: bool) -> None:
    # For what is built, launches of one size will do.
    monkeypatch.setattr("incpt.render.wavefront.BUILD_SIZES", (1,))
    own = Device()
    session_of(own, mixed_scene(), in_blocks, aovs=False).build()
    session = session_of(own, mixed_scene(), in_blocks)
    session.build()
    monkeypatch.setattr(own, "build", None)
    session.render(2)
    assert session.pass_image("albedo").any()


def test_a_scene_file_may_ask_for_them(tmp_path: Path) -> None:
    scene_save.save(mixed_scene(aovs=True), tmp_path / "a.toml")
    assert "\naovs = true\n" in (tmp_path / "a.toml").read_text()
    assert registry.load(tmp_path / "a.toml").settings.aovs


@pytest.mark.slow
def test_under_impact_they_are_of_the_edited_scene(device: Device) -> None:
    """In a drag, too, where what the step before it showed is in neither scene, and after undo."""
    start = mixed_scene()
    session = rendered(device, start, 64, strategy="impact")
    dragged = [start.with_object("red cube", position=(x, 0.9, 1.2)) for x in (-1.0, 0.9, 0.0)]
    for scene in (*dragged, start, dragged[0]):
        session.edit(scene, since=start)
        while session.mode is Mode.INCREMENTAL:
            session.step(7)
        session.render(8)
        for _ in range(8):
            session.step()
        fresh = rendered(device, scene, 64, seed=1)
        for name in NAMES:
            error = np.abs(session.pass_image(name) - fresh.pass_image(name)).max(axis=2)
            # Outlines differ where pixels have few samples.
            assert np.mean(error > 0.1) < 0.05
