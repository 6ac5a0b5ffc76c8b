"""Tables on the terminal, with the warning that belongs to them."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from incpt.benchmarks.kit.store import Results, Store

WIDTH = 250
"""Columns where there is no terminal."""


def print_table(tables: Table | Sequence[Table], results: Results, store: Store) -> None:
    """The tables, on what they were measured, whether the machine was busy, and where all of it is."""
    console = Console()
    wide = console if console.is_terminal else Console(width=WIDTH)
    for table in [tables] if isinstance(tables, Table) else tables:
        # A title of the table would be folded to its width.
        title, table.title = table.title, None
        wide.print(title or "", markup=False, style="bold")
        wide.print(table)
    for line in notes(results):
        wide.print(line, markup=False)
    names = ", ".join(store.path.with_suffix(suffix).name for suffix in (".jsonl", ".csv", ".json"))
    print(f"{store.folder}: {names}")


def notes(results: Results, timed: bool = True) -> list[str]:
    """On what the results were measured, one line for each machine and device, and a warning if it was
    busy; results that are not `timed` do not depend on that."""
    lines = []
    for key in dict.fromkeys(record.environment for record in results.records):
        environment = results.environments.get(key, {})
        records = [record for record in results.records if record.environment == key]
        place = f"{environment.get('machine', 'unknown machine')}, {environment.get('cores', '?')} cores"
        device = environment.get("device")
        what = f"{place}; {device}; " if device else f"{place}; "
        lines.append(what + f"commit {environment.get('commit', 'unknown')}; {len(records)} measurements")
        if timed and (warning := busy_warning(results, key)):
            lines.append(warning)
    return lines


def busy_warning(results: Results, environment: str | None = None) -> str | None:
    """Says that others used the machine; None where nobody did."""
    records = [r for r in results.records if environment in (None, r.environment)]
    busy = [record for record in records if record.busy]
    if not busy:
        return None
    worst = max(float(record.load["other_cores"]) for record in busy)
    return (
        f"BUSY MACHINE: during {len(busy)} of {len(records)} measurements other processes had up to "
        f"{worst:.1f} cores; do not quote these times"
    )
