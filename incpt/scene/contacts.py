"""Transparent bodies whose faces coincide.

Of two faces at one distance a ray meets one, by chance of rounding, and starts behind the other. So of two
bodies in contact one is grown by some roundings: their faces then lie in an order, and what is in both is
sorted out by priority, as of all nested dielectrics (C. M. Schmidt and B. Budge, Simple Nested
Dielectrics in Ray Traced Images, JGT 7(2), 2002).
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.scene.model import Object, Scene

Array = npt.NDArray[np.float64]

_CONTACT = 2.0**-20
"""How far apart planes may lie that are one, of the largest coordinate: what rounding puts between them."""
_GROWTH = 2.0**-17
"""By how much faces move apart, of the same: several times as far as rays keep off a surface."""
_MOST_GROWTH = 2.0**-8
"""A body that would have to grow by more stays as it is: one whose face in contact is close to its middle or
looks towards it, or that is hundreds of times its size away from the origin."""
_KEY_MARGIN = 2.0**-13
"""How far apart the keys of planes may lie that are compared, of the largest coordinate."""
_PAIRS_AT_ONCE = 1 << 20
_AXIS = np.array([0.36, 0.48, 0.8])
"""Any direction along which few planes are alike."""


def separated(scene: Scene) -> tuple[Object, ...]:
    """The objects of a scene as rays are to meet them, in its order: the same, but for `grown_bodies`."""
    grown = grown_bodies(scene)
    return tuple(grown.get(obj.name, obj) for obj in scene.objects) if grown else scene.objects


def grown_bodies(scene: Scene) -> dict[str, Object]:
    """Of the bodies of a scene that are in contact those that are grown, by name, as they are then."""
    bodies = [obj for obj in scene.objects if obj.visible and scene.material(obj.material).is_body]
    # The largest first; each by as many steps as those before leave it.
    bodies.sort(key=lambda obj: -float(np.prod(np.ptp(obj.world_bounds, axis=0))))
    bounds = np.array([obj.world_bounds for obj in bodies]).reshape(-1, 2, 3)
    levels: list[int] = []
    shares: list[float] = []
    found: dict[str, Object] = {}
    for place, obj in enumerate(bodies):
        heights: list[float] = []
        reach = least = 0.0
        refused: set[int] = set()
        for other in _boxes_met(bounds[:place], bounds[place]):
            contact = _contact(_faces_of(obj), _faces_of(bodies[other]))
            if contact is not None:
                heights.append(contact.height)
                reach = max(reach, _reach(obj, bodies[other]))
                refused |= contact.refused(levels[other])
                if contact.hole > 0:  # what fills it grows more than the hole
                    own = _reach(obj, bodies[other])
                    least = max(least, shares[other] * contact.hole + _GROWTH * own)
        level = next(level for level in range(len(bodies)) if level not in refused)
        by = max(level * _GROWTH * reach, least)
        share = by / min(heights) if heights and min(heights) > 0 else 0.0
        if 0 < share <= _MOST_GROWTH:
            found[obj.name] = _grown(obj, share)
        levels.append(level if obj.name in found else 0)
        shares.append(share if obj.name in found else 0.0)
    return found


@dataclass(frozen=True, eq=False)
class _Faces:
    """The faces of a body in world space: corners (F, 3, 3), unit normals (F, 3) that look out of it, and the
    height (F,) of each over the middle of the body, below 0 where the face looks towards it."""

    corners: Array
    normal: Array
    height: Array


def _faces_of(obj: Object) -> _Faces:
    faces = _KNOWN.get(obj)
    if faces is None:
        faces = _KNOWN[obj] = _make_faces(obj)
    return faces


def _make_faces(obj: Object) -> _Faces:
    matrix = obj.world_from_object
    corners = affine.apply(matrix, obj.mesh.vertices.astype(np.float64))[obj.mesh.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    corners, normal = corners[length[:, 0] > 0], normal[length[:, 0] > 0] / length[length[:, 0] > 0]
    normal *= np.sign(np.linalg.det(matrix[:, :3]))
    return _Faces(corners, normal, np.sum((corners[:, 0] - _middle(obj)) * normal, axis=1))


def _middle(obj: Object) -> Array:
    return np.asarray(obj.world_bounds.mean(axis=0))


def _reach(*objects: Object) -> float:
    """The largest coordinate."""
    return float(max(np.abs(obj.world_bounds).max() for obj in objects))


def _boxes_met(boxes: Array, box: Array) -> list[int]:
    """The numbers of the boxes (N, 2, 3) that a box (2, 3) touches."""
    slack = _CONTACT * max(np.abs(boxes).max(initial=0.0), np.abs(box).max())
    meet = (boxes[:, 0] <= box[1] + slack) & (box[0] <= boxes[:, 1] + slack)
    return np.flatnonzero(meet.all(axis=1)).tolist()


@dataclass(frozen=True)
class _Contact:
    """Of a body with a larger one. height: the least of its faces in contact; is_alike: whether some look the
    same way as those of the other; hole: the greatest height of the other's that look towards its middle."""

    height: float
    is_alike: bool
    hole: float

    def refused(self, level: int) -> set[int]:
        """By how many steps it must not grow if the other grows by `level`. Face to face, one must grow;
        where they look the same way, one more than the other."""
        return ({0} if level == 0 else set()) | ({level} if self.is_alike else set())


def _contact(a: _Faces, b: _Faces) -> _Contact | None:
    """How the faces of a body touch those of another one: in their planes, and where their boxes meet."""
    slack = _CONTACT * max(float(np.abs(faces.corners).max()) for faces in (a, b))
    first, second = _near(a, b, slack), _near(b, a, slack)
    if not (len(first) and len(second)):
        return None
    center = a.corners[first[0], 0]
    keys = [_plane_key(faces, chosen, center) for faces, chosen in ((a, first), (b, second))]
    order = np.argsort(keys[1])
    ordered, second = keys[1][order], second[order]
    # Small faces that coincide have normals that differ by rounding.
    margin = _KEY_MARGIN / _CONTACT * slack
    begin, end = (np.searchsorted(ordered, keys[0] + side * margin) for side in (-1, 1))
    ends = np.cumsum(end - begin)
    none = np.zeros(0, np.int64)
    ones, others = [none], [none]
    for start in range(0, int(ends[-1]), _PAIRS_AT_ONCE):
        pair = np.arange(start, min(start + _PAIRS_AT_ONCE, int(ends[-1])))
        row = np.searchsorted(ends, pair, side="right")
        one = first[row]
        other = second[begin[row] + pair - (ends[row] - (end - begin)[row])]
        touch = _coincide(a, one, b, other, slack)
        ones.append(one[touch])
        others.append(other[touch])
    one, other = np.concatenate(ones), np.concatenate(others)
    if not len(one):
        return None
    is_alike = bool((np.sum(a.normal[one] * b.normal[other], axis=1) > 0).any())
    return _Contact(float(a.height[one].min()), is_alike, max(float(-b.height[other].min()), 0.0))


def _near(a: _Faces, b: _Faces, slack: float) -> npt.NDArray[np.int64]:
    """The faces of `a` that meet the box around `b`."""
    low, high = b.corners.min(axis=(0, 1)) - slack, b.corners.max(axis=(0, 1)) + slack
    inside = (a.corners.max(axis=1) >= low).all(axis=1) & (a.corners.min(axis=1) <= high).all(axis=1)
    return np.flatnonzero(inside)


def _plane_key(faces: _Faces, chosen: npt.NDArray[np.int64], center: Array) -> Array:
    """A number for each plane, whichever side its normal is on."""
    normal = faces.normal[chosen]
    return np.asarray((normal @ _AXIS) * np.sum((faces.corners[chosen, 0] - center) * normal, axis=1))


def _coincide(
    a: _Faces, one: npt.NDArray[np.int64], b: _Faces, other: npt.NDArray[np.int64], slack: float
) -> npt.NDArray[np.bool_]:
    """Whether pairs of faces lie in one plane, the corners of the smaller in that of the larger, and their
    boxes meet."""
    corners, others = a.corners[one], b.corners[other]
    apart = np.abs(np.sum((corners - others[:, :1]) * b.normal[other][:, None], axis=2)).max(axis=1)
    back = np.abs(np.sum((others - corners[:, :1]) * a.normal[one][:, None], axis=2)).max(axis=1)
    meet = (corners.max(axis=1) >= others.min(axis=1) - slack) & (
        corners.min(axis=1) <= others.max(axis=1) + slack
    )
    return np.asarray((np.minimum(apart, back) <= slack) & meet.all(axis=1))


def _grown(obj: Object, share: float) -> Object:
    """The object grown about its middle by such a share of its size; the same one for the same again."""
    before = _GROWN.get(obj)
    if before is None or before[0] != share:
        before = _GROWN[obj] = share, _make_grown(obj, share)
    return before[1]


def _make_grown(obj: Object, share: float) -> Object:
    matrix = obj.world_from_object.copy()
    matrix[:, :3] *= 1 + share
    matrix[:, 3] = _middle(obj) + (1 + share) * (matrix[:, 3] - _middle(obj))
    return Object(obj.name, obj.mesh, obj.material, visible=obj.visible, matrix=matrix)


_KNOWN: WeakKeyDictionary[Object, _Faces] = WeakKeyDictionary()
"""The faces of bodies that were asked for, as long as those live: a drag asks again and again."""
_GROWN: WeakKeyDictionary[Object, tuple[float, Object]] = WeakKeyDictionary()
"""Bodies that are grown, by which share, and what they were grown to."""
