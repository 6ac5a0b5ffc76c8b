"""`impact`: what an edit changes is found by pairs of paths, and rendered where it is seen; see README.md
beside this file for the method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from incpt.render import tiles
from incpt.render.batch import Batch
from incpt.render.film import RADIANCE, Film, Float32Array
from incpt.render.impact import allocation, exploration, sums
from incpt.render.impact.comparison import Comparison
from incpt.render.impact.estimator import Estimator
from incpt.render.impact.findings import Findings, findings
from incpt.render.impact.pairs import PairBuffers, PairTracer
from incpt.render.impact.sums import PAIR_SUMS, reduce_pairs
from incpt.render.modes import Mode
from incpt.render.plan import CountArray, Queue
from incpt.render.strategy import Situation, Step, Strategy
from incpt.render.tiles import IntArray
from incpt.render.tracer import Tracer
from incpt.scene.change import Change

FIRST_ROUND = 0.34
"""Paths of the shortest round of allocation, as a share of one path for each pixel."""
ROUND_GROWTH = 0.6
"""Paths of a round as a share of those drawn before it: what is known changes less and less."""
LONGEST_ROUND = 8.0
"""Paths of the longest round, as a multiple of one path for each pixel."""


@dataclass(frozen=True, eq=False)
class Round(Queue):
    """The queue of a round; `passes` of exploration are done with it."""

    passes: int = 0


class Impact(Strategy):
    """Paths of the edited scene are compared with those of the scene before it; see the folder's
    README.md."""

    name = "impact"
    uses_nor = False
    keeps_picture = True
    keeps_anchor = True
    planes = (PAIR_SUMS,)

    def starts_over(self, change: Change) -> bool:
        """Light from far away can be compared as well; only another view shows other points."""
        return change.camera

    def order(self, situation: Situation) -> IntArray:
        """Row by row, where the scene is compared with no other."""
        return tiles.base_queue(situation.grid)

    def queue(self, situation: Situation, order: IntArray | None = None) -> Queue:
        """A round, which starts with an exploration while parts of the picture have less than a sample."""
        if not situation.has_anchor:
            return super().queue(situation, order)
        if situation.mode is Mode.INCREMENTAL:
            return self._first_round(situation)
        return self._next_round(situation)

    def _first_round(self, situation: Situation) -> Round:
        grid = situation.grid
        # The new place first: who drags an object looks at it.
        seen = exploration.seen_tiles(grid, situation.scene.camera, situation.affected[::-1])
        if situation.stale is not None:
            stale = np.flatnonzero(situation.stale).astype(np.int32)
            seen = np.concatenate([seen, np.setdiff1d(stale, seen)])
        is_seen = np.zeros(grid.count, np.bool_)
        is_seen[seen] = True
        near, all_squares = (exploration.squares(grid, chosen) for chosen in (is_seen, is_seen | True))
        everywhere = np.concatenate([near, np.setdiff1d(all_squares, near)])
        once, singles = np.ones(len(seen), np.int64), np.zeros(len(seen), np.bool_)
        return _round(everywhere, 0, seen, once, singles, worth=np.zeros(grid.count, np.int64))

    def _next_round(self, situation: Situation) -> Round:
        grid, queue = situation.grid, situation.queue
        found = situation.film.tile_sums()
        assert found is not None, "a scene with an anchor is compared with it"
        pixels, spent = float(grid.width * grid.height), float(found.samples.sum())
        passes = queue.passes if isinstance(queue, Round) else 0
        budget = min(max(FIRST_ROUND * pixels, ROUND_GROWTH * spent), LONGEST_ROUND * pixels)
        everywhere = np.zeros(0, np.int32)
        if passes < len(exploration.PASSES):
            everywhere = exploration.squares(grid, found.samples < found.pixels)
            budget = max(budget - len(everywhere) * grid.tile_size**2, 0.02 * pixels)
        believed = allocation.variances(found, grid.columns)
        random = np.random.default_rng((situation.settings.seed, int(spent)))
        granted = allocation.allocate(believed, found.pixels, budget, random)
        chosen = np.flatnonzero(granted.samples)
        chosen = chosen[np.argsort(-believed.gain(np.maximum(believed.samples, 0.5))[chosen], kind="stable")]
        worth = allocation.worth(found).astype(np.int64)
        return _round(
            everywhere,
            passes,
            chosen.astype(np.int32),
            granted.samples[chosen],
            granted.singles[chosen],
            worth,
            findings(found, believed.uncorrelated),
        )

    def render(self, step: Step, film: Film) -> int:
        """Trace a step, with the partners of its paths in the anchor."""
        comparison, batch = step.comparison, step.batch
        if comparison is None:
            return super().render(step, film)
        assert step.pairs is not None, "a comparison needs room for pairs"
        partners = PairTracer(step.tracer).trace(batch, comparison.anchor, comparison.changes, step.pairs)
        reduce_pairs(film, batch, step.plan.slots, step.pairs)
        others = tuple(one for one in film.passes if one is not RADIANCE)
        if others:
            film.reduce(batch.params, step.plan, batch.slots, batch.path_buffer, others)
        return partners

    def image(self, film: Film, comparison: Comparison | None) -> Float32Array:
        """The anchor's picture with what is found of the change."""
        if comparison is None:
            return super().image(film, None)
        return film.with_coverage(comparison.image(film))

    def begin(self, film: Film) -> None:
        """Forget the pairs of the scene before."""
        film.clear(PAIR_SUMS)

    def fold(self, film: Film, comparison: Comparison) -> None:
        """Make the picture that is shown the one that is kept, with the samples that its pixels are worth."""
        comparison.fold(film)

    def idle_launches(self, tracer: Tracer, batch: Batch, film: Film) -> list[Callable[[], None]]:
        """Those of pairs, statistics and shrinkage."""
        device = film.device
        pairs = PairBuffers.of(device, 64)
        scratch = Film(device, 1, 1, planes=self.planes)
        return [
            *PairTracer(tracer).idle_launches(batch, pairs),
            *sums.idle_launches(scratch, batch, pairs),
            *Estimator(device, 1, 1).idle_launches(scratch),
        ]


def _round(
    everywhere: IntArray,
    passes: int,
    chosen: IntArray,
    samples: CountArray,
    singles: np.ndarray,
    worth: CountArray,
    known: Findings | None = None,
) -> Round:
    """Pass number `passes` of the exploration over the squares that begin with the tiles `everywhere`, then
    the chosen tiles; `known` is what is known of the change so far."""
    ones = np.ones(len(everywhere), np.int64)
    subset = exploration.PASSES[passes] if len(everywhere) else -1
    return Round(
        tiles=np.concatenate([everywhere, chosen]),
        samples=np.concatenate([ones, samples]),
        replaces=False,
        subsets=np.concatenate([subset * ones, np.full(len(chosen), -1)]).astype(np.int8),
        singles=np.concatenate([np.zeros(len(everywhere), np.bool_), singles]),
        worth=worth,
        findings=known,
        passes=passes + (len(everywhere) > 0),
    )
