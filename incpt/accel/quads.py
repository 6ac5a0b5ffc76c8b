"""The quads of a mesh of few triangles, and the parallelepipeds among them.

A quad is a parallelogram where two triangles make one up, and a single triangle elsewhere. Blocks of paths
test a small scene by brute force, without a tree (cl/cpu/brute_force.cl). There a parallelogram costs a ray
little more than one triangle, and a parallelepiped of six of them little more than one of its sides. What
people build of few triangles is mostly rectangles and boxes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from incpt.scene.mesh import Mesh

SIDES = 6
"""How many quads bound a parallelepiped."""

_TOLERANCE = 2.0**-22
"""How far corners may be off a parallelogram, relative to the largest coordinate: what rounding makes."""
_MOST_IN_A_GROUP = 8


@dataclass(frozen=True, eq=False)
class Quads:
    """How the faces of a mesh pair up. Each face is in one of Q quads.

    corners  (Q, 4) int32 indices of vertices A, B, C and D on the way around; D is C for a single triangle.
    faces    (Q, 2) int32: the face with corners A, B, C, and the one with A, C, D; the same one for a single
             triangle.
    turns    (Q, 2) uint32: which corner of these faces A is.
    along    (Q,) uint32: for a side of a parallelepiped, which of its axes lead from A to B and from A to D:
             their numbers in bits 0 and 1, 3 and 4; bits 2 and 5 are set where they lead backwards.
    loose    the number of quads that belong to no parallelepiped. Behind them stand the sides of each: where
             its first axis is 0, where that is 1, where its second axis is 0 ...
    parallelepipeds  (P, 4) int32 indices of vertices: a corner of each and the ends of its axes.
    groups   where quads begin that lie near each other, parallelograms before triangles; the sides of a
             parallelepiped are one.
    """

    corners: npt.NDArray[np.int32]
    faces: npt.NDArray[np.int32]
    turns: npt.NDArray[np.uint32]
    along: npt.NDArray[np.uint32]
    loose: int
    parallelepipeds: npt.NDArray[np.int32]
    groups: tuple[int, ...]


class _Pair(NamedTuple):
    """A face ABC and which of its corners is A, and the face ACD and which of its corners is A."""

    face: int
    corner: int
    other: int
    other_corner: int


def find_quads(mesh: Mesh) -> Quads:
    """The quads of a mesh."""
    pairs = _chosen(_parallelograms(mesh))
    alone = set(range(len(mesh.faces))) - {f for pair in pairs for f in (pair.face, pair.other)}
    rows = np.array(pairs + [_Pair(f, 0, f, 0) for f in sorted(alone)], np.int32).reshape(-1, 4)
    faces, turns = rows[:, 0::2], rows[:, 1::2]
    first = mesh.faces[faces[:, :1], (turns[:, :1] + np.arange(3)) % 3]
    last = mesh.faces[faces[:, 1], (turns[:, 1] + 2) % 3]
    corners = np.column_stack([first, last]).astype(np.int32)

    found = _parallelepipeds(mesh, corners[: len(pairs)])
    sides = [side for each in found for side in each.sides]
    loose = np.setdiff1d(np.arange(len(corners)), np.array(sides, np.intp))
    groups = _groups(mesh.vertices[corners].mean(axis=1), loose)
    order = np.concatenate([*groups, np.array(sides, np.intp)])
    starts = np.cumsum([0, *map(len, groups), *[SIDES] * len(found)])[:-1]
    along = np.zeros(len(corners), np.uint32)
    along[sides] = [bits for each in found for bits in each.along]
    return Quads(
        corners[order],
        faces[order],
        turns[order].astype(np.uint32),
        along[order],
        len(loose),
        np.array([each.vertices for each in found], np.int32).reshape(-1, 4),
        tuple(starts.tolist()),
    )


class _Parallelepiped(NamedTuple):
    """One parallelepiped: its sides are indices of quads; the rest is as `Quads` has it."""

    sides: tuple[int, ...]
    along: tuple[int, ...]
    vertices: tuple[int, ...]


def _parallelepipeds(mesh: Mesh, corners: npt.NDArray[np.int32]) -> list[_Parallelepiped]:
    """Those among parallelograms with these corners (F, 4) that share no corner with others."""
    points = _same_points(mesh.vertices)[corners]
    bodies: dict[int, set[int]] = {}  # quads, by each point that they share
    for f, own in enumerate(points.tolist()):
        body = set.union({f}, *(bodies.get(point, set()) for point in own))
        for member in body:
            bodies.update(dict.fromkeys(points[member].tolist(), body))
    found = {id(body): body for body in bodies.values() if len(body) == SIDES}
    candidates = (_parallelepiped(mesh, corners, points, sorted(body)) for body in found.values())
    return [each for each in candidates if each is not None]


def _parallelepiped(
    mesh: Mesh, corners: npt.NDArray[np.int32], points: npt.NDArray[np.intp], body: list[int]
) -> _Parallelepiped | None:
    """The parallelepiped that six parallelograms make up, if they do."""
    origin = int(points[body[0], 0])
    vertex = dict(zip(points[body].ravel().tolist(), corners[body].ravel().tolist(), strict=True))
    ends = {int(points[f, (k + step) % 4]) for f in body for k in range(4) for step in (1, 3)
            if points[f, k] == origin}  # fmt: skip
    if len(vertex) != 8 or len(ends) != 3:
        return None
    vertices = [vertex[point] for point in (origin, *sorted(ends))]
    position = mesh.vertices.astype(np.float64)
    axes = position[vertices[1:]] - position[vertices[0]]
    if np.linalg.matrix_rank(axes) < 3:
        return None
    local = np.rint(
        np.linalg.solve(axes.T, (position[corners[body]] - position[vertices[0]]).reshape(-1, 3).T).T
    )
    away = local @ axes + position[vertices[0]] - position[corners[body]].reshape(-1, 3)
    if np.abs(away).max() > _TOLERANCE * np.abs(mesh.bounds).max() or set(local.ravel()) != {0, 1}:
        return None
    sides, along = [-1] * SIDES, [0] * SIDES
    for f, (a, b, _, d) in zip(body, local.reshape(-1, 4, 3).astype(int), strict=True):
        to_b, to_d = (int(np.flatnonzero(corner - a)[0]) for corner in (b, d))
        axis = 3 - to_b - to_d
        side = 2 * axis + int(a[axis])
        sides[side] = f
        along[side] = to_b | int(a[to_b]) << 2 | to_d << 3 | int(a[to_d]) << 5
    return _Parallelepiped(tuple(sides), tuple(along), tuple(vertices)) if -1 not in sides else None


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
        return [np.sort(members)] if len(members) else []
    own = centers[members]
    ordered = members[np.argsort(own[:, np.ptp(own, axis=0).argmax()], kind="stable")]
    middle = len(ordered) // 2
    return _groups(centers, ordered[:middle]) + _groups(centers, ordered[middle:])
