"""A session's picture as a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from incpt.core.errors import InputError
from incpt.formats import images
from incpt.render.session import Session

SUFFIXES = (".exr", ".png")


def write_picture(
    path: Path, session: Session, with_aovs: bool = False, exposure: float = 0.0, curve: str = "agx"
) -> None:
    """Write the picture as it is now: .exr holds linear radiance and, `with_aovs`, the first-hit images as
    layers; .png is tone-mapped (see `tone_mapping.tone_map`). Raises InputError for another suffix, and
    OutputError where the file cannot be written."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: ends in no known format; use .exr or .png")
    if suffix == ".png":
        images.write_png(path, session.image(), exposure, curve)
        return
    layers: dict[str, Any] = {"RGB": session.image()}
    if with_aovs:
        aovs = session.aovs()
        # Object ids are unsigned in OpenEXR; the largest one stands for "none".
        layers |= {"albedo.RGB": aovs.albedo, "normal.XYZ": aovs.normal, "depth.Z": aovs.depth}
        layers["object_id"] = aovs.object_id.view("uint32")
    images.write_exr(path, layers)
