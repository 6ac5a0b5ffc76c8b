"""What a replay leaves behind: pictures, a contact sheet, a table of errors."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path

import PIL.Image
from rich.markup import escape
from rich.table import Table

from incpt.core import files
from incpt.core.errors import OutputError
from incpt.formats import images
from incpt.formats.edit_script import Edit
from incpt.picture import tone_mapping
from incpt.replay.contact_sheet import Block, Cell, Row, contact_sheet
from incpt.replay.replay import Capture, Converged, Variant

COLUMNS = (
    "edit", "label", "strategy", "nor", "step", "mode", "normalized_rmse", "relative_mse", "paths", "seconds",
)  # fmt: skip


class ReplayReport:
    """Collects the pictures of a replay in a folder, each written when it comes. Raises OutputError."""

    def __init__(self, folder: Path, edits: Sequence[Edit]) -> None:
        self.folder, self._edits = folder, edits
        self._captures: list[Capture] = []
        self._cells: dict[tuple[int, Variant], list[Cell]] = {}
        self._converged: dict[int, Cell] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{folder}: cannot be made ({error.strerror}); choose another folder") from None
        files.write_bytes(self.csv_path, self._csv())  # tells now, not after minutes, if it cannot be written

    @property
    def csv_path(self) -> Path:
        """The errors of all captures, a line each."""
        return self.folder / "errors.csv"

    @property
    def sheet_path(self) -> Path:
        """All pictures on one page."""
        return self.folder / "sheet.png"

    @property
    def has_captures(self) -> bool:
        """Whether there is anything to tabulate."""
        return bool(self._captures)

    def add(self, picture: Converged | Capture) -> None:
        """Write a picture, and keep it for the sheet."""
        if isinstance(picture, Capture):
            name = f"{self._slug(picture.edit)}-{picture.variant.slug}-step{picture.step:03}.png"
            caption = f"{picture.step} steps, error {picture.normalized_rmse:.4f}"
            cells = self._cells.setdefault((picture.edit, picture.variant), [])
            cells.append(Cell(tone_mapping.tone_map(picture.image), caption))
            self._captures.append(picture)
        elif picture.edit is None:
            name = "base.png"
        else:
            name = f"{self._slug(picture.edit)}-converged.png"
            self._converged[picture.edit] = Cell(tone_mapping.tone_map(picture.image), "converged")
        images.write_png(self.folder / name, picture.image)

    def finish(self) -> None:
        """Write the table of errors and, where there is a capture, the contact sheet."""
        files.write_bytes(self.csv_path, self._csv())
        if self.has_captures:
            encoded = io.BytesIO()
            PIL.Image.fromarray(contact_sheet(self._blocks())).save(encoded, "PNG")
            files.write_bytes(self.sheet_path, encoded.getvalue())

    def table(self) -> Table:
        """Normalized RMSE: a row for each edit and variant, a column for each step."""
        steps = sorted({capture.step for capture in self._captures})
        table = Table(
            title="normalized RMSE after so many steps", title_justify="left", box=None, pad_edge=False
        )
        table.add_column("edit")
        table.add_column("strategy", no_wrap=True)
        for step in steps:
            table.add_column(str(step), justify="right", min_width=6, no_wrap=True)
        errors = {(c.edit, c.variant, c.step): f"{c.normalized_rmse:.4f}" for c in self._captures}
        for edit, variant in self._cells:
            row = [errors.get((edit, variant, step), "") for step in steps]
            table.add_row(escape(self._edits[edit].label), escape(variant.label), *row)
        return table

    def _slug(self, edit: int) -> str:
        label = re.sub(r"[^a-z0-9]+", "-", self._edits[edit].label.lower())[:40].strip("-")
        return f"{edit + 1}-{label}".rstrip("-")

    def _blocks(self) -> list[Block]:
        return [
            Block(
                f"{edit + 1}. {self._edits[edit].label}",
                [
                    Row(variant.label, [*cells, self._converged[edit]])
                    for (index, variant), cells in self._cells.items()
                    if index == edit
                ],
            )
            for edit in sorted({edit for edit, _ in self._cells})
        ]

    def _csv(self) -> bytes:
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(COLUMNS)
        for c in self._captures:
            label, variant = self._edits[c.edit].label, c.variant
            errors = f"{c.normalized_rmse:.6f}", f"{c.relative_mse:.6g}"
            place = (c.edit + 1, label, variant.strategy, variant.nor, c.step, c.mode.value)
            writer.writerow([*place, *errors, c.paths, f"{c.seconds:.4f}"])
        return text.getvalue().encode()
