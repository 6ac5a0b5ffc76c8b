"""XML, element by element. What entities would make of it is never known: a document type, which 3MF does not
allow, is refused where it begins, so that no entity is declared, expanded or fetched."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from xml.parsers import expat

from incpt.core.errors import InputError, reason_of


def read_elements(
    pieces: Iterable[bytes],
    place: str,
    take: Callable[[str, dict[str, str]], None],
    declare: Callable[[str | None, str], None] = lambda prefix, namespace: None,
) -> None:
    """Reads a text that comes in pieces, and calls `take` where an element begins, with its name and its
    attributes by theirs. Names in a namespace have that and a blank before them; `declare` is called with its
    prefix before the element that declares it. Raises InputError, which names `place`, and what `take`
    raises."""

    def refuse(*declaration: object) -> None:
        raise InputError(f"{place}: line {parser.CurrentLineNumber}: declares a document type; leave it out")

    parser = expat.ParserCreate(namespace_separator=" ")
    parser.StartElementHandler = take
    parser.StartDoctypeDeclHandler, parser.StartNamespaceDeclHandler = refuse, declare
    try:
        for piece in pieces:
            parser.Parse(piece, False)
        parser.Parse(b"", True)
    except InputError:
        raise
    except (expat.ExpatError, ValueError, LookupError) as error:  # the latter two of odd encodings
        raise InputError(f"{place}: is no XML, or damaged ({reason_of(error)})") from None
