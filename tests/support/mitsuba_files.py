"""Small scenes of Mitsuba, written for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import PIL.Image

from incpt.formats import registry
from incpt.formats.import_report import Fate, ImportReport
from incpt.scene.material import Material
from incpt.scene.model import Scene

SENSOR = '<sensor type="perspective"><float name="fov" value="40"/></sensor>'


def written(folder: Path, body: str, version: str = "3.0.0", name: str = "a.xml") -> Path:
    path = folder / name
    path.write_text(f'<scene version="{version}">\n{body}\n</scene>')
    return path


def read(
    folder: Path, body: str, version: str = "3.0.0", allow_outside: bool = False
) -> tuple[Scene, ImportReport]:
    return registry.load_with_report(written(folder, body, version), allow_outside=allow_outside)


def told(report: ImportReport, fate: Fate = Fate.LEFT_OUT) -> list[str]:
    return [remark.text for remark in report.of(fate)]


def material_of(folder: Path, bsdf: str) -> Material:
    """That of a rectangle with this BSDF, of which nothing is left out."""
    scene, report = read(folder, f'<shape type="rectangle">{bsdf}</shape>{SENSOR}')
    assert not told(report), told(report)
    return scene.materials[scene.objects[0].material]


def write_image(path: Path, pixels: object) -> None:
    PIL.Image.fromarray(np.asarray(pixels, np.uint8)).save(path)
