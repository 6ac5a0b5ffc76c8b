"""Results on disk: one line of JSON for each finished measurement, found again by its content.

A file holds lines of two kinds, `{"environment": {...}}`, which later lines refer to by its id, and

    {"key": ..., "subject": {...}, "environment": id, "at": ..., "load": {...}, "values": {...},
     "rows": [...], "command": ...}

`subject` says what was measured, with every setting that matters; `values` what came out; `rows` holds
figures that there are several of (errors at steps). A line is written at once, so that an interruption leaves
whole lines; a torn one is left out when the file is read. `export` turns all of it into CSV and JSON.
"""

from __future__ import annotations

import csv
import io
import json
import os
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from incpt.benchmarks.kit.content import digest
from incpt.benchmarks.kit.environment import command_line
from incpt.core import files
from incpt.core.errors import InputError, InputWarning, OutputError

Row = dict[str, Any]


@dataclass(frozen=True)
class Record:
    """A finished measurement; see the module's text."""

    key: str
    subject: Row
    environment: str
    at: str
    load: Row
    values: Row
    rows: tuple[Row, ...] = ()
    command: str = ""

    @property
    def busy(self) -> bool:
        """Whether others used the machine meanwhile."""
        return bool(self.load.get("busy"))


@dataclass(frozen=True)
class Results:
    """Everything in a file of results, in the order of measuring."""

    environments: Mapping[str, Row] = field(default_factory=dict)
    records: tuple[Record, ...] = ()

    def latest(self) -> Results:
        """Without those records that were measured again, by other code or in another environment, later."""
        last = {digest(record.subject): record for record in self.records}
        return Results(self.environments, tuple(r for r in self.records if last[digest(r.subject)] is r))

    def parts(self, *setup: str) -> list[tuple[Row, Results]]:
        """The newest results of each machine, device and `setup` (names in the subject): what may stand in
        one table. Each comes with what sets it apart."""
        found: dict[str, tuple[Row, list[Record]]] = {}
        for record in self.records:
            environment = self.environments.get(record.environment, {})
            place = {name: environment.get(name) for name in ("machine", "device")}
            own = {name: record.subject.get(name) for name in setup}
            found.setdefault(digest(place, own), ({**place, **own}, []))[1].append(record)
        return [
            (apart, Results(self.environments, tuple(records)).latest()) for apart, records in found.values()
        ]

    def where(self, **subject: Any) -> list[Record]:
        """The records whose subject has these values."""
        return [r for r in self.records if all(r.subject.get(name) == v for name, v in subject.items())]


class Store:
    """The results of one experiment in `folder`. Raises OutputError where that cannot be written."""

    def __init__(self, folder: Path, experiment: str) -> None:
        self.folder, self.experiment = folder, experiment
        self.path = folder / f"{experiment}.jsonl"
        make_folder(folder)
        found = self.read()
        self._known = {record.key for record in found.records}
        self._environments = set(found.environments)
        self._append("")  # tells now, not after an hour, if it cannot be written

    def key(self, subject: Mapping[str, Any], environment: Mapping[str, Any]) -> str:
        """What a measurement is found by."""
        return digest(self.experiment, subject, environment["id"])

    def has(self, key: str) -> bool:
        """Whether it is finished."""
        return key in self._known

    def read(self) -> Results:
        """All that is there."""
        return read(self.path)

    def add(
        self,
        subject: Row,
        environment: Row,
        load: Row,
        values: Row,
        rows: Iterable[Row] = (),
    ) -> Record:
        """Append a finished measurement, to stay also if the machine stops now."""
        record = Record(
            self.key(subject, environment), subject, environment["id"],
            datetime.now(UTC).isoformat(timespec="seconds"), load, values, tuple(rows),
            command_line(),
        )  # fmt: skip
        lines = []
        if environment["id"] not in self._environments:
            lines.append(_line({"environment": environment}))
            self._environments.add(environment["id"])
        lines.append(_line({**record.__dict__, "rows": list(record.rows)}))
        self._append("".join(lines))
        self._known.add(record.key)
        return record

    def export(self) -> list[Path]:
        """Write NAME.csv, a line for each row with everything it depends on, and NAME.json."""
        results = self.read()
        table, whole = self.path.with_suffix(".csv"), self.path.with_suffix(".json")
        files.write_bytes(table, to_csv(results).encode())
        whole_file = {
            "experiment": self.experiment,
            "environments": dict(results.environments),
            "records": [{**r.__dict__, "rows": list(r.rows)} for r in results.records],
        }
        files.write_bytes(whole, (json.dumps(whole_file, indent=1) + "\n").encode())
        return [table, whole]

    def _append(self, text: str) -> None:
        try:
            with open(self.path, "ab") as stream:
                if text:
                    # After a torn line a new one begins.
                    torn = stream.tell() > 0 and self.path.read_bytes()[-1:] != b"\n"
                    stream.write(b"\n" * torn + text.encode())
                    stream.flush()
                    os.fsync(stream.fileno())
        except OSError as error:
            raise OutputError(
                f"{self.path}: cannot be written ({error.strerror}); choose another --output"
            ) from None


def make_folder(folder: Path) -> None:
    """With its parents. Raises OutputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made ({error.strerror}); choose another --output") from None


def read(path: Path) -> Results:
    """The results in a file; none where there is no file. Raises InputError where it cannot be read."""
    if not path.exists():
        return Results()
    try:
        lines = path.read_bytes().splitlines()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    environments: dict[str, Row] = {}
    records: list[Record] = []
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            entry = json.loads(line)
            if "key" in entry:
                records.append(Record(**{**entry, "rows": tuple(entry["rows"])}))
            else:
                environments[entry["environment"]["id"]] = entry["environment"]
        except (ValueError, KeyError, TypeError):
            warnings.warn(f"{path}: line {number} is torn and left out", InputWarning, stacklevel=2)
    return Results(environments, tuple(records))


def to_csv(results: Results) -> str:
    """A line for each row of each record: its figures, then what it depends on."""
    table = []
    for record in results.records:
        environment = {k: v for k, v in results.environments.get(record.environment, {}).items() if k != "id"}
        for row in record.rows or ({},):
            merged = {**record.subject, **row, **record.values, **record.load, "at": record.at, **environment}
            merged["command"] = record.command
            table.append({name: _flat(value) for name, value in merged.items()})
    columns = list(dict.fromkeys(name for row in table for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    return text.getvalue()


def grouped(
    results: Results, value: Callable[[Record], float | None], *names: str
) -> dict[tuple[Any, ...], list[float]]:
    """The values of repeated records, grouped by the subject's `names`."""
    groups: dict[tuple[Any, ...], list[float]] = {}
    for record in results.records:
        found = value(record)
        if found is not None:
            groups.setdefault(tuple(record.subject.get(name) for name in names), []).append(found)
    return groups


def _flat(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, list | tuple | dict) else value


def _line(entry: Row) -> str:
    return json.dumps(entry, allow_nan=False) + "\n"
