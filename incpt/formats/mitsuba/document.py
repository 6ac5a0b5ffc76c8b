"""A scene file as nodes: parameters put in, files included, names of old versions made new, references found.

What Mitsuba's own parser does in "src/core/parser.cpp".
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import numpy as np

from incpt.core.errors import InputError, in_place
from incpt.formats import import_report
from incpt.formats.import_options import current_options
from incpt.formats.mitsuba.node import UNNAMED, Node
from incpt.formats.mitsuba.transforms import step_matrix
from incpt.formats.mitsuba.values import VALUE_TAGS, value_of
from incpt.formats.mitsuba.xml_file import DEEPEST, Element, read_xml
from incpt.formats.outside import check_inside

OBJECT_TAGS = (
    "scene", "bsdf", "emitter", "film", "integrator", "medium", "phase", "rfilter", "sampler", "sensor",
    "shape", "texture", "volume",
)  # fmt: skip
"""Elements that are objects; <spectrum type="..."> is one too."""
MOST_FILES = 1000
"""That a scene may include, each as often as it is."""
MOST_NODES = 1_000_000
_LONGEST_TEXT = 1 << 20
"""Characters of an attribute: parameters that name others twice grow without bounds."""
_LONGEST_NAME = 256
"""Characters of a parameter's name."""
_BEFORE_2 = (2, 0)
_PARAMETER = re.compile(r"(?<!\\)\$(\w*)", re.ASCII)


class Document:
    """The nodes of a scene file and of those that it includes. `root` is the scene; `nodes` are all of them,
    in their order. Raises InputError, in a line that names the line of the file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.nodes: list[Node] = []
        self._folders = [path.parent]
        # Those that are given come before every <default>.
        self._parameters = dict(current_options().parameters)
        self._unused = set(self._parameters)
        self._by_id: dict[str, Node] = {}
        self._references: list[tuple[Node, str, str]] = []
        self._open_files: list[Path] = []
        self._file_count = 0
        self.root = Node("scene", "scene", "line 1")
        for node in self.nodes_of_file(path, ""):
            if node.tag != "scene":
                raise InputError(f"{node.place}: <{node.tag}> is no scene; the outermost element is <scene>")
            self.root = node
        for name in sorted(self._unused):
            import_report.left_out(f"the parameter {name[:40]!r}: nothing in the scene asks for it")
        self._resolve()
        self._check_depth()

    def file(self, name: str, *first: Path) -> Path:
        """A file that the scene names, in one of the folders `first`, those of <path>, or its own. Raises
        InputError."""
        name, folders = name.replace("\\", "/"), [*first, *self._folders]
        check_inside(self.path.parent, os.path.join(folders[0], name))
        try:
            return next((folder / name for folder in folders if (folder / name).exists()), folders[0] / name)
        except (OSError, ValueError):  # too long a name, or a null character in it
            raise InputError(f"{name[:40]!r} is no name of a file") from None

    def nodes_of_file(self, path: Path, prefix: str) -> list[Node]:
        """What a file holds: its scene, or another object. `prefix` of places names an included file. Raises
        InputError."""
        real = Path(os.path.realpath(path))
        self._file_count += 1
        if real in self._open_files:
            raise InputError(f"{path.name} includes itself; leave out one <include>")
        if self._file_count > MOST_FILES or len(self._open_files) >= DEEPEST:
            raise InputError(f"more than {MOST_FILES} files are included, or {DEEPEST} within each other")
        self._open_files.append(real)
        with in_place(path.name) if prefix else nullcontext():
            element = read_xml(path)
        place = f"{prefix}line {element.line}"
        with in_place(place):
            reader = _Reader(self, path.parent, prefix, _version(element))
        holder = Node("", "", place)
        reader.put(element, holder)
        self._open_files.pop()
        return list(holder.objects.values())

    def substituted(self, attributes: dict[str, str]) -> dict[str, str]:
        """Attributes with the values of parameters ("$name") in them. Raises InputError."""
        return {key: self._substituted(text) if "$" in text else text for key, text in attributes.items()}

    def _substituted(self, text: str) -> str:
        found = _PARAMETER.sub(lambda match: self._parameter(match[1]), text)
        if len(found) > _LONGEST_TEXT:
            raise InputError(f"parameters make a text longer than {_LONGEST_TEXT} characters")
        return found.replace("\\$", "$")

    def _parameter(self, word: str) -> str:
        """The value of the parameter with the longest name that a word begins with, and the rest of it."""
        for end in range(min(len(word), _LONGEST_NAME), 0, -1):
            if word[:end] in self._parameters:
                self._unused.discard(word[:end])
                return self._parameters[word[:end]] + word[end:]
        raise InputError(f"the parameter ${word[:40]} has no value; give it one by <default>")

    def default(self, name: str, value: str) -> None:
        """The value of a parameter where it has none yet."""
        if not 0 < len(name) <= _LONGEST_NAME:
            raise InputError(f"<default> needs a name of at most {_LONGEST_NAME} characters")
        self._parameters.setdefault(name, value)

    def add(self, node: Node) -> None:
        """A node, which others may refer to by its id. Raises InputError."""
        self.nodes.append(node)
        if len(self.nodes) > MOST_NODES:
            raise InputError(f"the scene has more than {MOST_NODES:,} objects")
        if node.id:
            if node.id in self._by_id:
                raise InputError(f"id: {node.id!r} is that of {self._by_id[node.id]} too; rename one of them")
            self._by_id[node.id] = node

    def alias(self, old: str, new: str) -> None:
        """Another id for a node. Raises InputError."""
        if old not in self._by_id:
            raise InputError(f"<alias>: {old!r} is not the id of an object before it")
        if new in self._by_id:
            raise InputError(f"<alias>: {new!r} is the id of {self._by_id[new]} already")
        self._by_id[new] = self._by_id[old]

    def refer(self, node: Node, name: str, wanted: str) -> None:
        """An object of a node that another place of the scene says."""
        self._references.append((node, node.add_object(name, node), wanted))

    def search_in(self, folder: Path) -> None:
        """Files are looked for there first. Raises InputError where it leads out of the scene's folder."""
        check_inside(self.path.parent, os.path.abspath(folder))
        if folder.is_dir():
            self._folders.insert(0, folder)
        else:
            import_report.left_out(f"<path> {folder.name!r}: is no folder")

    def _resolve(self) -> None:
        for node, name, wanted in self._references:
            found = self._by_id.get(wanted)
            if found is None:
                raise InputError(f"{node.place}: no object has the id {wanted!r}; correct the <ref>")
            node.objects[name] = found

    def _check_depth(self) -> None:
        """Raises InputError where objects refer to each other in a circle, or stand too deep in each
        other."""
        depths: dict[int, int] = {}

        def depth(node: Node) -> int:
            return depths[id(node)]

        stack: list[tuple[Node, Iterator[Node]]] = [(self.root, iter(self.root.objects.values()))]
        inside = {id(self.root)}
        while stack:
            node, rest = stack[-1]
            child = next(rest, None)
            if child is None:
                stack.pop()
                inside.discard(id(node))
                depths[id(node)] = 1 + max(map(depth, node.objects.values()), default=0)
                if depths[id(node)] > DEEPEST:
                    raise InputError(f"{node.place}: objects refer to each other more than {DEEPEST} deep")
            elif id(child) in inside:
                raise InputError(f"{node.place}: {child} is part of itself; leave out one <ref>")
            elif id(child) not in depths:
                inside.add(id(child))
                stack.append((child, iter(child.objects.values())))


def _version(element: Element) -> tuple[int, ...]:
    text = element.attributes.get("version", "")
    if not re.fullmatch(r"\d{1,4}(\.\d{1,4}){1,3}", text):
        raise InputError(f'version: {text[:40]!r} is none; write version="3.0.0" into <{element.tag[:40]}>')
    return tuple(map(int, text.split(".")))


class _Reader:
    """Makes nodes of the elements of one file. `folder` is its own."""

    def __init__(self, document: Document, folder: Path, prefix: str, version: tuple[int, ...]) -> None:
        self._document, self._folder, self._prefix = document, folder, prefix
        self._is_old = version < _BEFORE_2

    def put(self, element: Element, parent: Node) -> None:
        """Puts what an element says into the node of the element around it. Raises InputError."""
        with in_place(f"{self._prefix}line {element.line}"):
            attributes = self._document.substituted(element.attributes)
            tag, name = element.tag, self._new_name(attributes.get("name", ""))
            is_object = tag in OBJECT_TAGS or (tag == "spectrum" and "type" in attributes)
            if not is_object and not name and tag in (*VALUE_TAGS, "transform"):
                raise InputError(f"<{tag}> has no name; name the property that it is")
            if tag in VALUE_TAGS and not is_object:
                with in_place(name):
                    self._set(parent, name, value_of(tag, attributes, self._document.file))
            elif tag == "transform":
                with in_place(name):
                    self._set(parent, name, self._transform(element))
            elif not is_object:
                self._command(element, attributes, name, parent)
        if is_object:
            self._object(element, attributes, name, parent)

    def _new_name(self, name: str) -> str:
        """In files before version 2 names had capitals in them: `toWorld`."""
        if not self._is_old:
            return name
        return re.sub(r"(?<=[a-z])([A-Z]+)", lambda found: f"_{found[1].lower()}", name)

    def _set(self, parent: Node, name: str, value: object) -> None:
        if self._is_old and parent.kind == "diffuse" and name == "diffuse_reflectance":
            name = "reflectance"
        if parent.has(name):
            raise InputError("is given twice; leave one of them out")
        parent.values[name] = value

    def _transform(self, element: Element) -> object:
        matrix = np.eye(4)
        for step in element.children:
            with in_place(f"{self._prefix}line {step.line}"), np.errstate(all="ignore"):
                matrix = step_matrix(step, self._document.substituted(step.attributes)) @ matrix
        if not np.isfinite(matrix).all():
            raise InputError("the transform is not finite")
        return matrix

    def _object(self, element: Element, attributes: dict[str, str], name: str, parent: Node) -> None:
        place = f"{self._prefix}line {element.line}"
        kind = attributes.get("type", "scene" if element.tag == "scene" else "")
        node = Node(element.tag, kind, place, attributes.get("id", ""))
        with in_place(place):
            if not kind:
                raise InputError(f"<{element.tag}> has no type; name one")
            self._document.add(node)
            parent.add_object(name, node)
        for child in element.children:
            self.put(child, node)
        if self._is_old:
            _upgrade_uv(node)

    def _command(self, element: Element, attributes: dict[str, str], name: str, parent: Node) -> None:
        """What is no property: references, parameters, other files."""
        document, tag = self._document, element.tag
        if tag == "ref":
            document.refer(parent, name, attributes.get("id", ""))
        elif tag == "default":
            document.default(attributes.get("name", ""), attributes.get("value", ""))
        elif tag == "alias":
            document.alias(attributes.get("id", ""), attributes.get("as", ""))
        elif tag == "path":
            self._search_in(attributes.get("value", "").replace("\\", "/"))
        elif tag == "include":
            self._include(attributes.get("filename", ""), name, parent)
        else:
            raise InputError(f"<{tag[:40]}> is no element of a scene; correct or remove it")

    def _search_in(self, name: str) -> None:
        try:
            self._document.search_in(self._folder / name)
        except (OSError, ValueError) as error:  # too long a name, or a null character in it
            if isinstance(error, InputError):
                raise
            raise InputError(f"<path>: {name[:40]!r} is no name of a folder") from None

    def _include(self, file: str, name: str, parent: Node) -> None:
        path = self._document.file(file, self._folder)
        for node in self._document.nodes_of_file(path, f"{path.name} "):
            if node.tag != "scene":
                parent.add_object(name, node)
                continue
            for own, value in node.values.items():
                self._set(parent, own, value)
            for own, child in node.objects.items():
                parent.add_object("" if own.startswith(UNNAMED) else own, child)


_UV_NAMES = ("uoffset", "voffset", "uscale", "vscale")


def _upgrade_uv(node: Node) -> None:
    """Before version 2 textures had four numbers for a transform."""
    found = {name: node.values.pop(name) for name in _UV_NAMES if name in node.values}
    if not found:
        return
    u, v, over, up = (
        float(value) if isinstance(value := found.get(name, default), int | float) else default
        for name, default in zip(_UV_NAMES, (0.0, 0.0, 1.0, 1.0), strict=True)
    )
    matrix = np.diag([over, up, 1.0, 1.0])
    matrix[:2, 3] = over * u, up * v
    node.values["to_uv"] = matrix
