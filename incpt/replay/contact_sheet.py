"""One picture that shows many side by side, with labels: the layout of the thesis's figures 5.1 to 5.6."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import PIL.Image
import PIL.ImageDraw
import PIL.ImageFont

Pixels = npt.NDArray[np.uint8]

WIDEST_CELL_PX = 480
_GAP_PX = 8
_TEXT_PX = 15
_TITLE_PX = 20
_LINE_PX = 24
_TITLE_LINE_PX = 38
_BACKGROUND = (255, 255, 255)
_INK = (20, 20, 20)


@dataclass(frozen=True, eq=False)
class Cell:
    """A picture, (H, W, 3) sRGB, and the line below it."""

    pixels: Pixels
    caption: str


@dataclass(frozen=True)
class Row:
    """Pictures side by side, with a line above them."""

    label: str
    cells: Sequence[Cell]


@dataclass(frozen=True)
class Block:
    """Rows that are compared with each other, under a title."""

    title: str
    rows: Sequence[Row]


def contact_sheet(blocks: Sequence[Block]) -> Pixels:
    """All blocks below each other, (H, W, 3) sRGB. Pictures wider than WIDEST_CELL_PX are scaled down."""
    rows = [row for block in blocks for row in block.rows]
    cell_width, cell_height = _cell_size(rows)
    columns = max(len(row.cells) for row in rows)
    width = _GAP_PX + columns * (cell_width + _GAP_PX)
    row_height = 2 * _LINE_PX + cell_height
    height = sum(_TITLE_LINE_PX + len(block.rows) * row_height for block in blocks) + _GAP_PX
    sheet = PIL.Image.new("RGB", (width, height), _BACKGROUND)
    draw = PIL.ImageDraw.Draw(sheet)
    text, title = (PIL.ImageFont.load_default(size) for size in (_TEXT_PX, _TITLE_PX))
    y = _GAP_PX
    for block in blocks:
        draw.text((_GAP_PX, y), block.title, _INK, title)
        y += _TITLE_LINE_PX
        for row in block.rows:
            draw.text((_GAP_PX, y), row.label, _INK, text)
            for column, cell in enumerate(row.cells):
                x = _GAP_PX + column * (cell_width + _GAP_PX)
                sheet.paste(_scaled(cell.pixels, cell_width, cell_height), (x, y + _LINE_PX))
                draw.text((x, y + _LINE_PX + cell_height + 2), cell.caption, _INK, text)
            y += row_height
    return np.asarray(sheet)


def _cell_size(rows: Sequence[Row]) -> tuple[int, int]:
    height, width = rows[0].cells[0].pixels.shape[:2]
    scale = min(1.0, WIDEST_CELL_PX / width)
    return max(1, round(width * scale)), max(1, round(height * scale))


def _scaled(pixels: Pixels, width: int, height: int) -> PIL.Image.Image:
    image = PIL.Image.fromarray(pixels)
    return image if image.size == (width, height) else image.resize((width, height), PIL.Image.Resampling.BOX)
