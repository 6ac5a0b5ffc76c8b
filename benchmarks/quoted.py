"""Rewrites the tables that documents quote from benchmarks/results/, so that they cannot say anything else.

    python -m incpt.benchmarks.quoted            rewrite benchmarks/README.md and docs/method.md
    python -m incpt.benchmarks.quoted --check    exit status 1 where they disagree

A quoted table stands between two comments; what is between them is replaced. The first names a file of
results without its suffix, from benchmarks/results/, and optionally which of its tables (1, 2 ...):

    <!-- quoted: table51 1 -->
    <!-- end of quote -->
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from incpt.benchmarks.catalogue import EXPERIMENTS, setup_text
from incpt.benchmarks.kit import store, tables
from incpt.core import files
from incpt.core.errors import InputError, in_place

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
DOCUMENTS = (ROOT / "benchmarks" / "README.md", ROOT / "docs" / "method.md")

_QUOTE = re.compile(r"(<!-- quoted: ([\w./-]+)(?: (\d+))? -->\n)(.*?)(<!-- end of quote -->)", re.DOTALL)


def rewritten(text: str, results: Path) -> str:
    """A document with its quotes made anew from the files in `results`.

    Raises InputError for a quote of what is not there.
    """
    return _QUOTE.sub(lambda match: match[1] + quote(results, match[2], match[3]) + match[5], text)


def quote(results: Path, name: str, number: str | None) -> str:
    """The tables of a file of results as Markdown, and on what and by which command they were measured."""
    path = results / f"{name}.jsonl"
    experiment = EXPERIMENTS.get(path.stem)
    if experiment is None:
        raise InputError(f"{path.stem}: no such experiment; there are {', '.join(EXPERIMENTS)}")
    found = store.read(path)
    if not found.records:
        raise InputError(f"{path}: no results; record a run there, or remove the quote")
    blocks = []
    for apart, part in found.parts(*experiment.setup):
        made = list(experiment.tables(part))
        if number is not None:
            if not 1 <= int(number) <= len(made):
                raise InputError(f"{path.stem} {number}: it has {len(made)} tables")
            made = [made[int(number) - 1]]
        commands = dict.fromkeys(record.command for record in part.records if record.command)
        sources = [setup_text(apart), *tables.notes(part, experiment.timed), *(f"`{c}`" for c in commands)]
        blocks += [markdown(table) for table in made]
        blocks.append("<br>\n".join(f"<sub>{source}</sub>" for source in sources if source))
    return "\n" + "\n\n".join(blocks) + "\n\n"


def markdown(table: Table) -> str:
    """A table of the terminal as Markdown; its title stands above it."""
    sides = ["---:" if column.justify == "right" else "---" for column in table.columns]
    headings = [str(column.header) for column in table.columns]
    rows = zip(*(list(column.cells) for column in table.columns), strict=True)
    lines = ["| " + " | ".join(str(cell) for cell in row) + " |" for row in (headings, sides, *rows)]
    title = f"{table.title}:\n\n" if table.title else ""
    return title + "\n".join(lines)


def main(arguments: Sequence[str]) -> int:
    """Rewrite or check the documents; returns the exit status."""
    disagree = 0
    for path in DOCUMENTS:
        text = path.read_text("utf-8")
        try:
            with in_place(path.name):
                new = rewritten(text, RESULTS)
        except InputError as error:
            print(error, file=sys.stderr)
            return 2
        if new == text:
            continue
        if "--check" in arguments:
            print(f"{path}: disagrees with {RESULTS}; run python -m incpt.benchmarks.quoted", file=sys.stderr)
            disagree = 1
        else:
            files.write_bytes(path, new.encode())
            print(path)
    return disagree


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
