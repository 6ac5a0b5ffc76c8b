"""The light tree: which light is worth a shadow ray from where, and which lights a ray may meet.

With many lights a table of chances is not enough: whatever it says holds everywhere, and a lamp that is near
is lost among thousands that are far. The tree holds lights in groups of groups, each with bounds of where its
lights are and where they shine to, and light sampling goes down from the root by what the groups may bring
(A. Conty Estevez and C. Kulla, Importance Sampling of Many Lights with Adaptive Tree Splitting, HPG 2018).
How much that is, is written down once, in cl/scene/light_tree.cl. Rays find the lights that they meet in the
same tree: each node has a second half, boxes around those lights alone.

Nodes have eight children. All leaves are equally deep and hold one light each, so that the way to a light is
a word of three bits for each level (its *trail*), by which a ray that meets the light knows its chance.

Ranges of lights are halved along the longest axis of their centres, from the root down, for all nodes of a
level at a time; then what is known of lights is joined from the leaves up. Ten thousand take less than 20
milliseconds, so that a lamp can be dragged among them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.core import layout
from incpt.core.layout import LIGHT_TREE_BITS, LightNodePlane

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

_WIDTH = layout.BVH_WIDTH
_LEAST_POWER = 1e-12
"""Of a light, as a share of all: so little that it costs nothing, and so much that no chance is lost in
single precision."""
_LEAST_FALLOFF = 0.05
"""Radians over which the light of a group falls off at least: so many that it does so steadily."""
_EVERYWHERE = 3.0
"""Radians from which on a spread is taken for all directions."""
_BOX_SLACK = 2.0**-20
"""Of boxes around what rays may meet, per metre of coordinates and extent."""
_SHARE_OF_SEGMENT = 0.999
"""Of the numbers between two whole ones, by which centres are sorted within their range."""


@dataclass(frozen=True, eq=False)
class TreeLights:
    """What a tree needs to know of N lights. Where two scenes choose among the same lights, these are bounds
    of both.

    bounds   (N, 2, 3) in world space
    axis     (N, 3) the middle of the directions of their normals, of unit length
    spread   (N,) the angle between that and any of the normals, radians; pi where they go everywhere
    falloff  (N,) the angle from a normal beyond which nothing is emitted, radians
    power    (N,) by which they are chosen at the same distance: their greatest intensity
    met      (N,) whether rays may meet them in the tree
    numbers  (N,) uint32 by which kernels know them, see layout.LIGHT_NODE
    """

    bounds: Array
    axis: Array
    spread: Array
    falloff: Array
    power: Array
    met: npt.NDArray[np.bool_]
    numbers: npt.NDArray[np.uint32]

    @classmethod
    def joined(cls, parts: list[TreeLights]) -> TreeLights:
        return cls(*(np.concatenate([getattr(part, name) for part in parts])
                     for name in cls.__dataclass_fields__))  # fmt: skip


@dataclass(frozen=True, eq=False)
class LightTree:
    """A tree over N lights: `nodes` (M,) layout.LIGHT_NODE, the same nodes as rays see them, `boxes` (M,)
    layout.NODE, and the `trails` (N,) uint32 of the lights."""

    nodes: npt.NDArray[np.void]
    boxes: npt.NDArray[np.void]
    trails: npt.NDArray[np.uint32]


def merged_cones(first: tuple[Array, Array], second: tuple[Array, Array]) -> tuple[Array, Array]:
    """Axes (N, 3) and spreads (N,) that cover those of two cones each."""
    axis = first[0] + second[0]
    length = np.linalg.norm(axis, axis=1)
    same = length > 1e-6
    axis = np.where(same[:, None], axis / np.where(same, length, 1)[:, None], first[0])
    spread = np.maximum(*(_angle(axis, own) + own_spread for own, own_spread in (first, second)))
    return axis, np.minimum(spread, np.pi)


def build(lights: TreeLights) -> LightTree:
    """The tree over these lights, one at least."""
    count = len(lights.numbers)
    levels = level_count(count)
    center = lights.bounds.mean(axis=1)
    order, edges = np.arange(count), np.array([0, count])
    fans, all_edges = [], []
    for level in range(levels):
        capacity = _WIDTH ** (levels - level - 1)
        fans.append(-(-np.diff(edges) // capacity))  # children of each node of the level
        if capacity > 1:
            order, edges = _split(center, order, edges, fans[-1])
        else:
            edges = np.arange(count + 1)
        all_edges.append(edges)

    trails = np.zeros(count, np.uint32)
    groups = _Groups.of(lights, order)
    references = (layout.NODE_LEAF | lights.numbers[order]).astype(np.uint32)
    first = sum(map(len, fans))
    parts: list[tuple[npt.NDArray[np.void], npt.NDArray[np.void]]] = []
    for level in reversed(range(levels)):
        fan = fans[level]
        starts = np.cumsum(fan) - fan
        node = np.repeat(np.arange(len(fan)), fan)
        slot = np.arange(len(node)) - starts[node]
        parts.append(_nodes(groups, node, slot, references))
        trails[order] |= np.repeat(
            (slot << LIGHT_TREE_BITS * level).astype(np.uint32), np.diff(all_edges[level])
        )
        groups = groups.joined(starts, node)
        first -= len(fan)
        references = (first + np.arange(len(fan))).astype(np.uint32)
    nodes, boxes = (np.concatenate(part[::-1]) for part in zip(*parts, strict=True))
    return LightTree(nodes, boxes, trails)


def level_count(count: int) -> int:
    """Of a tree over so many lights."""
    levels = 1
    while _WIDTH**levels < count:
        levels += 1
    return levels


def _split(center: Array, order: Indices, edges: Indices, children: Indices) -> tuple[Indices, Indices]:
    """`order` with the lights of each range sorted into so many children, and the edges of these."""
    while (children > 1).any():
        size, left = np.diff(edges), children // 2
        # The first of the children have one light more where they are not all alike.
        in_left = left * (size // children) + np.minimum(left, size % children)
        ordered = center[order]
        least = np.minimum.reduceat(ordered, edges[:-1])
        extent = np.maximum.reduceat(ordered, edges[:-1]) - least
        axis = extent.argmax(axis=1)
        rows = np.arange(len(axis))
        widest = extent[rows, axis]
        factor = np.where(children > 1, _SHARE_OF_SEGMENT / np.where(widest > 0, widest, 1), 0)
        segment = np.repeat(rows, size)
        key = (ordered[np.arange(len(order)), axis[segment]] - least[rows, axis][segment]) * factor[segment]
        order = order[np.argsort(segment + key)]
        parts = np.stack([left, children - left], axis=1)
        middles = np.stack([edges[:-1], edges[:-1] + in_left], axis=1)
        exists = parts > 0
        edges = np.append(middles[exists], edges[-1])
        children = parts[exists]
    return order, edges


@dataclass(frozen=True, eq=False)
class _Groups:
    """What is known of N groups of lights: `low` and `high` (N, 3) of their bounds, and of boxes around what
    rays may meet of them, infinite where that is nothing; the share of all power (N,); see `TreeLights` for
    the rest."""

    low: Array
    high: Array
    met_low: Array
    met_high: Array
    share: Array
    axis: Array
    spread: Array
    falloff: Array

    @classmethod
    def of(cls, lights: TreeLights, order: Indices) -> _Groups:
        """Each light a group of its own, in that order."""
        low, high, met = lights.bounds[order, 0], lights.bounds[order, 1], lights.met[order][:, None]
        # Lights stand where single precision has them, and so do the points in which rays meet them.
        slack = _BOX_SLACK * (np.maximum(np.abs(low), np.abs(high)) + (high - low))
        return cls(
            low,
            high,
            np.where(met, low - slack, np.inf),
            np.where(met, high + slack, -np.inf),
            np.maximum(lights.power / lights.power.sum(), _LEAST_POWER)[order],
            lights.axis[order],
            lights.spread[order],
            np.maximum(lights.falloff, _LEAST_FALLOFF)[order],
        )

    def joined(self, starts: Indices, owner: Indices) -> _Groups:
        """Groups of these groups: each begins at one of `starts`; `owner` (N,) are their numbers."""
        share = np.add.reduceat(self.share, starts)
        axis = np.add.reduceat(self.axis * self.share[:, None], starts)
        length = np.linalg.norm(axis, axis=1)
        has_middle = length > 1e-6 * share
        axis = np.where(
            has_middle[:, None], axis / np.where(has_middle, length, 1)[:, None], self.axis[starts]
        )
        spread = np.maximum.reduceat(_angle(axis[owner], self.axis) + self.spread, starts)
        return _Groups(
            np.minimum.reduceat(self.low, starts),
            np.maximum.reduceat(self.high, starts),
            np.minimum.reduceat(self.met_low, starts),
            np.maximum.reduceat(self.met_high, starts),
            share,
            axis,
            np.where(spread < _EVERYWHERE, spread, np.pi),
            np.maximum.reduceat(self.falloff, starts),
        )


def _nodes(
    groups: _Groups, node: Indices, slot: Indices, references: npt.NDArray[np.uint32]
) -> tuple[npt.NDArray[np.void], npt.NDArray[np.void]]:
    """The nodes of a level: group i is `slot[i]` of node[i]."""
    count = int(node[-1]) + 1
    nodes = np.zeros(count, layout.LIGHT_NODE)
    plane, planes = LightNodePlane, nodes["planes"]
    middle = ((groups.low + groups.high) / 2).astype(np.float32)
    # From the middle as it is stored, so that the ball holds the box.
    radius = np.linalg.norm(np.maximum(groups.high - middle, middle - groups.low), axis=1)
    cos_falloff = np.cos(groups.falloff)
    planes[node, plane.CENTER_X : plane.CENTER_Z + 1, slot] = middle
    planes[node, plane.RADIUS, slot] = radius
    planes[node, plane.POWER, slot] = groups.share
    planes[node, plane.AXIS_X : plane.AXIS_Z + 1, slot] = groups.axis
    planes[node, plane.COS_SPREAD, slot] = np.cos(groups.spread)
    planes[node, plane.SIN_SPREAD, slot] = np.sin(groups.spread)
    planes[node, plane.COS_FALLOFF, slot] = cos_falloff
    planes[node, plane.FALLOFF_SCALE, slot] = 1 / (1 - cos_falloff)
    nodes["child"] = layout.NODE_EMPTY
    nodes["child"][node, slot] = references
    nodes["last"] = np.bincount(node) - 1
    nodes["directed"][node[groups.spread < _EVERYWHERE]] = 1

    boxes = np.zeros(count, layout.NODE)
    bounds = boxes["bounds"]
    bounds[:, 0::2], bounds[:, 1::2] = np.inf, -np.inf
    bounds[node, 0::2, slot] = groups.met_low
    bounds[node, 1::2, slot] = groups.met_high
    boxes["child"] = nodes["child"]
    is_met = np.isfinite(groups.met_low[:, 0])
    boxes["child"][node[~is_met], slot[~is_met]] = layout.NODE_EMPTY
    boxes["order"] = _orders(bounds)
    return nodes, boxes


def _angle(a: Array, b: Array) -> Array:
    """(N,) radians between vectors (N, 3) of unit length. From their difference and their sum, since the
    arccosine of a product is off where they are nearly the same."""
    apart, together = np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1)
    return np.asarray(2 * np.arctan2(apart, together))


_OCTANT_SIGNS = np.array([[-1.0 if octant >> axis & 1 else 1.0 for axis in range(3)] for octant in range(8)],
                         np.float32)  # fmt: skip


def _orders(bounds: npt.NDArray[np.float32]) -> npt.NDArray[np.uint32]:
    """(M, 8) see layout.NODE.order: children by where their middles lie along the octant's diagonal."""
    with np.errstate(invalid="ignore"):
        middle = bounds[:, 0::2] + bounds[:, 1::2]  # (M, 3, 8); NaN where there is no box
    along = np.einsum("oa,mac->moc", _OCTANT_SIGNS, np.nan_to_num(middle, nan=0.0))
    farthest_first = np.argsort(-along, axis=2, kind="stable").astype(np.uint32)
    shifts = (3 * np.arange(_WIDTH)).astype(np.uint32)
    return np.asarray(np.bitwise_or.reduce(farthest_first << shifts, axis=2))
