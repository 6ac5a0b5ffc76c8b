"""Traversal, trees, growth, the report and quoted tables: small runs, and pages made of what is there."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from incpt.benchmarks import quoted, report
from incpt.benchmarks.catalogue import EXPERIMENTS
from incpt.benchmarks.impact import tables as impact
from incpt.benchmarks.kit import plots
from incpt.benchmarks.kit.experiment import run
from incpt.benchmarks.kit.fit import fitted
from incpt.benchmarks.kit.scenes import SCENES, crowd, cube, icosphere, plane
from incpt.benchmarks.kit.store import Results, Store, read
from incpt.benchmarks.kit.timing import summary
from incpt.benchmarks.measures import build, rays, scale
from incpt.benchmarks.measures.traversal import Rays, Tracer, camera_rays, scattered_rays, shadow_rays
from incpt.cli import main
from incpt.core.errors import InputError
from incpt.device.device import Device
from incpt.render.blocks import traces_in_blocks
from incpt.render.session import Session
from incpt.scene.material import Material
from incpt.scene.model import Scene

pytest.importorskip("matplotlib")


# ----------------------------------------------------------------------------------------------- rays


@pytest.fixture(scope="module")
def tracer(device: Device) -> Tracer:
    return Tracer(device, SCENES["cornell"].scene)


def test_camera_rays_are_those_of_the_session(tracer: Tracer, device: Device) -> None:
    scene = SCENES["cornell"].scene
    depth = Session(scene, (32, 32), device=device).first_hits().depth
    # Tile by tile of 16 x 16.
    tiles = depth.reshape(2, 16, 2, 16).transpose(0, 2, 1, 3)
    distances = tracer.place(camera_rays(scene.camera, (32, 32))).result()
    np.testing.assert_allclose(distances, tiles.ravel(), rtol=1e-4)
    distances = tracer.place(camera_rays(scene.camera, (32, 32), in_squares=True)).result()
    squares = tiles.reshape(2, 2, 4, 4, 4, 4).transpose(0, 1, 2, 4, 3, 5)
    np.testing.assert_allclose(distances, squares.ravel(), rtol=1e-4)


def test_shadow_rays_end_at_lamps(tracer: Tracer) -> None:
    scene = SCENES["cornell"].scene
    first = camera_rays(scene.camera, (48, 48))
    distances = tracer.place(first).result()
    shadows = shadow_rays(scene, first, distances, 1)
    occluded = tracer.place(shadows).result()
    assert set(np.unique(occluded)) == {0.0, 1.0}
    # What is nearer than a lamp is what a ray without a limit meets before it.
    nearest = tracer.place(
        Rays(shadows.origins, shadows.directions, np.full_like(shadows.limits, np.inf))
    ).result()
    assert np.mean((nearest < shadows.limits) == (occluded == 1)) > 0.999
    ends = shadows.origins + shadows.directions * shadows.limits[:, None]
    assert np.abs(ends[:, 1] - 1.99).max() < 0.01


def test_scattered_rays_leave_surfaces_in_random_order(tracer: Tracer) -> None:
    first = camera_rays(SCENES["cornell"].scene.camera, (48, 48))
    distances = tracer.place(first).result()
    scattered = scattered_rays(first, distances, 2000, 1)
    assert len(scattered) == 2000
    np.testing.assert_allclose(np.linalg.norm(scattered.directions, axis=1), 1, rtol=1e-5)
    assert np.abs(np.diff(scattered.origins[:, 0])).mean() > 0.3
    # In a box of matte walls nearly every one meets something: the front alone is open.
    assert np.isfinite(tracer.place(scattered).result()).mean() > 0.7


@pytest.mark.slow
def test_visits_count_tests(tracer: Tracer, device: Device) -> None:
    away = Rays(*(np.float32([[0, 50, 0]]), np.float32([[0, 1, 0]]), np.float32([np.inf])))
    assert tracer.visits(away) == (1, 0)  # the root of the top level, and nothing else
    first = camera_rays(SCENES["cornell"].scene.camera, (16, 16))
    nodes, packs = tracer.visits(first)
    assert 1 <= nodes < 20 and 0.5 < packs < 10
    # Shadow rays may stop at the first hit, and never look at more.
    any_hit = Rays(first.origins, first.directions, first.limits, any_hit=True)
    assert tracer.visits(any_hit)[1] <= packs
    plates = SCENES["plates"].scene
    assert Tracer(device, plates).visits(camera_rays(plates.camera, (16, 16)))[0] > nodes


def _among_balls() -> Scene:
    """Objects with trees of their own, one of them invisible, among more triangles than are swept over."""
    balls = crowd(30, icosphere(3))
    lamp_material = {"lamp": Material(emission=(9, 9, 9))}
    lamps = [plane(f"lamp {i}", "lamp", (i - 1, 2.5, 0), (180, 20 * i, 0), (0.4, 1, 0.4)) for i in range(3)]
    bricks = [
        cube(f"brick {i}", "floor", (0.25 * i - 1.9, 0.1, 1.9), (0, 31 * i, 0), (0.1,) * 3) for i in range(16)
    ]
    hidden = replace(balls.objects[5], visible=False)
    objects = (*balls.objects[:5], hidden, *balls.objects[6:], *lamps, *bricks)
    return replace(balls, materials={**balls.materials, **lamp_material}, objects=objects)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*SCENES, "balls"])
def test_rays_in_blocks_meet_what_rays_of_a_wavefront_meet(name: str, device: Device) -> None:
    """Swept, several at a time through trees, and one at a time: hits and shadow rays are the same."""
    if not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    scene = SCENES[name].scene if name in SCENES else _among_balls()
    blocks, single = Tracer(device, scene, in_blocks=True), Tracer(device, scene, in_blocks=False)
    first = camera_rays(scene.camera, (75, 51))  # blocks are not full
    distances = single.place(first).result()
    assert np.isfinite(distances).mean() > 0.3
    for rays_ in (first, scattered_rays(first, distances, 3000, 1), shadow_rays(scene, first, distances, 2)):
        expected = single.place(rays_).result()
        assert len(np.unique(expected)) > 1
        found = blocks.place(rays_).result()
        # Rounding moves the corners of a parallelogram, and a grazing ray's hit by several times that; a ray
        # along an outer edge may miss it.
        same = np.isclose(found, expected, rtol=1e-4, atol=1e-5)
        assert same.mean() > 0.999, np.stack([found[~same], expected[~same]])
        assert np.isclose(found, expected, rtol=2e-6, atol=1e-6).mean() > 0.995


def test_rays_beside_embree(tmp_path: Path, device: Device) -> None:
    pytest.importorskip("embreex")
    plan = rays.Plan(["cornell", "plates"], (64, 64), 1, 2)
    found = run(Store(tmp_path, rays.NAME), rays.tasks(device, plan), {"id": "e"})
    assert len(found.records) == 2 * 3 * 3
    differ = [r.values["differ"] for r in found.records if "differ" in r.values]
    assert len(differ) == 6 and max(differ) < 1e-3
    table = rays.table(found)
    assert table.row_count == 6
    assert all(cell.endswith(" x") for cell in table.columns[4].cells)


def test_disagreement_is_a_share_of_rays() -> None:
    three = Rays(np.zeros((3, 3), np.float32), np.zeros((3, 3), np.float32), np.zeros(3, np.float32))
    ours = np.float32([1, np.inf, 2])
    assert rays.disagreement(ours, ours, three) == 0
    assert rays.disagreement(ours, np.float32([1, 5, 2]), three) == pytest.approx(1 / 3)
    assert rays.disagreement(ours, np.float32([1, np.inf, 2.1]), three) == pytest.approx(1 / 3)


# ------------------------------------------------------------------------------------- trees and growth


def test_trees_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["bench", "build", "-o", str(tmp_path), "--repetitions", "1"]
    for count in ("100", "2000"):
        command += ["--triangles", count, "--objects", count]
    assert main.main(command) == 0
    found = read(tmp_path / "build.jsonl")
    assert len(found.records) == 8
    values = [r.values for r in found.where(measure="build")]
    assert [v["count"] for v in values] == [98, 1922] or [v["count"] for v in values] == [98, 2048]
    assert all(40 < v["bytes_per_triangle"] < 200 and 0.3 < v["pack_fill"] <= 1 for v in values)
    assert "n^" in capsys.readouterr().out
    assert build.points(found, "top", "triangles") == []
    assert [x for x, _ in build.points(found, "top", "objects")] == [100, 2000]


def test_growth_of_cost(tmp_path: Path, device: Device) -> None:
    plan = scale.Plan(("resolution", "lights"), (32, 32), 1, 0.005, 1, quick=True)
    found = run(Store(tmp_path, scale.NAME), scale.tasks(device, plan), {"id": "e"})
    points, law = scale.growth(found, "resolution")
    assert [x for x, _ in points] == [1024, 4096, 16384]
    assert law is not None and law.error is not None
    assert all(r.values["paths_per_second"] > 0 for r in found.records)
    assert scale.growth(found, "bounces") == ([], None)
    assert scale.table(found).row_count == 2


# ---------------------------------------------------------------------------------------- the report


class _Page(HTMLParser):
    """What a page refers to, and whether its elements close."""

    VOID = ("meta", "img", "br")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []
        self.headings: list[str | None] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = dict(attrs)
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "h2":
            self.headings.append(named["id"])
        self.sources += [
            str(v) for k, v in attrs if k in ("src", "href") and tag in ("img", "script", "link")
        ]

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def parsed(text: str) -> _Page:
    page = _Page()
    page.feed(text)
    assert page.open == []
    return page


@pytest.mark.slow
def test_report_of_partial_results(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no results; measure first"):
        report.page(tmp_path)
    environment = {"id": "e", "machine": "a <small> machine", "cores": 2}
    Store(tmp_path, scale.NAME).add(
        {"axis": "lights", "value": 1}, environment, {"busy": True, "other_cores": 1.5}, {"step_ms": 2.0}
    )
    page = report.page(tmp_path)  # one point: a plot without a law
    assert parsed(page).headings == ["scale"]
    assert "a &lt;small&gt; machine" in page
    store = Store(tmp_path, "table51")
    store.add({"edit": "rotate red cube", "strategy": "restart", "nor": None}, environment,
              {"busy": True, "other_cores": 1.5}, {}, [{"steps": 5, "normalized_rmse": 0.1,
              "relative_mse": 0.2, "flip": None}])  # fmt: skip
    text = report.page(tmp_path)
    page_parts = parsed(text)
    assert page_parts.headings == ["table51", "scale"]
    assert all(source.startswith("data:") for source in page_parts.sources)
    # Once: errors do not depend on it.
    assert text.count("BUSY MACHINE: during 1 of 1 measurements other processes had up to 1.5 cores") == 1
    assert "0.10000 (0.11519)" in text


@pytest.mark.slow
def test_report_of_every_experiment(tmp_path: Path) -> None:
    """A page with all kinds of plots, from the fewest results that have one."""
    environment = {"id": "e", "machine": "m", "cores": 2}

    def add(name: str, subject: dict[str, Any], values: dict[str, Any], rows: Any = ()) -> None:
        Store(tmp_path, name).add({"repetition": 0, **subject}, environment, {"busy": False}, values, rows)

    marks = [
        {"mark": mark, "steps": 1, "normalized_rmse": 0.1, "relative_mse": 0.2, "flip": 0.1}
        for mark in ("1 steps", "5 steps", "0.1 s", "1 s", "done")
    ]
    times = {"paths_per_second": 1e6, "first_tile_ms": 3.0, "step_ms": 2.0, "queue_s": None}
    place = {"scene": "s", "edit": "turn & move", "tile_size": 16, "max_bounces": 2}
    add("sweep", {**place, "strategy": "spiral", "nor": 16}, times, marks)
    add("sweep", {**place, "strategy": "restart", "nor": None}, {**times, "queue_s": 1.5}, marks)
    for variant in ("restart", "impact"):
        cell = {"measure": "steps", "edit": "cbox", "variant": variant, "base": 64}
        add("impact", cell, {}, [{"mark": "1 steps", **dict.fromkeys(impact.METRICS, 0.1)}])
    for tracer in rays.TRACERS:
        subject = {"scene": "s", "rays": "shadow", "tracer": tracer, "measure": "rate"}
        add("rays", subject, {"rays_per_second": 5e6})
    for peer in ("incpt", "cycles"):
        rate = {"paths_per_second": 2e6, "error_seconds": 0.01}
        add("peers", {"measure": "rate", "scene": "s", "peer": peer}, rate)
        add("peers", {"measure": "move", "scene": "s", "peer": peer}, {"ms": 12.0})
    for count in (10, 100):
        add("build", {"measure": "top", "objects": count}, {"ms": count**0.5, "count": count})
        add("scale", {"axis": "lights", "value": count}, {"step_ms": count**0.5})
    for mode, rate in (("BASE", 2e6), ("INCREMENTAL", 3e6)):
        subject = {"measure": "repetition", "scene": "s", "mode": mode}
        add("steps", subject, {"paths_per_second": rate})
    text = report.page(tmp_path)
    page = parsed(text)
    assert page.headings == [name for name in EXPERIMENTS if name not in ("table51", "latency")]
    # Errors by steps and by seconds; of impact; rays; rate, error and latency of renderers; trees; lamps;
    # repetition.
    assert text.count("<svg") == 2 + 1 + 1 + 3 + 1 + 1 + 1
    assert "turn &amp; move" in text and "<b>turn & move" not in text
    assert text.count("n^0.50") >= 2
    assert "<b>million rays per second</b>" in text


@pytest.mark.slow
def test_report_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.main(["bench", "report", str(tmp_path)]) == 2
    assert "no results" in capsys.readouterr().err
    store = Store(tmp_path, "build")
    store.add({"measure": "build", "triangles": 10, "repetition": 0}, {"id": "e"}, {}, {"ms": 1, "count": 10})
    assert main.main(["bench", "report", str(tmp_path)]) == 0
    page = parsed((tmp_path / "report.html").read_text())
    assert page.headings == ["build"]


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_has_tables_of_nothing(name: str) -> None:
    assert EXPERIMENTS[name].tables(Results())


@pytest.mark.slow
def test_plots_stand_for_themselves() -> None:
    law = fitted([1, 10, 100], [2, 20, 200])
    assert law is not None
    drawn = plots.lines({"a": [(1, 2), (10, 20), (100, 200)]}, "x", "y", "title", {"a": law})
    assert (
        drawn.startswith("<svg")
        and "http" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", drawn).split("<defs>")[-1]
    )
    zero = plots.lines({"a": [(0, 2), (10, 20)]}, "x", "y", "title")
    assert "<svg" in zero
    bars = plots.bars(
        {"s": {"a": summary([1, 2, 3]), "b": summary([2])}, "t": {"a": summary([3])}}, "y", "title"
    )
    assert bars.count("<svg") == 1


# ------------------------------------------------------------------------------------- quoted tables


QUOTE = "# A title\n\n<!-- quoted: build 1 -->\nold\n<!-- end of quote -->\n\nafter\n"


def test_quotes_are_made_of_results(tmp_path: Path) -> None:
    environment = {"id": "e", "machine": "this machine", "cores": 2, "commit": "c0ffee"}
    store = Store(tmp_path, "build")
    subject = {"measure": "build", "triangles": 1000, "repetition": 0}
    store.add(subject, environment, {}, {"ms": 1.25, "count": 1000})
    text = quoted.rewritten(QUOTE, tmp_path)
    assert text.startswith("# A title\n\n<!-- quoted: build 1 -->\n") and text.endswith("\n\nafter\n")
    assert "| building the tree of a mesh, by triangles | 1,000 | 1.25 | 1.25 |" in text
    assert "this machine, 2 cores; commit c0ffee" in text and "old" not in text
    assert quoted.rewritten(text, tmp_path) == text
    store.add(subject, environment, {"busy": True, "other_cores": 1.0}, {"ms": 2.5, "count": 1000})
    newer = quoted.rewritten(text, tmp_path)
    assert newer != text and "| 2.50 |" in newer and "BUSY MACHINE" in newer


@pytest.mark.parametrize(
    ("mark", "message"),
    [("build", "no results"), ("nothing 1", "no such experiment"), ("scale 4", "no results")],
)
def test_quote_of_what_is_not_there(mark: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        quoted.rewritten(QUOTE.replace("build 1", mark), tmp_path)


def test_quote_of_a_table_that_is_not_there(tmp_path: Path) -> None:
    Store(tmp_path, "scale").add({"axis": "lights", "value": 1}, {"id": "e"}, {}, {"step_ms": 1.0})
    with pytest.raises(InputError, match="it has 1 tables"):
        quoted.rewritten(QUOTE.replace("build 1", "scale 2"), tmp_path)


def test_documents_agree_with_the_results(capsys: pytest.CaptureFixture[str]) -> None:
    assert quoted.main(["--check"]) == 0, capsys.readouterr().err
    assert "<!-- quoted: " in (quoted.ROOT / "benchmarks" / "README.md").read_text("utf-8")


def test_disagreement_is_found_and_mended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    document = tmp_path / "README.md"
    document.write_text(QUOTE)
    Store(tmp_path, "build").add(
        {"measure": "top", "objects": 10, "repetition": 0}, {"id": "e"}, {}, {"ms": 1.0, "count": 10}
    )
    monkeypatch.setattr(quoted, "DOCUMENTS", (document,))
    monkeypatch.setattr(quoted, "RESULTS", tmp_path)
    assert quoted.main(["--check"]) == 1
    assert "disagrees" in capsys.readouterr().err
    assert quoted.main([]) == 0
    assert quoted.main(["--check"]) == 0
