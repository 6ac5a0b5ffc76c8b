"""What the statements of a pbrt file say, each in the state that those before it have made."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError, in_place
from incpt.core.files import read_bytes
from incpt.formats import import_report
from incpt.formats.outside import check_inside
from incpt.formats.pbrt.parameters import TYPES, Parameter, Statement
from incpt.formats.pbrt.tokens import Token, finite, tokens_of

Array = npt.NDArray[np.float64]
MOST_FILES = 10_000
"""That a scene may include, each as often as it is."""
_DEEPEST = 64
"""Files or attributes within each other."""
_ATTRIBUTE_TARGETS = ("shape", "light", "material", "medium", "texture")


@dataclass(frozen=True, eq=False)
class State:
    """What holds for a shape: where it stands (4, 4), its material, the light that it is."""

    matrix: Array = field(default_factory=lambda: np.eye(4))
    material: Statement | None = None
    area_light: Statement | None = None
    turns_over: bool = False
    has_medium: bool = False
    attributes: tuple[tuple[str, dict[str, Parameter]], ...] = ()


@dataclass(frozen=True, eq=False)
class Placed:
    """A shape, a light, a camera, or an instance of an object, in its state."""

    statement: Statement
    state: State


class Document:
    """All that a scene file and those that it includes say. Raises InputError, in a line that names the line
    of the file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.camera: Placed | None = None
        self.options: dict[str, Statement] = {}
        self.shapes: list[Placed] = []
        self.lights: list[Placed] = []
        self.instances: list[Placed] = []
        self.objects: dict[str, list[Placed]] = {}
        self.materials: dict[str, Statement] = {}
        self.textures: dict[str, Statement] = {}
        self.statements: list[Statement] = []
        self._state = State()
        self._stack: list[State] = []
        self._coordinate_systems: dict[str, Array] = {}
        self._object: str | None = None
        self._open_files: list[Path] = []
        self._file_count = 0
        self._read(path, "")
        if self._stack:
            raise InputError("an AttributeBegin has no AttributeEnd; add one")

    def file(self, name: str) -> Path:
        """A file that the scene names, relative to its folder. Raises InputError."""
        name = name.replace("\\", "/")
        check_inside(self.path.parent, name)
        return self.path.parent / name

    def _read(self, path: Path, prefix: str) -> None:
        real = Path(os.path.realpath(path))
        self._file_count += 1
        if real in self._open_files:
            raise InputError(f"{path.name} includes itself; leave out one Include")
        if self._file_count > MOST_FILES or len(self._open_files) >= _DEEPEST:
            raise InputError(f"more than {MOST_FILES} files are included, or {_DEEPEST} within each other")
        self._open_files.append(real)
        content = read_bytes(path).decode("utf-8", "replace").removeprefix("\ufeff")
        _Reader(self, tokens_of(content), prefix).read()
        self._open_files.pop()

    def include(self, name: str) -> None:
        """Reads the statements of another file. Raises InputError."""
        path = self.file(name)
        if path.suffix == ".gz":
            import_report.left_out(f"{name}: compressed files are not read; unpack it")
            return
        self._read(path, f"{path.name} ")

    # ------------------------------------------------------------------------------ what changes the state

    def move(self, matrix: Array) -> None:
        """Applies a matrix (4, 4) before those that hold. Raises InputError."""
        with np.errstate(all="ignore"):
            self.place_at(self._state.matrix @ matrix)

    def place_at(self, matrix: Array) -> None:
        """Lets a matrix (4, 4) hold in place of all others. Raises InputError."""
        if not np.isfinite(matrix).all():
            raise InputError("the transform is not finite")
        self._state = replace(self._state, matrix=matrix)

    def name_place(self, name: str) -> None:
        self._coordinate_systems[name] = self._state.matrix

    def place_named(self, name: str) -> None:
        """Raises InputError."""
        if name not in self._coordinate_systems:
            raise InputError(f"CoordSysTransform: {name[:40]!r} is not named before")
        self.place_at(self._coordinate_systems[name])

    def begin_world(self) -> None:
        self._coordinate_systems["world"] = np.eye(4)
        self._state = State(attributes=self._state.attributes)

    def push(self) -> None:
        """Raises InputError."""
        if len(self._stack) >= 10_000:
            raise InputError("more than 10,000 attributes stand within each other")
        self._stack.append(self._state)

    def pop(self) -> None:
        """Raises InputError."""
        if not self._stack:
            raise InputError("AttributeEnd has no AttributeBegin; remove it")
        self._state = self._stack.pop()

    def pop_place(self) -> None:
        """Ends what began with TransformBegin, of which only the place counts. Raises InputError."""
        state = self._state
        self.pop()
        self._state = replace(state, matrix=self._state.matrix)

    def begin_object(self, name: str) -> None:
        """Raises InputError."""
        if self._object is not None:
            raise InputError("ObjectBegin stands within another one; end that before")
        self.push()
        self._object = name
        self.objects[name] = []

    def end_object(self) -> None:
        """Raises InputError."""
        if self._object is None:
            raise InputError("ObjectEnd has no ObjectBegin; remove it")
        self._object = None
        self.pop()

    def turn_over(self) -> None:
        self._state = replace(self._state, turns_over=not self._state.turns_over)

    def enter_medium(self) -> None:
        self._state = replace(self._state, has_medium=True)

    # ------------------------------------------------------------------------------------ what stands there

    def add(self, statement: Statement) -> None:
        """Takes a statement with parameters in. Raises InputError."""
        directive = statement.directive
        target = {"Shape": "shape", "LightSource": "light", "Material": "material", "Texture": "texture"}
        for wanted, defaults in self._state.attributes:
            if wanted == target.get(directive):
                statement.defaults.update(defaults.keys() - statement.parameters.keys())
                statement.parameters = {**defaults, **statement.parameters}
        self.statements.append(statement)
        placed = Placed(statement, self._state)
        if directive == "Shape":
            (self.shapes if self._object is None else self.objects[self._object]).append(placed)
        elif directive == "LightSource":
            self.lights.append(placed)
        elif directive == "Camera":
            self.camera = placed
            self._coordinate_systems["camera"] = _inverse(self._state.matrix)
        elif directive == "Material":
            self._state = replace(self._state, material=statement)
        elif directive == "AreaLightSource":
            self._state = replace(self._state, area_light=statement)
        else:
            self.options[directive] = statement

    def add_material(self, name: str, statement: Statement) -> None:
        self.statements.append(statement)
        self.materials[name] = statement

    def use_material(self, name: str) -> None:
        """Raises InputError."""
        if name not in self.materials:
            raise InputError(f"NamedMaterial: {name[:40]!r} is not made before; correct the name")
        self._state = replace(self._state, material=self.materials[name])

    def add_texture(self, name: str, statement: Statement) -> None:
        self.statements.append(statement)
        self.textures[name] = statement

    def add_instance(self, statement: Statement) -> None:
        """Raises InputError."""
        if self._object is not None:
            raise InputError("ObjectInstance stands within an object; objects hold none")
        self.instances.append(Placed(statement, self._state))

    def set_attribute(self, target: str, parameters: dict[str, Parameter]) -> None:
        """Parameters that all statements of a kind have. Raises InputError."""
        if target not in _ATTRIBUTE_TARGETS:
            raise InputError(f"Attribute: {target[:40]!r} is not one of {', '.join(_ATTRIBUTE_TARGETS)}")
        known = tuple(self._state.attributes)[-100:]
        self._state = replace(self._state, attributes=(*known, (target, parameters)))


def _inverse(matrix: Array) -> Array:
    """Raises InputError."""
    try:
        return np.asarray(np.linalg.inv(matrix), np.float64)
    except np.linalg.LinAlgError:
        raise InputError("a transform flattens space") from None


class _Reader:
    """Reads the statements of one file."""

    def __init__(self, document: Document, tokens: Iterator[Token], prefix: str) -> None:
        self._document, self._tokens, self._prefix = document, tokens, prefix
        self._next: Token | None = None
        self._line = 1

    def read(self) -> None:
        """Raises InputError."""
        while (token := self._peek()) is not None:
            with in_place(f"{self._prefix}line {self._line}"):
                self._take()
                if token.text in _PLAIN:
                    _PLAIN[token.text](self._document)
                elif token.text in _NUMBERS:
                    count, act = _NUMBERS[token.text]
                    act(self._document, self._numbers(count))
                elif token.text in _NAMED:
                    _NAMED[token.text](self._document, self._quoted())
                elif token.text in _WITH_PARAMETERS:
                    self._statement(token.text)
                else:
                    shown = token.quoted if token.quoted is not None else token.text
                    raise InputError(f"{shown[:40]!r} is no directive; correct or remove it")

    def _peek(self) -> Token | None:
        if self._next is None:
            with in_place(self._prefix.strip()) if self._prefix else nullcontext():
                self._next = next(self._tokens, None)
        if self._next is not None:
            self._line = self._next.line
        return self._next

    def _take(self) -> Token:
        token = self._peek()
        if token is None:
            raise InputError("the file ends too soon")
        self._next = None
        return token

    def _quoted(self) -> str:
        token = self._take()
        if token.quoted is None:
            raise InputError(f"{token.text[:40]!r} stands where a name in quotation marks has to be")
        return token.quoted

    def _numbers(self, count: int) -> Array:
        """So many numbers, in brackets or not."""
        first = self._peek()
        if first is not None and first.numbers is not None:
            found = self._take().numbers
        else:
            found = np.array([self._number() for _ in range(count)])
        if found is None or len(found) != count:
            raise InputError(f"needs {count} numbers")
        return found

    def _number(self) -> float:
        token = self._take()
        try:
            value = float(token.text)
        except ValueError:
            raise InputError(f"{(token.quoted or token.text)[:40]!r} is not a number") from None
        finite(np.array([value]), token.line)
        return value

    def _statement(self, directive: str) -> None:
        """A directive with a type and parameters, or a name before them."""
        document, place = self._document, f"{self._prefix}line {self._line}"
        if directive in _APART:
            _APART[directive](self, place)
            return
        kind = self._quoted()
        if directive == "ObjectInstance":
            document.add_instance(Statement(directive, kind, place))
        elif directive == "Attribute":
            document.set_attribute(kind, self._parameters())
        else:
            document.add(Statement(directive, kind, place, self._parameters()))

    def texture(self, place: str) -> None:
        """A name, what it gives, its type, and parameters."""
        name, value, kind = self._quoted(), self._quoted(), self._quoted()
        self._document.add_texture(name, Statement(f"{value} Texture", kind, place, self._parameters()))

    def named_material(self, place: str) -> None:
        """A name, and parameters, of which one is the type."""
        name, parameters = self._quoted(), self._parameters()
        kind = parameters.pop("type", None)
        texts = kind.texts if kind is not None else ()
        statement = Statement("Material", texts[0] if texts else "", place, parameters)
        self._document.add_material(name, statement)

    def medium(self, _: str) -> None:
        """What no light is scattered in; the shapes in it tell."""
        self._quoted()
        self._parameters()

    def medium_interface(self, _: str) -> None:
        """One name, or two."""
        self._quoted()
        following = self._peek()
        if following is not None and following.quoted is not None:
            self._take()
        self._document.enter_medium()

    def option(self, place: str) -> None:
        """A name with its type, and a value."""
        name = self._quoted()
        self._value()
        import_report.left_out(f"Option {name[:40]!r} ({place}): no option of pbrt is read")

    def active_transform(self, _: str) -> None:
        """For which time transforms count."""
        if self._take().text != "All":
            _tell_of_motion(self._document, None)

    def _parameters(self) -> dict[str, Parameter]:
        """As many as follow."""
        found: dict[str, Parameter] = {}
        while (token := self._peek()) is not None and token.quoted is not None:
            words = self._quoted().split()
            if len(words) != 2 or words[0] not in TYPES:
                raise InputError(f"{' '.join(words)[:40]!r} is no parameter; write a type and a name")
            with in_place(words[1]):
                found[words[1]] = self._value(words[0])
        return found

    def _value(self, kind: str = "") -> Parameter:
        """One value, or those in brackets."""
        token = self._take()
        if token.numbers is not None:
            return Parameter(kind, token.numbers)
        values = [token]
        if token.text == "[":
            values = []
            while (token := self._take()).text != "]":
                values.append(token)
        texts = [one.quoted if one.quoted is not None else one.text for one in values]
        if kind in ("string", "texture", "bool", "") or any(one.quoted is not None for one in values):
            return Parameter(kind, np.zeros(0), texts)
        numbers = []
        for one in values:
            try:
                numbers.append(float(one.text))
            except ValueError:
                raise InputError(f"{one.text[:40]!r} is not a number") from None
        return Parameter(kind, finite(np.array(numbers), token.line))


def _look_at(numbers: Array) -> Array:
    """(4, 4) from the world to a camera that looks along +z, with x to the right and y up."""
    eye, look, up = numbers.reshape(3, 3)
    view = look - eye
    if not np.linalg.norm(view) > 0 or not np.linalg.norm(up) > 0:
        raise InputError("LookAt: the point that is looked at is the eye, or up has no length")
    view = view / np.linalg.norm(view)
    right = np.cross(up, view)
    if not np.linalg.norm(right) > 1e-9 * np.linalg.norm(up):
        raise InputError("LookAt: looks along up; turn one of them")
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([right, np.cross(view, right), view, eye])
    return _inverse(matrix)


def _translation(numbers: Array) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = numbers
    return matrix


def _rotation(numbers: Array) -> Array:
    angle, axis = math.radians(numbers[0]), numbers[1:]
    length = float(np.linalg.norm(axis))
    if length == 0:
        raise InputError("Rotate: the axis has no length")
    x, y, z = axis / length
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    # Rodrigues' formula.
    matrix[:3, :3] += math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return matrix


def _columns(numbers: Array) -> Array:
    """A matrix stands there column by column."""
    matrix = numbers.reshape(4, 4).T
    if not np.array_equal(matrix[3], [0, 0, 0, 1]):
        raise InputError("the last row of the matrix is not 0 0 0 1")
    return matrix


def _tell_of_motion(_: Document, __: object) -> None:
    import_report.left_out("transforms that change with time: what stands at the end of the shutter counts")


def _tell_of_color_space(_: Document, name: str) -> None:
    if name.lower() not in ("srgb", "rec709"):
        import_report.changed(f"ColorSpace {name[:40]!r}: colours are taken for those of Rec. 709")


_PLAIN: dict[str, Callable[[Document], None]] = {
    "Identity": lambda document: document.place_at(np.eye(4)),
    "WorldBegin": Document.begin_world,
    "AttributeBegin": Document.push,
    "AttributeEnd": Document.pop,
    "TransformBegin": Document.push,
    "TransformEnd": Document.pop_place,
    "ReverseOrientation": Document.turn_over,
    "ObjectEnd": Document.end_object,
}
"""Directives without anything behind them."""
_NUMBERS: dict[str, tuple[int, Callable[[Document, Array], None]]] = {
    "LookAt": (9, lambda document, numbers: document.move(_look_at(numbers))),
    "Translate": (3, lambda document, numbers: document.move(_translation(numbers))),
    "Scale": (3, lambda document, numbers: document.move(np.diag([*numbers, 1.0]))),
    "Rotate": (4, lambda document, numbers: document.move(_rotation(numbers))),
    "Transform": (16, lambda document, numbers: document.place_at(_columns(numbers))),
    "ConcatTransform": (16, lambda document, numbers: document.move(_columns(numbers))),
    "TransformTimes": (2, _tell_of_motion),
}
"""Directives with so many numbers."""
_NAMED: dict[str, Callable[[Document, str], None]] = {
    "CoordinateSystem": Document.name_place,
    "CoordSysTransform": Document.place_named,
    "NamedMaterial": Document.use_material,
    "Include": Document.include,
    "Import": Document.include,
    "ObjectBegin": Document.begin_object,
    "ColorSpace": _tell_of_color_space,
}
"""Directives with a name in quotation marks."""
_WITH_PARAMETERS = (
    "Camera", "Film", "Sampler", "PixelFilter", "Integrator", "Accelerator", "Shape", "LightSource",
    "AreaLightSource", "Material", "Texture", "MakeNamedMaterial", "MakeNamedMedium", "MediumInterface",
    "Attribute", "Option", "ObjectInstance", "ActiveTransform",
)  # fmt: skip
"""Directives with parameters, or with something else that is read on its own."""
_APART: dict[str, Callable[[_Reader, str], None]] = {
    "Texture": _Reader.texture,
    "MakeNamedMaterial": _Reader.named_material,
    "MakeNamedMedium": _Reader.medium,
    "MediumInterface": _Reader.medium_interface,
    "Option": _Reader.option,
    "ActiveTransform": _Reader.active_transform,
}
"""Those among them that are no type with parameters."""
