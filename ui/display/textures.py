"""The textures of one picture on the GPU."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from incpt.render.first_hits import FirstHits
from incpt.render.tiles import TileGrid
from incpt.ui.display import overlays
from incpt.ui.display.overlays import Overlay
from incpt.viewer.view import Picture


class PictureTextures:
    """One picture on the GPU: its radiance, what shows through where it has none yet, the result of tone
    mapping at its own size, and its overlay. A split view has two of these."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self.picture: Picture | None = None
        self.radiance: moderngl.Texture | None = None
        self.underlay: moderngl.Texture | None = None
        self.mapped: moderngl.Texture | None = None
        self.target: moderngl.Framebuffer | None = None
        self.mapped_with: tuple[float, str] | None = None
        self.tile_luma: moderngl.Texture | None = None
        self.tile_luma_target: moderngl.Framebuffer | None = None
        self.tile_luma_of: TileGrid | None = None
        self.overlay: Overlay | None = None
        self.overlay_texture: moderngl.Texture | None = None
        self.overlay_of: tuple[str, tuple[int, ...]] | None = None
        self.overlay_source: Picture | FirstHits | None = None

    @property
    def aspect(self) -> float:
        """Width over height."""
        assert self.picture is not None
        height, width = self.picture.image.shape[:2]
        return float(width / height)

    def upload(self, picture: Picture) -> None:
        old = self.picture
        self.picture = picture
        if old is not None and old.shown is picture.shown:
            return
        image = self._fitting(picture.shown)
        height, width = image.shape[:2]
        if self.radiance is None or self.radiance.size != (width, height):
            self._resize(width, height, old)
        assert self.radiance is not None
        self.radiance.write(np.ascontiguousarray(image, np.float32))
        self.mapped_with = self.tile_luma_of = None
        if self.underlay is not None and _is_complete(picture):
            self.underlay.release()
            self.underlay = None

    def begin_anew(self) -> None:
        """The next picture has nothing of this one, which shows through until that is complete."""
        if self.picture is None or self.radiance is None or not _is_complete(self.picture):
            return
        if self.underlay is not None:
            self.underlay.release()
        self.underlay, self.radiance = self.radiance, None

    def _resize(self, width: int, height: int, old: Picture | None) -> None:
        if self.radiance is not None:
            if old is not None and _is_complete(old):
                self.underlay, self.radiance = self.radiance, self.underlay
            if self.radiance is not None:
                self.radiance.release()
        for resource in (self.mapped, self.target):
            if resource is not None:
                resource.release()
        self.radiance = self._context.texture((width, height), 4, dtype="f4")
        self.mapped = self._context.texture((width, height), 4)
        self.mapped.repeat_x = self.mapped.repeat_y = False
        self.target = self._context.framebuffer([self.mapped])
        if self.underlay is not None:
            self.underlay.repeat_x = self.underlay.repeat_y = False
            self.underlay.filter = (moderngl.LINEAR, moderngl.LINEAR)

    def lay_over(self, kind: str, first_hits: FirstHits | None) -> None:
        """Makes the overlay texture that of `kind`, unless it is there already."""
        assert self.picture is not None
        source = first_hits if kind in overlays.NEEDS_FIRST_HITS else self.picture
        if self.overlay_of == (kind, self.picture.image.shape) and self.overlay_source is source:
            return
        self.overlay = overlays.build(kind, self.picture, first_hits)
        self.overlay_of, self.overlay_source = (kind, self.picture.image.shape), source
        if self.overlay is None:
            return
        image = self._fitting(self.overlay.image)
        height, width = image.shape[:2]
        if self.overlay_texture is None or self.overlay_texture.size != (width, height):
            if self.overlay_texture is not None:
                self.overlay_texture.release()
            self.overlay_texture = self._context.texture((width, height), 4)
        self.overlay_texture.write(np.ascontiguousarray(image))

    def make_tile_luma(self, size: tuple[int, int]) -> moderngl.Framebuffer:
        """The target for one brightness a tile, of a grid of columns and rows."""
        if self.tile_luma is None or self.tile_luma_target is None or self.tile_luma.size != size:
            for resource in (self.tile_luma, self.tile_luma_target):
                if resource is not None:
                    resource.release()
            self.tile_luma = self._context.texture(size, 1)
            self.tile_luma_target = self._context.framebuffer([self.tile_luma])
        return self.tile_luma_target

    def _fitting(self, image: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Every n-th pixel of an image that is larger than a texture may be."""
        limit = int(self._context.info["GL_MAX_TEXTURE_SIZE"])
        n = -(-max(image.shape[:2]) // limit)
        return image[::n, ::n]

    def release(self) -> None:
        for resource in (
            self.radiance,
            self.underlay,
            self.mapped,
            self.target,
            self.tile_luma,
            self.tile_luma_target,
            self.overlay_texture,
        ):
            if resource is not None:
                resource.release()


def _is_complete(picture: Picture) -> bool:
    if picture.transparent:  # Its alpha tells what is covered.
        return bool((picture.tile_spp > 0).all())
    return bool((picture.image[..., 3] != 0).all())
