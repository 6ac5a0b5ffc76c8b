"""What rays are swept over (cl/sweep.cl): the facets of a few objects in world space, in clusters with a box
each, so that rays pass by those that they cannot meet."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.accel.quads import SIDES, Facets
from incpt.core import layout
from incpt.scene.mesh import Mesh

MOST_CLUSTERS = 32
"""The sweep keeps a bit for each."""
_MOST_PARTS, _MOST_FACES, _MOST_TESTS, _MOST_COST = 128, 1536, 256, 80
"""Above one of these a tree is quicker (measured), or the tables would take too long after each edit:
objects, faces, what it takes to test all facets, and what a group of rays is expected to pay."""

_LEAST_HEIGHT = 2.0**-16
"""Of a parallelepiped, relative to the largest coordinate: below it rounding errors come near to it."""
_BOX_COST, _SOLID_COST = 0.4, 1.3
"""Of testing a box and a parallelepiped, in tests of a facet (instructions counted)."""
_RAYS = 16
"""That are tested together: they go into a box if one of them meets it."""


@dataclass(frozen=True, eq=False)
class Part:
    """What one object brings along: its facets, its index, and where its vertices and its faces begin."""

    facets: Facets
    index: int
    first_vertex: int
    first_face: int


@dataclass(frozen=True, eq=False)
class Tables:
    """layout.FACET, layout.SOLID and layout.CLUSTER, as the sweep reads them."""

    facets: npt.NDArray[np.void]
    solids: npt.NDArray[np.void]
    clusters: npt.NDArray[np.void]


def empty_tables() -> Tables:
    """Those of no objects."""
    return Tables(np.zeros(0, layout.FACET), np.zeros(0, layout.SOLID), np.zeros(1, layout.CLUSTER))


def may_be_few(meshes: Sequence[Mesh]) -> bool:
    """Whether it is worth looking for the facets of these objects' meshes, for `arrange`."""
    return 0 < len(meshes) <= _MOST_PARTS and sum(len(mesh.faces) for mesh in meshes) <= _MOST_FACES


def arrange(
    parts: Sequence[Part],
    vertices: npt.NDArray[np.float32],
    places: npt.NDArray[np.uint32],
    flat: npt.NDArray[np.bool_],
) -> Tables | None:
    """The tables of all parts; None where rays are quicker by the way of a tree.

    vertices  (V, 3) of all parts, in world space.
    places    (N,) where the faces of all parts stand in the packs, as HIT_TRIANGLE has it.
    flat      (8 * P,) whether a face without area is in that place of the packs, which no ray meets.

    The box of the last cluster is not worth asking: nearly all rays would meet it. It may be empty.
    """
    rows, groups, sides = _rows(parts, vertices, places)
    solids, thick = _solids(parts, vertices)
    # The sides of a parallelepiped that is too thin stand for themselves.
    sides[sides] = np.repeat(thick, SIDES)
    solids = solids[thick]
    kept = ~flat[rows["place"] & ~np.uint32(layout.NODE_PACK)].any(axis=1) | sides
    rows, sides, group = rows[kept], sides[kept], np.unique(groups[kept], return_inverse=True)[1]
    if len(rows) == 0:
        return empty_tables()
    if np.count_nonzero(~sides) + _SOLID_COST * len(solids) > _MOST_TESTS:
        return None
    boxes = _boxes(rows, group, sides)
    around = functools.reduce(_Box.joined, boxes).area
    clusters = _joined(boxes, around)
    if sum(cluster.cost(around) for cluster in clusters) > _MOST_COST:
        return None
    return _tables(rows, solids, sides, group, [cluster for cluster in clusters if cluster.box_pays(around)])


def _tables(
    rows: npt.NDArray[np.void],
    solids: npt.NDArray[np.void],
    sides: npt.NDArray[np.bool_],
    group: npt.NDArray[np.intp],
    clusters: Sequence[_Box],
) -> Tables:
    """Everything in the order of the clusters; what is in none of them is in the last."""
    number_of_group = np.full(int(group.max()) + 1, len(clusters))
    for i, cluster in enumerate(clusters):
        number_of_group[list(cluster.groups)] = i
    number = number_of_group[group]
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


def _rows(
    parts: Sequence[Part], vertices: npt.NDArray[np.float32], places: npt.NDArray[np.uint32]
) -> tuple[npt.NDArray[np.void], npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """All facets, the number of the group that each is in, and whether it is a side of a parallelepiped."""
    own = [part.facets for part in parts]
    counts = [len(facets.faces) for facets in own]

    def each(values: list[int]) -> npt.NDArray[np.intp]:
        return np.repeat(np.array(values, np.intp), counts)

    turns = np.concatenate([facets.turns for facets in own])
    along = np.concatenate([facets.along for facets in own])
    rows = np.zeros(sum(counts), layout.FACET)
    corners = (
        np.concatenate([facets.corners for facets in own]) + each([p.first_vertex for p in parts])[:, None]
    )
    faces = np.concatenate([facets.faces for facets in own]) + each([p.first_face for p in parts])[:, None]
    rows["vertex"] = vertices[corners].reshape(-1, 12)
    rows["place"] = places[faces]
    rows["object"] = each([part.index for part in parts])
    rows["turns"] = turns[:, 0] | turns[:, 1] << np.uint32(2) | along << np.uint32(4)
    firsts = np.cumsum([0, *counts[:-1]])
    starts = np.zeros(len(rows), np.intp)
    starts[[first + start for facets, first in zip(own, firsts, strict=True) for start in facets.groups]] = 1
    sides = np.arange(len(rows)) - each(firsts.tolist()) >= each([facets.loose for facets in own])
    return rows, np.cumsum(starts) - 1, sides


def _solids(
    parts: Sequence[Part], vertices: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.void], npt.NDArray[np.bool_]]:
    """The parallelepipeds of all parts, and whether the distances of their sides are well above rounding
    errors."""
    corners = vertices[np.concatenate([part.facets.solids + part.first_vertex for part in parts])]
    corners = corners.astype(np.float64)
    axes = corners[:, 1:] - corners[:, :1]
    regular = np.linalg.det(axes) != 0
    axes[~regular] = np.eye(3)
    inverse = np.linalg.inv(axes).transpose(0, 2, 1)
    rows = np.zeros(len(corners), layout.SOLID)
    rows["corner"], rows["local_from_world"] = corners[:, 0], inverse.reshape(-1, 9)
    steepest = np.sqrt((inverse**2).sum(axis=2).max(axis=1, initial=0.0))
    return rows, regular & (steepest * np.abs(vertices).max() * _LEAST_HEIGHT < 1)


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


def _joined(boxes: Sequence[_Box], around: float) -> list[_Box]:
    """Neighbours become one cluster where that is cheaper, and where there would be too many."""
    done = _in_space(boxes)
    dearer = 0.0
    while True:
        boxes, done = done, []
        for box in boxes:
            last = box
            while done and (both := done[-1].joined(last)).cost(around) <= dearer + done[-1].cost(
                around
            ) + last.cost(around):
                done.pop()
                last = both
            done.append(last)
        if len(done) < MOST_CLUSTERS:
            return done
        dearer = 2 * dearer + _BOX_COST


def _in_space(boxes: Sequence[_Box]) -> list[_Box]:
    """In the order of a curve that fills space (Morton 1966), so that neighbours are near each other."""
    centers = np.array([box.least for box in boxes]) + np.array([box.greatest for box in boxes])
    centers -= centers.min(axis=0)
    cells = (centers * (1023 / max(float(centers.max()), 1e-30))).astype(np.int64)
    code = np.zeros(len(boxes), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return [boxes[i] for i in np.argsort(code, kind="stable").tolist()]
