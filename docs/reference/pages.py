"""The pages of the manual, with what they take from the program in its place."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from reference import editor_keys, formats, options, public_names, scene_keys

FOLDER = Path(__file__).resolve().parent.parent
"""docs/"""
_PIECE = re.compile(r"(<!-- from the program: ([^\n]+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)

PIECES: Mapping[str, Callable[[], str]] = {
    **scene_keys.PIECES,
    **options.PIECES,
    **editor_keys.PIECES,
    **formats.PIECES,
    **public_names.PIECES,
}
"""What makes each piece, by its name."""


def pages() -> list[Path]:
    """All pages of the manual."""
    return sorted(FOLDER.glob("*.md"))


def rewritten(text: str) -> str:
    """A page with its pieces made anew. Raises KeyError for a piece that there is not."""
    return _PIECE.sub(lambda match: f"{match[1]}\n{PIECES[match[2]]()}\n\n{match[4]}", text)


def named(text: str) -> list[str]:
    """The names of the pieces of a page."""
    return [match[2] for match in _PIECE.finditer(text)]


def main(arguments: Sequence[str]) -> int:
    """Rewrite or check the pages; returns the exit status."""
    disagree = 0
    for path in pages():
        text = path.read_text("utf-8")
        new = rewritten(text)
        if new == text:
            continue
        if "--check" in arguments:
            print(f"{path}: disagrees with the program; run ./run docs", file=sys.stderr)
            disagree = 1
        else:
            path.write_text(new, "utf-8", newline="\n")
            print(path)
    return disagree
