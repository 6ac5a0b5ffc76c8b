"""What rays are swept over (cl/sweep.cl): the facets of a few objects in world space, in clusters with a box
each, so that rays pass by those that they cannot meet."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt import layout
from incpt.facets import SIDES, Facets

MOST_CLUSTERS = 32
"""The sweep keeps a bit for each."""

_LEAST_HEIGHT = 2.0**-16
"""Of a parallelepiped, relative to the largest coordinate: below it rounding errors come near to it."""
_BOX_COST, _SOLID_COST = 0.4, 1.3
"""Of testing a box and a parallelepiped, in tests of a facet (instructions counted)."""
_RAYS = 16
"""That are tested together: they go into a box if one of them meets it."""


@dataclass(frozen=True, eq=False)
class Part:
    """What one object brings along: its facets, the world-space vertices (V, 3) of its mesh, its index, and
    the place of each of its faces in the packs (N,), as HIT_TRIANGLE has it."""

    facets: Facets
    vertices: npt.NDArray[np.float32]
    index: int
    places: npt.NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class Tables:
    """layout.FACET, layout.SOLID and layout.CLUSTER, as the sweep reads them."""

    facets: npt.NDArray[np.void]
    solids: npt.NDArray[np.void]
    clusters: npt.NDArray[np.void]


def arrange(parts: Sequence[Part], flat: npt.NDArray[np.bool_]) -> Tables:
    """The tables of all parts. `flat` (8 * P,) tells of each place in the packs whether a face without area
    is there, which no ray meets.

    The box of the last cluster is not worth asking: nearly all rays would meet it. It may be empty.
    """
    if not parts:
        nothing = np.zeros(0, layout.FACET), np.zeros(0, layout.SOLID)
        return Tables(*nothing, np.zeros(1, layout.CLUSTER))
    rows = np.concatenate([_rows(part) for part in parts])
    solids, thick = _solids(parts, float(np.abs(rows["vertex"]).max(initial=0.0)))
    groups = np.cumsum(np.concatenate([_starts(part.facets) for part in parts])) - 1
    sides = np.concatenate([np.arange(len(part.facets.faces)) >= part.facets.loose for part in parts])
    # Those of a parallelepiped that is too thin stand for themselves.
    sides[sides] = np.repeat(thick, SIDES)
    solids = solids[thick]
    kept = ~flat[rows["place"] & ~np.uint32(layout.NODE_PACK)].any(axis=1) | sides
    rows, sides, group = rows[kept], sides[kept], np.unique(groups[kept], return_inverse=True)[1]
    clusters, number = _clustered(rows, group, sides)

    single = rows["place"][:, 0] == rows["place"][:, 1]
    order = np.lexsort([single, number, sides])
    table = np.zeros(len(clusters) + 1, layout.CLUSTER)
    for row, cluster in zip(table, clusters, strict=False):
        row["bounds"] = np.stack([cluster.least, cluster.greatest], axis=-1).ravel()

    def ends(chosen: npt.NDArray[np.bool_]) -> npt.NDArray[np.intp]:
        return np.cumsum(np.bincount(number[chosen], minlength=len(table)))

    table["end"] = ends(~sides)
    table["first"][1:] = table["end"][:-1]
    table["first_triangle"] = table["end"] - np.diff(ends(single), prepend=0)
    table["solid_end"] = ends(sides) // SIDES
    table["first_solid"][1:] = table["solid_end"][:-1]
    solids = solids[np.argsort(number[sides][::SIDES], kind="stable")]
    solids["first_side"] = np.count_nonzero(~sides) + SIDES * np.arange(len(solids))
    return Tables(rows[order], solids, table)


def _rows(part: Part) -> npt.NDArray[np.void]:
    own = part.facets
    rows = np.zeros(len(own.faces), layout.FACET)
    rows["vertex"] = part.vertices[own.corners].reshape(-1, 12)
    rows["place"] = part.places[own.faces]
    rows["object"] = part.index
    rows["turns"] = own.turns[:, 0] | own.turns[:, 1] << np.uint32(2) | own.along << np.uint32(4)
    return rows


def _solids(parts: Sequence[Part], largest: float) -> tuple[npt.NDArray[np.void], npt.NDArray[np.bool_]]:
    """The parallelepipeds of all parts, and whether the distances of their sides are well above rounding
    errors; `largest` is the largest coordinate."""
    corners = np.concatenate([part.vertices[part.facets.solids] for part in parts]).astype(np.float64)
    axes = corners[:, 1:] - corners[:, :1]
    regular = np.linalg.det(axes) != 0
    axes[~regular] = np.eye(3)
    inverse = np.linalg.inv(axes).transpose(0, 2, 1)
    rows = np.zeros(len(corners), layout.SOLID)
    rows["corner"], rows["local_from_world"] = corners[:, 0], inverse.reshape(-1, 9)
    steepest = np.sqrt((inverse**2).sum(axis=2).max(axis=1, initial=0.0))
    return rows, regular & (steepest * largest * _LEAST_HEIGHT < 1)


def _starts(own: Facets) -> npt.NDArray[np.bool_]:
    starts = np.zeros(len(own.faces), np.bool_)
    starts[list(own.groups)] = True
    return starts


@dataclass(frozen=True)
class _Box:
    """Around the facets of some groups; what it takes to test them all."""

    groups: tuple[int, ...]
    inside: float
    least: tuple[float, ...]
    greatest: tuple[float, ...]

    @property
    def area(self) -> float:
        """Half of it."""
        x, y, z = (high - low for low, high in zip(self.least, self.greatest, strict=True))
        return x * y + y * z + z * x

    def joined(self, other: _Box) -> _Box:
        return _Box(
            self.groups + other.groups,
            self.inside + other.inside,
            tuple(map(min, self.least, other.least)),
            tuple(map(max, self.greatest, other.greatest)),
        )

    def box_pays(self, around: float) -> bool:
        """Whether it is cheaper to ask for the box first, for rays that go about in one of area `around`."""
        return self._cost_if_boxed(around) < self.inside

    def cost(self, around: float) -> float:
        """What such rays pay for the facets, and for the box if it pays."""
        return min(self._cost_if_boxed(around), self.inside)

    def _cost_if_boxed(self, around: float) -> float:
        share = min(self.area / around, 1.0) if around > 0 else 1.0
        return _BOX_COST + self.inside * (1 - (1 - share) ** _RAYS)


def _boxes(
    rows: npt.NDArray[np.void], group: npt.NDArray[np.intp], sides: npt.NDArray[np.bool_]
) -> list[_Box]:
    starts = np.flatnonzero(np.diff(group, prepend=-1))
    corners = rows["vertex"].reshape(-1, 4, 3)
    least = np.minimum.reduceat(corners.min(axis=1), starts).tolist()
    greatest = np.maximum.reduceat(corners.max(axis=1), starts).tolist()
    inside = np.where(sides[starts], _SOLID_COST, np.bincount(group)).tolist()
    return [
        _Box((i,), cost, tuple(low), tuple(high))
        for i, (cost, low, high) in enumerate(zip(inside, least, greatest, strict=True))
    ]


def _clustered(
    rows: npt.NDArray[np.void], group: npt.NDArray[np.intp], sides: npt.NDArray[np.bool_]
) -> tuple[list[_Box], npt.NDArray[np.intp]]:
    """The clusters whose boxes are asked for, and the number of its cluster for each row; one more than there
    are is that of the rows which rays meet without asking."""
    if len(rows) == 0:
        return [], np.zeros(0, np.intp)
    boxes = _boxes(rows, group, sides)
    around = functools.reduce(_Box.joined, boxes).area
    clusters = [cluster for cluster in _joined(boxes, around) if cluster.box_pays(around)]
    number = np.full(len(boxes), len(clusters))
    for i, cluster in enumerate(clusters):
        number[list(cluster.groups)] = i
    return clusters, number[group]


def _joined(boxes: Sequence[_Box], around: float) -> list[_Box]:
    """Neighbours in the order of the objects become one cluster where that is cheaper, or where there would
    be too many."""
    done: list[_Box] = []
    for box in boxes:
        last = box
        while done and done[-1].joined(last).cost(around) <= done[-1].cost(around) + last.cost(around):
            last = done.pop().joined(last)
        done.append(last)
    while len(done) >= MOST_CLUSTERS:
        both = [a.joined(b) for a, b in itertools.pairwise(done)]
        more = [
            joined.cost(around) - a.cost(around) - b.cost(around)
            for joined, (a, b) in zip(both, itertools.pairwise(done), strict=True)
        ]
        i = more.index(min(more))
        done[i : i + 2] = [both[i]]
    return done
