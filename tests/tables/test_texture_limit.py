"""Images that are halved until they fit a limit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.small_scenes import small_settings

from incpt.core.errors import DeviceError
from incpt.device.device import Device
from incpt.picture.color import srgb_from_linear
from incpt.render.modes import Mode
from incpt.render.session import Session
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.summary import described_textures
from incpt.scene.texture import Bitmap, Texture, fitted_size
from incpt.tables import texels
from incpt.tables.textures import TexturePool, texture_tables


def checked(size: int = 16, dtype: type = np.uint8) -> Bitmap:
    """Black and white pixels by turns."""
    white = np.indices((size, size)).sum(axis=0) % 2
    largest = 1 if dtype == np.float32 else np.iinfo(dtype).max
    return Bitmap(np.repeat((white * largest)[..., None], 3, axis=2).astype(dtype))


@pytest.mark.parametrize(
    ("size", "limit", "expected"),
    [
        ((16, 16), 0, (16, 16)),
        ((16, 16), 16, (16, 16)),
        ((16, 4), 8, (8, 2)),
        ((17, 5), 4, (3, 1)),
        ((9, 1), 1, (1, 1)),
    ],
)
def test_sizes(size: tuple[int, int], limit: int, expected: tuple[int, int]) -> None:
    assert fitted_size(*size, limit) == expected
    bitmap = Bitmap(np.zeros((size[1], size[0], 3), np.uint8))
    smaller = texels.fitted(bitmap, True, limit)
    assert (smaller.width, smaller.height) == expected
    assert bitmap.device_bytes(limit) == smaller.pixels.size
    assert texels.fitted(bitmap, True, limit) is smaller


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_means_are_of_light_and_not_of_codes(dtype: type) -> None:
    bitmap = checked(dtype=dtype)
    largest = 1 if dtype == np.float32 else np.iinfo(dtype).max
    as_color, as_number = (texels.fitted(bitmap, is_color, 4).pixels / largest for is_color in (True, False))
    encoded = 0.5 if dtype == np.float32 else float(srgb_from_linear(0.5))
    np.testing.assert_allclose(as_color, encoded, atol=0.003)
    np.testing.assert_allclose(as_number, 0.5, atol=0.003)


def test_what_is_transparent_brings_no_colour_in() -> None:
    pixels = np.zeros((4, 4, 4), np.uint8)
    pixels[::2] = (200, 100, 50, 255)
    pixels[1::2] = (0, 255, 0, 0)
    halved = texels.fitted(Bitmap(pixels), True, 2).pixels
    np.testing.assert_allclose(halved[..., :3], np.broadcast_to((200, 100, 50), (2, 2, 3)), atol=1)
    np.testing.assert_allclose(halved[..., 3], 127.5, atol=0.5)


def test_odd_edges_and_strips_leave_no_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(3)
    pixels = random.integers(0, 256, (37, 23, 3), np.uint8)
    whole = texels.fitted(Bitmap(pixels), False, 20).pixels
    monkeypatch.setattr(texels, "_ROWS_AT_ONCE", 4)
    np.testing.assert_array_equal(texels.fitted(Bitmap(pixels), False, 20).pixels, whole)
    np.testing.assert_allclose(whole[3, 5], pixels[6:8, 10:12].mean(axis=(0, 1)), atol=0.51)
    np.testing.assert_allclose(whole[18, 11], pixels[36, 22], atol=0.51)


def wall(**settings: object) -> Scene:
    """A glowing wall with a checked image, over the whole picture."""
    texture = Texture(checked(64), filter="nearest")
    material = Material((0, 0, 0), specular=0, emission=(1, 1, 1), emission_texture=texture)
    plane = Object("wall", shape("plane"), "wall", rotation=(90, 0, 0), scale=(4, 1, 4))
    return Scene(
        Camera((0, 0, 1), (0, 0, 0), fov_y=60), Environment((0, 0, 0)), {"wall": material}, (plane,),
        small_settings(size=(16, 8), max_bounces=0, **settings),
    )  # fmt: skip


def test_the_limit_is_a_setting_of_the_picture(device: Device) -> None:
    session = Session(wall(), device=device)
    session.render(1)
    assert set(np.unique(session.image())) == {0, 1}
    assert session._tables.textures.byte_count > 64 * 64 * 3
    limited = replace(session.settings, texture_limit=16)
    session.configure(limited)
    assert session.mode is Mode.BASE
    session.render(1)
    np.testing.assert_allclose(session.image(), 0.5, atol=0.01)
    assert session._tables.textures.byte_count < 64 * 64
    assert "0.0 MiB" in described_textures(session.scene)
    # An edit of a scene that knows nothing of it keeps it.
    session.edit(wall().with_object("wall", scale=(5, 1, 5)))
    session.render(1)
    np.testing.assert_allclose(session.image(), 0.5, atol=0.01)
    session.configure(replace(limited, texture_limit=0))
    session.render(1)
    assert set(np.unique(session.image())) == {0, 1}
    own = Session(wall(), settings=replace(wall().settings, texture_limit=16), device=device)
    own.render(1)
    np.testing.assert_allclose(own.image(), 0.5, atol=0.01)


def test_without_room_a_line_names_the_setting(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise DeviceError("device memory ran out")

    monkeypatch.setattr(TexturePool, "hold", full)
    with pytest.raises(
        DeviceError, match=r"^textures: .*; or halve large ones by texture_limit in \[render\]$"
    ):
        texture_tables(device, {})
