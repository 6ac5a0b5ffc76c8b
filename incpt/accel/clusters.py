"""What rays are tested against by brute force (cl/cpu/brute_force.cl): the quads of a few objects in world
space. They stand in clusters with a box each, so that rays pass by those that they cannot meet."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.accel.quads import SIDES, Quads
from incpt.accel.top_level import PlacedMesh, WorldTriangles
from incpt.core import layout
from incpt.scene.mesh import Mesh

MOST_CLUSTERS = 32
"""The kernels keep a bit for each."""
_MOST_PARTS, _MOST_FACES, _MOST_TESTS, _MOST_COST = 128, 1536, 256, 80
"""Above one of these a tree is quicker (measured), or the tables would take too long after each edit:
objects, faces, what it takes to test all quads, and what a group of rays is expected to pay."""

_LEAST_HEIGHT = 2.0**-16
"""Below this height, relative to the largest coordinate, a parallelepiped is as thin as rounding errors."""
_UNEVENNESS = 5 * 2.0**-24
"""How far the corners of a side may be off its plane, relative to their coordinates and distances: what
rounding makes of a parallelepiped that is turned."""
_BOX_COST, _PARALLELEPIPED_COST = 0.4, 1.3
"""What testing a box and a parallelepiped costs, in tests of a quad (instructions counted)."""
_RAYS = 16
"""How many are tested together; they go into a box if one of them meets it."""


@dataclass(frozen=True, eq=False)
class _Part:
    """One object: its quads, its index, and where its vertices and faces begin among those of all parts."""

    quads: Quads
    index: int
    first_vertex: int
    first_face: int


@dataclass(frozen=True, eq=False)
class BruteForceTables:
    """Rows of layout.QUAD, layout.PARALLELEPIPED and layout.CLUSTER, as the kernels read them."""

    quads: npt.NDArray[np.void]
    parallelepipeds: npt.NDArray[np.void]
    clusters: npt.NDArray[np.void]


def empty_tables() -> BruteForceTables:
    """Those of no objects."""
    return BruteForceTables(
        np.zeros(0, layout.QUAD), np.zeros(0, layout.PARALLELEPIPED), np.zeros(1, layout.CLUSTER)
    )


def arrange(triangles: WorldTriangles, quads_of: Callable[[Mesh], Quads]) -> BruteForceTables | None:
    """The tables of these triangles, or None where rays are quicker by the way of their tree. `quads_of` is
    asked for the quads of a mesh, see `quads.find_quads`, where brute force may be quicker.

    The last cluster is tested without its box, since nearly all rays would meet that. It may be empty.
    """
    if not _may_pay(triangles.meshes):
        return None
    places = zip(triangles.meshes, triangles.first_vertices, triangles.first_faces, strict=True)
    parts = [
        _Part(quads_of(placed.mesh), placed.object_index, vertex, face) for placed, vertex, face in places
    ]
    vertices, without_area = triangles.vertices, triangles.without_area
    rows, groups, sides = _rows(parts, vertices, triangles.places)
    parallelepipeds, regular = _parallelepipeds(parts, vertices)
    regular &= _are_sides_even(parallelepipeds, rows["vertex"][sides])
    # The sides of a parallelepiped that is too thin or too uneven stand for themselves.
    sides[sides] = np.repeat(regular, SIDES)
    parallelepipeds = parallelepipeds[regular]
    kept = ~without_area[rows["place"] & ~np.uint32(layout.NODE_PACK)].any(axis=1) | sides
    rows, sides, group = rows[kept], sides[kept], np.unique(groups[kept], return_inverse=True)[1]
    if len(rows) == 0:
        return empty_tables()
    rows, source = _halves(rows, sides | _are_even(rows))
    sides, group = sides[source], group[source]
    if np.count_nonzero(~sides) + _PARALLELEPIPED_COST * len(parallelepipeds) > _MOST_TESTS:
        return None
    boxes = _boxes(rows, group, sides)
    around = functools.reduce(_Box.joined, boxes).area
    clusters = _joined(boxes, around)
    if sum(cluster.cost(around) for cluster in clusters) > _MOST_COST:
        return None
    boxed = [cluster for cluster in clusters if cluster.box_pays(around)]
    return _tables(rows, parallelepipeds, sides, group, boxed)


def _may_pay(meshes: Sequence[PlacedMesh]) -> bool:
    """Whether brute force may be quicker, so that it is worth looking for quads."""
    return len(meshes) <= _MOST_PARTS and sum(len(placed.mesh.faces) for placed in meshes) <= _MOST_FACES


def _tables(
    rows: npt.NDArray[np.void],
    parallelepipeds: npt.NDArray[np.void],
    sides: npt.NDArray[np.bool_],
    group: npt.NDArray[np.intp],
    clusters: Sequence[_Box],
) -> BruteForceTables:
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
    table["parallelepiped_end"] = ends(sides) // SIDES
    table["first_parallelepiped"][1:] = table["parallelepiped_end"][:-1]
    parallelepipeds = parallelepipeds[np.argsort(number[sides][::SIDES], kind="stable")]
    parallelepipeds["first_side"] = np.count_nonzero(~sides) + SIDES * np.arange(len(parallelepipeds))
    return BruteForceTables(rows[order], parallelepipeds, table)


def _rows(
    parts: Sequence[_Part], vertices: npt.NDArray[np.float32], places: npt.NDArray[np.uint32]
) -> tuple[npt.NDArray[np.void], npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """All quads, the number of the group that each is in, and whether it is a side of a parallelepiped."""
    own = [part.quads for part in parts]
    counts = [len(quads.faces) for quads in own]

    def each(values: list[int]) -> npt.NDArray[np.intp]:
        return np.repeat(np.array(values, np.intp), counts)

    turns = np.concatenate([quads.turns for quads in own])
    along = np.concatenate([quads.along for quads in own])
    rows = np.zeros(sum(counts), layout.QUAD)
    corners = (
        np.concatenate([quads.corners for quads in own]) + each([p.first_vertex for p in parts])[:, None]
    )
    faces = np.concatenate([quads.faces for quads in own]) + each([p.first_face for p in parts])[:, None]
    rows["vertex"] = vertices[corners].reshape(-1, 12)
    rows["normal"] = _normals(rows)
    rows["place"] = places[faces]
    rows["object"] = each([part.index for part in parts])
    rows["turns"] = (
        turns[:, 0]
        | turns[:, 1] << np.uint32(layout.TURNS_SECOND.shift)
        | along << np.uint32(layout.TURNS_AXIS_B.shift)
    )
    firsts = np.cumsum([0, *counts[:-1]])
    starts = np.zeros(len(rows), np.intp)
    starts[[first + start for quads, first in zip(own, firsts, strict=True) for start in quads.groups]] = 1
    sides = np.arange(len(rows)) - each(firsts.tolist()) >= each([quads.loose for quads in own])
    return rows, np.cumsum(starts) - 1, sides


def _parallelepipeds(
    parts: Sequence[_Part], vertices: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.void], npt.NDArray[np.bool_]]:
    """The parallelepipeds of all parts, and whether the distances of their sides are well above rounding
    errors."""
    corners = vertices[np.concatenate([part.quads.parallelepipeds + part.first_vertex for part in parts])]
    corners = corners.astype(np.float64)
    axes = corners[:, 1:] - corners[:, :1]
    opposite = corners[:, 0] + axes.sum(axis=1)
    regular = np.linalg.det(axes) != 0
    axes[~regular] = np.eye(3)
    inverse = np.linalg.inv(axes).transpose(0, 2, 1)
    rows = np.zeros(len(corners), layout.PARALLELEPIPED)
    rows["corner"], rows["opposite"] = corners[:, 0], opposite
    rows["local_from_world"] = inverse.reshape(-1, 9)
    steepest = np.sqrt((inverse**2).sum(axis=2).max(axis=1, initial=0.0))
    return rows, regular & (steepest * np.abs(vertices).max() * _LEAST_HEIGHT < 1)


def _normals(rows: npt.NDArray[np.void]) -> npt.NDArray[np.float64]:
    """(Q, 3) of quads, as layout.QUAD has them."""
    a, b, c, _ = rows["vertex"].reshape(-1, 4, 3).astype(np.float64).transpose(1, 0, 2)
    return np.asarray(np.cross(c - a, b - a))


def _are_even(rows: npt.NDArray[np.void]) -> npt.NDArray[np.bool_]:
    """Whether all corners of quads lie in one plane, up to what rays keep off a surface that they leave."""
    corners, normal = rows["vertex"].reshape(-1, 4, 3).astype(np.float64), np.abs(_normals(rows))
    away = corners - corners[:, :1]
    off = np.abs(np.einsum("qi,qi->q", _normals(rows), away[:, 3]))
    reach = np.abs(corners).max(axis=1) + np.abs(away).max(axis=1)
    return np.asarray(off <= _UNEVENNESS * np.einsum("qi,qi->q", normal, reach))


def _halves(
    rows: npt.NDArray[np.void], whole: npt.NDArray[np.bool_]
) -> tuple[npt.NDArray[np.void], npt.NDArray[np.intp]]:
    """The quads, with two triangles in place of those that are not `whole`; and which quad each was."""
    source = np.repeat(np.arange(len(rows)), np.where(whole, 1, 2))
    second = np.diff(source, prepend=-1) == 0
    first = np.diff(source, append=len(rows)) == 0
    halves = rows[source]
    vertex = halves["vertex"].reshape(-1, 4, 3)
    vertex[second, 1] = vertex[second, 2]
    vertex[second, 2] = vertex[second, 3]
    vertex[first, 3] = vertex[first, 2]
    halves["vertex"] = vertex.reshape(-1, 12)
    halves["place"][first, 1] = halves["place"][first, 0]
    halves["place"][second, 0] = halves["place"][second, 1]
    turns = halves["turns"]
    turns[second] = turns[second] >> np.uint32(layout.TURNS_SECOND.shift) & np.uint32(layout.TURNS_FIRST.mask)
    halves["normal"] = _normals(halves)
    return halves, source


def _are_sides_even(
    parallelepipeds: npt.NDArray[np.void], sides: npt.NDArray[np.float32]
) -> npt.NDArray[np.bool_]:
    """Whether the corners (6 P, 12) of the sides of parallelepipeds lie in the planes that kernels test, up
    to what rays keep off a surface that they leave (cl/path/setup_surface.cl)."""
    corners = sides.astype(np.float64).reshape(-1, 3, 2, 4, 3)  # by body, local axis, and its ends
    ends = np.stack([parallelepipeds["corner"], parallelepipeds["opposite"]], axis=1).astype(np.float64)
    inverse = parallelepipeds["local_from_world"].astype(np.float64).reshape(-1, 3, 3)
    away = corners - ends[:, None, :, None]
    off = np.abs(np.einsum("pki,pkeci->pkec", inverse, away)).max(axis=3)
    reach = np.abs(corners).max(axis=3) + np.abs(away).max(axis=3)
    allowed = _UNEVENNESS * np.einsum("pki,pkei->pke", np.abs(inverse), reach)
    return np.asarray((off <= allowed).all(axis=(1, 2)))


@dataclass(frozen=True)
class _Box:
    """A box around the quads of some groups; testing them all costs `inside` tests of a quad."""

    groups: tuple[int, ...]
    inside: float
    least: tuple[float, ...]
    greatest: tuple[float, ...]

    @property
    def area(self) -> float:
        """Half of its surface."""
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
        """What such rays pay for the quads, and for the box if it pays."""
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
    inside = np.where(sides[starts], _PARALLELEPIPED_COST, np.bincount(group)).tolist()
    return [
        _Box((i,), cost, tuple(low), tuple(high))
        for i, (cost, low, high) in enumerate(zip(inside, least, greatest, strict=True))
    ]


def _joined(boxes: Sequence[_Box], around: float) -> list[_Box]:
    """Clusters of boxes: neighbours become one where that is cheaper, and where there would be too many."""
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
    """The boxes along a curve that fills space (Morton 1966), which puts near ones next to each other."""
    centers = np.array([box.least for box in boxes]) + np.array([box.greatest for box in boxes])
    centers -= centers.min(axis=0)
    cells = (centers * (1023 / max(float(centers.max()), 1e-30))).astype(np.int64)
    code = np.zeros(len(boxes), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return [boxes[i] for i in np.argsort(code, kind="stable").tolist()]
