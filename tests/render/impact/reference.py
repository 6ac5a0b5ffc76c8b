"""What the kernels of cl/impact/ compute, in numpy with double precision and without shortcuts.

Names and order follow the kernels; incpt/render/impact/README.md has the reasons.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.core.layout import CELL_SIZE, SMOOTHING_SCALES, SMOOTHING_STEPS, PairPlane

Array = npt.NDArray[np.float64]
HALVES = 2


@dataclass
class State:
    """Of each pixel: the kept picture (H, W, 3) with its samples (H, W), and the sums of pairs: (2, H, W, 3)
    and (2, H, W) for each half, (H, W) for both."""

    anchor: Array
    kept: Array
    new: Array
    old: Array
    samples: Array
    pairs: Array
    new_moment: Array
    old_moment: Array
    joint_moment: Array
    touched: Array

    @classmethod
    def empty(cls, anchor: npt.ArrayLike, kept: npt.ArrayLike) -> State:
        anchor = np.asarray(anchor, np.float64)
        shape = anchor.shape[:2]
        colours, counts = (HALVES, *shape, 3), (HALVES, *shape)
        sizes = (colours, colours, counts, counts, shape, shape, shape, shape)
        return cls(anchor, np.broadcast_to(np.asarray(kept, np.float64), shape), *map(np.zeros, sizes))

    def add(self, index: int, new: Array, old: Array, touched: Array, single: bool = False) -> None:
        """Take in sample `index` of every pixel: radiances (H, W, 3), NaN in all channels where a pixel has
        no such sample, and whether its path met a change."""
        rows, columns = np.mgrid[: new.shape[0], : new.shape[1]]
        has = ~np.isnan(new).all(axis=-1)
        x = np.where(has[..., None], finite(new) - self.anchor, 0)
        y = np.where(has[..., None], finite(old) - self.anchor, 0)
        for half in range(HALVES):
            here = has & (half_of(index, columns, rows) == half)
            self.new[half] += x * here[..., None]
            self.samples[half] += here
            if not single:
                self.old[half] += y * here[..., None]
                self.pairs[half] += here
        self.new_moment += (x * x).mean(-1)
        self.touched += has & touched
        if not single:
            self.old_moment += (y * y).mean(-1)
            self.joint_moment += (x * y).mean(-1)

    def planes(self) -> npt.NDArray[np.float32]:
        """(planes, H, W) as layout.PairPlane."""
        planes = [*np.moveaxis(self.new, 3, 1).reshape(6, *self.kept.shape)]
        planes += [*np.moveaxis(self.old, 3, 1).reshape(6, *self.kept.shape), *self.samples, *self.pairs]
        planes += [self.new_moment, self.old_moment, self.joint_moment, self.touched]
        assert len(planes) == len(PairPlane)
        return np.asarray(planes, np.float32)

    def anchor_sums(self) -> npt.NDArray[np.float32]:
        """(4, H, W) as a film has them of radiance."""
        return np.asarray([*np.moveaxis(self.anchor * self.kept[..., None], 2, 0), self.kept], np.float32)


def half_of(index: int, x: npt.NDArray[np.integer], y: npt.NDArray[np.integer]) -> npt.NDArray[np.integer]:
    return (index + x + y + x // 4 + y // 4) % HALVES


def finite(radiance: Array) -> Array:
    """Black where a channel is not finite."""
    return np.where(np.isfinite(radiance).all(axis=-1, keepdims=True), radiance, 0.0)


@dataclass
class Guides:
    """(H, W) labels, (H, W, 3) normals and (H, W) whether a pixel's own object changed."""

    labels: npt.NDArray[np.integer]
    normals: Array
    changed: npt.NDArray[np.bool_]

    def weights(self, step: int) -> Array:
        """(9, H, W) of the neighbours at that distance, row by row; they sum up to 1."""
        height, width = self.labels.shape
        weights = np.zeros((9, height, width))
        for i, (dy, dx) in enumerate(neighbours(step)):
            inside, labels = shifted(np.ones_like(self.labels), dy, dx), shifted(self.labels, dy, dx)
            normals = shifted(self.normals, dy, dx)
            cosine = np.clip((self.normals * normals).sum(-1), 0, 1)
            surface = (self.normals != 0).any(-1) | (normals != 0).any(-1)
            alike = np.where(surface, np.floor(cosine**16 * 255 + 0.5) / 255, 1.0)
            kernel = (2 - abs(dy) // step) * (2 - abs(dx) // step) / 4
            weights[i] = kernel * (1.0 if dx == dy == 0 else alike * inside * (labels == self.labels))
        return weights / weights.sum(0)

    def smoothed(self, values: Array, scale: int) -> Array:
        """Guided means of (H, W, N) values, from neighbours 2^scale pixels away."""
        step = 2**scale
        weights = self.weights(step)
        return sum(
            weight[..., None] * shifted(values, dy, dx)
            for weight, (dy, dx) in zip(weights, neighbours(step), strict=True)
        )


def neighbours(step: int) -> list[tuple[int, int]]:
    return [(dy, dx) for dy in (-step, 0, step) for dx in (-step, 0, step)]


def shifted(values: npt.NDArray, dy: int, dx: int) -> npt.NDArray:
    """values[y + dy, x + dx], and 0 outside."""
    height, width = values.shape[:2]
    result = np.zeros_like(values)
    to_y, to_x = slice(max(0, -dy), height - max(0, dy)), slice(max(0, -dx), width - max(0, dx))
    from_y, from_x = slice(max(0, dy), height - max(0, -dy)), slice(max(0, dx), width - max(0, -dx))
    if abs(dy) < height and abs(dx) < width:
        result[to_y, to_x] = values[from_y, from_x]
    return result


@dataclass
class Spread:
    """(H, W) degrees of freedom, and sums of squares and products of deviations from a pixel's mean."""

    freedom_new: Array
    squares_new: Array
    freedom_pairs: Array
    squares_old: Array
    products: Array


def spread_of(state: State) -> Spread:
    samples, pairs = state.samples.sum(0), state.pairs.sum(0)
    x, y = state.new.sum(0), state.old.sum(0)
    per_sample, per_pair = 1 / np.maximum(samples, 1), 1 / np.maximum(pairs, 1)
    squares_new = np.maximum(state.new_moment - (x * x).mean(-1) * per_sample, 0)
    squares_old = np.maximum(state.old_moment - (y * y).mean(-1) * per_pair, 0)
    products = state.joint_moment - (x * y).mean(-1) * per_sample
    # Pairs are taken from the mean of all samples; see the test of its expectation.
    excess = np.maximum(pairs * (samples - 1) * per_sample, 1e-20)
    return Spread(
        np.maximum(samples - 1, 0),
        np.where(samples >= 2, squares_new, 0),
        np.maximum(pairs - 1, 0),
        np.where(pairs >= 2, squares_old, 0),
        np.where(pairs >= 2, products * (pairs - 1) / excess, 0),
    )


@dataclass
class Known:
    """(H, W) what the pixels around a pixel tell of its samples; see layout.CellPlane."""

    new_variance: Array
    old_variance: Array
    covariance: Array
    freedom_new: Array
    freedom_pairs: Array
    touched: Array


def known(state: State, changed: npt.NDArray[np.bool_], enough: float = 300, most_around: int = 2) -> Known:
    spread, shape = spread_of(state), state.kept.shape
    terms = [
        spread.freedom_new,
        spread.squares_new,
        spread.freedom_pairs,
        spread.squares_old,
        spread.products,
    ]
    result = np.zeros((6, *shape))
    for class_of_pixels in (False, True):
        here = changed == class_of_pixels
        cells = np.stack([cell_sums(term * here) for term in (*terms, state.touched)])
        wide = cells
        for around in range(1, most_around + 1):
            few = wide[0] < enough
            wide = np.where(few, sums_around(cells, around), wide)
        spread_out = np.repeat(np.repeat(wide, CELL_SIZE, 1), CELL_SIZE, 2)[:, : shape[0], : shape[1]]
        result = np.where(here, spread_out, result)
    freedom_new, squares_new, freedom_pairs, squares_old, products, touched = result
    new_variance = squares_new / np.maximum(freedom_new, 1)
    old_variance = squares_old / np.maximum(freedom_pairs, 1)
    covariance = np.clip(products / np.maximum(freedom_pairs, 1), 0, np.sqrt(new_variance * old_variance))
    return Known(new_variance, old_variance, covariance, freedom_new, freedom_pairs, touched)


def cell_sums(values: Array) -> Array:
    height, width = values.shape
    rows, columns = -(-height // CELL_SIZE), -(-width // CELL_SIZE)
    padded = np.zeros((rows * CELL_SIZE, columns * CELL_SIZE))
    padded[:height, :width] = values
    return padded.reshape(rows, CELL_SIZE, columns, CELL_SIZE).sum((1, 3))


def sums_around(cells: Array, around: int) -> Array:
    rows, columns = cells.shape[1:]
    padded = np.pad(cells, ((0, 0), (around, around), (around, around)))
    edge = range(2 * around + 1)
    return sum(padded[:, i : i + rows, j : j + columns] for i in edge for j in edge)


def old_weight(state: State, about: Known) -> Array:
    samples, pairs = np.maximum(state.samples.sum(0), 1), state.pairs.sum(0)
    equal = (state.kept + pairs) / (state.kept + samples)
    weight = (about.covariance * pairs / samples + 1e-8 * equal) / (about.old_variance + 1e-8)
    return np.where(about.freedom_pairs < 0.5, equal, np.clip(weight, 0, 1.5))


def refinement(state: State) -> Array:
    """(H, W, 3) the refined old picture less the kept one."""
    count = np.maximum(state.kept + state.pairs.sum(0), 1e-20)
    return state.old.sum(0) / count[..., None]


def changes(state: State, weight: Array) -> Array:
    """(2, H, W, 3) what each half shows beside the refined old picture."""
    base = refinement(state)
    new_mean = state.new / np.maximum(state.samples, 1)[..., None]
    old_mean = state.old / np.maximum(state.pairs, 1)[..., None]
    used = np.where(state.pairs > 0, weight, 0)[..., None]
    change = new_mean - base - used * (old_mean - base)
    return np.where(state.samples[..., None] > 0, change, 0)


def sample_variance(state: State, about: Known, weight: Array) -> Array:
    samples, pairs = np.maximum(state.samples.sum(0), 1), state.pairs.sum(0)
    share = np.where(pairs > 0, weight * state.kept / np.maximum(state.kept + pairs, 1e-20), 0)
    old = weight * share * about.old_variance * samples / np.maximum(pairs, 1)
    return np.maximum(about.new_variance - 2 * share * about.covariance + old, 1e-12)


def shown_variance(state: State, about: Known) -> Array:
    refined = about.new_variance / np.maximum(state.kept + state.pairs.sum(0), 1)
    changed = sample_variance(state, about, old_weight(state, about)) / np.maximum(state.samples.sum(0), 1)
    return np.where(about.touched > 0, changed, refined)


def picture(state: State, guides: Guides) -> Array:
    """(H, W, 3) what is shown."""
    about = known(state, guides.changed)
    weight = old_weight(state, about)
    change = np.where((about.touched > 0)[..., None], changes(state, weight), 0)
    freedom = about.freedom_new
    prior = 0.5 * ((state.anchor**2).mean(-1) + 1e-6)
    variance = (freedom * sample_variance(state, about, weight) + 4 * prior) / (freedom + 4)
    return state.anchor + refinement(state) + shrunk(change, state.samples, variance, guides)


def shrunk(change: Array, samples: Array, variance: Array, guides: Guides) -> Array:
    """What is shown of a change (2, H, W, 3) that halves with so many samples (2, H, W) show."""
    both = (samples > 0).all(0)
    apart = ((change[0] - change[1]) ** 2).mean(-1) * samples.sum(0) / 4
    weights = samples / (np.maximum(variance, np.where(both, 0.05 * apart, 0)) + 1e-7)
    total = np.zeros(change.shape[1:])
    for scale in range(SMOOTHING_SCALES + 1):
        if scale < SMOOTHING_SCALES:
            coarse_weights = np.stack([guides.smoothed(w[..., None], scale)[..., 0] for w in weights])
            coarse = np.stack(
                [
                    guides.smoothed(w[..., None] * c, scale) / np.maximum(v, 1e-300)[..., None]
                    for w, c, v in zip(weights, change, coarse_weights, strict=True)
                ]
            )
            details = change - coarse
        else:
            details, coarse, coarse_weights = change, change, weights
        details = np.where((weights > 0)[..., None], details, 0)
        total += shown_of_detail(details, weights, scale, guides)
        change, weights = coarse, coarse_weights
    return total


def shown_of_detail(details: Array, weights: Array, scale: int, guides: Guides) -> Array:
    both, weight = (weights > 0).all(0), weights.sum(0)
    shares = weights / np.maximum(weight, 1e-300)
    mean = (shares[..., None] * details).sum(0)
    signal = (details[0] * details[1]).mean(-1)
    noise = np.where(both, ((details[0] - details[1]) ** 2).mean(-1) * shares[0] * shares[1], 0)
    counts = both & (details != 0).any((0, 3))
    evidence_weight = np.where(counts, 1 / (0.05 * noise + 1 / np.maximum(weight, 1e-300) + 1e-12), 0)
    evidence = np.stack([signal, noise, np.ones_like(noise)], -1) * evidence_weight[..., None]
    for i in range(2):
        evidence = guides.smoothed(evidence, min(scale + i, SMOOTHING_STEPS - 1))
    strength = np.maximum(evidence[..., 0], 0)
    all_of_it = strength + np.maximum(evidence[..., 1], 0.05 * noise * evidence[..., 2])
    share = np.where(all_of_it > 0, strength / np.maximum(all_of_it, 1e-300), 0)
    shows = both if scale == 0 else weight > 0
    return np.where(shows, share, 0)[..., None] * mean


def worth(state: State, about: Known) -> Array:
    """(H, W) samples that the shown picture is worth."""
    samples, refined = state.samples.sum(0), state.kept + state.pairs.sum(0)
    variances = about.new_variance * about.old_variance
    unknown = (about.freedom_pairs < 0.5) | (variances <= 0)
    correlation = np.where(unknown, 0, about.covariance**2 / np.where(unknown, 1, variances))
    kept_share = np.where(about.touched > 0, np.minimum(correlation, 1), 1)
    per_worth = (1 - kept_share) / np.maximum(samples, 1) + kept_share / np.maximum(refined, 1e-20)
    return np.where(samples > 0, 1 / per_worth, state.kept)
