"""`incpt bench table51`: table 5.1 and figures 5.1 to 5.6 of the thesis, measured again.

The scene is the thesis's kind of scene, not its own, whose environment image is not free; its edits are those
of chapter 5. A frame is one step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import PIL.Image
import typer
from rich.table import Table

from incpt.benchmarks.kit import environment, experiment, options
from incpt.benchmarks.kit.content import digest
from incpt.benchmarks.kit.experiment import Outcome, Task, Work
from incpt.benchmarks.kit.pictures import Gallery
from incpt.benchmarks.kit.store import Record, Results, Store, make_folder
from incpt.benchmarks.kit.tables import print_table
from incpt.benchmarks.measures.edits import EditBench, Marks, Timeline, edit_subject
from incpt.core import files
from incpt.core.errors import InputError
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.formats import registry
from incpt.formats.edit_script import Edit, EditScript, load_edits
from incpt.formats.images import write_png
from incpt.picture.tone_mapping import tone_map
from incpt.replay.contact_sheet import Block, Cell, Row, contact_sheet
from incpt.replay.replay import Variant

NAME = "table51"
FRAMES = (5, 10, 30)
VARIANTS = (Variant("restart", 1), Variant("spiral", 64), Variant("spiral", 128), Variant("spiral", 256))
THESIS = {
    5: (0.11519, 0.01523, 0.01335, 0.01506),
    10: (0.08106, 0.01788, 0.01539, 0.01425),
    30: (0.04632, 0.02885, 0.02048, 0.01628),
}
"""Table 5.1: normalized RMSE after so many frames; standard path tracing, NoR 64, 128, 256."""
FIGURES = (
    ("5.1 and 5.2", "shrink small grey cube", (0, 2, 5, 10)),
    ("5.3 and 5.4", "rotate red cube", (0, 2, 5, 10)),
    ("5.5 and 5.6", "move large translucent cube", (0, 5, 15, 30)),
)
TABLE_EDIT = "rotate red cube"
ERRORS = (
    ("normalized_rmse", "normalized RMSE of what is displayed (the thesis's own figures in brackets)"),
    ("relative_mse", "relMSE of linear radiance"),
    ("flip", "FLIP, what the eye sees"),
)


@dataclass(frozen=True)
class Plan:
    """How large, and how well converged, the pictures are."""

    size: tuple[int, int] = (480, 270)
    base_spp: int = 1024
    reference_spp: int = 4096


class _Pictures:
    """The captured pictures on disk, as PNG."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def path(self, key: str, step: int) -> Path:
        """Where the picture of a measurement is."""
        return self._folder / f"{key}-{step:02}.png"

    def write(self, key: str, line: Timeline) -> None:
        """All pictures of a measurement."""
        make_folder(self._folder)
        for capture in line.captures:
            write_png(self.path(key, capture.steps), capture.image)


def tasks(bench: EditBench, script: EditScript, settings: RenderSettings, pictures: _Pictures) -> list[Task]:
    """One for each edit and variant."""
    steps = {edit: set(frames) for _, edit, frames in FIGURES}
    steps[TABLE_EDIT] |= set(FRAMES)
    edits = {edit.label: edit for edit in script.edits}
    for missing in steps.keys() - edits.keys():
        raise InputError(f"the edit script has no edit {missing!r}; use scenes/editing.edits.toml")
    return [
        _task(bench, edits[label], variant, settings, Marks(tuple(sorted(frames))), pictures)
        for label, frames in steps.items()
        for variant in VARIANTS
    ]


def _task(
    bench: EditBench,
    edit: Edit,
    variant: Variant,
    settings: RenderSettings,
    marks: Marks,
    pictures: _Pictures,
) -> Task:
    chosen = variant.settings(settings)
    subject = edit_subject(bench, edit, chosen, marks, 0)

    def measure(work: Work) -> Outcome:
        line = bench.run(edit, chosen, marks, work.check, work.timing_starts)
        pictures.write(digest(subject), line)
        return Outcome(line.values(), [capture.as_row() for capture in line.captures])

    return Task(f"{edit.label}: {variant.label}", subject, measure, max(marks.steps) + 20.0)


# -------------------------------------------------------------------------------- tables and figures


def record_of(results: Results, edit: str, variant: Variant) -> Record | None:
    """The measurement of an edit under a variant."""
    nor = variant.nor if variant.uses_nor else None
    found = results.where(edit=edit, strategy=variant.strategy, nor=nor)
    return found[-1] if found else None


def errors_after(results: Results, error: str) -> dict[int, list[float | None]]:
    """Rows of table 5.1: by frames, an error for each variant, None where there is none."""
    rows: dict[int, list[float | None]] = {}
    for frames in FRAMES:
        rows[frames] = []
        for variant in VARIANTS:
            record = record_of(results, TABLE_EDIT, variant)
            found = [row[error] for row in record.rows if row["steps"] == frames] if record else []
            rows[frames].append(found[0] if found else None)
    return rows


def tables(results: Results) -> list[Table]:
    """Table 5.1 for each measure of error."""
    made = []
    for error, title in ERRORS:
        table = Table(title=f"after {TABLE_EDIT}: {title}", title_justify="left", box=None, pad_edge=False)
        table.add_column("frames", justify="right")
        for name in ("standard", *(f"NoR {variant.nor}" for variant in VARIANTS[1:])):
            table.add_column(name, justify="right", no_wrap=True)
        for frames, row in errors_after(results, error).items():
            cells = ["" if value is None else f"{value:.5f}" for value in row]
            if error == "normalized_rmse":
                cells = [f"{c} ({thesis:.5f})" for c, thesis in zip(cells, THESIS[frames], strict=True)]
            table.add_row(str(frames), *cells)
        made.append(table)
    return made


def write_sheets(
    folder: Path, results: Results, pictures: _Pictures, converged: dict[str, Any]
) -> list[Path]:
    """A contact sheet for each pair of figures: restarting above, NoR 64, 128 and 256 below."""
    written = []
    for figure, edit, frames in FIGURES:
        found = [_row(results, edit, variant, frames, pictures, converged) for variant in VARIANTS]
        rows = [row for row in found if row is not None]
        if not rows:
            continue
        path = folder / f"figures-{figure.replace(' and ', '-')}.png"
        sheet = contact_sheet([Block(f"Figures {figure}: {edit}", rows)])
        files.write_atomically(path, lambda temporary, s=sheet: PIL.Image.fromarray(s).save(temporary))  # type: ignore[misc]
        written.append(path)
    return written


def _row(
    results: Results,
    edit: str,
    variant: Variant,
    frames: Sequence[int],
    pictures: _Pictures,
    converged: dict[str, Any],
) -> Row | None:
    record = record_of(results, edit, variant)
    if record is None:
        return None
    cells = []
    key = digest(record.subject)
    for row in record.rows:
        path = pictures.path(key, row["steps"])
        if row["steps"] in frames and path.exists():
            pixels = np.asarray(PIL.Image.open(path).convert("RGB"))
            cells.append(Cell(pixels, f"{row['steps']} frames, error {row['normalized_rmse']:.4f}"))
    if edit in converged:
        cells.append(Cell(tone_map(converged[edit]), "converged"))
    return Row(variant.label if variant.uses_nor else "standard", cells) if cells else None


def table51(
    output: options.OutputOption = options.DEFAULT_FOLDER,
    scene_file: Annotated[Path | None, typer.Option("--scene", help="Instead of editing.toml.")] = None,
    edits_file: Annotated[Path | None, typer.Option("--edits", help="Of editing.edits.toml.")] = None,
    size: options.SizeOption = None,
    base_spp: Annotated[int | None, typer.Option(help="Samples per pixel before the edits.", min=1)] = None,
    reference_spp: Annotated[int | None, typer.Option(help="Samples to compare with.", min=1)] = None,
    quick: options.QuickOption = False,
    device: options.DeviceOption = None,
) -> None:
    """The thesis's table 5.1 beside its own figures, and figures 5.1 to 5.6 as contact sheets."""
    plan = Plan(
        options.parse_size(size, (240, 135) if quick else Plan.size),
        base_spp or (256 if quick else Plan.base_spp),
        reference_spp or (1024 if quick else Plan.reference_spp),
    )
    scenes = Path(str(resources.files("incpt.scenes")))
    scene = registry.load(scene_file or scenes / "editing.toml")
    script = load_edits(edits_file or scenes / "editing.edits.toml", scene)
    settings = replace(scene.settings, size=plan.size)
    opened = Device(device)
    store = Store(output, NAME)
    bench = EditBench(
        opened, Gallery(output / "references", opened), scene, plan.base_spp, plan.reference_spp
    )
    pictures = _Pictures(output / NAME)
    every = tasks(bench, script, settings, pictures)
    found = experiment.run(store, every, environment.describe(opened))
    print_table(tables(found), found, store)
    converged = {e.label: bench.reference(e.apply(scene), settings, lambda f: None) for e in script.edits}
    for path in write_sheets(output, found, pictures, converged):
        print(path)
