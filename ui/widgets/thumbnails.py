"""Small pictures of images: textures that imgui's own renderer makes and frees, for each image and size."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import PIL.Image
from imgui_bundle import imgui

from incpt.picture.color import srgb_from_linear

_UNUSED_FRAMES = 120
"""For how many frames one is kept that nobody draws."""
_MOST = 256
"""How many are kept at once; those that were drawn longest ago go first."""
_OVERSIZE = 4
"""How many times larger than a thumbnail the image is made first, by leaving pixels out."""
_CHECKS = ((0.42, 0.42, 0.42), (0.58, 0.58, 0.58))
"""What is seen through an image that is transparent, sRGB."""
_CHECK_SIZE = 6
"""Edge of a square of it, pixels."""


@dataclass
class _Thumbnail:
    owner: object
    """While it is held, no other can have its id, by which the thumbnail is found."""
    texture: imgui.ImTextureData
    drawn_in: int


class Thumbnails:
    """Those that were drawn lately. imgui knows them as long as it draws, so they have to live that long."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[int, int], _Thumbnail] = OrderedDict()
        self._leaving: list[imgui.ImTextureData] = []
        self._frame = 0

    def begin_frame(self) -> None:
        """Free what was not drawn for long."""
        self._frame += 1
        gone = [one for one in self._leaving if one.status == imgui.ImTextureStatus.destroyed]
        for texture in gone:
            imgui.internal.unregister_user_texture(texture)
        self._leaving = [one for one in self._leaving if one not in gone]
        while self._kept:
            oldest = next(iter(self._kept.values()))
            if len(self._kept) <= _MOST and self._frame - oldest.drawn_in <= _UNUSED_FRAMES:
                return
            self._kept.popitem(last=False)
            self._leaving.append(oldest.texture)
            _ask_to_free(oldest.texture)

    def draw(self, owner: object, pixels: npt.NDArray[Any], side: float) -> None:
        """Draw a thumbnail as a widget, in a square of `side` points. `pixels` (H, W, C) are those of the
        image `owner`: whole numbers are shown as they are, floats are linear."""
        texture, across, down = self._texture(owner, pixels, side)
        start = imgui.get_cursor_screen_pos()
        imgui.dummy(imgui.ImVec2(side, side))
        low = start.x + (side - across) / 2, start.y + (side - down) / 2
        high = low[0] + across, low[1] + down
        imgui.get_window_draw_list().add_image(texture.get_tex_ref(), low, high)

    def draw_wide(self, owner: object, pixels: npt.NDArray[Any], width: float) -> None:
        """Draw one as a widget that is so wide, in points, and as high as its image asks for."""
        texture, across, down = self._texture(owner, pixels, width)
        size = imgui.ImVec2(width, width * down / across)
        imgui.image(texture.get_tex_ref(), size)

    def draw_round(
        self, owner: object, pixels: npt.NDArray[Any], at: tuple[float, float], side: float
    ) -> None:
        """Draw the middle of one as a disk whose box has its top left `at`, in points."""
        texture, across, down = self._texture(owner, pixels, side)
        u, v = (1 - min(across, down) / across) / 2, (1 - min(across, down) / down) / 2
        canvas, high = imgui.get_window_draw_list(), (at[0] + side, at[1] + side)
        white = imgui.get_color_u32(imgui.ImVec4(1, 1, 1, 1))
        canvas.add_image_rounded(texture.get_tex_ref(), at, high, (u, v), (1 - u, 1 - v), white, side / 2)

    @property
    def count(self) -> int:
        """How many are kept."""
        return len(self._kept)

    def _texture(
        self, owner: object, pixels: npt.NDArray[Any], side: float
    ) -> tuple[imgui.ImTextureData, float, float]:
        """The texture, and its width and height in points where the larger one is `side`."""
        scale = imgui.get_io().display_framebuffer_scale.x or 1.0
        # Powers of two, or a panel that is made wider would have one of each width.
        most = 1 << (max(round(side * scale), 1) - 1).bit_length()
        key = id(owner), most
        if key not in self._kept:
            self._kept[key] = _Thumbnail(owner, _registered(reduced(pixels, most)), self._frame)
        found = self._kept[key]
        self._kept.move_to_end(key)
        found.drawn_in = self._frame
        height, width = pixels.shape[:2]
        larger = max(width, height)
        return found.texture, side * width / larger, side * height / larger


def reduced(pixels: npt.NDArray[Any], side: int) -> npt.NDArray[np.uint8]:
    """(h, w, 4) uint8 an image (H, W, C) with `side` pixels along its larger edge, without alpha: over
    squares where it is transparent."""
    height, width = pixels.shape[:2]
    step = max(max(width, height) // (_OVERSIZE * side), 1)
    shown = as_shown(pixels[::step, ::step])
    channels = shown.shape[2]
    color = np.repeat(shown[..., :1], 3, axis=2) if channels < 3 else shown[..., :3]
    if channels in (2, 4):
        alpha = shown[..., -1:]
        color = color * alpha + _squares(*shown.shape[:2]) * (1 - alpha)
    size = max(round(width * side / max(width, height)), 1), max(round(height * side / max(width, height)), 1)
    image = PIL.Image.fromarray((np.clip(color, 0, 1) * 255 + 0.5).astype(np.uint8))
    small = np.asarray(image.resize(size, PIL.Image.Resampling.BOX))
    return np.dstack([small, np.full(small.shape[:2], 255, np.uint8)])


def as_shown(pixels: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Values from 0 to 1 as a display has them."""
    if pixels.dtype == np.float32:
        # Alpha is no light.
        colors = pixels.shape[2] - (pixels.shape[2] in (2, 4))
        return np.concatenate([srgb_from_linear(pixels[..., :colors]), pixels[..., colors:]], axis=2)
    return np.asarray(pixels, np.float64) / np.iinfo(pixels.dtype).max


def _squares(height: int, width: int) -> npt.NDArray[np.float64]:
    rows, columns = np.arange(height) // _CHECK_SIZE, np.arange(width) // _CHECK_SIZE
    squares: npt.NDArray[np.float64] = np.array(_CHECKS)[(rows[:, None] + columns) % 2]
    return squares


def _registered(pixels: npt.NDArray[np.uint8]) -> imgui.ImTextureData:
    texture = imgui.ImTextureData()
    height, width = pixels.shape[:2]
    texture.create(imgui.ImTextureFormat.rgba32, width, height)
    texture.get_pixels_array()[:] = pixels.reshape(texture.get_pixels_array().shape)
    texture.use_colors = True
    texture.set_status(imgui.ImTextureStatus.want_create)
    imgui.internal.register_user_texture(texture)
    return texture


def _ask_to_free(texture: imgui.ImTextureData) -> None:
    # Without the first imgui would have its renderer make it again.
    texture.want_destroy_next_frame = True
    texture.set_status(imgui.ImTextureStatus.want_destroy)
    texture.unused_frames = 1
