"""XML as elements that know their lines, read by expat, which is told to refuse what can do harm.

A DOCTYPE may declare entities, which grow without bounds or name other files. Mitsuba's scenes have none, so
that it is refused as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from incpt.core.errors import InputError
from incpt.core.files import read_bytes

DEEPEST = 64
"""Elements within each other."""


@dataclass
class Element:
    """A tag with its attributes, the line that it begins in, and the elements within."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)


def read_xml(path: Path) -> Element:
    """The outermost element of an XML file. Raises InputError, without the name of the file."""
    top = Element("", {}, 0)
    open_elements = [top]
    parser = expat.ParserCreate()

    def start(tag: str, attributes: dict[str, str]) -> None:
        if len(open_elements) > DEEPEST:
            raise InputError(
                f"line {parser.CurrentLineNumber}: more than {DEEPEST} elements stand within each other"
            )
        element = Element(tag, attributes, parser.CurrentLineNumber)
        open_elements[-1].children.append(element)
        open_elements.append(element)

    def end(_: str) -> None:
        open_elements.pop()

    def refuse(*_: object) -> None:
        raise InputError(f"line {parser.CurrentLineNumber}: has a DOCTYPE, which no scene needs; remove it")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(read_bytes(path), True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise InputError(f"line {error.lineno}: is no XML ({reason}); repair it there") from None
    except (ValueError, LookupError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError("its encoding is not known; save it as UTF-8") from None
    return top.children[0]
