"""The parameters of a statement: "type name" and values, and which of them were read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.scene.checks import LARGEST

Array = npt.NDArray[np.float64]
_POINTS = ("point3", "point", "vector3", "vector", "normal3", "normal")
_PAIRS = ("point2", "vector2")
TYPES = ("float", "integer", "bool", "string", "rgb", "spectrum", "blackbody", "texture", *_POINTS, *_PAIRS)


@dataclass(frozen=True, eq=False)
class Parameter:
    """Its type, and its values: numbers (N,), or texts."""

    type: str
    numbers: Array
    texts: Sequence[str] = ()


@dataclass(eq=False)
class Statement:
    """A directive with its type and parameters. `place` says where it stands in the file. Parameters of its
    `defaults` were given for all statements of a kind, of which it need not use them."""

    directive: str
    kind: str
    place: str
    parameters: dict[str, Parameter] = field(default_factory=dict)
    asked: set[str] = field(default_factory=set)
    defaults: set[str] = field(default_factory=set)

    def __str__(self) -> str:
        return (
            f"{self.directive} {self.kind!r} ({self.place})"
            if self.kind
            else f"{self.directive} ({self.place})"
        )

    def has(self, name: str) -> bool:
        return name in self.parameters

    def parameter(self, name: str) -> Parameter | None:
        """None where there is none of that name."""
        self.asked.add(name)
        return self.parameters.get(name)

    def number(self, name: str, default: float, low: float = -LARGEST, high: float = LARGEST) -> float:
        """Raises InputError."""
        found = self.numbers(name, 1, ("float", "integer"))
        value = default if found is None else float(found[0])
        if not low <= value <= high:
            raise InputError(f"{name}: {value:g} is out of range; use {low:g} to {high:g}")
        return value

    def whole(self, name: str, default: int, low: int, high: int) -> int:
        """Raises InputError."""
        value = self.number(name, default, low, high)
        if value != int(value):
            raise InputError(f"{name}: {value:g} is not a whole number")
        return int(value)

    def numbers(self, name: str, count: int | None, types: Sequence[str]) -> Array | None:
        """(count,) numbers of one of these types, or any number of them. Raises InputError."""
        found = self.parameter(name)
        if found is None:
            return None
        if found.type not in types:
            raise InputError(f"{name}: is of type {found.type}; use {types[0]}")
        if count is not None and len(found.numbers) != count:
            raise InputError(f"{name}: holds {len(found.numbers)} numbers; write {count}")
        return found.numbers

    def vectors(self, name: str, size: int = 3) -> Array | None:
        """(N, size) points or vectors. Raises InputError."""
        found = self.numbers(name, None, _POINTS if size == 3 else (*_PAIRS, "float"))
        if found is None:
            return None
        if len(found) % size:
            raise InputError(f"{name}: holds {len(found)} numbers, which are no multiple of {size}")
        return found.reshape(-1, size)

    def vector(self, name: str, default: tuple[float, float, float]) -> Array:
        """(3,) Raises InputError."""
        found = self.vectors(name)
        if found is None:
            return np.array(default)
        if len(found) != 1:
            raise InputError(f"{name}: holds {len(found)} points; write one")
        return np.asarray(found[0])

    def indices(self, name: str, size: int) -> npt.NDArray[np.int64] | None:
        """(N, size) whole numbers. Raises InputError."""
        found = self.numbers(name, None, ("integer",))
        if found is None:
            return None
        if len(found) % size:
            raise InputError(f"{name}: holds {len(found)} numbers, which are no multiple of {size}")
        return np.clip(found, -1, 2**31 - 1).astype(np.int64).reshape(-1, size)

    def text(self, name: str, default: str = "") -> str:
        """Raises InputError."""
        found = self.parameter(name)
        if found is None:
            return default
        if found.type != "string" or len(found.texts) != 1:
            raise InputError(f'{name}: is not one text; write "string {name}" "..."')
        return found.texts[0]

    def flag(self, name: str, default: bool) -> bool:
        """Raises InputError."""
        found = self.parameter(name)
        if found is None:
            return default
        if found.type != "bool" or len(found.texts) != 1 or found.texts[0] not in ("true", "false"):
            raise InputError(f'{name}: is neither true nor false; write "bool {name}" true')
        return found.texts[0] == "true"

    def ignore(self, *names: str) -> None:
        """Marks parameters as read that change no picture, or that are told otherwise."""
        self.asked.update(names)

    def unread(self) -> list[str]:
        """Names of parameters that nobody has asked for."""
        return [name for name in self.parameters if name not in self.asked | self.defaults]
