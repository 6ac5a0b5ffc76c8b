"""Impact beside others: what counts as a path and as time, which pictures are compared, and the tables."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.small_scenes import mixed_scene, small_settings

from incpt.benchmarks.impact import tables
from incpt.benchmarks.impact.bench import DRAG_VARIANTS, ImpactBench, Purse, Variant, variants
from incpt.benchmarks.impact.edits import DRAG_STEPS, EDITS, FIRST_STEPS, STAGES, drag_step
from incpt.benchmarks.impact.pictures import write_pictures
from incpt.benchmarks.impact.tasks import Plan
from incpt.benchmarks.kit.denoise import Denoiser
from incpt.benchmarks.kit.pictures import FloatImage, Gallery
from incpt.benchmarks.kit.store import Record, Results, read
from incpt.benchmarks.measures.edits import EditBench
from incpt.cli import main
from incpt.device.device import Device
from incpt.picture.metrics import normalized_rmse
from incpt.render.modes import Mode
from incpt.render.session import Session, StepReport
from incpt.scene.change import affected_objects, diff

SCENE = mixed_scene()
AFTER = SCENE.with_object("red cube", position=(0.3, 0.5, 0.2))
SETTINGS = small_settings()
RESTART, DENOISED, SPIRAL, IMPACT = (
    Variant("restart", "restart"),
    Variant("restart + OIDN", "restart", denoised=True),
    Variant("spiral 4", "spiral", 4),
    Variant("impact", "impact"),
)


def nothing(fraction: float) -> None:
    assert 0 <= fraction <= 1


@pytest.fixture
def bench(device: Device, tmp_path: Path) -> ImpactBench:
    return ImpactBench(device, Gallery(tmp_path / "references", device), 64)


@pytest.fixture
def start(bench: ImpactBench) -> EditBench:
    return bench.start(SCENE, "editing", 32)


# --------------------------------------------------------------------------------------------- edits


@pytest.mark.parametrize("name", EDITS)
def test_every_edit_changes_what_is_seen(name: str) -> None:
    edit = EDITS[name]
    change = diff(edit.between or edit.before, edit.after)
    assert not change.camera and change.is_local != change.is_global
    assert change.is_global or affected_objects(edit.between or edit.before, edit.after, change)
    assert edit.between is None or diff(edit.before, edit.between).is_local
    assert not (change.is_global and edit.local)
    assert edit.before is edit.before and edit.after is edit.after


def test_edits_are_those_of_the_method_and_many_of_other_kinds() -> None:
    names = list(EDITS)
    assert len(names) == 31
    kinds = set()
    for name in names[15:]:
        change = diff(EDITS[name].before, EDITS[name].after)
        kinds |= {key for key, value in vars(change).items() if value}
        kinds |= {"two"} if len(change.objects) == 2 else set()
        kinds |= {"three materials"} if len(change.materials) == 3 else set()
    assert {
        "deformed",
        "added",
        "removed",
        "moved",
        "reshaped",
        "reassigned",
        "two",
        "three materials",
        "materials",
        "environment",
    } <= kinds


def test_a_drag_ends_after_its_steps() -> None:
    scene = STAGES["cornell"].scene
    assert not diff(scene, drag_step(scene, 0)).moved
    places = [drag_step(scene, number).object("short block").position for number in range(DRAG_STEPS + 1)]
    steps = np.diff(places, axis=0)
    np.testing.assert_allclose(steps, np.broadcast_to(steps[0], steps.shape), atol=1e-12)


# --------------------------------------------------------------------------------------- equal paths


@pytest.mark.slow
def test_a_first_edit_is_made_and_rendered_before(bench: ImpactBench, start: EditBench) -> None:
    first = SCENE.with_object("red cube", position=(0.1, 0.5, 0.2))
    (shown,) = bench.after_steps(start, AFTER, IMPACT, SETTINGS, (1,), nothing, first)
    session = start.at(start.start(IMPACT.settings(SETTINGS), nothing))
    session.edit(first)
    Purse(session).spend(FIRST_STEPS)
    session.edit(AFTER)
    Purse(session).spend(1)
    np.testing.assert_array_equal(shown.image, session.image())
    (alone,) = bench.after_steps(start, AFTER, IMPACT, SETTINGS, (1,), nothing)
    assert not np.array_equal(shown.image, alone.image)


@pytest.mark.slow
@pytest.mark.parametrize("variant", [RESTART, SPIRAL, IMPACT])
def test_as_many_paths_are_spent_as_a_mark_allows(start: EditBench, variant: Variant) -> None:
    session = start.at(start.start(variant.settings(SETTINGS), nothing))
    session.edit(AFTER)
    purse, reports = Purse(session), []
    step = session.step

    def reported(slots: int | None = None) -> StepReport:
        reports.append(step(slots))
        return reports[-1]

    session.step = reported  # type: ignore[method-assign]
    grid = session.grid
    for mark in (1, 2, 7):
        purse.spend(mark)
        spent = sum(report.paths + report.partners for report in reports)
        assert purse.paths == spent
        # Half a tile's worth is left at most, and a tile with all its partners too much.
        assert abs(spent - mark * grid.count * 64) <= 128
        assert purse.steps == spent / (grid.count * 64)
    assert (sum(report.partners for report in reports) > 0) == (variant is IMPACT)


def test_compared_pictures_are_those_of_a_session(bench: ImpactBench, start: EditBench) -> None:
    for variant in (RESTART, SPIRAL):
        found = list(bench.after_steps(start, AFTER, variant, SETTINGS, (1, 3), nothing))
        assert [(one.mark, one.steps) for one in found] == [("1 steps", 1.0), ("3 steps", 3.0)]
        session = Session(SCENE, settings=variant.settings(SETTINGS), device=bench.device)
        session.render(32)
        session.edit(AFTER)
        for _ in range(3):
            session.step()
        np.testing.assert_allclose(found[1].image, session.image(), rtol=1e-4, atol=1e-5)


def test_impact_goes_on_from_the_kept_picture(bench: ImpactBench, start: EditBench) -> None:
    truth = start.reference(AFTER, SETTINGS, nothing)
    own, restarted = (
        [
            normalized_rmse(one.image, truth)
            for one in bench.after_steps(start, AFTER, variant, SETTINGS, (1, 4), nothing)
        ]
        for variant in (IMPACT, RESTART)
    )
    kept = normalized_rmse(start.kept(SETTINGS, nothing), truth)
    assert own[0] < 0.7 * restarted[0] and own[0] < kept


def test_large_stages_get_fewer_samples(bench: ImpactBench) -> None:
    scene = STAGES["city"].scene
    city = ImpactBench(bench.device, bench.gallery, 4096).start(scene, "city", 4096)
    assert (city.base_spp, city.reference_spp) == (1024, 1024)
    small = bench.start(SCENE, "editing", 4096)
    assert (small.base_spp, small.reference_spp) == (4096, 64)


# ------------------------------------------------------------------------------------- equal seconds


class Ticks:
    """A clock that goes on by 10 ms whenever it is asked."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        self.now += 0.01
        return self.now


class Plain:
    """A denoiser that marks what it had in hands."""

    def denoised(self, image: FloatImage, guides: list[FloatImage]) -> FloatImage:
        assert [guide.shape for guide in guides] == [image.shape] * 2
        return image + 1


def test_pictures_on_the_screen(bench: ImpactBench, start: EditBench) -> None:
    bench._clock = Ticks()
    readied: list[bool] = []
    found, values = bench.after_seconds(
        start, AFTER, RESTART, SETTINGS, (0.025, 0.065, 0.1), nothing, lambda: readied.append(True)
    )
    # The edit takes 10 ms, a step 10, a picture 10. The first picture comes after the first step, at 30 ms;
    # the next one, 33 ms after that began at 20, after the fourth step, from 60 to 70.
    assert [one.mark for one in found] == ["0.025 s", "0.065 s", "0.1 s"]
    assert [one.steps for one in found] == [0, 1, 4]
    assert [one.seconds for one in found] == pytest.approx([0, 0.03, 0.07])
    assert values["edit_ms"] == pytest.approx(10) and values["picture_ms"] == pytest.approx(10)
    assert values["pictures"] == 3 and values["denoising_ms"] is None and readied == [True]
    np.testing.assert_array_equal(found[0].image, start.kept(SETTINGS, nothing))
    fresh = Session(AFTER, settings=RESTART.settings(SETTINGS), device=bench.device)
    fresh.step()
    np.testing.assert_allclose(found[1].image, fresh.image(), rtol=1e-4, atol=1e-5)


@pytest.mark.slow
def test_a_denoised_picture_comes_later(bench: ImpactBench, start: EditBench) -> None:
    bench._denoiser = Plain()  # type: ignore[assignment]
    bench._clock = Ticks()
    found, values = bench.after_seconds(
        start, AFTER, DENOISED, SETTINGS, (0.035, 0.065, 0.085), nothing, lambda: None
    )
    # All pictures of the test above come 10 ms later; the old one is on the screen as it was.
    assert values["denoising_ms"] == pytest.approx(10)
    assert [one.steps for one in found] == [0, 1, 4]
    assert [one.seconds for one in found] == pytest.approx([0, 0.04, 0.08])
    np.testing.assert_array_equal(found[0].image, start.kept(SETTINGS, nothing))
    fresh = Session(AFTER, settings=RESTART.settings(SETTINGS), device=bench.device)
    fresh.step()
    np.testing.assert_allclose(found[1].image, fresh.image() + 1, rtol=1e-4, atol=1e-5)


def test_denoiser_takes_noise_away(bench: ImpactBench, start: EditBench) -> None:
    pytest.importorskip("pyoidn")
    settings = replace(SETTINGS, size=(96, 64))
    truth = start.reference(AFTER, settings, nothing)
    assert bench.missing(DENOISED) is None
    errors = [
        normalized_rmse(next(bench.after_steps(start, AFTER, v, settings, (2,), nothing)).image, truth)
        for v in (RESTART, DENOISED)
    ]
    assert errors[1] < 0.6 * errors[0]


def test_without_the_denoiser_it_is_said_what_brings_it(
    bench: ImpactBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    assert bench.missing(DENOISED) == (
        'restart + OIDN: pyoidn is not installed; run pip install "incpt[denoise]"'
    )
    assert bench.missing(IMPACT) is None
    with pytest.raises(Exception, match="pyoidn"):
        Denoiser()


# --------------------------------------------------------------------------------------------- drags


@pytest.mark.slow
def test_drag(bench: ImpactBench) -> None:
    scene = STAGES["cornell"].scene
    start = bench.start(scene, "cornell", 16)
    settings = Plan(size_scale=0.2).settings("cornell")
    for variant in (DRAG_VARIANTS[2], DRAG_VARIANTS[3]):
        found = list(bench.drag(start, variant, settings, (1, DRAG_STEPS), (2,), nothing))
        assert [(shown.mark, shown.steps) for _, shown in found] == [
            ("edit 1", 1), (f"edit {DRAG_STEPS}", DRAG_STEPS), ("rest +2", DRAG_STEPS + 2),
        ]  # fmt: skip
        assert [
            diff(drag_step(scene, n), now).moved for n, (now, _) in zip((1, 20, 20), found, strict=True)
        ] == [frozenset()] * 3
        session = start._session
        assert session is not None and session.mode is not Mode.BASE
        if variant.rest_nor is not None:
            assert session.settings.nor == variant.rest_nor


# -------------------------------------------------------------------------------------------- tables


def results(*found: tuple[str, int, str, str, dict[str, float]]) -> Results:
    """Results of (measure, samples of the kept picture, edit, variant, error at each mark)."""
    records = []
    for measure, base, edit, variant, errors in found:
        subject = {"measure": measure, "base": base, "edit": edit, "variant": variant}
        rows = tuple(
            {"mark": mark, "normalized_rmse": error, "relative_mse": error**2, "flip": None}
            for mark, error in errors.items()
        )
        records.append(Record("key", subject, "e", "now", {}, {}, rows))
    return Results({}, tuple(records))


FOUND = results(
    ("steps", 64, "cbox", "restart", {"1 steps": 0.4, "10 steps": 0.1}),
    ("steps", 64, "cbox", "restart + OIDN", {"1 steps": 0.11, "10 steps": 0.1}),
    ("steps", 64, "cbox", "spiral 16", {"1 steps": 0.2, "10 steps": 0.16}),
    ("steps", 64, "cbox", "spiral 64", {"1 steps": 0.3, "10 steps": 0.12}),
    ("steps", 64, "cbox", "impact", {"1 steps": 0.1, "10 steps": 0.11}),
    ("steps", 64, "rotate", "restart", {"1 steps": 0.8}),
    ("steps", 64, "rotate", "spiral 16", {"1 steps": 0.4}),
    ("steps", 64, "rotate", "impact", {"1 steps": 0.1}),
    ("steps", 4096, "rotate", "impact", {"1 steps": 0.5}),
    ("seconds", 64, "floor", "spiral 16", {"0.05 s": 0.1}),
    ("seconds", 64, "floor", "impact", {"0.05 s": 0.2}),
    ("seconds", 64, "floor", "impact", {"0.05 s": 0.4}),
    ("seconds", 64, "floor", "impact", {"0.05 s": 0.3}),
    ("drags", 64, "drag", "restart", {"edit 5": 0.3, "rest +5": 0.1, "edit 20": 0.2}),
)  # fmt: skip


def texts(table: tables.Table) -> list[list[str]]:
    return [list(map(str, row)) for row in zip(*(column.cells for column in table.columns), strict=True)]


def test_cells_are_compared_with_the_best_spiral_of_each() -> None:
    found = tables.cells(FOUND, "steps", "normalized_rmse")
    assert [cell.base for cell in found] == [4096, 64, 64, 64]
    assert [cell.edit for cell in found if cell.base == 64] == ["rotate", "cbox", "cbox"]
    first = found[tables.Cell(64, "cbox", "1 steps")]
    last = found[tables.Cell(64, "cbox", "10 steps")]
    assert (tables.best_spiral(first), tables.best_spiral(last)) == (0.2, 0.12)
    assert (tables.better(first), tables.better(last)) == (0.2, 0.1)
    assert tables.ratio(last, tables.better) == pytest.approx(1.1)
    of_64 = {cell: errors for cell, errors in found.items() if cell.base == 64}
    assert tables.mean_ratio(of_64, tables.better) == pytest.approx((0.5 * 1.1 * 0.25) ** (1 / 3))
    assert tables.mean_ratio({}, tables.better) is None
    # A repeated measurement counts by its median, and errors that there are not by nothing.
    seconds = tables.cells(FOUND, "seconds", "normalized_rmse")
    assert seconds == {tables.Cell(64, "floor", "0.05 s"): {"spiral 16": 0.1, "impact": 0.3}}
    assert tables.cells(FOUND, "steps", "flip") == {}


def test_marks_stand_in_their_order() -> None:
    assert tables.marks(FOUND, "steps") == ["1 steps", "10 steps"]
    assert tables.marks(FOUND, "drags") == ["edit 5", "edit 20", "rest +5"]


def test_tables_of_cells_means_and_lost_cells() -> None:
    by_title = [(str(table.title), texts(table)) for table in tables.tables(FOUND)]
    cells = next(rows for title, rows in by_title if "picture of 64 samples: restart /" in title)
    assert cells[:2] == [
        ["rotate red cube", "8000/-/4000/1000 0.25", ""],
        ["cornell: move block", "4000/1100/2000/1000 0.50", "1000/1000/1200/1100 1.10"],
    ]
    means = next(
        rows
        for title, rows in by_title
        if title.endswith("picture of 64 samples: geometric means over edits")
    )
    assert [
        "normalized RMSE",
        "restart",
        f"{(0.25 * 0.125) ** 0.5:.3f}",
        "1.100",
        f"{(0.25 * 0.125 * 1.1) ** (1 / 3):.3f}",
    ] in means
    assert ["normalized RMSE", "restart + OIDN", f"{1 / 1.1:.3f}", "1.100", "1.000"] in means
    counts, lost = (texts(table) for table in tables.tables(FOUND)[-2:])
    assert ["paths", "normalized RMSE", tables.BETTER, "1", "3", "1.10"] in counts
    assert ["paths", "normalized RMSE", "restart + OIDN", "1", "2", "1.10"] in counts
    worst = [
        "seconds",
        "relMSE",
        tables.BETTER,
        "64",
        "floor: metal to diffuse (everything)",
        "0.05 s",
        "100.0",
    ]
    assert lost[0][:7] == worst
    assert [
        "paths",
        "normalized RMSE",
        tables.BETTER,
        "64",
        "cornell: move block",
        "10 steps",
        "1000",
        "1100",
        "1.10",
    ] in lost
    drags = next(rows for title, rows in by_title if "in a drag" in title)
    assert drags == [["restart", "3000", "2000", "1000"]]


def test_curves_are_relative_to_restarting() -> None:
    found = tables.curves(FOUND, "steps")[64]
    assert found["restart"] == [(1.0, pytest.approx(1)), (10.0, pytest.approx(1))]
    assert found["impact"] == [(1.0, pytest.approx((0.25 * 0.125) ** 0.5)), (10.0, pytest.approx(1.1))]
    assert found["spiral 64"][1] == (10.0, pytest.approx(1.2))


# --------------------------------------------------------------------------------------- the command

SMALL = ["--size-scale", "0.2", "--base-spp", "16", "--reference-spp", "32", "--nor", "4", "--at-step", "1",
         "--at-second", "0.05"]  # fmt: skip


@pytest.mark.slow
def test_impact_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    command = ["bench", "impact", "-o", str(tmp_path / "out"), "--edit", "cbox", "--edit", "drag", *SMALL]
    assert main.main(command) == 0
    printed = capsys.readouterr()
    assert "cornell: move block" in printed.out and "spiral 16, then 64" in printed.out
    assert printed.err.count("skipped: restart + OIDN: pyoidn is not installed") == 1
    found = read(tmp_path / "out" / "impact.jsonl")
    assert [(r.subject["measure"], r.subject["variant"]) for r in found.records] == [
        ("steps", "restart"), ("steps", "spiral 4"), ("steps", "spiral adapting"), ("steps", "impact"),
        ("drags", "restart"), ("drags", "spiral 16, then 64"), ("drags", "impact"),
        ("seconds", "restart"), ("seconds", "spiral 4"), ("seconds", "spiral adapting"),
        ("seconds", "impact"),
    ]  # fmt: skip
    assert all(0 < row["normalized_rmse"] < 0.5 for record in found.records for row in record.rows)
    assert [len(record.rows) for record in found.records] == [1] * 4 + [7] * 3 + [1] * 4
    assert found.records[0].subject["size"] == [29, 29] and found.records[0].load == {}
    assert main.main(command) == 0
    assert "11 of 14 measurements were there" in capsys.readouterr().err


@pytest.mark.slow
def test_pictures_of_edits(bench: ImpactBench, tmp_path: Path) -> None:
    plan = Plan(edits=("cbox", "drag"), nors=(4,), bases=(16,), size_scale=0.2)
    (sheet,) = write_pictures(tmp_path, bench, plan, nothing)
    labels = [v.slug for v in variants((4,)) if bench.missing(v) is None]
    names = {f"cbox-16-{label}-{steps}.png" for label in labels for steps in (1, 2, 5)}
    assert {path.name for path in tmp_path.glob("*.png")} == names | {
        "cbox-16-old.png", "cbox-16-truth.png", "cbox-16.png",
    }  # fmt: skip
    assert sheet == tmp_path / "cbox-16.png" and "cbox-16-impact-5.png" in names


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--edit", "magic"], "--edit: 'magic' is not known; choose from shrink, rotate"),
        (["--measure", "magic"], "--measure: 'magic' is not known; choose from steps, drags, seconds"),
        (["--size-scale", "0"], "--size-scale: 0 is out of range"),
        (["--tile", "4096"], "--tile, --nor, --seed or --size-scale: tile_size: 4096 is out of range"),
        (["--at-second", "-1"], "--at-second: -1 is out of range"),
        (["--nor", "0"], "--nor: 0 is too small"),
    ],
)
def test_bad_options(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main.main(["bench", "impact", "-o", str(tmp_path / "out"), *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
    assert not (tmp_path / "out").exists()
