"""The nodes of a glTF file: which are in its scene, what they are called, where they stand, who sees them."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.formats import import_report
from incpt.formats.gltf.accessors import Accessors
from incpt.formats.gltf.document import Document
from incpt.formats.gltf.table import Table
from incpt.scene.checks import LARGEST

Matrix = npt.NDArray[np.float64]
_FLAT = 1e-6
"""The volume that axes of unit length span below which they lie in a plane."""
INSTANCING = "EXT_mesh_gpu_instancing"
_PROPERTIES: dict[str, tuple[float, ...]] = {
    "translation": (0.0, 0.0, 0.0),
    "rotation": (0.0, 0.0, 0.0, 1.0),
    "scale": (1.0, 1.0, 1.0),
}
"""What a node without a matrix stands by, with the defaults; the rotation is a quaternion."""


@dataclass(frozen=True, eq=False)
class Node:
    """A node of the scene: its table, its name among all nodes of the file, its placement (4, 4) in the
    world, and whether it and all above it are visible."""

    number: int
    table: Table
    name: str
    world: Matrix
    is_visible: bool

    @property
    def flattens(self) -> bool:
        """Whether nothing that has directions can stand there."""
        with np.errstate(all="ignore"):
            axes = self.world[:3, :3] / np.linalg.norm(self.world[:3, :3], axis=0)
        return not bool(np.isfinite(axes).all() and abs(np.linalg.det(axes)) > _FLAT)


class Nodes:
    """All nodes of a file."""

    def __init__(self, document: Document) -> None:
        """Raises InputError: a node below itself or below two others, or one that is not there."""
        self._document = document
        self._tables = list(document.root.tables("nodes"))
        self._names = _names(self._tables)
        self._children = [self._checked(table.indices("children"), table.place) for table in self._tables]
        self.worlds: list[Matrix] = [np.eye(4)] * len(self._tables)
        """(4, 4) for each node."""
        self._visible = [True] * len(self._tables)
        self._place()

    def _checked(self, numbers: list[int], place: str) -> list[int]:
        for number in numbers:
            if number >= len(self._tables):
                raise InputError(f"{place}: names node {number} of {len(self._tables)}; the file is damaged")
        return numbers

    def _place(self) -> None:
        below = [child for children in self._children for child in children]
        if len(set(below)) < len(below):
            raise InputError("nodes: one stands below two others; the file is damaged")
        self._roots = sorted(set(range(len(self._tables))).difference(below))
        left = [(root, np.eye(4), True) for root in self._roots]
        reached = 0
        while left:
            number, above, is_visible = left.pop()
            table = self._tables[number]
            with table.in_messages():
                self.worlds[number] = above @ _local(table)
                is_visible = is_visible and table.extension("KHR_node_visibility").flag("visible", True)
            self._visible[number] = is_visible
            left += [(child, self.worlds[number], is_visible) for child in self._children[number]]
            reached += 1
        # With one parent at most, what no root leads to goes round in a circle.
        if reached < len(self._tables):
            raise InputError("nodes: one stands below itself; the file is damaged")

    def in_scene(self) -> list[Node]:
        """The nodes of the default scene, each before its children. Other scenes are told of. Raises
        InputError."""
        scenes = self._document.root.entries("scenes")
        if scenes:
            chosen = self._document.root.index("scene") or 0
            table = self._document.item("scenes", chosen)
            roots = self._checked(table.indices("nodes"), table.place)
            if len(scenes) > 1:
                import_report.left_out(f"{len(scenes) - 1} of {len(scenes)} scenes: only the default is read")
        else:
            roots = self._roots
        found: list[Node] = []
        left = list(reversed(dict.fromkeys(roots)))
        while left:
            number = left.pop()
            found.append(
                Node(
                    number, self._tables[number], self._names[number], self.worlds[number],
                    self._visible[number],
                )
            )  # fmt: skip
            left += reversed(self._children[number])
        return found


def _names(tables: list[Table]) -> list[str]:
    """One for each node: its own, its number where it has none, counted on where two have the same."""
    used: dict[str, None] = {}
    counts: dict[str, int] = {}
    for number, table in enumerate(tables):
        name = wanted = table.text("name") or str(number)
        counted = re.fullmatch(r"(.*)_(\d{1,9})", name, re.DOTALL)
        stem, count = (counted[1], int(counted[2])) if counted else (name, 0)
        count = max(count, counts.get(wanted, 0))
        while name in used:
            count += 1
            name = f"{stem}_{count}"
        counts[wanted] = count
        used[name] = None
    return list(used)


def _local(table: Table) -> Matrix:
    """(4, 4) placement of a node below the one above it."""
    if "matrix" in table:
        values = table.numbers("matrix", (0.0,) * 16)
        matrix = np.array(values).reshape(4, 4).T
        if not np.array_equal(matrix[3], [0, 0, 0, 1]):
            import_report.changed(f"the matrix of {table.place}: its last row is not [0, 0, 0, 1]")
            matrix[3] = [0, 0, 0, 1]
        return matrix
    found = {name: np.array(table.numbers(name, default)) for name, default in _PROPERTIES.items()}
    if not found["rotation"].any():
        import_report.changed(f"the rotation of {table.place}: is all zeros, and counts as none")
    return composed(found["translation"], found["rotation"], found["scale"])


def composed(translation: Matrix, rotation: Matrix, scale: Matrix) -> Matrix:
    """(..., 4, 4) that scale by axis (..., 3), then turn by a quaternion (..., 4) x, y, z, w, then move."""
    with np.errstate(all="ignore"):
        unit = rotation / np.linalg.norm(rotation, axis=-1, keepdims=True)
    unit = np.where(np.isfinite(unit).all(axis=-1, keepdims=True), unit, [0.0, 0.0, 0.0, 1.0])
    x, y, z, w = np.moveaxis(unit, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix = np.zeros((*np.shape(x), 4, 4))
    for i, row in enumerate(rows):
        for j, value in enumerate(row):
            matrix[..., i, j] = value * scale[..., j]
    matrix[..., :3, 3] = translation
    matrix[..., 3, 3] = 1
    return matrix


def instances(node: Table, accessors: Accessors) -> Matrix | None:
    """(N, 4, 4) where the instances of a node's mesh stand, in the space of the node; None without any.
    Raises InputError."""
    table = node.extension(INSTANCING)
    if "attributes" not in table:
        return None
    with table.in_messages():
        names = table.table("attributes")
        found = {}
        for name, default in _PROPERTIES.items():
            number = names.index(name.upper())
            if number is not None:
                values = accessors.doubles(number, len(default))
                found[name] = np.clip(np.nan_to_num(values), -LARGEST, LARGEST)
        counts = {len(values) for values in found.values()}
        if len(counts) != 1:
            raise InputError("attributes: are of no instances, or of different numbers of them")
        count = counts.pop()
        wanted = [
            found.get(name, np.broadcast_to(default, (count, len(default))))
            for name, default in _PROPERTIES.items()
        ]
        return composed(wanted[0], wanted[1], wanted[2])
