"""What stands for meshes and images of a scene file that cannot be read, where the options allow it.

A placeholder remembers what it stands for, so that the scene is saved with the names that it came with, and
`relink` puts another file in its place.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from incpt.core.errors import InputError
from incpt.core.layout import TextureSlot
from incpt.formats import import_report
from incpt.formats.import_options import current_options
from incpt.scene.image import Image
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.shapes import shape
from incpt.scene.texture import Bitmap, BitmapSource

T = TypeVar("T")

_MAGENTA, _WHITE, _FLAT = (255, 0, 255), (255, 255, 255), (128, 128, 255)
_PIXELS = {
    TextureSlot.BASE_COLOR: _MAGENTA,
    TextureSlot.NORMAL: _FLAT,
    TextureSlot.CLEARCOAT_NORMAL: _FLAT,
}
"""The pixel that stands for an image: a colour that nobody takes for the real one, and for normals one that
bends nothing. All other parameters are as they are without their image, white."""
_RADIANCE = 0.5
"""That of an environment, by which the rest of the scene can be seen."""


def read_or(read: Callable[[], T], stand_in: Callable[[], T], what: str) -> T:
    """What `read` gives. Where that is refused and options allow it: what `stand_in` gives, of which the
    report tells that it is `what`. Raises InputError where they do not."""
    try:
        return read()
    except InputError as error:
        if not current_options().allow_missing:
            raise
        import_report.left_out(f"{error}; {what} stands for it")
        return stand_in()


def mesh(source: MeshSource) -> Mesh:
    """A cube of one metre, with texture coordinates."""
    cube = shape("cube")
    return Mesh(cube.vertices, cube.faces, source=source, uvs=cube.uvs, is_placeholder=True)


def bitmap(source: BitmapSource, slot: TextureSlot) -> Bitmap:
    """One pixel, see `_PIXELS`."""
    return Bitmap(np.array([[_PIXELS.get(slot, _WHITE)]], np.uint8), source, is_placeholder=True)


def image(source: str) -> Image:
    """An even grey around the scene."""
    return Image(np.full((1, 2, 3), _RADIANCE, np.float32), source, is_placeholder=True)
