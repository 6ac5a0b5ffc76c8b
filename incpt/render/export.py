"""A session's picture as a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.formats import images
from incpt.render.session import Session

SUFFIXES = (".exr", ".png")


def shown_image(session: Session, denoised: npt.NDArray[np.float32] | None = None) -> npt.NDArray[np.float32]:
    """(H, W, 3) the radiance that a picture for displays is made of, or (H, W, 4) with alpha under the
    setting `transparent`. `denoised` (H, W, 3) takes the place of what was rendered."""
    image = session.image(alpha=session.settings.transparent)
    return image if denoised is None else np.concatenate([denoised, image[..., 3:]], axis=-1)


def write_picture(
    path: Path,
    session: Session,
    with_aovs: bool = False,
    exposure: float = 0.0,
    curve: str = "agx",
    denoised: npt.NDArray[np.float32] | None = None,
) -> None:
    """Write the picture as it is now: .exr holds linear radiance and, `with_aovs`, auxiliary images as
    layers; .png is tone-mapped (see `tone_mapping.tone_map`). Under the setting `transparent` both have the
    picture's alpha: as programs expect, radiance is multiplied by it in .exr, and colours in .png are not.
    `denoised` (H, W, 3) is what .png then shows, and a layer of .exr, whose radiance stays as it was
    rendered. Raises InputError for another suffix, and OutputError where the file cannot be written.

    Distance and object ids are those of rays through pixel centres. Base colours and normals are means over
    the samples of the picture where the session has the setting `aovs` or `transparent`, else of those rays
    too.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: ends in no known format; use .exr or .png")
    if suffix == ".png":
        images.write_png(path, shown_image(session, denoised), exposure, curve)
        return
    is_transparent = session.settings.transparent
    image = session.image(alpha=is_transparent)
    layers: dict[str, Any] = {"RGBA" if is_transparent else "RGB": image}
    if denoised is not None:
        layers["denoised.RGB"] = denoised
    if with_aovs:
        hits = session.first_hits()
        # Object ids are unsigned in OpenEXR; the largest one stands for "none".
        layers |= {"depth.Z": hits.depth, "object_id": hits.object_id.view("uint32")}
        has_passes = session.settings.has_aovs
        layers["albedo.RGB"] = session.pass_image("albedo") if has_passes else hits.albedo
        layers["normal.XYZ"] = session.pass_image("normal") if has_passes else hits.normal
    images.write_exr(path, layers)
