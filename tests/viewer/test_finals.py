"""Final renders beside the view: what is in the files, and who goes first."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import PIL.Image
import pytest
from support.small_scenes import mixed_scene

from incpt.core.errors import InputError, OutputError
from incpt.device.device import Device
from incpt.picture import denoise
from incpt.picture.tone_mapping import tone_map
from incpt.render.final import FinalRender, FinalSettings
from incpt.render.session import Session
from incpt.viewer import finals
from incpt.viewer.renderer import EndFinal, Exported, Finals, Message, Problem, RenderFinal
from incpt.viewer.threaded import ThreadedRenderer
from incpt.viewer.view import Frame, View

PATIENCE = 60.0
SCENE = mixed_scene()
LARGE = replace(SCENE, settings=replace(SCENE.settings, size=(60, 52)))


@pytest.fixture
def renderer(device: Device, monkeypatch: pytest.MonkeyPatch) -> Iterator[ThreadedRenderer]:
    monkeypatch.setattr(finals, "_TELLING_SECONDS", 0.0)
    renderer = ThreadedRenderer(device)
    yield renderer
    renderer.close()


def said_until(renderer: ThreadedRenderer, kind: type, count: int = 1) -> list[Message]:
    """All messages up to the `count`-th of that kind."""
    said: list[Message] = []
    end = time.monotonic() + PATIENCE
    while sum(isinstance(one, kind) for one in said) < count:
        assert time.monotonic() < end, said
        said += renderer.poll()
        time.sleep(0.002)
    return said


def read_exr(path: Path) -> np.ndarray:
    return np.asarray(OpenEXR.File(str(path)).channels()["RGB"].pixels)


def test_a_file_has_the_picture_of_its_own_scene_while_another_is_shown(
    renderer: ThreadedRenderer, device: Device, tmp_path: Path
) -> None:
    renderer.show(View(SCENE, step_ms=2))
    for name in "ab":
        renderer.request(RenderFinal(LARGE, FinalSettings(tmp_path / f"{name}.exr", spp=6)))
    edited = SCENE.with_object("red cube", position=(0.4, 0.5, 0.4))
    renderer.show(View(edited, step_ms=2))
    said = said_until(renderer, Exported, 2)
    assert [one for one in said if isinstance(one, Exported)] == [
        Exported(tmp_path / "a.exr", (60, 52)), Exported(tmp_path / "b.exr", (60, 52))
    ]  # fmt: skip
    told = [one.current for one in said if isinstance(one, Finals)]
    shares = [one.share for one in told if one is not None and one.path.stem == "a"]
    assert shares == sorted(shares) and shares[0] == 0 and shares[-1] <= 1
    assert [one.waiting for one in told if one is not None][-1] == 0
    frames = [one for one in said if isinstance(one, Frame)]
    assert frames and frames[-1].view.scene is edited, "the view goes on"
    session = Session(LARGE, device=device)
    session.render(6)
    for name in "ab":
        assert np.array_equal(read_exr(tmp_path / f"{name}.exr"), session.image())


def test_an_edit_is_answered_first(device: Device) -> None:
    renderer = ThreadedRenderer(device)
    try:
        steps: list[bool] = []
        queue = finals.FinalQueue.advance
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(finals.FinalQueue, "advance", lambda self, s: (steps.append(True), queue(self, s)))
            renderer.show(View(SCENE, step_ms=2))
            said_until(renderer, Frame, 3)
            renderer.request(RenderFinal(SCENE, FinalSettings(Path("never.exr"), spp=1 << 20)))
            said_until(renderer, Frame, 3)
            assert steps
            edited = SCENE.with_object("red cube", position=(0.4, 0.5, 0.4))
            renderer.show(View(edited, before=SCENE, step_ms=2))
            said_until(renderer, Frame, 2)
            before = len(steps)
            said_until(renderer, Frame, 3)
            assert len(steps) == before, "a final render took its time while something was dragged"
            renderer.show(View(edited, step_ms=2))
            said_until(renderer, Frame, 3)
            assert len(steps) > before
    finally:
        renderer.close()
    assert not Path("never.exr").exists()


def test_one_is_given_up_and_another_kept_as_it_is(renderer: ThreadedRenderer, tmp_path: Path) -> None:
    renderer.show(View(SCENE, step_ms=2))
    for name in "ab":
        renderer.request(RenderFinal(SCENE, FinalSettings(tmp_path / f"{name}.png", spp=1 << 20)))
    said_until(renderer, Finals, 4)
    renderer.request(EndFinal(is_kept=False))
    said_until(renderer, Finals, 6)
    renderer.request(EndFinal(is_kept=True))
    said = said_until(renderer, Exported)
    assert [one for one in said if isinstance(one, Exported)] == [Exported(tmp_path / "b.png", (44, 28))]
    while Finals(None) not in said:
        said += said_until(renderer, Finals)
    assert not (tmp_path / "a.png").exists()
    with PIL.Image.open(tmp_path / "b.png") as file:
        assert np.asarray(file).min() < np.asarray(file).max()


def test_what_cannot_be_written_is_a_problem_and_the_next_comes(
    renderer: ThreadedRenderer, tmp_path: Path
) -> None:
    renderer.show(View(SCENE, step_ms=2))
    for name in ("missing/a.png", "b.png"):
        renderer.request(RenderFinal(SCENE, FinalSettings(tmp_path / name, spp=1)))
    said = said_until(renderer, Exported)
    (problem,) = [one for one in said if isinstance(one, Problem)]
    assert "missing" in problem.text and not problem.fatal and (tmp_path / "b.png").exists()


def test_time_ends_it_once_there_is_a_whole_picture(device: Device, tmp_path: Path) -> None:
    wanted = FinalSettings(tmp_path / "a.png", spp=1 << 20, seconds=1e-9)
    final = FinalRender(Session(SCENE, settings=wanted.of_session(SCENE.settings), device=device), wanted)
    steps = 0
    while not final.is_done:
        assert final.share in (0.0, 1.0)
        final.step(4)
        steps += 1
    assert steps > 1 and final.spp == 1
    final.write()
    with PIL.Image.open(tmp_path / "a.png") as file:
        assert np.abs(np.asarray(file).astype(int) - tone_map(final.session.image())).max() <= 1


def test_what_cannot_be_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for path, values in (("a.gif", {}), ("a.png", {"spp": 0}), ("a.png", {"seconds": 0.0})):
        with pytest.raises(InputError):
            FinalSettings(tmp_path / path, **values)  # type: ignore[arg-type]
    monkeypatch.setattr(denoise, "is_available", lambda: False)
    with pytest.raises(InputError, match="not installed"):
        FinalSettings(tmp_path / "a.png", denoise=True)
    (tmp_path / "folder.png").mkdir()
    for path in ("folder.png", "missing/a.png"):
        with pytest.raises(OutputError):
            FinalSettings(tmp_path / path).check_place()


def test_a_picture_that_cannot_be_written_is_rescued(
    renderer: ThreadedRenderer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rescue = tmp_path / "rescue"
    rescue.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(rescue))
    renderer.show(View(SCENE, step_ms=2))
    gone = tmp_path / "gone"
    for has_room in (True, False):
        gone.mkdir()
        wanted = FinalSettings(gone / "a.exr", spp=1)
        wanted.check_place()
        gone.rmdir()
        if not has_room:
            monkeypatch.setattr(tempfile, "tempdir", str(gone))
        renderer.request(RenderFinal(SCENE, wanted))
        line = next(one.text for one in said_until(renderer, Problem) if isinstance(one, Problem))
        assert line.startswith(str(gone / "a.exr"))
        (written,) = rescue.rglob("a.exr")
        assert line.endswith(f"; the picture is in {written}") == has_room
    assert np.isfinite(read_exr(written)).all()
