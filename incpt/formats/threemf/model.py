"""The model parts of a 3MF file: objects, what they are coloured with, and what is built of them."""

from __future__ import annotations

import math
import posixpath
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from incpt.core.checks import described
from incpt.core.errors import InputError
from incpt.formats import import_report
from incpt.formats.import_report import counted
from incpt.formats.threemf.markup import read_elements
from incpt.picture.color import linear_from_srgb

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
MATERIALS = "http://schemas.microsoft.com/3dmanufacturing/material/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
"""Namespaces of the specification and of the extensions that are read."""
_KNOWN = (CORE, MATERIALS, PRODUCTION)
UNITS = {
    "micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048, "meter": 1.0,
}  # fmt: skip
"""Metres of a unit."""
_SILENT = frozenset(f"{CORE} {name}" for name in (
    "resources", "build", "mesh", "vertices", "triangles", "components", "metadata", "metadatagroup",
))  # fmt: skip
"""Elements that hold others, or say nothing of what is seen."""
GREY = (0.8, 0.8, 0.8, 1.0)
"""Of what has no colour beside others that have one, linear."""
NOTHING = -1
"""In place of a number that a triangle or an object does not have."""

Row = TypeVar("Row", bound=tuple[float, ...])
Key = tuple[str, int]
"""A resource: the part that it stands in, and its id there."""
Matrix = npt.NDArray[np.float64]
Handler = Callable[[dict[str, str]], None]
"""Takes the attributes of an element."""


@dataclass(frozen=True, eq=False)
class Placed:
    """An object at a place, by a (4, 4) matrix."""

    key: Key
    matrix: Matrix


@dataclass
class Solid:
    """An object: a mesh, or components. `triangles` has seven numbers for each: three vertices, the id of a
    group of properties, and a number in it for each corner, NOTHING where there is none; those of the object
    count then."""

    name: str
    group: int
    property: int
    vertices: array[float] = field(default_factory=lambda: array("d"))
    triangles: array[int] = field(default_factory=lambda: array("q"))
    components: list[Placed] = field(default_factory=list)


@dataclass
class ColorGroup:
    """Linear colours with an alpha; base materials have names."""

    colors: list[tuple[float, ...]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)


@dataclass
class ImageGroup:
    """Texture coordinates of an image, from its bottom left."""

    image: Key
    uvs: list[tuple[float, float]] = field(default_factory=list)


@dataclass
class LayerGroup:
    """Properties that lie on each other: the ids of their groups, the lowest first, and for each property its
    numbers in these."""

    groups: list[int]
    numbers: list[list[int]] = field(default_factory=list)


@dataclass(frozen=True)
class ImageUse:
    """The part that holds an image, and how it goes on beyond its edges."""

    part: str
    wrap: tuple[str, str]
    filter: str


@dataclass
class Model:
    """What the model parts of a file hold, by part and id. `build`: what is made, in the units of the root
    part."""

    unit: float = UNITS["millimeter"]
    solids: dict[Key, Solid] = field(default_factory=dict)
    colors: dict[Key, ColorGroup] = field(default_factory=dict)
    images: dict[Key, ImageUse] = field(default_factory=dict)
    image_groups: dict[Key, ImageGroup] = field(default_factory=dict)
    build: list[Placed] = field(default_factory=list)
    parts: list[str] = field(default_factory=list)
    """Those that were named, the root first."""


def read_part(model: Model, part: str, pieces: Iterable[bytes]) -> None:
    """Adds what a model part holds; parts that it names are added to `model.parts`. Raises InputError."""
    reader = _PartReader(model, part)
    read_elements(pieces, part, reader.take, reader.declare)
    reader.flatten_layers()
    for name, count in reader.unknown.items():
        import_report.left_out(f"{counted(count, 'element')} <{name}> of {part}: nothing here is like them")


class _PartReader:
    """Takes the elements of a part in their order; what they belong to is the one before them."""

    def __init__(self, model: Model, part: str) -> None:
        self._model, self._part = model, part
        self._solid = Solid("", NOTHING, NOTHING)
        self._colors, self._image_group = ColorGroup(), ImageGroup(("", NOTHING))
        self._mixed, self._mixed_from = ColorGroup(), (ColorGroup(), [0])
        self._layers = LayerGroup([])
        self._layer_groups: dict[int, LayerGroup] = {}
        self.unknown: Counter[str] = Counter()
        self._namespaces: dict[str | None, str] = {}
        # Until the root is there, no other element may be.
        self._handlers: dict[str, Handler] = {f"{CORE} model": self._begin}

    def declare(self, prefix: str | None, namespace: str) -> None:
        """Takes a namespace that the elements behind have by that prefix."""
        self._namespaces[prefix] = namespace

    def take(self, name: str, given: dict[str, str]) -> None:
        """Takes an element by its name and its attributes. Raises InputError."""
        handler = self._handlers.get(name)
        try:
            if handler is not None:
                handler(given)
            elif len(self._handlers) == 1:
                raise InputError("is no model of 3MF; save the file again")
            elif name not in _SILENT:
                self.unknown[_local(name)] += 1
        except InputError as error:
            raise InputError(f"{self._part}: <{_local(name)}>: {error}") from None
        except KeyError as error:
            raise InputError(f"{self._part}: <{_local(name)}>: lacks {error}") from None
        except (ValueError, OverflowError):
            raise InputError(f"{self._part}: <{_local(name)}>: has a number that is none") from None

    def _begin(self, given: dict[str, str]) -> None:
        for prefix in given.get("requiredextensions", "").split():
            name = self._namespaces.get(prefix, prefix)
            if name not in _KNOWN:
                raise InputError(f"requires the extension {name!r}, which is not read; save it without")
        if self._part == self._model.parts[0]:
            unit = given.get("unit", "millimeter")
            if unit not in UNITS:
                raise InputError(f"unit {described(unit)} is none of {', '.join(UNITS)}")
            self._model.unit = UNITS[unit]
        core: dict[str, Handler] = {
            "object": self._object, "vertex": self._vertex, "triangle": self._triangle,
            "component": self._component, "item": self._item, "basematerials": self._color_group,
            "base": self._base, "model": lambda given: None,
        }  # fmt: skip
        materials: dict[str, Handler] = {
            "colorgroup": self._color_group, "color": self._color, "texture2d": self._image,
            "texture2dgroup": self._begin_image_group, "tex2coord": self._uv,
            "compositematerials": self._begin_mixtures, "composite": self._mixture,
            "multiproperties": self._begin_layers, "multi": self._layer,
        }  # fmt: skip
        self._handlers = {f"{CORE} {name}": handler for name, handler in core.items()}
        self._handlers |= {f"{MATERIALS} {name}": handler for name, handler in materials.items()}

    def _object(self, given: dict[str, str]) -> None:
        number = int(given["id"])
        self._solid = Solid(
            given.get("name", "") or f"object {number}",
            int(given.get("pid", NOTHING)),
            int(given.get("pindex", NOTHING)),
        )
        self._model.solids[self._part, number] = self._solid

    def _vertex(self, given: dict[str, str]) -> None:
        self._solid.vertices.extend((float(given["x"]), float(given["y"]), float(given["z"])))

    def _triangle(self, given: dict[str, str]) -> None:
        corners = int(given["v1"]), int(given["v2"]), int(given["v3"])
        if len(given) == 3:
            self._solid.triangles.extend((*corners, NOTHING, NOTHING, NOTHING, NOTHING))
            return
        first = int(given.get("p1", NOTHING))
        self._solid.triangles.extend((
            *corners, int(given.get("pid", NOTHING)), first,
            int(given.get("p2", first)), int(given.get("p3", first)),
        ))  # fmt: skip

    def _component(self, given: dict[str, str]) -> None:
        self._solid.components.append(self._placed(given))

    def _item(self, given: dict[str, str]) -> None:
        self._model.build.append(self._placed(given))

    def _placed(self, given: dict[str, str]) -> Placed:
        part = given.get(f"{PRODUCTION} path")
        part = self._part if part is None else posixpath.join("/", part)
        if part not in self._model.parts:
            self._model.parts.append(part)
        return Placed((part, int(given["objectid"])), _matrix(given.get("transform")))

    def _color_group(self, given: dict[str, str]) -> None:
        self._colors = self._model.colors[self._part, int(given["id"])] = ColorGroup()

    def _base(self, given: dict[str, str]) -> None:
        self._colors.names.append(given.get("name", ""))
        self._colors.colors.append(_linear(given["displaycolor"]))

    def _color(self, given: dict[str, str]) -> None:
        self._colors.colors.append(_linear(given["color"]))

    def _image(self, given: dict[str, str]) -> None:
        styles = given.get("tilestyleu", "wrap"), given.get("tilestylev", "wrap")
        if "none" in styles:
            import_report.changed("an image that ends at its edges: goes on with the colours there")
        wraps = {"wrap": "repeat", "mirror": "mirror"}
        self._model.images[self._part, int(given["id"])] = ImageUse(
            posixpath.join("/", given["path"]),
            (wraps.get(styles[0], "clamp"), wraps.get(styles[1], "clamp")),
            "nearest" if given.get("filter") == "nearest" else "bilinear",
        )

    def _begin_image_group(self, given: dict[str, str]) -> None:
        group = ImageGroup((self._part, int(given["texid"])))
        self._image_group = self._model.image_groups[self._part, int(given["id"])] = group

    def _uv(self, given: dict[str, str]) -> None:
        self._image_group.uvs.append((float(given["u"]), float(given["v"])))

    def _begin_mixtures(self, given: dict[str, str]) -> None:
        base = self._model.colors.get((self._part, int(given["matid"])), ColorGroup())
        self._mixed = self._model.colors[self._part, int(given["id"])] = ColorGroup()
        self._mixed_from = base, _whole_numbers(given["matindices"])

    def _mixture(self, given: dict[str, str]) -> None:
        base, places = self._mixed_from
        shares = [max(float(word), 0.0) for word in given["values"].split()]
        parts = [
            (share, base.colors[place])
            for share, place in zip(shares, places, strict=False)
            if 0 <= place < len(base.colors)
        ]
        total = sum(share for share, _ in parts)
        if not 0 < total < math.inf:
            raise InputError("mixes nothing; give it values, and materials that there are")
        mixed = np.sum([np.multiply(share / total, color) for share, color in parts], axis=0)
        self._mixed.colors.append(tuple(mixed.tolist()))

    def _begin_layers(self, given: dict[str, str]) -> None:
        self._layers = LayerGroup(_whole_numbers(given["pids"]))
        self._layer_groups[int(given["id"])] = self._layers

    def _layer(self, given: dict[str, str]) -> None:
        self._layers.numbers.append(_whole_numbers(given["pindices"]))

    def flatten_layers(self) -> None:
        """Makes groups of their own of those with layers: of each the topmost that is an image or a
        colour."""
        for number, layers in self._layer_groups.items():
            key = self._part, number
            known = [
                (place, (self._part, group)) for place, group in enumerate(layers.groups)
                if (self._part, group) in self._model.colors.keys() | self._model.image_groups.keys()
            ]  # fmt: skip
            if not known:
                continue
            place, below = known[-1]
            chosen = [row[place] if place < len(row) else 0 for row in layers.numbers]
            if below in self._model.colors:
                colors = self._model.colors[below].colors
                self._model.colors[key] = ColorGroup([_at(colors, one, GREY) for one in chosen])
            else:
                group = self._model.image_groups[below]
                self._model.image_groups[key] = ImageGroup(
                    group.image, [_at(group.uvs, one, (0.0, 0.0)) for one in chosen]
                )
            if len(layers.groups) > 1:
                import_report.changed(
                    f"layers of properties {number} of {self._part}: only the topmost is used"
                )


def _at(values: Sequence[Row], place: int, default: Row) -> Row:
    return values[place] if 0 <= place < len(values) else default


def _whole_numbers(text: str) -> list[int]:
    return [int(word) for word in text.split()]


def _local(name: str) -> str:
    """The name of an element without its namespace."""
    return name.rpartition(" ")[2]


def _linear(text: str) -> tuple[float, ...]:
    """Of #RRGGBB or #RRGGBBAA in sRGB. Raises InputError."""
    try:
        numbers = bytes.fromhex(text.strip().removeprefix("#"))
    except ValueError:
        numbers = b""
    if len(numbers) not in (3, 4):
        raise InputError(f"colour {described(text)} is not like #RRGGBB or #RRGGBBAA")
    alpha = numbers[3] / 255 if len(numbers) == 4 else 1.0
    return (*linear_from_srgb(np.frombuffer(numbers, np.uint8, 3) / 255).tolist(), alpha)


def _matrix(text: str | None) -> Matrix:
    """(4, 4) from the twelve numbers of a transform, which has points as rows. Raises InputError."""
    matrix = np.eye(4)
    if text is not None:
        numbers = [float(word) for word in text.split()]
        if len(numbers) != 12 or not np.isfinite(numbers).all():
            raise InputError(f"transform {described(text)} has not twelve numbers")
        matrix[:3] = np.reshape(numbers, (4, 3)).T
    return matrix
