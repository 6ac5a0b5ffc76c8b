"""Images in Basis Universal, in KTX2 containers, decoded by a library that an installation may lack."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError, reason_of
from incpt.scene.texture import BITMAP_MAX_SIZE

SUFFIX = ".ktx2"


def pixels_of_ktx2(content: bytes) -> npt.NDArray[np.uint8]:
    """(H, W, C) the pixels of a KTX2 file, with alpha where it has some. Raises InputError."""
    try:
        library: Any = import_module("opengl_basisu")
    except ImportError:
        raise InputError(
            "is in Basis Universal (KTX2); `pip install incpt[gltf]`, or save it as PNG or WebP, as "
            "`gltf-transform webp` does"
        ) from None
    try:
        texture = library.open(content)
        if texture.faces != 1 or texture.layers != 1:
            raise InputError("is a cube map or an array, which is no texture; save a flat image")
        if max(texture.width, texture.height) > BITMAP_MAX_SIZE:
            size = f"{texture.width} x {texture.height} pixels"
            raise InputError(f"has {size}, more than {BITMAP_MAX_SIZE} a side; scale it down")
        pixels = np.array(texture.transcode(library.Target.RGBA8).data)
        return pixels if texture.has_alpha else np.ascontiguousarray(pixels[:, :, :3])
    except InputError:
        raise
    except Exception as error:  # The library raises errors of many types for damaged files.
        raise InputError(f"is no KTX2 image, or a damaged one ({reason_of(error)})") from None
