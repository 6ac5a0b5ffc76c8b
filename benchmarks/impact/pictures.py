"""Pictures of the edits under every variant, to look at."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import PIL.Image

from incpt.benchmarks.impact.bench import ImpactBench, variants
from incpt.benchmarks.impact.edits import DRAG, EDITS
from incpt.benchmarks.impact.tasks import Plan
from incpt.benchmarks.kit.pictures import FloatImage
from incpt.benchmarks.kit.store import make_folder
from incpt.benchmarks.measures.edits import Note
from incpt.core import files
from incpt.formats.images import write_png
from incpt.picture.metrics import normalized_rmse
from incpt.picture.tone_mapping import tone_map
from incpt.replay.contact_sheet import WIDEST_CELL_PX, Block, Cell, Pixels, Row, contact_sheet

STEPS = (1, 2, 5)


def write_pictures(folder: Path, bench: ImpactBench, plan: Plan, note: Note) -> list[Path]:
    """For each edit and kept picture of a plan: EDIT-SPP-old.png, -truth.png, -VARIANT-STEPS.png, and all of
    them on one sheet, EDIT-SPP.png. Returns the sheets. Raises OutputError."""
    make_folder(folder)
    chosen = [(base, name) for name in plan.edits if name != DRAG for base in plan.bases]
    return [_write(folder, bench, plan, *case, note) for case in chosen]


def _write(folder: Path, bench: ImpactBench, plan: Plan, base: int, name: str, note: Note) -> Path:
    edit, settings = EDITS[name], plan.settings(EDITS[name].stage)
    start = bench.start(edit.before, edit.stage, base)
    truth = start.reference(edit.after, settings, note)
    rows = [
        Row("", _cells(folder, f"{name}-{base}", {"old": start.kept(settings, note), "truth": truth}, truth))
    ]
    for variant in variants(plan.nors):
        if bench.missing(variant):
            continue
        found = bench.after_steps(start, edit.after, variant, settings, STEPS, note, edit.between)
        shown = {f"{variant.slug}-{one.mark.split()[0]}": one.image for one in found}
        rows.append(Row(variant.label, _cells(folder, f"{name}-{base}", shown, truth)))
    sheet = contact_sheet([Block(f"{edit.words}, picture of {base} samples", rows)])
    path = folder / f"{name}-{base}.png"
    files.write_atomically(path, lambda temporary: PIL.Image.fromarray(sheet).save(temporary, format="PNG"))
    return path


def _cells(folder: Path, prefix: str, pictures: dict[str, FloatImage], truth: FloatImage) -> Sequence[Cell]:
    cells = []
    for name, image in pictures.items():
        write_png(folder / f"{prefix}-{name}.png", image)
        error = normalized_rmse(image, truth)
        caption = f"{name}, error {1e4 * error:.0f}" if error else name
        cells.append(Cell(_magnified(tone_map(image)), caption))
    return cells


def _magnified(pixels: Pixels) -> Pixels:
    """As many times larger as a sheet has room for, so that each pixel can be looked at."""
    factor = max(1, WIDEST_CELL_PX // pixels.shape[1])
    return pixels.repeat(factor, axis=0).repeat(factor, axis=1)
