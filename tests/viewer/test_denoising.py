"""The thread that denoises: what it takes, and what is shown of it. The library is not needed for that."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.small_scenes import mixed_scene

from incpt.picture import denoise
from incpt.render import tiles
from incpt.render.first_hits import FirstHits
from incpt.render.impact.findings import Findings
from incpt.render.modes import Mode
from incpt.scene.model import Scene
from incpt.viewer.denoising import DenoisingThread, is_worth_denoising
from incpt.viewer.view import Frame, Picture, View

WIDTH, HEIGHT = 44, 28
SCENE = mixed_scene()


def hits(size: tuple[int, int] = (HEIGHT, WIDTH)) -> FirstHits:
    return FirstHits(
        np.zeros(size, np.int32), np.zeros((*size, 3), np.float32), np.ones(size, np.float32),
        np.full((*size, 3), 0.5, np.float32),
    )  # fmt: skip


def frame(scene: Scene = SCENE, spp: int = 2, value: float = 0.2, **changes: Any) -> Frame:
    """A picture that alternates around a value."""
    image = np.ones((HEIGHT, WIDTH, 4), np.float32)
    image[..., :3] = value
    image[::2, ::2, :3] *= 1.5
    grid = tiles.TileGrid(WIDTH, HEIGHT, 8)
    spps = np.full(grid.count, spp, np.int64)
    mode = changes.pop("mode", Mode.REFINE)
    picture = Picture(
        image, grid, mode, tiles.base_queue(grid), 0, spps, spps > 0, 0.0, None, "impact",
        findings=changes.pop("findings", None),
    )  # fmt: skip
    view = View(scene, denoise=changes.pop("denoise", True), before=changes.pop("before", None))
    made = Frame(view, (picture,), False, 0.0, 0.0, "device", hits(), 0, 0.0, False)
    return replace(made, **changes)


class Hand:
    """A thread, and what it has told."""

    def __init__(self) -> None:
        self.done: list[Frame] = []
        self.problems: list[str] = []
        self.news = threading.Event()
        self.thread = DenoisingThread(self._take, self._tell)

    def _take(self, shown: Frame) -> None:
        self.done.append(shown)
        self.news.set()

    def _tell(self, text: str) -> None:
        self.problems.append(text)
        self.news.set()

    def wait(self) -> None:
        assert self.news.wait(20)
        self.news.clear()


@pytest.fixture
def hand(monkeypatch: pytest.MonkeyPatch) -> Iterator[Hand]:
    """With a denoiser that makes everything the mean."""

    def flat(image: Any, *guides: Any) -> Any:
        assert len(guides) in (0, 2)
        return np.broadcast_to(image.mean(axis=(0, 1)), image.shape).astype(np.float32)

    monkeypatch.setattr(denoise, "denoise", flat)
    monkeypatch.setattr("incpt.viewer.denoising._REST_SHARE", 0.0)
    hand = Hand()
    yield hand
    hand.thread.close()


def test_a_denoised_picture_comes_later_and_stays_until_the_next(hand: Hand) -> None:
    first = frame()
    assert hand.thread.shown(first) is first
    hand.wait()
    (done,) = hand.done
    (picture,) = done.pictures
    assert picture.denoised is not None and picture.image is first.pictures[0].image
    assert picture.shown is picture.denoised
    assert np.ptp(picture.denoised[..., :3], axis=(0, 1)).max() < 1e-4
    assert (picture.denoised[..., 3] == 1).all()
    # A few samples more are not worth another one.
    more = hand.thread.shown(frame(spp=2))
    assert more.pictures[0].denoised is picture.denoised
    assert not hand.news.wait(0.1)


def test_another_scene_is_shown_as_it_is_rendered(hand: Hand) -> None:
    hand.thread.shown(frame())
    hand.wait()
    edited = frame(SCENE.with_object("red cube", position=(1, 1, 1)), value=0.6)
    assert hand.thread.shown(edited) is edited
    hand.wait()
    shown = hand.done[-1].pictures[0]
    assert shown.denoised is not None and shown.denoised[..., :3].mean() > 0.5
    # The scene before is not remembered.
    assert hand.thread.shown(frame()).pictures[0].denoised is None
    hand.wait()


def test_what_is_no_longer_asked_for_is_not_shown(hand: Hand) -> None:
    hand.thread.shown(frame())
    hand.wait()
    off = frame(denoise=False)
    assert hand.thread.shown(off) is off
    hand.thread.shown(frame(spp=100))
    hand.thread.shown(frame(denoise=False))
    time.sleep(0.1)
    assert all(one.view.denoise for one in hand.done)


def test_little_noise_leaves_the_picture_alone(hand: Hand) -> None:
    for spp in (1000, 4000):
        hand.thread.shown(frame(spp=spp))
        time.sleep(0.2)
    assert hand.thread.shown(frame(spp=4000)).pictures[0].denoised is None


def test_after_an_edit_the_error_that_is_left_is_noise(hand: Hand) -> None:
    """What was kept is left alone, and what is not found yet is denoised."""
    for spp in (500, 1000):
        hand.thread.shown(frame(spp=spp))
        time.sleep(0.2)
    grid = frame().pictures[0].grid
    error = np.zeros(grid.count)
    error[grid.tile_of_pixels()[4, 4]] = 1.0
    none = np.zeros(grid.count)
    found = Findings(0.5, error, none, none.copy(), none.copy())
    moved = SCENE.with_object("red cube", position=(1, 1, 1))
    edited = frame(moved, spp=1000, findings=found, mode=Mode.INCREMENTAL)
    hand.thread.shown(edited)
    hand.wait()
    shown, image = hand.done[-1].pictures[0].shown, edited.pictures[0].image
    assert (shown[4, 4] != image[4, 4]).any()
    np.testing.assert_array_equal(shown[16:, 32:], image[16:, 32:])


def test_what_fails_is_told_once(hand: Hand, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> None:
        raise RuntimeError("no weights\nat all")

    monkeypatch.setattr(denoise, "denoise", fail)
    hand.thread.shown(frame())
    hand.wait()
    assert hand.problems == ["denoising has stopped: no weights at all"]
    again = frame(spp=64)
    assert hand.thread.shown(again) is again


def test_what_is_worth_it() -> None:
    assert is_worth_denoising(frame(), None)
    assert not is_worth_denoising(frame(denoise=False), None)
    assert not is_worth_denoising(frame(before=SCENE), None)
    assert not is_worth_denoising(frame(is_preview=True), None)
    assert not is_worth_denoising(frame(first_hits=None), None)
    assert not is_worth_denoising(frame(first_hits=hits((14, 22))), None)
    assert is_worth_denoising(frame(SCENE.with_camera(f_stop=2.8), first_hits=None), None)
    assert not is_worth_denoising(frame(spp=0, mode=Mode.BASE), None)
    assert is_worth_denoising(frame(spp=20), 16) and not is_worth_denoising(frame(spp=17), 16)
    assert is_worth_denoising(frame(spp=17, resting=True), 16)
    assert not is_worth_denoising(frame(spp=16, resting=True), 16)


def test_a_view_with_denoising_wants_first_hits_but_behind_a_lens() -> None:
    assert View(SCENE, denoise=True).needs_first_hits and not View(SCENE).needs_first_hits
    assert not View(SCENE.with_camera(f_stop=2.8), denoise=True).needs_first_hits
