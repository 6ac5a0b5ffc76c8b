"""What can be laid over the picture, as small images: the queue, tiles already replaced, samples per pixel,
what the rays of the pixel centres hit, and what is known of an edit. Pure numpy; `display` stretches and
blends them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.render.first_hits import FirstHits
from incpt.render.impact.findings import Findings
from incpt.render.strategies import STRATEGIES_BY_NAME
from incpt.viewer.view import Picture

Pixels = npt.NDArray[np.uint8]
"""(h, w, 3) or (h, w, 4), sRGB, row 0 on top."""
Color = tuple[int, int, int]
"""sRGB, 0 to 255."""
TileColors = tuple[Pixels, npt.NDArray[np.bool_], tuple[tuple[str, Color], ...]]
"""(count, 3) colours of tiles, (count,) which of them are shown, and the legend."""

NEEDS_FIRST_HITS = frozenset({"object_ids", "normals", "albedo", "depth"})
"""Overlays of first hits: they want a View with `first_hits`."""

NEEDS_FINDINGS = frozenset({"error_left", "touched", "pairs", "weight"})
"""Overlays of what is known of an edit, which strategies that compare scenes measure."""

_DONE_ALPHA, _WAITING_ALPHA = 90, 255
"""Opacity of tiles that the queue has passed and of those that wait, 0 to 255."""
_REPLACED = (70, 200, 140, 150)
"""Colour of a replaced tile, sRGB with alpha."""
_LEAST_SPP_RANGE = 4.0
"""The scale of samples per pixel spans at least this factor."""
_DEPTH_PERCENTILES = (1.0, 99.0)
"""The scale of depth runs between these percentiles of the depths that were hit."""
_ERROR_RANGE = (1e-3, 1e-1)
"""The scale of the error that is left, as shares of the display's range. It stays, so that tiles fade."""
_PAIRS, _SINGLES = (86, 180, 233), (230, 159, 0)
"""Colours of tiles whose paths are traced in pairs, and of those that do without, sRGB: two that colour-blind
eyes tell apart as well (M. Okabe and K. Ito, 2008)."""
_NOTHING = (128, 128, 128)
"""Colour beside a word that says why there is nothing to see, sRGB."""
_GOLDEN_TURN = math.tau * 0.6180339887498949
"""A golden section of a full turn, in radians."""


def _table(text: str) -> npt.NDArray[np.float64]:
    return np.array([[int(word[i : i + 2], 16) for i in (0, 2, 4)] for word in text.split()], np.float64)


VIRIDIS = _table("440154 472d7b 3b528b 2c728e 21918c 28ae80 5ec962 addc30 fde725")
"""(9, 3) colours at equal distances of the map of that name, by S. van der Walt and N. Smith (matplotlib,
2015; CC0). Straight lines between them stay within 4 of 255 of the map itself."""
HEAT = _table("57106e 8a226a bc3754 e45a31 f98e09 f9cb35 fcffa4")
"""(7, 3) colours of Inferno, by the same authors, without its first quarter, which is so dark that nothing
would be seen beneath."""


@dataclass(frozen=True, eq=False)
class Overlay:
    """An image to be laid over a picture.

    image        (h, w, 4) uint8, sRGB with straight alpha, row 0 on top.
    extent_px    width and height of what it spans, from the picture's top left corner, in pixels of the
                 picture: that of its tiles, so beyond the edge where tiles are cut, or of the picture.
    legend       values and their colours, least first.
    numbers      (n,) numbers to be written at `numbers_at` (n, 2), (x, y) in pixels of the picture.
    """

    image: Pixels
    extent_px: tuple[int, int]
    legend: tuple[tuple[str, Color], ...] = ()
    numbers: npt.NDArray[np.int64] | None = None
    numbers_at: npt.NDArray[np.float64] | None = None


def build(kind: str, picture: Picture, first_hits: FirstHits | None) -> Overlay | None:
    """The overlay of that kind, one of preferences.OVERLAYS. None for "none", and where first hits are
    wanted that are not there yet."""
    if kind == "queue":
        return _queue(picture)
    if kind == "replaced":
        return _replaced(picture)
    if kind == "spp":
        return _spp(picture)
    if kind in NEEDS_FINDINGS:
        return _of_findings(kind, picture)
    if first_hits is None or kind not in NEEDS_FIRST_HITS:
        return None
    height, width = picture.image.shape[:2]
    image, legend = _PER_PIXEL[kind](first_hits)
    return Overlay(image, (width, height), legend)


def color_map(table: npt.NDArray[np.float64], places: npt.ArrayLike) -> Pixels:
    """(..., 3) colours at `places`, 0 to 1, along a table of colours at equal distances."""
    at = np.clip(np.asarray(places, np.float64), 0.0, 1.0) * (len(table) - 1)
    stops = np.arange(len(table))
    channels = [np.interp(at, stops, table[:, c]) for c in range(3)]
    return np.rint(np.stack(channels, axis=-1)).astype(np.uint8)


def object_colors(count: int) -> Pixels:
    """(count, 3) colours of objects by index: hues a golden turn apart, so that neighbours in the list
    differ most and a new object changes no other's, in two lightnesses of OKLab (B. Ottosson, 2020)."""
    index = np.arange(count)
    hue = index * _GOLDEN_TURN + 0.5
    lightness = np.where(index % 2 == 0, 0.74, 0.6)
    return _srgb8(_linear_from_oklab(lightness, 0.13 * np.cos(hue), 0.13 * np.sin(hue)))


def _queue(picture: Picture) -> Overlay:
    grid, order = picture.grid, np.asarray(picture.queue)
    place = np.arange(len(order))
    image = np.zeros((grid.count, 4), np.uint8)
    image[order, :3] = color_map(VIRIDIS, place / max(len(order) - 1, 1))
    image[order, 3] = np.where(place < picture.queue_done, _DONE_ALPHA, _WAITING_ALPHA)
    x, y = grid.origin(order)
    right, bottom = np.minimum(x + grid.tile_size, grid.width), np.minimum(y + grid.tile_size, grid.height)
    centers = np.column_stack([(x + right) / 2, (y + bottom) / 2])
    legend = _legend(VIRIDIS, [("first", 0.0), ("last", 1.0)])
    return _of_tiles(picture, image, legend, place + 1, centers)


def _replaced(picture: Picture) -> Overlay:
    image = np.where(np.asarray(picture.replaced)[:, None], np.array(_REPLACED, np.uint8), np.uint8(0))
    return _of_tiles(picture, image, (("replaced", _REPLACED[:3]),))


def _spp(picture: Picture) -> Overlay:
    """On a logarithmic scale; black where there is no sample yet."""
    spp = np.asarray(picture.tile_spp, np.float64)
    some = spp > 0
    high = max(float(spp.max(initial=1.0)), 1.0)
    # Without this range 255 samples beside 256 would have the two ends of the scale.
    low = max(min(float(spp[some].min(initial=high)), high / _LEAST_SPP_RANGE), 1.0)
    image = np.full((len(spp), 4), 255, np.uint8)
    image[:, :3] = color_map(HEAT, _log_place(np.maximum(spp, low), low, high))
    image[~some, :3] = 0
    values = np.unique(np.rint(np.geomspace(low, high, 5)).astype(np.int64))
    legend = _legend(HEAT, [(f"{v:,}", float(_log_place(v, low, high))) for v in values])
    return _of_tiles(picture, image, legend)


def _of_findings(kind: str, picture: Picture) -> Overlay:
    """Nothing but a word where nothing is known."""
    if picture.findings is not None:
        colors, is_shown, legend = _PER_TILE[kind](picture.findings)
        image = np.concatenate([colors, np.where(is_shown, np.uint8(255), np.uint8(0))[:, None]], axis=1)
        return _of_tiles(picture, image, legend)
    nothing = np.zeros((picture.grid.count, 4), np.uint8)
    return _of_tiles(picture, nothing, ((_why_nothing(picture), _NOTHING),))


def _why_nothing(picture: Picture) -> str:
    if picture.error_left is not None:
        return "not measured yet" if picture.error_left > 0 else "nothing is left of an edit"
    if STRATEGIES_BY_NAME[picture.strategy].keeps_anchor:
        return "the picture starts over"
    return f"not measured by the strategy {picture.strategy}"


def _error_left(found: Findings) -> TileColors:
    """On a logarithmic scale."""
    low, high = _ERROR_RANGE
    colors = color_map(HEAT, _log_place(np.maximum(found.error, low), low, high))
    steps = [
        (f"{100 * v:.2g} % of white", float(_log_place(v, low, high))) for v in np.geomspace(low, high, 5)
    ]
    return colors, found.error > low, _legend(HEAT, steps)


def _touched(found: Findings) -> TileColors:
    return color_map(VIRIDIS, found.touched), found.touched > 0, _shares(" of the paths")


def _weight(found: Findings) -> TileColors:
    return color_map(VIRIDIS, found.weight), found.touched > 0, _shares("")


def _pairs(found: Findings) -> TileColors:
    colors = color_map(np.array([_PAIRS, _SINGLES], np.float64), found.singles)
    return colors, found.touched > 0, (("pairs", _PAIRS), ("singles", _SINGLES))


_PER_TILE: Mapping[str, Callable[[Findings], TileColors]] = {
    "error_left": _error_left,
    "touched": _touched,
    "pairs": _pairs,
    "weight": _weight,
}
"""The overlays that are made from findings, by kind."""


def _shares(of: str) -> tuple[tuple[str, Color], ...]:
    return _legend(VIRIDIS, [(f"{100 * share:.0f} %{of}", share) for share in np.linspace(0.0, 1.0, 5)])


def _of_tiles(
    picture: Picture,
    image: Pixels,
    legend: tuple[tuple[str, Color], ...],
    numbers: npt.NDArray[np.int64] | None = None,
    numbers_at: npt.NDArray[np.float64] | None = None,
) -> Overlay:
    grid = picture.grid
    extent = (grid.columns * grid.tile_size, grid.rows * grid.tile_size)
    return Overlay(image.reshape(grid.rows, grid.columns, 4), extent, legend, numbers, numbers_at)


def _object_ids(hits: FirstHits) -> tuple[Pixels, tuple[tuple[str, Color], ...]]:
    ids = hits.object_id
    colors = np.zeros((int(ids.max(initial=-1)) + 2, 4), np.uint8)
    colors[1:, :3] = object_colors(len(colors) - 1)
    colors[1:, 3] = 255
    return colors[ids + 1], ()


def _normals(hits: FirstHits) -> tuple[Pixels, tuple[tuple[str, Color], ...]]:
    rgb = np.rint(hits.normal * 127.5 + 127.5).astype(np.uint8)
    axes = (("+x", (255, 128, 128)), ("+y", (128, 255, 128)), ("+z", (128, 128, 255)))
    return _of_hits(hits, rgb), axes


def _albedo(hits: FirstHits) -> tuple[Pixels, tuple[tuple[str, Color], ...]]:
    return _of_hits(hits, _srgb8(hits.albedo)), ()


def _depth(hits: FirstHits) -> tuple[Pixels, tuple[tuple[str, Color], ...]]:
    """On a logarithmic scale, near is bright. The farthest hundredth (a floor's horizon) shares a colour."""
    hit = np.isfinite(hits.depth)
    if not hit.any():
        return _of_hits(hits, np.zeros((*hits.depth.shape, 3), np.uint8)), ()
    near, far = np.maximum(np.percentile(hits.depth[hit], _DEPTH_PERCENTILES), 1e-6)
    far = max(far, near * 1.01)
    depth = np.clip(np.where(hit, hits.depth, far), near, far)
    shades = color_map(VIRIDIS, np.linspace(1.0, 0.0, 256))
    rgb = shades[np.rint(_log_place(depth, near, far) * 255.0).astype(np.uint8)]
    steps = [(f"{d:.3g} m", 1.0 - float(_log_place(d, near, far))) for d in np.geomspace(near, far, 5)]
    return _of_hits(hits, rgb), _legend(VIRIDIS, steps)


_PER_PIXEL = {"object_ids": _object_ids, "normals": _normals, "albedo": _albedo, "depth": _depth}
"""The overlays that are made from first hits, by kind."""


def _of_hits(hits: FirstHits, rgb: Pixels) -> Pixels:
    alpha = np.where(hits.object_id >= 0, np.uint8(255), np.uint8(0))
    return np.concatenate([rgb, alpha[..., None]], axis=-1)


def _log_place(values: npt.ArrayLike, low: float, high: float) -> npt.NDArray[np.float64]:
    span = math.log(high / low)
    place: npt.NDArray[np.float64] = (
        np.log(np.asarray(values, np.float64) / low) / span
        if span > 0
        else (np.ones_like(values, np.float64))
    )
    return place


def _legend(
    table: npt.NDArray[np.float64], entries: list[tuple[str, float]]
) -> tuple[tuple[str, Color], ...]:
    colors = color_map(table, [place for _, place in entries])
    return tuple(
        (text, (int(r), int(g), int(b))) for (text, _), (r, g, b) in zip(entries, colors, strict=True)
    )


def _linear_from_oklab(
    lightness: npt.NDArray[np.float64], a: npt.NDArray[np.float64], b: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    long = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3
    medium = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3
    short = (lightness - 0.0894841775 * a - 1.2914855480 * b) ** 3
    return np.stack(
        [
            4.0767416621 * long - 3.3077115913 * medium + 0.2309699292 * short,
            -1.2684380046 * long + 2.6097574011 * medium - 0.3413193965 * short,
            -0.0041960863 * long - 0.7034186147 * medium + 1.7076147010 * short,
        ],
        axis=-1,
    )


def _srgb8(linear: npt.ArrayLike) -> Pixels:
    steps = 1 << 14
    x = np.arange(steps) / (steps - 1)
    encoded = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    table = np.rint(encoded * 255.0).astype(np.uint8)
    place = np.clip(np.asarray(linear, np.float32), 0.0, 1.0) * np.float32(steps - 1)
    result: Pixels = table[np.rint(place).astype(np.int16)]
    return result
