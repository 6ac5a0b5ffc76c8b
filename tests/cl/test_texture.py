"""Textures as kernels read them, against numpy: cl/base/texture.cl and incpt/tables/texels.py."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.kernels import call, device

from incpt.core import layout
from incpt.picture.color import linear_from_srgb
from incpt.scene.material import Material
from incpt.scene.texture import FILTERS, WRAPS, Bitmap, Texture
from incpt.tables.textures import TextureTables, texture_tables

Array = npt.NDArray[np.floating]

BODY = """Shading s; s.textures = textures; s.texels = texels; s.byte_values = byte_values;
    Uvs uvs; uvs.u0 = u[i]; uvs.v0 = v[i]; uvs.u1 = -v[i]; uvs.v1 = u[i];
    Texel t = sample_texture(&s, number[0], &uvs);
    r[i] = t.color.x; g[i] = t.color.y; b[i] = t.color.z; a[i] = t.alpha;"""


def on_device(tables: TextureTables, number: int, u: Array, v: Array) -> Array:
    """(N, 4) a texture of the tables, at texture coordinates."""
    rows = np.zeros(len(tables.numbers), layout.TEXTURE)
    device().read(tables.buffer, rows)
    words = np.zeros(tables.pool.texels.size // 4, np.uint32)
    device().read(tables.pool.texels, words)
    values = np.zeros(512, np.float32)
    device().read(tables.pool.buffers["byte_values"], values)
    result = call(
        "texture", BODY, len(u), ("r", "g", "b", "a"), textures=rows, texels=words, byte_values=values,
        u=np.asarray(u, np.float32), v=np.asarray(v, np.float32), number=np.uint32([number]),
    )  # fmt: skip
    return np.stack(result, axis=1)


def sampled(texture: Texture, u: Array, v: Array, is_color: bool = False) -> Array:
    slot = "base_color_texture" if is_color else "metallic_roughness_texture"
    tables = texture_tables(device(), {"m": Material(**{slot: texture})})
    return on_device(tables, tables.numbers[texture, is_color], u, v)


def expected(texture: Texture, u: Array, v: Array, is_color: bool = False) -> Array:
    """The same by numpy in double precision."""
    bitmap = texture.bitmap
    height, width = bitmap.pixels.shape[:2]
    rgba = _rgba(bitmap, is_color)
    uv = np.stack([u, v, np.ones_like(u)]) if texture.uv_set == 0 else np.stack([-v, u, np.ones_like(u)])
    x, y = texture.matrix @ uv
    half = 0.0 if texture.filter == "nearest" else 0.5
    total: Array = np.zeros((len(u), 4))
    for dx in (0, 1):
        for dy in (0, 1):
            px, py = _wrapped(x, texture.wrap[0]) * width - half, _wrapped(y, texture.wrap[1]) * height - half
            tx, ty = (0 * px, 0 * py) if half == 0 else (px - np.floor(px), py - np.floor(py))
            column = _index(np.floor(px) + dx, width, texture.wrap[0])
            row = _index(np.floor(py) + dy, height, texture.wrap[1])
            total += ((tx if dx else 1 - tx) * (ty if dy else 1 - ty))[:, None] * rgba[row, column]
    return total


def _rgba(bitmap: Bitmap, is_color: bool) -> Array:
    pixels: npt.NDArray[Any] = bitmap.pixels
    values = pixels.astype(np.float64)
    if pixels.dtype != np.float32:
        values /= np.iinfo(pixels.dtype).max
    has_alpha = bitmap.channels in (2, 4)
    color, alpha = (
        (values[..., :-1], values[..., -1:]) if has_alpha else (values, np.ones_like(values[..., :1]))
    )
    if is_color and pixels.dtype != np.float32:
        color = linear_from_srgb(color)
    if color.shape[2] == 1:
        color = np.repeat(color, 3, axis=2)
    return np.concatenate([color, alpha], axis=2)


def _wrapped(x: Array, how: str) -> Array:
    if how == "clamp":
        return np.clip(x, 0, 1)
    return x - np.floor(x) if how == "repeat" else x % 2


def _index(i: Array, size: int, how: str) -> npt.NDArray[np.int64]:
    if how == "repeat":
        return (i % size).astype(int)
    if how == "mirror":
        i = i % (2 * size)
        return np.where(i >= size, 2 * size - 1 - i, i).astype(int)
    return np.clip(i, 0, size - 1).astype(int)


def image(dtype: type, channels: int, seed: int = 3, height: int = 5, width: int = 7) -> Bitmap:
    rng = np.random.default_rng(seed)
    if dtype is np.float32:
        return Bitmap(rng.normal(0.5, 2, (height, width, channels)).astype(np.float32))
    return Bitmap(rng.integers(0, np.iinfo(dtype).max + 1, (height, width, channels)).astype(dtype))


def places(count: int = 2000, reach: float = 3.0) -> tuple[Array, Array]:
    rng = np.random.default_rng(8)
    # Away from the edges between pixels, where nearest pixels differ by rounding.
    u, v = rng.integers(-70, 70, (2, count)) / 7 + rng.uniform(0.02, 0.12, (2, count))
    return (u / 7 * reach).astype(np.float32), (v / 7 * reach).astype(np.float32)


@pytest.mark.parametrize("is_color", [True, False])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_pixels_of_every_kind(dtype: type, channels: int, is_color: bool) -> None:
    texture = Texture(image(dtype, channels))
    u, v = places()
    # Half floats have eleven bits.
    tolerance = 1e-5 if dtype is np.uint8 else 2e-3
    np.testing.assert_allclose(
        sampled(texture, u, v, is_color), expected(texture, u, v, is_color), rtol=tolerance, atol=tolerance
    )


@pytest.mark.parametrize("filter_", FILTERS)
@pytest.mark.parametrize("wrap_v", WRAPS)
@pytest.mark.parametrize("wrap_u", WRAPS)
def test_edges_and_filters(wrap_u: str, wrap_v: str, filter_: str) -> None:
    texture = Texture(image(np.uint8, 3), wrap=(wrap_u, wrap_v), filter=filter_)
    rng = np.random.default_rng(5)
    # In the middle of the quarters of pixels, three images far: no rounding decides.
    u, v = ((rng.integers(-3 * 4 * n, 3 * 4 * n, 3000) + 0.5) / (4 * n) for n in (7, 5))
    np.testing.assert_allclose(sampled(texture, u, v), expected(texture, u, v), atol=2e-5)


@settings(max_examples=40, deadline=None)
@given(
    offset=st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    rotation=st.floats(-400, 400),
    scale=st.tuples(st.floats(-4, 4), st.floats(-4, 4)),
    uv_set=st.integers(0, 1),
)
def test_transforms(
    offset: tuple[float, float], rotation: float, scale: tuple[float, float], uv_set: int
) -> None:
    texture = Texture(image(np.uint8, 3), uv_set, offset=offset, rotation=rotation, scale=scale)
    u, v = places(500, 1.0)
    # Rounding of places of some tens of pixels, times the steps between pixels.
    np.testing.assert_allclose(sampled(texture, u, v), expected(texture, u, v), atol=5e-4)


def test_rotation_turns_what_is_read_counter_clockwise() -> None:
    """KHR_texture_transform: at (1, 0) a rotation by a quarter turn reads what is at (0, -1), upwards."""
    np.testing.assert_allclose(
        Texture(image(np.uint8, 3), rotation=90).matrix @ [1, 0, 1], [0, -1], atol=1e-12
    )


def test_far_places_and_single_pixels_stay_in_the_image() -> None:
    for size in ((1, 1), (1, 9), (2, 1)):
        for wrap in WRAPS:
            texture = Texture(image(np.uint8, 3, height=size[0], width=size[1]), wrap=wrap)
            u = np.float32([1e9, -1e9, 123456.7, -0.0, 1.0, 0.99999994, 1e-30, -1e-30])
            found = sampled(texture, u, u[::-1].copy())
            pixels = texture.bitmap.pixels.reshape(-1, 3) / 255
            assert (found[:, :3] >= pixels.min(axis=0) - 1e-6).all()
            assert (found[:, :3] <= pixels.max(axis=0) + 1e-6).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_bitmaps_take_little_more_than_they_say(dtype: type) -> None:
    """Each once, however many textures use it and whatever for."""
    bitmap = image(dtype, 3, height=64, width=33)
    texture = Texture(bitmap)
    materials = {
        "a": Material(base_color_texture=texture),
        "b": Material(base_color_texture=Texture(bitmap, wrap="mirror"), emission_texture=texture),
    }
    # Beside it a white pixel, and up to two words at the end of each.
    size = bitmap.device_bytes()
    assert size <= texture_tables(device(), materials).byte_count <= size + 24


def test_several_bitmaps_lie_side_by_side() -> None:
    """Of sizes that leave bytes over at their ends."""
    textures = [
        Texture(image(np.uint8, c, seed=c + n, height=n, width=n + 1)) for n in (1, 2, 3) for c in (1, 3)
    ]
    tables = texture_tables(
        device(), {str(i): Material(base_color_texture=t) for i, t in enumerate(textures)}
    )
    u, v = places(200)
    for texture in textures:
        found = on_device(tables, tables.numbers[texture, True], u, v)
        np.testing.assert_allclose(found, expected(texture, u, v, True), atol=1e-4)
