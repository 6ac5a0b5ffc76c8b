"""The objects of a scene with their properties, and which of these were read.

Whoever reads a property asks for it by its name; what nobody has asked for in the end is told as left out, so
that nothing of a file goes in silence.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.scene.checks import LARGEST

Array = npt.NDArray[np.float64]
UNNAMED = "\0"
"""What the names of objects that were given none begin with; no file can hold it."""


@dataclass(frozen=True)
class Color:
    """Linear red, green and blue."""

    rgb: tuple[float, float, float]


@dataclass(eq=False)
class Node:
    """An object: a shape, a BSDF, a texture ... `kind` is the plugin that it names, `place` says where it
    stands in the file. `objects` are those within it with their names, of which one that begins with UNNAMED
    was given none."""

    tag: str
    kind: str
    place: str
    id: str = ""
    values: dict[str, object] = field(default_factory=dict)
    objects: dict[str, Node] = field(default_factory=dict)
    asked: set[str] = field(default_factory=set)

    def __str__(self) -> str:
        named = f" {self.id!r}" if self.id else ""
        return f"{self.kind} {self.tag}{named} ({self.place})"

    def has(self, name: str) -> bool:
        """Whether it has a property of that name, or an object."""
        return name in self.values or name in self.objects

    def add_object(self, name: str, node: Node) -> str:
        """Puts an object within it; returns its name, which it gets where it has none. Raises InputError."""
        if self.has(name):
            raise InputError(f"{name[:40]}: is given twice; leave one of them out")
        name = name or f"{UNNAMED}{len(self.objects)}"
        self.objects[name] = node
        return name

    def value(self, name: str) -> object:
        """A property, or the object of that name; None where there is none."""
        self.asked.add(name)
        return self.values.get(name, self.objects.get(name))

    def number(self, name: str, default: float, low: float = -LARGEST, high: float = LARGEST) -> float:
        """Raises InputError."""
        value = self.value(name)
        if value is None:
            return default
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{name}: is not a number; write <float name={name!r} .../>")
        if not low <= value <= high:
            raise InputError(f"{name}: {value:g} is out of range; use {low:g} to {high:g}")
        return float(value)

    def whole(self, name: str, default: int, low: int, high: int) -> int:
        """Raises InputError."""
        value = self.number(name, default, low, high)
        if value != int(value):
            raise InputError(f"{name}: {value:g} is not a whole number")
        return int(value)

    def flag(self, name: str, default: bool) -> bool:
        """Raises InputError."""
        value = self.value(name)
        if value is None:
            return default
        if not isinstance(value, bool):
            raise InputError(f"{name}: is neither true nor false; write <boolean name={name!r} .../>")
        return value

    def text(self, name: str, default: str = "") -> str:
        """Raises InputError."""
        value = self.value(name)
        if value is None:
            return default
        if not isinstance(value, str):
            raise InputError(f"{name}: is not a text; write <string name={name!r} .../>")
        return value

    def vector(self, name: str, default: tuple[float, float, float]) -> Array:
        """(3,) Raises InputError."""
        value = self.value(name)
        if value is None:
            return np.array(default)
        if not isinstance(value, np.ndarray) or value.shape != (3,):
            raise InputError(f"{name}: is not a point or a vector; write <vector name={name!r} .../>")
        return value

    def matrix(self, name: str) -> Array:
        """(4, 4) a transform; the identity where there is none. Raises InputError."""
        value = self.value(name)
        if value is None:
            return np.eye(4)
        if not isinstance(value, np.ndarray) or value.shape != (4, 4):
            raise InputError(f"{name}: is not a transform; write <transform name={name!r}> ... </transform>")
        return value

    def objects_of(self, *tags: str) -> Iterator[Node]:
        """The objects within it that have one of these tags."""
        for name, node in self.objects.items():
            if node.tag in tags:
                self.asked.add(name)
                yield node

    def ignore(self, *names: str) -> None:
        """Marks properties as read that change no picture, or that are told otherwise."""
        self.asked.update(names)

    def unread(self) -> list[str]:
        """Names of properties, and tags of objects, that nobody has asked for."""
        names = [name for name in self.values if name not in self.asked]
        objects = [(name, node) for name, node in self.objects.items() if name not in self.asked]
        return names + [f"<{node.tag}>" if name.startswith(UNNAMED) else name for name, node in objects]
