"""The facets of a few triangles: parallelograms where two of them make one up, single triangles elsewhere.

Blocks of paths meet a small top level without a tree (cl/sweep.cl). There a parallelogram costs a ray little
more than one triangle, and what people build of few triangles is mostly rectangles. The facets stand in
clusters with a box each, so that rays pass by those that they cannot meet.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from incpt import layout
from incpt.scene import Mesh

MOST_CLUSTERS = 32
"""The sweep keeps a bit for each."""

_TOLERANCE = 2.0**-22
"""How far corners may be off a parallelogram, relative to the largest coordinate: what rounding makes."""
_MOST_IN_A_GROUP = 8
_BOX_COST = 0.4
"""Of testing a box, in tests of a facet (instructions counted)."""
_RAYS = 16
"""That are tested together: they go into a box if one of them meets it."""


@dataclass(frozen=True, eq=False)
class Facets:
    """How the faces of a mesh pair up; F facets, each face is in one.

    corners  (F, 4) int32 indices of vertices A, B, C and D on the way around; D is C for a single triangle.
    faces    (F, 2) int32: the face with corners A, B, C, and the one with A, C, D; the same one for a single
             triangle.
    turns    (F, 2) uint32: which corner of these faces A is.
    groups   where facets begin that lie near each other, parallelograms before triangles.
    """

    corners: npt.NDArray[np.int32]
    faces: npt.NDArray[np.int32]
    turns: npt.NDArray[np.uint32]
    groups: tuple[int, ...]


class _Pair(NamedTuple):
    """A face ABC and which of its corners is A, and the face ACD and which of its corners is A."""

    face: int
    corner: int
    other: int
    other_corner: int


def pair_faces(mesh: Mesh) -> Facets:
    """The facets of a mesh."""
    pairs = _chosen(_parallelograms(mesh))
    alone = set(range(len(mesh.faces))) - {f for pair in pairs for f in (pair.face, pair.other)}
    rows = np.array(pairs + [_Pair(f, 0, f, 0) for f in sorted(alone)], np.int32).reshape(-1, 4)
    faces, turns = rows[:, 0::2], rows[:, 1::2]
    first = mesh.faces[faces[:, :1], (turns[:, :1] + np.arange(3)) % 3]
    last = mesh.faces[faces[:, 1], (turns[:, 1] + 2) % 3]
    corners = np.column_stack([first, last]).astype(np.int32)
    groups = _groups(mesh.vertices[corners].mean(axis=1), np.arange(len(corners)))
    order = np.concatenate(groups)
    starts = np.cumsum([0, *map(len, groups[:-1])])
    return Facets(corners[order], faces[order], turns[order].astype(np.uint32), tuple(starts.tolist()))


def _chosen(possible: list[_Pair]) -> list[_Pair]:
    """Pairs of which no two share a face. Faces with the fewest possible partners come first, so that few
    stay alone; else the order is kept."""
    partners: dict[int, set[int]] = {}
    for pair in possible:
        partners.setdefault(pair.face, set()).add(pair.other)
        partners.setdefault(pair.other, set()).add(pair.face)
    chosen = []
    while possible:
        pair = min(possible, key=lambda p: min(len(partners[p.face]), len(partners[p.other])))
        chosen.append(pair)
        gone = {pair.face, pair.other}
        for f in gone:
            for other in partners[f] - gone:
                partners[other].discard(f)
        possible = [p for p in possible if p.face not in gone and p.other not in gone]
    return chosen


def _parallelograms(mesh: Mesh) -> list[_Pair]:
    """Pairs of faces that make one up, those with the longest diagonals first: as it is in a rectangle."""
    points = _same_points(mesh.vertices)[mesh.faces].tolist()
    vertices = mesh.vertices[mesh.faces].astype(np.float64)
    tolerance = _TOLERANCE * float(np.abs(mesh.bounds).max(initial=0.0))
    corner_of = {
        (face[k], face[(k + 1) % 3]): (f, k) for f, face in enumerate(points) for k in range(3)
    }  # at which an edge begins
    found = []
    for (c, a), (f, k) in corner_of.items():  # the diagonal: from C to A, and from A to C in the other face
        other, turn = corner_of.get((a, c), (f, 0))
        if other <= f:
            continue
        at_c, at_a, at_b = vertices[f, [k, (k + 1) % 3, (k + 2) % 3]]
        if np.abs(at_a + at_c - at_b - vertices[other, (turn + 2) % 3]).max() <= tolerance:
            found.append((float(np.sum((at_a - at_c) ** 2)), _Pair(f, (k + 1) % 3, other, turn)))
    return [pair for _, pair in sorted(found, key=lambda entry: -entry[0])]


def _same_points(vertices: npt.NDArray[np.float32]) -> npt.NDArray[np.intp]:
    """(V,) a number for each position. Adding 0 makes -0 the same as 0."""
    return np.asarray(np.unique(vertices + np.float32(0), axis=0, return_inverse=True)[1].reshape(-1))


def _groups(centers: npt.NDArray[np.float32], members: npt.NDArray[np.intp]) -> list[npt.NDArray[np.intp]]:
    """Halves of halves along the widest axis, until they are small; in each the order is kept."""
    if len(members) <= _MOST_IN_A_GROUP:
        return [np.sort(members)]
    own = centers[members]
    ordered = members[np.argsort(own[:, np.ptp(own, axis=0).argmax()], kind="stable")]
    middle = len(ordered) // 2
    return _groups(centers, ordered[:middle]) + _groups(centers, ordered[middle:])


@dataclass(frozen=True, eq=False)
class Part:
    """What one object brings along: its facets, the world-space vertices (V, 3) of its mesh, its index, and
    the place of each of its faces in the packs (N,), as HIT_TRIANGLE has it."""

    facets: Facets
    vertices: npt.NDArray[np.float32]
    index: int
    places: npt.NDArray[np.uint32]


def arrange(
    parts: Sequence[Part], flat: npt.NDArray[np.bool_]
) -> tuple[npt.NDArray[np.void], npt.NDArray[np.void]]:
    """The layout.FACET of all parts, and the layout.CLUSTER over them.

    The box of the last cluster is not worth asking: nearly all rays would meet it. It may be empty. `flat`
    (8 * P,) tells of each place in the packs whether a face without area is there, which no ray meets.
    """
    rows = np.concatenate([_rows(part) for part in parts])
    group = np.cumsum(np.concatenate([_starts(part.facets) for part in parts])) - 1
    kept = ~flat[rows["place"] & ~np.uint32(layout.NODE_PACK)].any(axis=1)
    rows, group = rows[kept], np.unique(group[kept], return_inverse=True)[1]
    boxes = _boxes(rows, group)
    around = functools.reduce(_Box.joined, boxes).area if boxes else 0.0
    clusters = _clustered(boxes, around)
    boxed = [cluster for cluster in clusters if cluster.box_pays(around)]
    number = np.full(len(boxes), len(boxed))
    for i, cluster in enumerate(boxed):
        number[list(cluster.groups)] = i
    single = rows["place"][:, 0] == rows["place"][:, 1]
    order = np.lexsort([single, number[group]])
    table = np.zeros(len(boxed) + 1, layout.CLUSTER)
    for row, cluster in zip(table, boxed, strict=False):
        row["bounds"] = np.stack([cluster.least, cluster.greatest], axis=-1).ravel()
    table["end"] = np.cumsum(np.bincount(number[group], minlength=len(table)))
    table["first"][1:] = table["end"][:-1]
    table["first_triangle"] = table["end"] - np.bincount(number[group[single]], minlength=len(table))
    return rows[order], table


def _rows(part: Part) -> npt.NDArray[np.void]:
    rows = np.zeros(len(part.facets.faces), layout.FACET)
    rows["vertex"] = part.vertices[part.facets.corners].reshape(-1, 12)
    rows["place"] = part.places[part.facets.faces]
    rows["object"] = part.index
    rows["turns"] = part.facets.turns[:, 0] | part.facets.turns[:, 1] << np.uint32(2)
    return rows


def _starts(own: Facets) -> npt.NDArray[np.bool_]:
    starts = np.zeros(len(own.faces), np.bool_)
    starts[list(own.groups)] = True
    return starts


@dataclass(frozen=True)
class _Box:
    """Around `count` facets, those of some groups."""

    groups: tuple[int, ...]
    count: int
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
            self.count + other.count,
            tuple(map(min, self.least, other.least)),
            tuple(map(max, self.greatest, other.greatest)),
        )

    def box_pays(self, around: float) -> bool:
        """Whether it is cheaper to ask for the box first, for rays that go about in one of area `around`."""
        return self._cost_if_boxed(around) < self.count

    def cost(self, around: float) -> float:
        """What such rays pay for the facets, and for the box if it pays."""
        return min(self._cost_if_boxed(around), self.count)

    def _cost_if_boxed(self, around: float) -> float:
        share = min(self.area / around, 1.0) if around > 0 else 1.0
        return _BOX_COST + self.count * (1 - (1 - share) ** _RAYS)


def _boxes(rows: npt.NDArray[np.void], group: npt.NDArray[np.intp]) -> list[_Box]:
    if len(rows) == 0:
        return []
    starts = np.flatnonzero(np.diff(group, prepend=-1))
    corners = rows["vertex"].reshape(-1, 4, 3)
    least = np.minimum.reduceat(corners.min(axis=1), starts).tolist()
    greatest = np.maximum.reduceat(corners.max(axis=1), starts).tolist()
    counts = np.bincount(group).tolist()
    return [
        _Box((i,), count, tuple(low), tuple(high))
        for i, (count, low, high) in enumerate(zip(counts, least, greatest, strict=True))
    ]


def _clustered(boxes: Sequence[_Box], around: float) -> list[_Box]:
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
        i = min(
            range(len(both)),
            key=lambda i: both[i].cost(around) - done[i].cost(around) - done[i + 1].cost(around),
        )
        done[i : i + 2] = [both[i]]
    return done
