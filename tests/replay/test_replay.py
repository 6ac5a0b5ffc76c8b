"""Headless edit sessions: what is captured when, against what, and what is left in the folder."""

from __future__ import annotations

import csv
import signal
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from incpt.cli.main import main
from incpt.core.errors import InputError
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.formats.edit_script import Edit, EditScript, load_edits
from incpt.formats.registry import load
from incpt.picture.metrics import normalized_rmse, relative_mse
from incpt.picture.tone_mapping import tone_map
from incpt.render.session import Session
from incpt.replay.contact_sheet import Block, Cell, Row, contact_sheet
from incpt.replay.replay import Capture, Converged, Replay, Variant, variants
from incpt.scene.camera import Camera
from incpt.scene.change import diff
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

SETTINGS = RenderSettings(size=(40, 32), tile_size=8, nor=8, max_bounces=1)
RESTART, SPIRAL = Variant("restart", 8), Variant("spiral", 8)


def scene() -> Scene:
    materials = {"red": Material((0.8, 0.1, 0.1)), "grey": Material((0.5, 0.5, 0.5), roughness=0.4)}
    cube = Object("cube", shape("cube"), "red", position=(0, 0.5, 0))
    floor = Object("floor", shape("plane"), "grey", scale=(9, 1, 9))
    return Scene(Camera(), Environment((0.6, 0.7, 0.8)), materials, (cube, floor), SETTINGS)


def edit(step: int, capture: tuple[int, ...], label: str = "turn", **changes: object) -> Edit:
    return Edit(step, label, "object", "cube", changes or {"rotation": (0.0, 40.0, 0.0)}, capture)


@pytest.fixture(scope="module")
def device() -> Device:
    return Device()


def pictures(plan: Replay, device: Device) -> tuple[dict[int | None, np.ndarray], list[Capture]]:
    made = list(plan.pictures(device, lambda what, report: None))
    converged = {p.edit: p.image for p in made if isinstance(p, Converged)}
    return converged, [p for p in made if isinstance(p, Capture)]


def test_variants_are_listed_once() -> None:
    assert variants(["restart", "spiral", "restart"], [64, 256]) == [
        Variant("restart", 64),
        Variant("spiral", 64),
        Variant("spiral", 256),
    ]
    assert [v.label for v in variants(["restart", "spiral"], [64])] == ["restart", "spiral, NoR 64"]
    assert [v.slug for v in variants(["restart", "spiral"], [64])] == ["restart", "spiral64"]


def test_separate_edits_each_start_from_the_base_picture(device: Device) -> None:
    script = EditScript((edit(0, (0, 3)), edit(2, (1,), position=(0.6, 0.5, 0.0))), cumulative=False)
    plan = Replay(scene(), script, [RESTART, SPIRAL], SETTINGS, base_spp=5, reference_spp=7)
    converged, captures = pictures(plan, device)
    assert [(c.edit, c.variant, c.step) for c in captures] == [
        (i, v, s) for i, steps in ((0, (0, 3)), (1, (1,))) for v in (RESTART, SPIRAL) for s in steps
    ]
    for capture in captures:
        session = Session(scene(), settings=capture.variant.settings(SETTINGS), device=device)
        session.render(5)
        for _ in range(script[capture.edit].step):
            session.step()
        session.edit(script[capture.edit].apply(scene()))
        reports = [session.step() for _ in range(capture.step)]
        assert np.array_equal(capture.image, session.image())
        assert capture.mode is session.mode
        assert capture.paths == sum(report.paths for report in reports)
        assert (capture.seconds > 0) == (capture.step > 0)
        reference = converged[capture.edit]
        assert capture.normalized_rmse == normalized_rmse(session.image(), reference) > 0
        assert capture.relative_mse == relative_mse(session.image(), reference) > 0


def test_edits_that_follow_each_other(device: Device) -> None:
    second = edit(2, (0, 1), position=(0.6, 0.5, 0.0))
    script = EditScript((edit(0, (1, 2, 9)), second, edit(2, (4,), scale=(0.5, 0.5, 0.5))))
    plan = Replay(scene(), script, [SPIRAL], SETTINGS, base_spp=3, reference_spp=4)
    assert [timed.captures for timed in plan.runs[0]] == [(1,), (), (4,)]
    assert plan.left_out == 4
    converged, captures = pictures(plan, device)
    assert set(converged) == {None, 0, 2}  # nothing is captured between the second and the third
    session = Session(scene(), settings=SPIRAL.settings(SETTINGS), device=device)
    session.render(3)
    scenes = script.scenes(scene())
    session.edit(scenes[0])
    session.step()
    assert np.array_equal(captures[0].image, session.image())
    session.step()
    session.edit(scenes[1])
    session.edit(scenes[2])
    for _ in range(4):
        session.step()
    assert np.array_equal(captures[1].image, session.image())


def test_what_is_kept_is_not_compared_with_itself(device: Device) -> None:
    plan = Replay(scene(), EditScript((edit(0, (0,)),)), [SPIRAL], SETTINGS, base_spp=8, reference_spp=8)
    converged, (capture,) = pictures(plan, device)
    assert np.array_equal(capture.image, converged[None])
    corner = (
        capture.image[-8:, :8],
        converged[0][-8:, :8],
    )  # of the floor, where the edit changes next to nothing
    assert (corner[0] != corner[1]).mean() > 0.9


def test_a_converged_picture_is_that_of_a_fresh_render(device: Device) -> None:
    plan = Replay(scene(), EditScript((edit(0, (0,)),)), [SPIRAL], SETTINGS, base_spp=2, reference_spp=6)
    converged, _ = pictures(plan, device)
    fresh = Session(edit(0, (0,)).apply(scene()), settings=replace(SETTINGS, seed=1), device=device)
    fresh.render(6)
    assert np.allclose(converged[0], fresh.image(), rtol=1e-5, atol=1e-6)


def test_nothing_to_capture_is_refused() -> None:
    script = EditScript((edit(0, (5,)), edit(3, (0,)), edit(3, (2,))))
    assert Replay(scene(), script, [SPIRAL], SETTINGS).runs[0][2].captures == (2,)
    script = EditScript((edit(0, (5,)), replace(edit(3, (0,)), capture=())))
    with pytest.raises(InputError, match="give the edits later steps"):
        Replay(scene(), script, [SPIRAL], SETTINGS)


def test_the_progress_total_counts_everything() -> None:
    script = EditScript((edit(0, (0, 3)), edit(2, (1,))), cumulative=False)
    plan = Replay(scene(), script, [RESTART, SPIRAL], SETTINGS, base_spp=5, reference_spp=7)
    assert plan.paths_per_pixel == 5 + 2 * 7 + 2 * (3 + (2 + 1))


# --------------------------------------------------------------------------------------- the command

SCENE_FILE = """
version = 1
[environment]
color = [0.6, 0.7, 0.8]
[render]
size = [40, 32]
tile_size = 8
nor = 8
max_bounces = 1
[materials.red]
base_color = [0.8, 0.1, 0.1]
[[objects]]
name = "cube"
shape = "cube"
position = [0, 1, 0]
material = "red"
"""

EDITS_FILE = """
cumulative = false
capture = [0, 2]
[[edits]]
name = "Turn, a little!"
object = "cube"
rotation = [0, 30, 0]
[[edits]]
object = "cube"
scale = [0.5, 0.5, 0.5]
capture = [1]
"""


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    (tmp_path / "scene.toml").write_text(SCENE_FILE)
    (tmp_path / "edits.toml").write_text(EDITS_FILE)
    names = [str(tmp_path / name) for name in ("scene.toml", "edits.toml")]
    return ["replay", *names, "--base-spp", "3", "--reference-spp", "4"]


def read_errors(folder: Path) -> list[dict[str, str]]:
    with open(folder / "errors.csv", newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.slow
def test_the_command_leaves_pictures_sheet_and_errors(
    files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "new" / "out"
    assert main([*files, "-o", str(folder)]) == 0
    names = {path.name for path in folder.iterdir()}
    turned = {f"1-turn-a-little-{v}-step00{s}.png" for v in ("restart", "spiral8", "impact") for s in (0, 2)}
    shrunk = {f"2-cube-{v}-step001.png" for v in ("restart", "spiral8", "impact")}
    converged = {"base.png", "1-turn-a-little-converged.png", "2-cube-converged.png"}
    assert names == turned | shrunk | converged | {"errors.csv", "sheet.png"}
    assert all(PIL.Image.open(folder / name).size == (40, 32) for name in turned | shrunk | converged)
    rows = read_errors(folder)
    assert [(r["edit"], r["strategy"], r["step"]) for r in rows] == [
        ("1", "restart", "0"),
        ("1", "restart", "2"),
        ("1", "spiral", "0"),
        ("1", "spiral", "2"),
        ("1", "impact", "0"),
        ("1", "impact", "2"),
        ("2", "restart", "1"),
        ("2", "spiral", "1"),
        ("2", "impact", "1"),
    ]
    printed = capsys.readouterr().out
    for row in rows:
        assert f"{float(row['normalized_rmse']):.4f}" in printed
    base = np.asarray(PIL.Image.open(folder / "base.png"))
    assert np.array_equal(base, PIL.Image.open(folder / "1-turn-a-little-spiral8-step000.png"))


def test_options_choose_the_variants(files: list[str], tmp_path: Path) -> None:
    options = ["--strategy", "spiral", "--nor", "4", "--nor", "16", "--size", "24x16", "--seed", "5"]
    assert main([*files, "-o", str(tmp_path / "out"), *options]) == 0
    assert {(r["strategy"], r["nor"]) for r in read_errors(tmp_path / "out")} == {
        ("spiral", "4"),
        ("spiral", "16"),
    }
    assert PIL.Image.open(tmp_path / "out" / "base.png").size == (24, 16)


def test_ctrl_c_keeps_the_captures_so_far(
    files: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    edit_once = Session.edit
    calls: list[Scene] = []

    def press_at_the_third_edit(self: Session, *given: object, **more: object) -> object:
        calls.append(self.scene)
        if len(calls) == 3:  # converged picture, restart, spiral
            signal.raise_signal(signal.SIGINT)
        return edit_once(self, *given, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(Session, "edit", press_at_the_third_edit)
    folder = tmp_path / "out"
    assert main([*files, "-o", str(folder)]) == 130
    assert "holds what was done" in capsys.readouterr().err.splitlines()[-1]
    kept = [(r["strategy"], r["step"]) for r in read_errors(folder)]
    assert kept == [("restart", "0"), ("restart", "2"), ("spiral", "0")]
    assert (folder / "sheet.png").exists()


def test_captures_that_are_left_out_are_told(
    files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path(files[2]).write_text(EDITS_FILE.replace("cumulative = false", ""))
    assert main([*files, "-o", str(tmp_path / "out"), "--strategy", "restart"]) == 0
    assert "2 captures come after the next edit" in capsys.readouterr().err


# ------------------------------------------------------------------------------------ the contact sheet


def test_the_sheet_has_rows_of_strategies_and_columns_of_steps() -> None:
    colors = np.arange(1, 7, dtype=np.uint8)[:, None] * np.array([20, 30, 40], np.uint8)
    cells = [Cell(np.broadcast_to(color, (30, 50, 3)), "a caption") for color in colors]
    sheet = contact_sheet(
        [
            Block("one", [Row("restart", cells[:2]), Row("spiral", cells[2:4])]),
            Block("two", [Row("x", cells[4:])]),
        ]
    )
    boxes = []
    for color in colors:
        y, x = np.nonzero((sheet == color).all(axis=2))
        assert len(x) == 30 * 50, "whole and nothing over it"
        boxes.append((int(x.min()), int(y.min())))
    columns, rows = [x for x, _ in boxes], [y for _, y in boxes]
    assert columns == columns[:2] * 3
    assert columns[1] > columns[0] + 50
    assert rows[0] == rows[1] < rows[2] == rows[3] < rows[4] == rows[5]


def test_wide_pictures_are_scaled_down() -> None:
    wide = np.zeros((200, 2000, 3), np.uint8)
    sheet = contact_sheet([Block("one", [Row("restart", [Cell(wide, "0"), Cell(wide, "1")])])])
    assert sheet.shape[1] < 1100
    black = (sheet == 0).all(axis=2)
    assert black.sum(axis=1).max() == 960


def test_the_sheet_shows_text() -> None:
    white = np.full((10, 100, 3), 255, np.uint8)
    block = Block("title", [Row("label", [Cell(white, "caption")])])
    assert (contact_sheet([block]) < 100).any()
    assert (tone_map(np.full((1, 1, 3), 1e6)) == 255).all()


def test_the_demo_makes_the_edits_of_the_thesis() -> None:
    folder = Path(str(resources.files("incpt.scenes")))
    before = load(folder / "editing.toml")
    script = load_edits(folder / "editing.edits.toml", before)
    assert not script.cumulative
    changed = [diff(before, after).moved for after in script.scenes(before)]
    assert changed == [{"small grey cube"}, {"red cube"}, {"large translucent cube"}]
