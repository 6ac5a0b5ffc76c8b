"""What can be laid over the picture: places, colours and legends."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from incpt.render import tiles
from incpt.render.first_hits import FirstHits
from incpt.render.impact.findings import Findings
from incpt.render.modes import Mode
from incpt.ui.display import overlays
from incpt.ui.preferences import OVERLAYS
from incpt.viewer.view import Picture

WIDTH, HEIGHT, TILE = 44, 28, 8
GRID = tiles.TileGrid(WIDTH, HEIGHT, TILE)


def findings(**changes: Any) -> Findings:
    places = np.linspace(0, 1, GRID.count)
    values = dict.fromkeys(("error", "touched", "singles", "weight"), places)
    return Findings(0.25, **{name: np.array(value) for name, value in {**values, **changes}.items()})


def picture(**changes: Any) -> Picture:
    values: dict[str, Any] = {
        "image": np.ones((HEIGHT, WIDTH, 4), np.float32),
        "grid": GRID,
        "mode": Mode.INCREMENTAL,
        "queue": tiles.spiral_queue(GRID, (20, 12)),
        "queue_done": 5,
        "tile_spp": np.arange(GRID.count, dtype=np.int64),
        "replaced": np.arange(GRID.count) < 7,
        "seconds": 1.0,
        "error": None,
        "strategy": "impact",
        "error_left": 0.25,
        "findings": findings(),
    }
    return Picture(**{**values, **changes})


def first_hits() -> FirstHits:
    ids = np.full((HEIGHT, WIDTH), -1, np.int32)
    ids[10:, :20], ids[10:, 20:] = 0, 3
    hit = ids >= 0
    normal = np.where(hit[..., None], np.float32([0, 1, 0]), np.float32(0))
    depth = np.where(hit, np.linspace(1, 10, WIDTH, dtype=np.float32), np.float32(np.inf))
    albedo = np.where(hit[..., None], np.float32([0.5, 0.18, 0]), np.float32(0))
    return FirstHits(ids, normal, depth, albedo)


@pytest.mark.parametrize("kind", OVERLAYS)
def test_every_kind_fits_the_picture(kind: str) -> None:
    overlay = overlays.build(kind, picture(), first_hits())
    if kind == "none":
        assert overlay is None
        return
    assert overlay is not None and overlay.image.dtype == np.uint8 and overlay.image.any()
    per_pixel = kind in overlays.NEEDS_FIRST_HITS
    assert overlay.image.shape == ((HEIGHT, WIDTH, 4) if per_pixel else (GRID.rows, GRID.columns, 4))
    assert overlay.extent_px == ((WIDTH, HEIGHT) if per_pixel else (GRID.columns * TILE, GRID.rows * TILE))
    assert overlays.build(kind, picture(), None) is None or not per_pixel


def test_the_queue_goes_from_dark_to_bright_and_is_numbered_where_its_tiles_are() -> None:
    shown = picture()
    overlay = overlays.build("queue", shown, None)
    assert overlay is not None and overlay.numbers is not None and overlay.numbers_at is not None
    flat = overlay.image.reshape(-1, 4)[shown.queue]
    assert flat[0, :3].tolist() == [0x44, 0x01, 0x54] and flat[-1, :3].tolist() == [0xFD, 0xE7, 0x25]
    assert (flat[:5, 3] < flat[5:, 3].min()).all()
    assert overlay.numbers.tolist() == list(range(1, GRID.count + 1))
    x, y = overlay.numbers_at.astype(int).T
    assert (GRID.tile_at(x, y) == shown.queue).all()
    last = int(np.flatnonzero(shown.queue == GRID.count - 1)[0])
    assert overlay.numbers_at[last].tolist() == [42, 26]  # of 40 to 44, 24 to 28: cut


def test_only_replaced_tiles_are_marked() -> None:
    replaced = np.zeros(GRID.count, bool)
    replaced[[3, 9]] = True
    overlay = overlays.build("replaced", picture(replaced=replaced), None)
    assert overlay is not None
    assert np.flatnonzero(overlay.image[..., 3]).tolist() == [3, 9]


def test_samples_are_shown_on_a_logarithmic_scale() -> None:
    spp = np.ones(GRID.count, np.int64)
    spp[:4] = 0, 1, 16, 256
    overlay = overlays.build("spp", picture(tile_spp=spp), None)
    assert overlay is not None
    colors = overlay.image.reshape(-1, 4)[:4, :3]
    assert colors[0].tolist() == [0, 0, 0]
    expected = overlays.color_map(overlays.HEAT, [0, 0.5, 1])
    assert (colors[1:] == expected).all()
    assert [text for text, _ in overlay.legend] == ["1", "4", "16", "64", "256"]
    assert overlay.legend[2][1] == tuple(expected[1])


def test_samples_that_hardly_differ_look_alike() -> None:
    spp = np.full(GRID.count, 256, np.int64)
    spp[0] = 250
    overlay = overlays.build("spp", picture(tile_spp=spp), None)
    assert overlay is not None
    colors = overlay.image.reshape(-1, 4)[:2, :3].astype(int)
    assert 0 < np.abs(colors[0] - colors[1]).max() < 20
    nothing = overlays.build("spp", picture(tile_spp=np.zeros(GRID.count, np.int64)), None)
    assert nothing is not None and not nothing.image[..., :3].any()


def tile_values(**values: float) -> Findings:
    """Findings that have some values in the third tile, and nothing in the others."""
    third = np.arange(GRID.count) == 2
    return findings(
        **{n: np.where(third, values.get(n, 0.0), 0.0) for n in ("error", "touched", "singles", "weight")}
    )


def third_tile(kind: str, **values: float) -> list[int]:
    overlay = overlays.build(kind, picture(findings=tile_values(**values)), None)
    assert overlay is not None
    flat = overlay.image.reshape(-1, 4)
    assert not flat[np.arange(GRID.count) != 2, 3].any(), "tiles that an edit left alone stay clear"
    return list(flat[2].tolist())


def test_the_error_that_is_left_fades_on_a_scale_that_stays() -> None:
    for error, place in ((0.01, 0.5), (0.1, 1.0), (0.7, 1.0)):
        expected = overlays.color_map(overlays.HEAT, [place])[0].tolist()
        assert third_tile("error_left", error=error) == [*expected, 255]
    assert third_tile("error_left", error=0.0009)[3] == 0
    built = overlays.build("error_left", picture(), None)
    assert built is not None
    assert [text for text, _ in built.legend][::2] == ["0.1 % of white", "1 % of white", "10 % of white"]


def test_shares_and_weights_run_along_one_map() -> None:
    half = [*overlays.color_map(overlays.VIRIDIS, [0.5])[0].tolist(), 255]
    assert third_tile("touched", touched=0.5) == half
    assert third_tile("weight", touched=0.1, weight=0.5) == half
    least = [*overlays.color_map(overlays.VIRIDIS, [0.0])[0].tolist(), 255]
    assert third_tile("weight", touched=0.1) == least, "a tile that starts over is shown"


def test_pairs_and_singles_have_colours_of_their_own() -> None:
    pairs, singles = (third_tile("pairs", touched=0.1, singles=share) for share in (0.0, 1.0))
    built = overlays.build("pairs", picture(), None)
    assert built is not None
    assert dict(built.legend) == {"pairs": tuple(pairs[:3]), "singles": tuple(singles[:3])}
    assert pairs[2] > pairs[0] and singles[0] > singles[2]


@pytest.mark.parametrize(
    ("error_left", "strategy", "word"),
    [
        (None, "spiral", "not measured by the strategy spiral"),
        (None, "impact", "the picture starts over"),
        (0.0, "impact", "nothing is left of an edit"),
        (1.0, "impact", "not measured yet"),
    ],
)
@pytest.mark.parametrize("kind", sorted(overlays.NEEDS_FINDINGS))
def test_where_nothing_is_known_a_word_says_why(
    kind: str, error_left: float | None, strategy: str, word: str
) -> None:
    overlay = overlays.build(kind, picture(findings=None, error_left=error_left, strategy=strategy), None)
    assert overlay is not None and not overlay.image[..., 3].any()
    assert [text for text, _ in overlay.legend] == [word]


def test_the_sky_is_left_alone_by_first_hit_overlays() -> None:
    for kind in overlays.NEEDS_FIRST_HITS:
        overlay = overlays.build(kind, picture(), first_hits())
        assert overlay is not None
        assert ((overlay.image[..., 3] > 0) == (first_hits().object_id >= 0)).all()


def test_first_hit_values() -> None:
    built = {kind: overlays.build(kind, picture(), first_hits()) for kind in overlays.NEEDS_FIRST_HITS}
    at = {kind: overlay.image[20, 5, :3].tolist() for kind, overlay in built.items() if overlay is not None}
    assert at["normals"] == [128, 255, 128]
    assert at["albedo"] == [188, 118, 0]
    assert at["object_ids"] == overlays.object_colors(1)[0].tolist()
    depth = built["depth"]
    assert depth is not None
    green = depth.image[20, :, 1].astype(int)
    assert (np.diff(green) <= 0).all() and green[0] - green[-1] > 150  # near is bright
    assert depth.legend[0][0] == "1 m" and len(depth.legend) == 5


def test_a_picture_of_nothing_has_overlays() -> None:
    empty = FirstHits(
        np.full((HEIGHT, WIDTH), -1, np.int32),
        np.zeros((HEIGHT, WIDTH, 3), np.float32),
        np.full((HEIGHT, WIDTH), np.inf, np.float32),
        np.zeros((HEIGHT, WIDTH, 3), np.float32),
    )
    for kind in overlays.NEEDS_FIRST_HITS:
        overlay = overlays.build(kind, picture(), empty)
        assert overlay is not None and not overlay.image[..., 3].any()


def lightness(rgb: np.ndarray) -> np.ndarray:
    """CIE L* of sRGB colours 0 to 255."""
    x = rgb / 255
    linear = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    return 116 * np.cbrt(np.maximum(luminance, 0.008856)) - 16


@pytest.mark.parametrize("table", [overlays.VIRIDIS, overlays.HEAT])
def test_lightness_climbs_evenly_along_color_maps(table: np.ndarray) -> None:
    steps = np.diff(lightness(overlays.color_map(table, np.linspace(0, 1, 17)).astype(float)))
    assert steps.min() > 0.6 * steps.mean() and steps.max() < 1.5 * steps.mean()


def test_object_colors_are_distinct_and_stay() -> None:
    colors = overlays.object_colors(12).astype(int)
    assert (overlays.object_colors(40)[:12] == colors).all()
    apart = np.abs(colors[:, None] - colors[None]).sum(axis=-1)
    assert apart[~np.eye(12, dtype=bool)].min() > 30
    assert np.abs(np.diff(colors, axis=0)).sum(axis=-1).min() > 100
