"""What the kernels of cl/impact/ compute, in numpy with double precision and without shortcuts.

Names and order follow the kernels; incpt/render/impact/README.md has the reasons.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.core.layout import CELL_SIZE, GUIDE_UNIT, LOCAL_SCALES, SMOOTHING_SCALES, PairPlane

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
    """(H, W) labels, (H, W, 3) normals and (H, W) whether a pixel's own object changed; the picture (H, W, 3)
    that is started from at the pixels `in_target` (H, W), where there is one."""

    labels: npt.NDArray[np.integer]
    normals: Array
    changed: npt.NDArray[np.bool_]
    in_target: npt.NDArray[np.bool_] | None = None
    target: Array | None = None

    @property
    def starts(self) -> npt.NDArray[np.bool_]:
        """(H, W) `in_target`, nowhere if there is none."""
        return np.zeros(self.labels.shape, bool) if self.in_target is None else self.in_target

    def weights(self, step: int) -> Array:
        """(9, H, W) of the neighbours at that distance, row by row; they sum up to 1."""
        height, width = self.labels.shape
        weights = np.zeros((9, height, width))
        for i, (dy, dx) in enumerate(neighbours(step)):
            inside, labels = shifted(np.ones_like(self.labels), dy, dx), shifted(self.labels, dy, dx)
            changed, normals = shifted(self.changed, dy, dx), shifted(self.normals, dy, dx)
            cosine = np.clip((self.normals * normals).sum(-1), 0, 1)
            surface = (self.normals != 0).any(-1) | (normals != 0).any(-1)
            same = inside * (labels == self.labels) * (changed == self.changed)
            same = same * (shifted(self.starts, dy, dx) == self.starts)
            kernel = (2 - abs(dy) // step) * (2 - abs(dx) // step) / 4
            weights[i] = kernel * (1.0 if dx == dy == 0 else same * np.where(surface, cosine**16, 1))
        weights = np.floor(weights / weights.sum(0) * GUIDE_UNIT + 0.5) / GUIDE_UNIT
        weights[4] = 1 - (weights.sum(0) - weights[4])
        return weights

    def smoothed(self, values: Array, scale: int) -> Array:
        """Guided means of (H, W, N) values, from neighbours 2^scale pixels away."""
        weights = self.weights(2**scale)
        return sum(
            weight[..., None] * shifted(values, dy, dx)
            for weight, (dy, dx) in zip(weights, neighbours(2**scale), strict=True)
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
    """(H, W) degrees of freedom of new samples, pairs that tell of old ones, and sums of squares and products
    of deviations: of new samples from their mean, of old ones from the refined old picture."""

    freedom_new: Array
    squares_new: Array
    pairs: Array
    squares_old: Array
    products: Array


def spread_of(state: State) -> Spread:
    samples, pairs = state.samples.sum(0), state.pairs.sum(0)
    x, y = state.new.sum(0), state.old.sum(0)
    per_sample, refined = 1 / np.maximum(samples, 1), np.maximum(state.kept + pairs, 1)
    squares_new = np.maximum(state.new_moment - (x * x).mean(-1) * per_sample, 0)
    squares_old = np.maximum(state.old_moment - (y * y).mean(-1) / refined, 0)
    pair_share = pairs * per_sample / refined
    products = state.joint_moment - pair_share * (x * y).mean(-1)
    usable = (state.kept >= 1) & (pairs > 0)
    products = (products - squares_old / refined) / np.where(usable, 1 - pair_share, 1)
    return Spread(
        np.maximum(samples - 1, 0),
        np.where(samples >= 2, squares_new, 0),
        np.where(usable, pairs, 0),
        np.where(usable, squares_old, 0),
        np.where(usable, products, 0),
    )


@dataclass
class PairSpread:
    """(H, W) degrees of freedom, and sums of squares and products of deviations from the means of pixels."""

    freedom: Array
    squares_old: Array
    products: Array


def pair_spread_of(state: State) -> PairSpread:
    samples, pairs = state.samples.sum(0), state.pairs.sum(0)
    x, y = state.new.sum(0), state.old.sum(0)
    spreads = pairs >= 2
    squares_old = state.old_moment - (y * y).mean(-1) / np.maximum(pairs, 1)
    products = state.joint_moment - (x * y).mean(-1) / np.maximum(samples, 1)
    # Of the mean of all samples less goes with the old values than of that of the pairs.
    products *= (1 - 1 / np.maximum(pairs, 2)) / (1 - 1 / np.maximum(samples, 2))
    return PairSpread(*(np.where(spreads, values, 0) for values in (pairs - 1, squares_old, products)))


@dataclass
class Known:
    """(rows, columns) of cells: what the pixels of one class in and around each tell: layout.CellPlane, and
    the old variance and the covariance from the means of pixels."""

    new_variance: Array
    old_variance: Array
    covariance: Array
    new_moment: Array
    freedom_new: Array
    pairs: Array
    touched: Array
    samples: Array
    pair_squares_old: Array
    pair_products: Array
    freedom_pairs: Array


def known(state: State, changed: npt.NDArray[np.bool_], enough: float = 300) -> list[Known]:
    """For pixels that did not change, and for those that did."""
    spread, result = spread_of(state), []
    terms = [state.samples.sum(0), spread.pairs, spread.freedom_new, spread.squares_new, state.new_moment]
    terms += [spread.squares_old, spread.products, state.touched, *vars(pair_spread_of(state)).values()]
    for class_of_pixels in (False, True):
        cells = np.stack([cell_sums(term * (changed == class_of_pixels)) for term in terms])
        wide = sums_around(cells, 2)
        if not class_of_pixels:
            near = sums_around(cells, 1)
            wide = np.where(cells[0] >= enough, cells, np.where(near[0] >= enough, near, wide))
        samples, pairs, freedom, squares_new, new_moment, squares_old, products, touched = wide[:8]
        freedom_pairs, pair_squares_old, pair_products = wide[8:]
        per_pair = 1 / np.maximum(pairs, 1)
        result.append(
            Known(
                squares_new / np.maximum(freedom, 1),
                squares_old * per_pair,
                np.maximum(products * per_pair, 0),
                new_moment / np.maximum(samples, 1),
                freedom,
                pairs,
                touched,
                samples,
                pair_squares_old / np.maximum(freedom_pairs, 1),
                pair_products / np.maximum(freedom_pairs, 1),
                freedom_pairs,
            )
        )
    return result


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


def to_pixels(of_classes: list[Array], changed: npt.NDArray[np.bool_], interpolated: bool = True) -> Array:
    """(H, W) from values of cells for each class, between the centres of cells or not."""
    y, x = ((np.arange(size) + 0.5) / CELL_SIZE - 0.5 for size in changed.shape)
    if not interpolated:
        y, x = np.floor(y + 0.5), np.floor(x + 0.5)
    result = []
    for cells in of_classes:
        (y0, y1), (x0, x1) = (
            np.clip([np.floor(at), np.floor(at) + 1], 0, count - 1).astype(int)
            for at, count in zip((y, x), cells.shape, strict=True)
        )
        fx, fy = x - np.floor(x), (y - np.floor(y))[:, None]
        upper, lower = (cells[r][:, x0] * (1 - fx) + cells[r][:, x1] * fx for r in (y0, y1))
        result.append(upper * (1 - fy) + lower * fy)
    return np.where(changed, result[1], result[0])


@dataclass
class Rule:
    """What follows from `Known`; see layout.RulePlane."""

    old_weight: Array
    base_share: Array
    variance: Array
    prior: Array
    covered: Array


def rules(about: list[Known]) -> list[Rule]:
    result = []
    for i, one in enumerate(about):
        fitting = np.minimum((one.covariance + 1e-8) / (one.old_variance + 1e-8), 1.5)
        weight = np.where(one.pairs > 0, fitting, 1)
        share = one.freedom_new / (one.freedom_new + 4)
        resemblance = np.clip(1.5 * weight - 0.5, 0, 1)
        variance = share * one.new_variance + i * (1 - share) * one.new_moment
        covered = share * (2 * one.pair_products - weight * one.pair_squares_old)
        most = variance * one.freedom_pairs / (one.freedom_pairs + 4) / np.maximum(weight, 1e-6)
        result.append(
            Rule(
                weight,
                resemblance if i else np.ones_like(weight),
                variance,
                (1 - i) * 0.5 * (1 - share),
                np.minimum(covered, most),
            )
        )
    return result


def rule_of_pixels(about: list[Known], changed: npt.NDArray[np.bool_], interpolated: bool = True) -> Rule:
    """(H, W) each."""
    of_classes = rules(about)
    names = Rule.__dataclass_fields__
    return Rule(*(to_pixels([getattr(r, name) for r in of_classes], changed, interpolated) for name in names))


def touched_around(about: list[Known], changed: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """(H, W) whether a sample that met a change is behind what is known of a pixel."""
    return to_pixels([one.touched for one in about], changed, interpolated=False) > 0


def pair_weight(state: State, rule: Rule) -> Array:
    return rule.old_weight * state.pairs.sum(0) / np.maximum(state.samples.sum(0), 1)


def refinement(state: State) -> Array:
    """(H, W, 3) the refined old picture less the kept one."""
    count = np.maximum(state.kept + state.pairs.sum(0), 1e-20)
    return state.old.sum(0) / count[..., None]


def changes(state: State, weight: Array, base: Array | None = None) -> Array:
    """(2, H, W, 3) what each half shows beside a base, by default the refined old picture, with such a weight
    of old values."""
    refined = refinement(state)
    new_mean = state.new / np.maximum(state.samples, 1)[..., None]
    old_mean = state.old / np.maximum(state.pairs, 1)[..., None]
    used = np.where(state.pairs > 0, weight, 0)[..., None]
    change = new_mean - used * (old_mean - refined) - (refined if base is None else base - state.anchor)
    return np.where(state.samples[..., None] > 0, change, 0)


def sample_variance(state: State, rule: Rule) -> Array:
    kept_share = state.kept / np.maximum(state.kept + state.pairs.sum(0), 1e-20)
    guess = rule.prior * ((state.anchor**2).mean(-1) + 1e-6)
    return np.maximum(rule.variance + guess - rule.covered * pair_weight(state, rule) * kept_share, 1e-12)


def shown_variance(state: State, about: list[Known], changed: npt.NDArray[np.bool_]) -> Array:
    rule = rule_of_pixels(about, changed, interpolated=False)
    old_variance = to_pixels([one.old_variance for one in about], changed, interpolated=False)
    refined = old_variance / np.maximum(state.kept + state.pairs.sum(0), 1)
    of_change = sample_variance(state, rule) / np.maximum(state.samples.sum(0), 1)
    return np.where(touched_around(about, changed), of_change, refined)


def change_variance(state: State, about: list[Known], changed: npt.NDArray[np.bool_]) -> Array:
    rule = rule_of_pixels(about, changed, interpolated=False)
    return np.where(touched_around(about, changed), sample_variance(state, rule), 0)


def picture(state: State, guides: Guides) -> Array:
    """(H, W, 3) what is shown."""
    return picture_and_shares(state, guides)[0]


def picture_and_shares(state: State, guides: Guides) -> tuple[Array, Array]:
    """(H, W, 3) what is shown, and (H, W) which share of the noise of the change that shows."""
    about = known(state, guides.changed)
    rule = rule_of_pixels(about, guides.changed)
    touched = touched_around(about, guides.changed)[..., None]
    refined = state.anchor + refinement(state)
    base = np.where(touched, rule.base_share[..., None], 1) * refined
    if guides.target is not None:
        waits = to_pixels([one.samples for one in about], guides.changed, interpolated=False)[..., None] == 0
        base = np.where((touched | waits) & guides.starts[..., None], guides.target, base)
    change = np.where(touched, changes(state, pair_weight(state, rule), base), 0)
    shown, shares = shrunk(change, state.samples, sample_variance(state, rule), guides)
    return base + shown, shares


def shrunk(change: Array, samples: Array, variance: Array, guides: Guides) -> tuple[Array, Array]:
    """What is shown of a change (2, H, W, 3) that halves with so many samples (2, H, W) show, and which share
    of its noise."""
    both = (samples > 0).all(0)
    apart = ((change[0] - change[1]) ** 2).mean(-1) * samples.sum(0) / 4
    weights = samples / (np.maximum(variance, np.where(both, 0.05 * apart, 0)) + 1e-7)
    total, shares = np.zeros(change.shape[1:]), np.zeros(change.shape[1:3])
    # White noise in one pixel spreads over a binomial kernel with each pass; squares of it add up.
    kernel, left = np.ones(1), [1.0]
    for scale in range(SMOOTHING_SCALES):
        wider = np.zeros(2 ** (scale + 1) + 1)
        wider[:: 2**scale] = 0.25, 0.5, 0.25
        kernel = np.convolve(kernel, wider)
        left.append((kernel**2).sum() ** 2)
    noise = -np.diff([*left, 0.0])
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
        mean, share = shown_of_detail(details, weights, samples.sum(0), scale, guides)
        total += share[..., None] * mean
        shares += noise[scale] * share
        change, weights = coarse, coarse_weights
    return total, shares


def shown_of_detail(
    details: Array, weights: Array, samples: Array, scale: int, guides: Guides
) -> tuple[Array, Array]:
    """(H, W, 3) a detail as both halves show it, and (H, W) the share of it that is shown."""
    both, weight = (weights > 0).all(0), weights.sum(0)
    parts = weights / np.maximum(weight, 1e-300)
    mean = (parts[..., None] * details).sum(0)
    count = np.where(both, np.sqrt(weight), 0)
    signal = count * (details[0] * details[1]).mean(-1)
    noise = count * ((details[0] - details[1]) ** 2).mean(-1) * parts[0] * parts[1]
    of_cells = [
        to_pixels([tent(cell_sums(values * (guides.changed == c))) for c in (False, True)], guides.changed)
        for values in (signal, noise)
    ]
    strength, noisy = np.stack(of_cells)
    if scale < LOCAL_SCALES:
        around = guides.smoothed(np.stack([signal, noise], -1), scale)
        strength, noisy = np.moveaxis(around, -1, 0) + 32 / np.maximum(samples, 1) * np.stack(of_cells)
    strength = np.maximum(strength, 0)
    share = np.where(strength > 0, strength / np.maximum(strength + noisy, 1e-300), 0)
    return np.where(both if scale == 0 else weight > 0, 1.0, 0.0)[..., None] * mean, share


def tent(cells: Array) -> Array:
    """Means over the pixels of cells and those around, half of the sides and a quarter of the corners."""
    padded = np.pad(cells, 1)
    rows, columns = cells.shape
    parts = [(i, j, (2 - abs(i - 1)) * (2 - abs(j - 1)) / 4) for i in range(3) for j in range(3)]
    return sum(p * padded[i : i + rows, j : j + columns] for i, j, p in parts) / (4 * CELL_SIZE**2)


def worth(state: State, guides: Guides) -> Array:
    """(H, W) samples that the shown picture is worth."""
    about = known(state, guides.changed)
    shown = np.clip(2 * picture_and_shares(state, guides)[1], 0.03, 1)
    samples, refined = state.samples.sum(0), state.kept + state.pairs.sum(0)
    shares = []
    for one in about:
        variance = (one.freedom_new * one.new_variance + one.new_moment) / (one.freedom_new + 1)
        correlation = one.covariance**2 / np.maximum(variance * one.old_variance, 1e-300)
        shares.append(np.where(one.touched > 0, np.minimum(correlation, 1), 1))
    kept_share = to_pixels(shares, guides.changed, interpolated=False)
    per_worth = (1 - kept_share) * shown / np.maximum(samples, 1) + kept_share / np.maximum(refined, 1e-20)
    return np.where(samples > 0, 1 / per_worth, state.kept)
