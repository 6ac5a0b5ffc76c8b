"""The method's law: after any sequence of edits the converged picture is that of a fresh render.

A sample depends on (pixel, index, seed) alone, and every edit ends with each tile holding samples 0 to n - 1
of the scene as it is. So the law can be tested far below the noise: with the same counts, the same samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from support.law import LARGE_STEPS, assert_within_noise
from support.small_scenes import mixed_scene, sky

from incpt.device.device import Device
from incpt.render.modes import Mode
from incpt.render.session import Session
from incpt.render.strategies import strategy_of
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

pytestmark = pytest.mark.slow

Edit = Callable[[Scene], Scene]
NOR = 4

numbers = st.integers(-20, 20).map(lambda n: n / 10)
vectors = st.tuples(numbers, numbers, numbers)
scales = st.tuples(*[st.sampled_from([-1.2, -0.5, 0.3, 0.8, 1.5])] * 3)
names = st.sampled_from(["red cube", "glass ball", "grey drum", "floor", "lamp", "late"])
unit = st.integers(0, 10).map(lambda n: n / 10)


def on_object(name: str, **changes: object) -> Edit:
    return lambda scene: scene.with_object(name, **changes) if name in scene.object_index else scene


def removed(name: str) -> Edit:
    return lambda scene: scene.without_object(name) if name in scene.object_index else scene


def added(position: tuple[float, float, float], mesh: str, material: str) -> Edit:
    def edit(scene: Scene) -> Scene:
        late = Object("late", shape(mesh), material, position=position)
        return scene if "late" in scene.object_index else scene.with_added(late)

    return edit


def deformed(name: str, amount: float) -> Edit:
    def edit(scene: Scene) -> Scene:
        if name not in scene.object_index:
            return scene
        mesh = scene.object(name).mesh
        vertices = mesh.vertices * (1 + amount * np.sin(7 * mesh.vertices[:, [1, 2, 0]]))
        return scene.with_object(name, mesh=Mesh(vertices, mesh.faces, mesh.normals))

    return edit


def materials(name: str, **changes: object) -> Edit:
    return lambda scene: scene.with_material(name, **changes)


LENSES: list[dict[str, object]] = [
    {"f_stop": 0.1, "focus_distance": 3.0, "blades": 5},
    {"f_stop": 0.0, "shift_x": 0.1, "shift_y": -0.2},
    {"projection": "orthographic", "ortho_height": 3.0, "near": 0.5},
    {"projection": "perspective", "focal_length": 35.0},
]
material_names = st.sampled_from(["red", "floor", "grey", "glass", "lamp"])
edits = st.one_of(
    st.builds(lambda n, v: on_object(n, position=v), names, vectors),
    st.builds(lambda n, v: on_object(n, rotation=tuple(90 * x for x in v)), names, vectors),
    st.builds(lambda n, v: on_object(n, scale=v), names, scales),
    st.builds(lambda n, v: on_object(n, visible=v), names, st.booleans()),
    st.builds(lambda n, m: on_object(n, material=m), names, material_names),
    st.builds(
        lambda n, m: on_object(n, mesh=shape(m)), names, st.sampled_from(["cube", "cylinder", "plane"])
    ),
    st.builds(removed, names),
    st.builds(added, vectors, st.sampled_from(["cube", "sphere"]), material_names),
    st.builds(deformed, names, unit),
    st.builds(lambda n, r, m: materials(n, roughness=r, metallic=m), material_names, unit, unit),
    st.builds(lambda n, t: materials(n, transmission=t), material_names, unit),
    st.builds(lambda n, e: materials(n, emission=(e, e, 2 * e)), material_names, unit),
    st.builds(lambda x: lambda s: s.with_camera(position=(x, 1.4, 4.2)), numbers),
    st.builds(lambda c: lambda s: s.with_camera(**c), st.sampled_from(LENSES)),
    st.builds(lambda i, r: lambda s: s.with_environment(intensity=i, rotation_y=90 * r), unit, numbers),
    st.builds(lambda on: lambda s: s.with_environment(image=sky() if on else None), st.booleans()),
)


def assert_counts_agree(session: Session) -> None:
    """The host counts samples of the scene as it is now, the film those behind what it shows; both are the
    same wherever the film shows that scene, and only there the host counts any."""
    counts = session._state.film.sums()["radiance"][3]
    spp = session.spp()
    np.testing.assert_array_equal(counts[spp > 0], spp[spp > 0])
    assert session.mode is Mode.BASE or (spp > 0).all()


def apply_all(
    device: Device,
    strategy: str,
    sequence: list[tuple[Edit, int]],
    slots: int | None,
    nor_adapts: bool = True,
) -> tuple[Session, Scene]:
    scene = mixed_scene(strategy=strategy, nor=NOR, nor_adapts=nor_adapts, base_nor=NOR, slots_per_step=slots)
    session = Session(scene, size=(20, 14), device=device)
    session.render(NOR)
    # What tiles are worth in a comparison is not what the film counts.
    counts_samples = not strategy_of(session.settings).keeps_anchor
    for edit, steps in sequence:
        scene = edit(scene)
        session.edit(scene)
        if counts_samples:
            assert_counts_agree(session)
        for _ in range(steps):
            session.step()
            if counts_samples:
                assert_counts_agree(session)
    return session, scene


@hypothesis_settings(
    max_examples=25,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(
    st.sampled_from(["spiral", "restart"]),
    st.lists(st.tuples(edits, st.integers(0, 6)), min_size=1, max_size=4),
    st.sampled_from([None, 5]),
    st.booleans(),
)
def test_edits_then_convergence_equal_a_fresh_render(
    device: Device,
    strategy: str,
    sequence: list[tuple[Edit, int]],
    slots: int | None,
    nor_adapts: bool,
) -> None:
    session, scene = apply_all(device, strategy, sequence, slots, nor_adapts)
    # However far it got, every tile is brought to the same samples.
    session.render(6 * NOR)
    spp = session.spp()
    assert session.mode is Mode.REFINE
    counts = np.unique(spp)
    image = session.image()
    settings = replace(scene.settings, slots_per_step=None)
    # Of a copy of the scene no tables live, so that they are made without those of the scenes before.
    fresh = Session(replace(scene), size=(20, 14), settings=settings, device=device)
    fresh.configure(replace(fresh.settings, base_nor=1))
    for count in counts.tolist():
        fresh.render(count)
        here = spp == count
        np.testing.assert_allclose(image[here], fresh.image()[here], rtol=1e-3, atol=1e-4)
    assert nor_adapts or (counts % NOR == 0).all()


@pytest.mark.parametrize("strategy", ["spiral", "restart", "impact"])
def test_edits_then_convergence_equal_a_fresh_render_with_other_numbers(
    device: Device, strategy: str
) -> None:
    # Within noise, as the law says it: the fresh render has another seed.
    sequence = [
        (on_object("red cube", position=(0.4, 0.6, 0.2)), 1),
        (materials("grey", base_color=(0.1, 0.3, 0.8)), 0),
        (on_object("lamp", position=(-0.5, 2.2, 0.5)), 2),
    ]
    session, scene = apply_all(device, strategy, sequence, None)
    session.render(128)
    assert_within_noise(device, session, scene, 128)


@hypothesis_settings(
    max_examples=10,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(st.lists(st.tuples(edits, st.integers(0, 6)), min_size=1, max_size=4), st.sampled_from([None, 5]))
def test_impact_converges_to_a_fresh_render(
    device: Device, sequence: list[tuple[Edit, int]], slots: int | None
) -> None:
    session, scene = apply_all(device, "impact", sequence, slots)
    session.configure(replace(session.settings, slots_per_step=LARGE_STEPS))
    # Heavy tails of a few glass paths would need thousands of samples to show in both.
    session.render(256)
    assert_within_noise(device, session, scene, 128)
