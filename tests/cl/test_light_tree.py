"""Choices by the light tree: samples against their chances, and those against 1."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import SIGNIFICANCE, call, chi_square, uniforms
from support.light_trees import Tree, made_up

from incpt.core import layout
from incpt.tables.light_tree import TreeLights

Array = npt.NDArray[np.floating]
FEATURES = ("SHAPED_LIGHTS", "LIGHT_TREE")


def inputs(tree: Tree) -> dict[str, npt.NDArray[Any]]:
    params = np.zeros(1, layout.PARAMS)
    params["light_levels"] = tree.levels
    return {"all_params": params, "nodes": tree.nodes}


_BEGIN = """
    const Params params = all_params[0];
    Emitters emitters;
    emitters.light_nodes = nodes;
    Receiver receiver;
    receiver.position = vec3(px[i], py[i], pz[i]);
    receiver.normal = vec3(nx[i], ny[i], nz[i]);
    receiver.all_sides = all_sides[i];
"""


def receivers(positions: Array, normals: Array | None) -> dict[str, Array]:
    """Of positions (N, 3) and normals (N, 3), or from all sides."""
    all_sides = np.full(len(positions), float(normals is None))
    normals = np.zeros_like(positions) if normals is None else normals
    names = ("px", "py", "pz", "nx", "ny", "nz")
    columns = dict(zip(names, np.concatenate([positions, normals], axis=1).T, strict=True))
    return {**columns, "all_sides": all_sides}


def sampled(
    tree: Tree, choice: Array, positions: Array, normals: Array | None, features: tuple[str, ...] = FEATURES
) -> tuple[Array, Array]:
    """The numbers (N,) of the lights that are chosen, and their chances."""
    number, chance = call(
        "light",
        _BEGIN
        + """
    LightWalk walk = {choice[i], 0u, 1.0f};
    for (uint level = 0u; level < params.light_levels; level++)
        light_step(emitters.light_nodes, &receiver, &walk);
    number[i] = (float)(walk.node & ~NODE_LEAF);
    chance[i] = walk.chance;""",
        len(choice), ("number", "chance"), features, **inputs(tree), choice=choice,
        **receivers(positions, normals),
    )  # fmt: skip
    return number.astype(int), chance


def chances(tree: Tree, trails: npt.NDArray[np.uint32], positions: Array, normals: Array | None) -> Array:
    """(N,) of the lights with these trails."""
    (chance,) = call(
        "light",
        _BEGIN + "chance[i] = chance_of_light(&params, &emitters, &receiver, trail[i]);",
        len(trails), ("chance",), FEATURES, **inputs(tree), trail=trails, **receivers(positions, normals),
    )  # fmt: skip
    return chance


def all_chances(tree: Tree, position: Array, normal: Array | None) -> Array:
    """(count,) of all lights for one receiver."""
    count = len(tree.trails)
    positions = np.broadcast_to(position, (count, 3))
    return chances(
        tree, tree.trails, positions, None if normal is None else np.broadcast_to(normal, (count, 3))
    )


UP = np.array([0.0, 1.0, 0.0])
PLACES = {
    "inside": np.array([0.1, -0.2, 0.3]),
    "below": np.array([0.3, -1.5, 0.2]),
    "far": np.array([900.0, -300.0, 500.0]),
    "10 km": np.array([10_000.0, 10.0, -2000.0]),
}


@pytest.mark.parametrize("normal", [None, UP], ids=["all sides", "normal"])
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("count", [1, 8, 9, 70, 900])
def test_chances_add_up_to_one(count: int, place: str, normal: Array | None) -> None:
    chance = all_chances(Tree.of(made_up(count)), PLACES[place], normal)
    assert (chance > 0).all()
    assert chance.sum(dtype=np.float64) == pytest.approx(1, rel=2e-5)


def test_chances_on_a_light_itself() -> None:
    lights = made_up(300)
    for i in range(3):
        chance = all_chances(Tree.of(lights), lights.bounds[i].mean(axis=0), None)
        assert (chance > 0).all() and chance.sum(dtype=np.float64) == pytest.approx(1, rel=2e-5)


def test_chances_far_from_the_origin() -> None:
    lights = made_up(300, offset=10_000.0)
    for place in (np.full(3, 10_000.0), np.array([10_002.0, 9998.0, 10_000.5])):
        chance = all_chances(Tree.of(lights), place, UP)
        assert (chance > 0).all() and chance.sum(dtype=np.float64) == pytest.approx(1, rel=2e-5)


@pytest.mark.parametrize("normal", [None, UP], ids=["all sides", "normal"])
@pytest.mark.parametrize("place", ["inside", "below", "far"])
@pytest.mark.parametrize("count", [5, 9, 300])
def test_samples_follow_their_chances(count: int, place: str, normal: Array | None) -> None:
    lights = made_up(count)
    tree, (choice,) = Tree.of(lights), uniforms(200_000, 1, seed=7)
    normals = None if normal is None else np.broadcast_to(normal, (len(choice), 3))
    number, chance = sampled(tree, choice, np.broadcast_to(PLACES[place], (len(choice), 3)), normals)
    expected = np.zeros(count)
    expected[lights.numbers] = all_chances(tree, PLACES[place], normal)
    # What a sample knows of its chance is what a ray finds that meets the light, to the bit.
    np.testing.assert_array_equal(chance, expected[number].astype(np.float32))
    assert chi_square(np.bincount(number, minlength=count), expected * len(choice)) > SIGNIFICANCE


@pytest.mark.parametrize("normal", [None, UP], ids=["all sides", "normal"])
def test_processors_without_vectors_choose_the_same(normal: Array | None) -> None:
    tree, random = Tree.of(made_up(700)), np.random.default_rng(6)
    (choice,), positions = uniforms(20_000, 1, seed=9), random.uniform(-2, 2, (20_000, 3))
    normals = None if normal is None else np.broadcast_to(normal, positions.shape)
    number, chance = sampled(tree, choice, positions, normals)
    portable, its_chance = sampled(tree, choice, positions, normals, (*FEATURES, "PORTABLE_LANES"))
    same = number == portable
    assert same.mean() > 0.99  # a share of the choices lies near an end
    np.testing.assert_allclose(chance[same], its_chance[same], rtol=0.02)


def test_the_ends_of_the_choices_lead_to_lights() -> None:
    tree = Tree.of(made_up(13))
    ends = np.array([0.0, 2.0**-24, 0.5, 0.99999994], np.float32)
    for position in np.random.default_rng(2).uniform(-2, 2, (200, 3)):
        number, chance = sampled(tree, ends, np.broadcast_to(position, (4, 3)), None)
        assert ((number >= 0) & (number < 13)).all() and (chance > 0).all()


def brings(lights: TreeLights, position: Array, normal: Array) -> Array:
    """(N,) what each light may bring a receiver at most, up to a factor; of points in the middle of it."""
    way = lights.bounds.mean(axis=1) - position
    distance2 = (way**2).sum(axis=1)
    way /= np.sqrt(distance2)[:, None]
    angle = np.arccos(np.clip(-(way * lights.axis).sum(axis=1), -1, 1)) - lights.spread
    shines = np.where(angle < lights.falloff, np.cos(np.maximum(angle, 0)), 0)
    return np.asarray(lights.power / distance2 * shines * np.maximum(way @ normal, 0))


def looking_inwards(random: np.random.Generator, count: int) -> list[tuple[Array, Array]]:
    """Positions and normals of receivers that some lights shine on."""
    positions = random.uniform(-1.3, 1.3, (count, 3))
    normals = random.normal(size=(count, 3)) - positions
    return list(zip(positions, normals / np.linalg.norm(normals, axis=1)[:, None], strict=True))


def test_chances_follow_what_lights_bring() -> None:
    """Few choices go to what brings nothing, and what brings much is not forgotten."""
    lights = made_up(900, size=0.001)
    tree, random = Tree.of(lights), np.random.default_rng(5)
    wasted, squares, by_power = [], [], []
    for position, normal in looking_inwards(random, 40):
        chance, worth = all_chances(tree, position, normal), brings(lights, position, normal)
        wasted.append(chance[worth == 0].sum())
        share = worth / worth.sum()
        squares.append((share**2 / chance).sum())
        by_power.append((share**2 / (lights.power / lights.power.sum())).sum())
    assert np.mean(wasted) < 0.25
    # The mean square of a sample over the square of the mean.
    assert np.median(squares) < 4 and np.median(by_power) > 4 * np.median(squares)


def test_no_light_of_a_large_group_is_given_up() -> None:
    """Bounds of a group leave more than the least to each light that brings something."""
    random = np.random.default_rng(8)
    for seed in range(6):
        lights = made_up(64, seed=seed, size=0.001)
        tree = Tree.of(lights)
        for position, normal in looking_inwards(random, 20):
            worth = brings(lights, position, normal)
            chance = all_chances(tree, position, normal)
            much = worth > max(0.05 * worth.sum(), 1e-9)
            assert (chance[much] * worth.sum() > 0.03 * worth[much]).all()


def test_packed_normals() -> None:
    random = np.random.default_rng(3)
    axes = np.concatenate([np.eye(3), -np.eye(3), [[1, 1, 1], [-1, -1, -1], [1, -1, 0], [1e-9, 0, -1]]])
    n = np.concatenate([axes, random.normal(size=(5000, 3))])
    n /= np.linalg.norm(n, axis=1)[:, None]
    x, y, z, none = call(
        "light",
        """
    const uint packed = packed_normal(vec3(x[i], y[i], z[i]));
    const Vec3 n = unpacked_normal(packed);
    rx[i] = n.x;
    ry[i] = n.y;
    rz[i] = n.z;
    none[i] = packed == NO_INDEX ? 1.0f : 0.0f;""",
        len(n), ("rx", "ry", "rz", "none"), FEATURES, x=n[:, 0], y=n[:, 1], z=n[:, 2],
    )  # fmt: skip
    np.testing.assert_allclose(np.stack([x, y, z], axis=1), n, atol=1e-4)
    assert not none.any()
