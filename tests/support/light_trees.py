"""Light trees over lights that are made up, for tests of the tree alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.tables import light_tree
from incpt.tables.light_tree import TreeLights


@dataclass(frozen=True, eq=False)
class Tree:
    """See `light_tree.LightTree`; and how many levels it has."""

    nodes: npt.NDArray[np.void]
    boxes: npt.NDArray[np.void]
    trails: npt.NDArray[np.uint32]
    levels: int

    @classmethod
    def of(cls, lights: TreeLights) -> Tree:
        """The tree over these lights."""
        tree = light_tree.build(lights)
        return cls(tree.nodes, tree.boxes, tree.trails, light_tree.level_count(len(lights.numbers)))


def made_up(count: int, seed: int = 1, offset: float = 0.0, size: float = 0.05) -> TreeLights:
    """Lights of all kinds in a cube of two metres, `offset` metres from the origin along each axis, with
    powers over four decades. Their numbers are some that are in no order."""
    random = np.random.default_rng(seed)
    center = random.uniform(-1, 1, (count, 3)) + offset
    half = random.uniform(0, size, (count, 3)) * (random.random((count, 1)) < 0.8)
    axis = random.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    kind = random.integers(0, 3, count)  # flat, spot, everywhere
    return TreeLights(
        np.stack([center - half, center + half], axis=1),
        axis,
        np.choose(kind, [np.zeros(count), random.uniform(0, 0.5, count), np.full(count, np.pi)]),
        np.choose(
            kind, [np.full(count, np.pi / 2), random.uniform(0, 0.5, count), np.full(count, np.pi / 2)]
        ),
        10 ** random.uniform(-2, 2, count),
        random.random(count) < 0.7,
        random.permutation(count).astype(np.uint32),
    )
