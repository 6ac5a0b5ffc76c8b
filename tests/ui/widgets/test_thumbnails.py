"""Small pictures of images: what is in them, that each is made once, and that they go again."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from support.parameters import A_TEXTURE
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, desk

from incpt.core.layout import TextureSlot
from incpt.formats import bitmaps
from incpt.picture.color import linear_from_srgb
from incpt.scene.selection import Selection
from incpt.scene.texture import Bitmap, BitmapSource, Texture
from incpt.ui.commands import files
from incpt.ui.panels import textures
from incpt.ui.widgets import thumbnails
from incpt.ui.widgets.thumbnails import Thumbnails, reduced

LIT = mixed_scene(size=(48, 32)).with_material("red", normal_texture=A_TEXTURE)
SCENE = LIT.with_environment(image=None)


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        made.editor.select(Selection(("red cube",)))
        made.frames(2)
        yield made


def kept(user: Desk) -> Thumbnails:
    return user.workspace._thumbnails


# -------------------------------------------------------------------------------------- what is in them


def test_the_longer_side_fits_and_colours_stay() -> None:
    pixels = np.zeros((40, 80, 3), np.uint8)
    pixels[:, :40], pixels[:, 40:] = (200, 100, 0), (0, 50, 255)
    small = reduced(pixels, 16)
    assert small.shape == (8, 16, 4) and small.dtype == np.uint8 and (small[..., 3] == 255).all()
    assert (small[:, :8, :3] == (200, 100, 0)).all() and (small[:, 8:, :3] == (0, 50, 255)).all()
    assert reduced(pixels[:1, :1], 16).shape == (16, 16, 4)
    assert reduced(np.zeros((1, 9000, 1), np.uint8), 16).shape == (1, 16, 4)


def test_every_kind_of_number_is_shown_alike() -> None:
    grey = reduced(np.full((4, 4, 1), 128, np.uint8), 4)
    assert (grey[..., :3] == 128).all()
    assert np.array_equal(reduced(np.full((4, 4, 1), 128 * 257, np.uint16), 4), grey)
    linear = np.full((4, 4, 3), linear_from_srgb(128 / 255), np.float32)
    assert np.array_equal(reduced(linear, 4), grey)
    bright = reduced(np.full((4, 4, 3), 1e6, np.float32), 4)
    assert (bright == 255).all()


def test_what_is_transparent_shows_squares() -> None:
    clear = np.zeros((32, 32, 4), np.uint8)
    shown = reduced(clear, 32)
    assert len(np.unique(shown[..., 0])) == 2
    half = np.dstack([np.full((32, 32), 255, np.uint8), np.full((32, 32), 128, np.uint8)])
    assert reduced(half, 32)[..., 0].min() > shown[..., 0].min()


# ------------------------------------------------------------------------------------------ their life


def test_each_is_made_once_and_freed_when_nobody_draws_it(
    user: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[int] = []
    real = thumbnails.reduced
    monkeypatch.setattr(
        thumbnails, "reduced", lambda pixels, side: (made.append(side), real(pixels, side))[1]
    )
    monkeypatch.setattr(thumbnails, "_UNUSED_FRAMES", 5)
    assert user.shows("thumbnail normal_texture") and kept(user).count == 1
    before = len(imgui.get_platform_io().textures)
    user.frames(10)
    assert not made, "it is there already"
    user.editor.select(Selection())
    user.frames(10)
    assert kept(user).count == 0 and len(imgui.get_platform_io().textures) == before - 1
    user.editor.select(Selection(("red cube",)))
    user.frames(3)
    assert len(made) == 1 and kept(user).count == 1


def test_the_oldest_go_where_there_are_too_many(user: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(thumbnails, "_MOST", 3)
    many = [Bitmap(np.full((2, 2, 3), i, np.uint8)) for i in range(6)]
    for one in many:
        user.begin()
        kept(user).begin_frame()
        kept(user).draw(one, one.pixels, 20.0)
        user.end()
    user.begin()
    kept(user).begin_frame()
    user.end()
    assert kept(user).count == 3


# ----------------------------------------------------------------------------------- where they stand


def test_a_drop_goes_to_the_material_that_is_shown(user: Desk, tmp_path: Path) -> None:
    """The one that is chosen in the list, which the active object need not have."""
    bitmaps.write_bitmap(tmp_path / "wood.png", A_TEXTURE.bitmap)
    user.panel("Materials")
    user.click("material grey")
    user.click("Textures")
    user.frames(3)
    slot = textures.slot_at(*user.place("Choose…##base_color_texture"))
    assert slot == ("grey", TextureSlot.BASE_COLOR)
    files.drop(user.editor, tmp_path / "wood.png", slot)
    assert user.scene.materials["grey"].base_color_texture is not None
    assert user.scene.materials["red"] == SCENE.materials["red"]
    user.frames(2)
    assert user.shows("thumbnail base_color_texture")
    texture = user.scene.materials["grey"].base_color_texture
    drawn = [one for one in kept(user)._kept.values() if one.owner is texture.bitmap]
    assert len(drawn) == 2, "in the row and in the list"


def test_it_is_said_what_is_from_where() -> None:
    wood = Texture(Bitmap(np.zeros((4, 8, 3), np.uint8), BitmapSource("/w/wood.png")), uv_set=1)
    assert textures.kind_text(TextureSlot.BASE_COLOR, wood) == "8 × 4, 8-bit RGB, colours in sRGB, UV set 1"
    assert "plain numbers" in textures.kind_text(TextureSlot.NORMAL, wood)
    light = Texture(Bitmap(np.zeros((4, 8, 2), np.float32)))
    assert textures.kind_text(TextureSlot.EMISSION, light) == (
        "8 × 4, 32-bit float grey and alpha, linear colours, UV set 0"
    )
    missing = Texture(Bitmap(np.zeros((1, 1, 4), np.uint16), is_placeholder=True))
    assert textures.kind_text(TextureSlot.BUMP, missing).startswith("missing, 16-bit RGB and alpha")


def test_the_environment_has_one_too(user: Desk) -> None:
    user.editor.propose(LIT, "Sky")
    user.panel("Scene")
    user.frames(3)
    assert user.shows("thumbnail environment")
