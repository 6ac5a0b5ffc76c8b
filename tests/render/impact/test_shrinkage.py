"""The shown picture: equal to the reference, right where nothing changed, better than what it is made of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from render.impact import made_up, reference
from render.impact.made_up import Rig

from incpt.device.device import Device
from incpt.render.film import RADIANCE
from incpt.render.impact.sums import PAIR_SUMS
from incpt.render.tiles import TileGrid

SIZES = [(70, 45), (32, 8), (5, 3), (64, 16), (33, 50), (530, 20)]


def sampled(
    width: int, height: int, spp: int, seed: int = 0, single_from: int = 99, kept: float = made_up.KEPT
) -> tuple[made_up.Edit, reference.State]:
    rng = np.random.default_rng(seed)
    edit = made_up.edit(width, height, rng)
    state = edit.state(rng, kept)
    for index in range(spp):
        state.add(index, *edit.samples(rng), single=index >= single_from)
    return edit, state


@pytest.mark.slow
@pytest.mark.parametrize("spp", [0, 1, 2, 5])
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_pictures_equal_the_reference(device: Device, size: tuple[int, int], spp: int) -> None:
    edit, state = sampled(*size, spp)
    rig = Rig(device, *size)
    rig.load(state, edit.guides)
    np.testing.assert_allclose(rig.picture(), reference.picture(state, edit.guides), atol=1e-4)


def test_pictures_with_samples_that_have_no_partners(device: Device) -> None:
    edit, state = sampled(70, 45, 6, single_from=2)
    rig = Rig(device, 70, 45)
    rig.load(state, edit.guides)
    np.testing.assert_allclose(rig.picture(), reference.picture(state, edit.guides), atol=1e-4)


def test_pictures_after_a_sixteenth_of_the_samples(device: Device) -> None:
    """Most pixels have none, and show what their neighbours know."""
    rng = np.random.default_rng(4)
    edit = made_up.edit(70, 45, rng)
    state = edit.state(rng)
    for index, (y, x) in enumerate([(0, 0), (2, 3)]):
        new, old, met = edit.samples(rng)
        here = np.zeros(met.shape, bool)
        here[y::4, x::4] = True
        state.add(index, np.where(here[..., None], new, np.nan), old, met)
    rig = Rig(device, 70, 45)
    rig.load(state, edit.guides)
    shown = rig.picture()
    np.testing.assert_allclose(shown, reference.picture(state, edit.guides), atol=1e-4)
    without = state.samples.sum(0) == 0
    assert (np.abs(shown - state.anchor)[without].max(-1) > 0.05).any()


def test_only_one_half_has_samples(device: Device) -> None:
    edit, state = sampled(40, 24, 1)
    for plane in (state.new, state.old, state.samples, state.pairs):
        plane[1] = 0
    rig = Rig(device, 40, 24)
    rig.load(state, edit.guides)
    shown = rig.picture()
    np.testing.assert_allclose(shown, reference.picture(state, edit.guides), atol=1e-4)
    # One half alone cannot tell a change from noise.
    np.testing.assert_allclose(shown, state.anchor + reference.refinement(state), atol=1e-6)


def test_some_pixels_have_samples_in_one_half_only(device: Device) -> None:
    edit, state = sampled(70, 45, 4)
    for plane in (state.new, state.old, state.samples, state.pairs):
        plane[1, :, ::3] = 0
    rig = Rig(device, 70, 45)
    rig.load(state, edit.guides)
    np.testing.assert_allclose(rig.picture(), reference.picture(state, edit.guides), atol=1e-4)


def test_where_no_path_met_a_change_the_old_picture_is_refined_and_no_more(device: Device) -> None:
    edit, state = sampled(200, 60, 3)
    state.touched[:, 100:] = 0
    edit.guides.changed[:, 100:] = False
    rig = Rig(device, 200, 60)
    rig.load(state, edit.guides)
    shown, refined = rig.picture(), state.anchor + reference.refinement(state)
    # From cells that met a change it is taken two cells further, and smoothed over 15 pixels.
    far = np.s_[:, 104 + 2 * 8 + 16 :]
    np.testing.assert_allclose(shown[far], refined[far], atol=1e-6)
    assert np.abs(shown - refined)[:, :100].max() > 0.1


@pytest.mark.parametrize("place", [(20, 20), (100, 150), (180, 290)], ids=str)
def test_a_large_change_before_a_small_one_leaves_nothing(device: Device, place: tuple[int, int]) -> None:
    """The planes that pictures are made in are those of the picture before, and what it had far from what
    changes now must not show at the borders of that."""
    width, height = 300, 200
    edit, large = sampled(width, height, 3)
    large.touched[:] = 1
    large.new[:] += 5 * large.samples[..., None]
    _, small = sampled(width, height, 3, seed=1)
    small.touched[:] = 0
    small.touched[place] = 1
    small.new[:] = small.old
    edit.guides.changed[:] = False
    rig, fresh = Rig(device, width, height), Rig(device, width, height)
    rig.load(large, edit.guides)
    rig.picture()
    for one in (rig, fresh):
        one.load(small, edit.guides)
    np.testing.assert_array_equal(rig.picture(), fresh.picture())
    np.testing.assert_array_equal(rig.picture(), fresh.picture())


def test_without_pairs_the_picture_is_the_kept_one(device: Device) -> None:
    edit, state = sampled(70, 45, 0)
    rig = Rig(device, 70, 45)
    rig.load(state, edit.guides)
    np.testing.assert_array_equal(rig.picture(), rig.film.image()[..., :3])
    assert (rig.shrinkage.image()[..., 3] == 1).all()


def test_pixels_without_any_sample_are_marked(device: Device) -> None:
    edit, state = sampled(40, 24, 0, kept=0)
    state.samples[0, 5, 7] = 1
    rig = Rig(device, 40, 24)
    rig.load(state, edit.guides)
    rig.picture()
    alpha = rig.shrinkage.image()[..., 3]
    assert alpha[5, 7] == 1 and alpha.sum() == 1


def error(picture: reference.Array, truth: reference.Array) -> float:
    return float(np.sqrt(((picture - truth) ** 2).mean()))


@pytest.mark.parametrize(("spp", "most"), [(1, 0.4), (2, 0.55), (8, 0.8)])
def test_shrinkage_takes_noise_away(device: Device, spp: int, most: float) -> None:
    """Against the change as the samples show it, of which nothing is held back."""
    edit, state = sampled(160, 96, spp)
    rig = Rig(device, 160, 96)
    rig.load(state, edit.guides)
    rule = reference.rule_of_pixels(reference.known(state, edit.guides.changed), edit.guides.changed)
    samples = state.samples / np.maximum(state.samples.sum(0), 1)
    change = (reference.changes(state, reference.pair_weight(state, rule)) * samples[..., None]).sum(0)
    plain = error(state.anchor + reference.refinement(state) + change, edit.new)
    assert error(rig.picture(), edit.new) < most * plain
    assert error(rig.picture(), edit.new) < 0.5 * error(state.anchor, edit.new)


def test_the_picture_converges(device: Device) -> None:
    """Everything that is true of the change is shown in the end, whatever the guides say."""
    rng = np.random.default_rng(0)
    edit = made_up.edit(64, 40, rng)
    edit.guides.labels[:], edit.guides.normals[:] = 0, 0
    rig, errors = Rig(device, 64, 40), []
    for spp in (64, 1024, 16384):
        state = edit.state(rng)
        # As many samples at once, by their means and moments.
        pairs = [edit.samples(rng) for _ in range(64)]
        for index, (new, old, met) in enumerate(pairs):
            share = np.sqrt(64 / spp)
            state.add(index, edit.new + (new - edit.new) * share, edit.old + (old - edit.old) * share, met)
        scaled(state, spp / 64)
        rig.load(state, edit.guides)
        errors.append(error(rig.picture(), edit.new))
    assert errors[0] < 0.05
    assert errors[1] < 0.4 * errors[0] and errors[2] < 0.4 * errors[1]


def scaled(state: reference.State, factor: float) -> None:
    """Let each sample stand for several whose mean it is."""
    x, y, count = state.new.sum(0), state.old.sum(0), state.samples.sum(0)
    for name, a, b in (("new_moment", x, x), ("old_moment", y, y), ("joint_moment", x, y)):
        of_means = (a * b).mean(-1) / count
        spread = (getattr(state, name) - of_means) * factor
        setattr(state, name, factor * (of_means + spread))
    for name in ("new", "old", "samples", "pairs", "touched"):
        setattr(state, name, factor * getattr(state, name))


def test_pictures_do_not_darken(device: Device) -> None:
    """Noise falls on both sides of the truth, so that the mean of the picture stays, however few samples."""
    biases = []
    rig = Rig(device, 96, 64)
    for seed in range(12):
        edit, state = sampled(96, 64, 1, seed)
        rig.load(state, edit.guides)
        biases.append((rig.picture() - edit.new).mean() / edit.new.mean())
    assert abs(np.mean(biases)) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("weight", [0.0, 0.7, 1.0])
def test_raw_sums_are_unbiased_with_a_fixed_weight(weight: float) -> None:
    """New values less weighted old ones, which the refined old picture gives back. The weight that is
    estimated depends on the same samples, and is left out here."""
    rng, errors = np.random.default_rng(7), []
    edit = made_up.edit(24, 16, rng)
    for _ in range(400):
        state = edit.state(rng, kept=8)
        for index in range(4):
            state.add(index, *edit.samples(rng), single=index == 3)
        fixed = np.full(state.kept.shape, weight)
        samples = state.samples / state.samples.sum(0)
        change = (reference.changes(state, fixed) * samples[..., None]).sum(0)
        errors.append(state.anchor + reference.refinement(state) + change - edit.new)
    z = np.mean(errors, 0) / (np.std(errors, 0) / np.sqrt(400) + 1e-12)
    assert np.abs(z).max() < 5 and 0.8 < z.std() < 1.2


EXTREMES = {
    "many kept samples": {"kept": 1e6},
    "no kept samples": {"kept": 0.0},
    "black": {"light": 0.0},
    "glaring": {"light": 1e4},
    "dim": {"light": 1e-6},
    "no noise": {"noise": 0.0},
    "fireflies": {"firefly": 1e4},
}


@pytest.mark.slow
@pytest.mark.parametrize("spp", [1, 3])
@pytest.mark.parametrize("name", EXTREMES)
def test_extremes_stay_finite_and_equal_the_reference(device: Device, name: str, spp: int) -> None:
    values = {"kept": 64.0, "light": 1.0, "noise": 0.4, "firefly": 0.0, **EXTREMES[name]}
    rng = np.random.default_rng(2)
    edit = made_up.edit(50, 30, rng, values["noise"])
    edit.old *= values["light"]
    edit.new *= values["light"]
    state = edit.state(rng, values["kept"])
    for index in range(spp):
        new, old, met = edit.samples(rng)
        new[rng.random(met.shape) < 0.01 * met] += values["firefly"]
        state.add(index, new, old, met)
    rig = Rig(device, 50, 30)
    rig.load(state, edit.guides)
    shown = rig.picture()
    assert np.isfinite(shown).all()
    scale = max(np.abs(edit.new).max(), 1e-3)
    np.testing.assert_allclose(shown / scale, reference.picture(state, edit.guides) / scale, atol=5e-4)
    assert error(shown, edit.new) <= 1.01 * error(state.anchor, edit.new) or name in (
        "fireflies",
        "no kept samples",
    )


def test_a_million_samples_keep_their_digits(device: Device) -> None:
    edit, state = sampled(50, 30, 6, kept=1e6)
    scaled(state, 2.0**17)
    rig = Rig(device, 50, 30)
    rig.load(state, edit.guides)
    np.testing.assert_allclose(rig.picture(), reference.picture(state, edit.guides), atol=2e-4)


def test_folding_keeps_the_picture_and_its_worth(device: Device) -> None:
    edit, state = sampled(70, 45, 3)
    rig = Rig(device, 70, 45)
    rig.load(state, edit.guides)
    shown = rig.picture()
    rig.fold()
    sums = rig.film.sums()
    assert not sums[PAIR_SUMS.name].any()
    about = reference.known(state, edit.guides.changed)
    expected = reference.worth(state, edit.guides)
    np.testing.assert_allclose(sums[RADIANCE.name][3], expected, rtol=1e-2)
    np.testing.assert_allclose(rig.film.image()[..., :3], shown, atol=1e-5)
    untouched = ~reference.touched_around(about, edit.guides.changed)
    assert untouched.any()
    np.testing.assert_allclose(expected[untouched], made_up.KEPT + 3)
    # What changed is worth more than its samples where less than half of their noise is shown, but not much.
    changed = expected[edit.touched == 1]
    assert changed.min() >= 3 and 4 < np.median(changed) < made_up.KEPT


def test_folding_without_samples_changes_nothing(device: Device) -> None:
    edit, state = sampled(70, 45, 0, kept=49)  # dividing by it loses digits
    rig = Rig(device, 70, 45)
    rig.load(state, edit.guides)
    before = rig.film.sums()[RADIANCE.name]
    for _ in range(2):
        rig.picture()
        rig.fold()
        np.testing.assert_array_equal(rig.film.sums()[RADIANCE.name], before)


def test_folding_keeps_what_pixels_without_samples_are_worth(device: Device) -> None:
    edit, state = sampled(70, 45, 2)
    for plane in (state.new, state.old, state.samples, state.pairs):
        plane[:, :, ::2] = 0
    for moment in (state.new_moment, state.old_moment, state.joint_moment, state.touched):
        moment[:, ::2] = 0
    rig = Rig(device, 70, 45)
    rig.load(state, edit.guides)
    shown = rig.picture()
    rig.fold()
    assert (rig.film.sums()[RADIANCE.name][3, :, ::2] == made_up.KEPT).all()
    np.testing.assert_allclose(rig.film.image()[..., :3], shown, atol=1e-5)


def test_idle_launches_leave_everything_alone(device: Device) -> None:
    edit, state = sampled(70, 45, 2)
    rig = Rig(device, 70, 45)
    rig.load(state, edit.guides)
    shown, sums = rig.picture(), rig.film.sums()
    launches = [
        *rig.guides.idle_launches(),
        *rig.statistics.idle_launches(rig.film, rig.guides),
        *rig.shrinkage.idle_launches(rig.film, rig.guides, rig.statistics),
    ]
    for launch in launches:
        launch()
    for name, planes in rig.film.sums().items():
        np.testing.assert_array_equal(planes, sums[name])
    np.testing.assert_array_equal(rig.shrinkage.image()[..., :3], shown)
    np.testing.assert_array_equal(rig.picture(), shown)


def test_other_guides_take_the_place_of_the_first(device: Device) -> None:
    edit, state = sampled(70, 45, 2)
    rig = Rig(device, 70, 45)
    rig.load(state, edit.guides)
    first = rig.picture()
    edit.guides.labels[:], edit.guides.normals[:], edit.guides.changed[:] = 0, 0, False
    rig.load(state, edit.guides)
    np.testing.assert_allclose(rig.picture(), reference.picture(state, edit.guides), atol=1e-4)
    assert np.abs(rig.picture() - first).max() > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("size", [(70, 45), (530, 20)], ids=str)
def test_groups_of_work_items_make_the_same_picture(
    size: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on GPUs, where a work-item does a column of a patch and sums go through local memory."""
    monkeypatch.setattr(Device, "is_clang_cpu", False)
    device = Device()
    edit, state = sampled(*size, 3)
    rig = Rig(device, *size)
    rig.load(state, edit.guides)
    np.testing.assert_allclose(rig.picture(), reference.picture(state, edit.guides), atol=1e-4)
    grid = TileGrid(*size, 16)
    sums = rig.tile_sums(grid)
    samples = np.bincount(grid.tile_of_pixels().ravel(), state.samples.sum(0).ravel(), grid.count)
    np.testing.assert_array_equal(sums.samples, samples)
    rig.fold()
    expected = reference.worth(state, edit.guides)
    np.testing.assert_allclose(rig.film.sums()[RADIANCE.name][3], expected, rtol=1e-2)


def with_target(edit: made_up.Edit, rng: np.random.Generator) -> reference.Guides:
    """The guides of an edit that starts from a picture of right and wrong parts, at most of its pixels."""
    height, width = edit.guides.labels.shape
    target = edit.new * (1 + 0.2 * rng.normal(size=edit.new.shape))
    target[:, width // 2 :] = 0.1
    in_target = np.ones((height, width), bool)
    in_target[:, width // 3 : width // 3 + 5] = False
    return replace(edit.guides, in_target=in_target, target=target)


@pytest.mark.parametrize("spp", [0, 1, 2, 5])
def test_pictures_with_a_target_equal_the_reference(device: Device, spp: int) -> None:
    edit, state = sampled(70, 45, spp)
    guides = with_target(edit, np.random.default_rng(1))
    rig = Rig(device, 70, 45)
    rig.load(state, guides)
    np.testing.assert_allclose(rig.picture(), reference.picture(state, guides), atol=1e-4)


def test_a_target_stands_until_samples_come_nearby(device: Device) -> None:
    rng = np.random.default_rng(2)
    edit = made_up.edit(200, 120, rng)
    guides, state = with_target(edit, rng), edit.state(rng)
    _, old, met = edit.samples(rng)
    met[:] = 0
    here = np.zeros(met.shape, bool)
    here[:8, :8] = True
    state.add(0, np.where(here[..., None], old, np.nan), old, met)
    rig = Rig(device, 200, 120)
    rig.load(state, guides)
    shown = rig.picture()
    refined = state.anchor + reference.refinement(state)
    np.testing.assert_allclose(shown[:8, :8], refined[:8, :8], rtol=1e-5, err_msg="nothing was met there")
    far = np.zeros(met.shape, bool)
    far[24:] = True
    expected = np.where(guides.in_target[..., None], guides.target, refined)
    np.testing.assert_allclose(shown[far], expected[far], rtol=1e-5)


def test_a_wrong_target_is_forgotten(device: Device) -> None:
    rng = np.random.default_rng(3)
    edit = made_up.edit(96, 64, rng)
    errors = []
    for target in (None, np.full((64, 96, 3), 0.05)):
        rng = np.random.default_rng(3)
        state = edit.state(rng, 4096.0)
        for index in range(400):
            state.add(index, *edit.samples(rng))
        in_target = None if target is None else np.ones((64, 96), bool)
        rig = Rig(device, 96, 64)
        rig.load(state, replace(edit.guides, in_target=in_target, target=target))
        errors.append(error(rig.picture(), edit.new))
    assert errors[1] < 1.1 * errors[0]


def test_bright_pairs_among_samples_without_partners_drown_nobody(device: Device) -> None:
    """What a few pairs cover is more than the variance of all samples then."""
    rng = np.random.default_rng(5)
    edit = made_up.edit(96, 64, rng)
    pictures = []
    for bright in (0.0, 30.0):
        rng = np.random.default_rng(5)
        state = edit.state(rng)
        for index in range(12):
            new, old, met = edit.samples(rng)
            if index < 2:  # in the shadow
                new[40:48:3, 64:72:3] += bright
                old[40:48:3, 64:72:3] += bright
                met[40:48, 64:72] = 1
            here = np.ones(met.shape, bool)
            here[40:48, 64:72] = index < 2 or index > 3
            state.add(index, np.where(here[..., None], new, np.nan), old, met, single=index >= 2)
        rig = Rig(device, 96, 64)
        rig.load(state, edit.guides)
        pictures.append(rig.picture())
    around = np.zeros((64, 96), bool)
    around[28:60, 52:84] = True
    around[38:50, 62:74] = False
    around &= ~edit.guides.changed
    plain, beside = (error(shown[around], edit.new[around]) for shown in pictures)
    assert beside < 1.5 * plain
