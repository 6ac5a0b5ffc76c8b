"""Results of benchmarks: found again by content, resumed, never half-written."""

from __future__ import annotations

import csv
import json
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.small_scenes import mixed_scene

from incpt.benchmarks.kit import content, experiment, store
from incpt.benchmarks.kit.content import code_digest, digest
from incpt.benchmarks.kit.experiment import Outcome, Task, Work, time_left
from incpt.benchmarks.kit.store import Results, Store
from incpt.cli.console import Stopped
from incpt.core.errors import InputWarning, OutputError

ENVIRONMENT = {"id": "e1", "machine": "a machine", "cores": 2, "device": "a device", "commit": "c0ffee"}
QUIET = {"busy": False, "other_cores": 0.0, "load_average": 0.1}


def counting_task(name: str, calls: list[str], value: float = 1.0) -> Task:
    def measure(work: Work) -> Outcome:
        calls.append(name)
        return Outcome({"ms": value})

    return Task(name, {"case": name, "repetition": 0}, measure)


# ------------------------------------------------------------------------------------------- content


def test_digest_tells_content_apart() -> None:
    scene = mixed_scene()
    name = scene.objects[0].name
    assert digest(scene) == digest(scene.with_object(name, position=scene.objects[0].position))
    assert digest(scene) != digest(scene.with_object(name, position=(9, 9, 9)))
    assert digest(scene) != digest(scene.with_material("another"))
    assert digest([1, 2], 3) != digest([1], 2, 3)
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})
    assert digest(1) == digest(1.0) == digest(np.float32(1))
    assert digest(1) != digest("1") != digest(None)
    with pytest.raises(TypeError):
        digest(object())


@pytest.mark.slow
@given(st.recursive(st.none() | st.integers() | st.text() | st.floats(allow_nan=False), st.lists))
def test_digest_is_that_of_what_json_keeps(value: Any) -> None:
    # A subject is compared after it has been to disk and back.
    assert digest(json.loads(json.dumps(value))) == digest(value)


def test_code_digest_is_short_and_stable() -> None:
    assert code_digest() == code_digest()
    assert len(code_digest()) == 16


def test_results_depend_on_all_code_that_renders() -> None:
    incpt = Path(content.__file__).parents[2] / "incpt"
    packages = {".".join(file.parent.relative_to(incpt).parts) for file in incpt.rglob("*.py")}
    assert set(content._MEASURED) == packages - {"", "cli", "replay"}


def test_converged_pictures_depend_on_kernels_that_trace_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    def digest_with(path: str) -> str:
        content.kernel_digest.cache_clear()
        monkeypatch.setattr(content, "_kernels", lambda: {"path/shade": "a", "impact/pair": "b", path: "c"})
        return content.kernel_digest()

    assert digest_with("impact/pair") == digest_with("impact/other") != digest_with("path/shade")
    content.kernel_digest.cache_clear()


# --------------------------------------------------------------------------------------------- store


def test_results_come_back(tmp_path: Path) -> None:
    there = Store(tmp_path, "demo")
    record = there.add({"n": 1}, ENVIRONMENT, QUIET, {"ms": 2.5}, [{"mark": "a"}, {"mark": "b"}])
    again = Store(tmp_path, "demo")
    assert again.has(record.key)
    assert again.read().records == (record,)
    assert again.read().environments == {"e1": ENVIRONMENT}
    other = {**ENVIRONMENT, "id": "e2"}
    assert not again.has(again.key({"n": 1}, other))
    assert not again.has(again.key({"n": 2}, ENVIRONMENT))


def test_torn_line_is_left_out_and_written_past(tmp_path: Path) -> None:
    first = Store(tmp_path, "demo")
    kept = first.add({"n": 1}, ENVIRONMENT, QUIET, {"ms": 1.0})
    first.add({"n": 2}, ENVIRONMENT, QUIET, {"ms": 2.0})
    first.path.write_bytes(first.path.read_bytes()[:-20])
    with pytest.warns(InputWarning, match="line 3 is torn"):
        second = Store(tmp_path, "demo")
    assert second.has(kept.key)
    third = second.add({"n": 3}, ENVIRONMENT, QUIET, {"ms": 3.0})
    with pytest.warns(InputWarning, match="torn"):
        assert second.read().records == (kept, third)


def test_export_has_a_line_for_each_row_with_all_it_depends_on(tmp_path: Path) -> None:
    there = Store(tmp_path, "demo")
    there.add({"n": 1, "size": [4, 3]}, ENVIRONMENT, QUIET, {"ms": 2.5}, [{"mark": "a"}, {"mark": "b"}])
    there.add({"n": 2}, ENVIRONMENT, QUIET, {"ms": 3.5})
    table, whole = there.export()
    with open(table, newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["n"], row["mark"], row["ms"]) for row in rows] == [
        ("1", "a", "2.5"), ("1", "b", "2.5"), ("2", "", "3.5"),
    ]  # fmt: skip
    assert {(row["machine"], row["device"], row["commit"]) for row in rows} == {
        ("a machine", "a device", "c0ffee")
    }
    assert rows[0]["size"] == "[4, 3]"
    loaded = json.loads(whole.read_text())
    assert loaded["environments"]["e1"]["cores"] == 2
    assert [record["values"]["ms"] for record in loaded["records"]] == [2.5, 3.5]


def test_latest_replaces_what_was_measured_before(tmp_path: Path) -> None:
    there = Store(tmp_path, "demo")
    there.add({"n": 1}, ENVIRONMENT, QUIET, {"ms": 1.0})
    there.add({"n": 2}, ENVIRONMENT, QUIET, {"ms": 2.0})
    there.add({"n": 1}, {**ENVIRONMENT, "id": "e2"}, QUIET, {"ms": 9.0})
    assert [r.values["ms"] for r in there.read().latest().records] == [2.0, 9.0]


def test_parts_keep_apart_what_cannot_be_compared(tmp_path: Path) -> None:
    there = Store(tmp_path, "demo")
    other = {**ENVIRONMENT, "id": "e2", "device": "another device"}
    newer = {**ENVIRONMENT, "id": "e3", "commit": "later"}
    there.add({"n": 1, "size": [8, 8]}, ENVIRONMENT, QUIET, {"ms": 1.0})
    there.add({"n": 1, "size": [64, 64]}, ENVIRONMENT, QUIET, {"ms": 2.0})
    there.add({"n": 2, "size": [8, 8]}, ENVIRONMENT, QUIET, {"ms": 3.0})
    there.add({"n": 1, "size": [8, 8]}, other, QUIET, {"ms": 4.0})
    there.add({"n": 2, "size": [8, 8]}, newer, QUIET, {"ms": 5.0})
    parts = there.read().parts("size")
    assert [[r.values["ms"] for r in part.records] for _, part in parts] == [[1.0, 5.0], [2.0], [4.0]]
    assert parts[2][0] == {"machine": "a machine", "device": "another device", "size": [8, 8]}


def test_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="choose another --output"):
        Store(tmp_path / "file", "demo")


def test_no_file_has_no_results(tmp_path: Path) -> None:
    assert store.read(tmp_path / "none.jsonl") == Results()


# --------------------------------------------------------------------------------------- experiments


def test_finished_tasks_are_not_measured_again(tmp_path: Path) -> None:
    calls: list[str] = []
    tasks = [counting_task(name, calls) for name in "abc"]
    experiment.run(Store(tmp_path, "demo"), tasks[:2], ENVIRONMENT)
    found = experiment.run(Store(tmp_path, "demo"), tasks, ENVIRONMENT)
    assert calls == ["a", "b", "c"]
    assert [r.subject["case"] for r in found.records] == ["a", "b", "c"]
    # On another machine, or with other code, they are other measurements.
    experiment.run(Store(tmp_path, "demo"), tasks, {**ENVIRONMENT, "id": "e2"})
    assert calls == ["a", "b", "c", "a", "b", "c"]


def test_interruption_keeps_what_is_done_and_goes_on(tmp_path: Path) -> None:
    calls: list[str] = []

    def interrupted(work: Work) -> Outcome:
        signal.raise_signal(signal.SIGINT)
        work.check()
        raise AssertionError("work goes on after Ctrl-C")

    first = [counting_task("a", calls), Task("b", {"case": "b", "repetition": 0}, interrupted)]
    with pytest.raises(Stopped, match=r"1 of 2 measurements .* the same command goes on"):
        experiment.run(Store(tmp_path, "demo"), first, ENVIRONMENT)
    assert (tmp_path / "demo.csv").read_text().count("\n") == 2
    both = [counting_task("a", calls), counting_task("b", calls)]
    experiment.run(Store(tmp_path, "demo"), both, ENVIRONMENT)
    assert calls == ["a", "b"]


def test_failure_keeps_what_is_done(tmp_path: Path) -> None:
    calls: list[str] = []

    def failing(work: Work) -> Outcome:
        raise ZeroDivisionError

    tasks = [counting_task("a", calls), Task("b", {"case": "b"}, failing)]
    with pytest.raises(ZeroDivisionError):
        experiment.run(Store(tmp_path, "demo"), tasks, ENVIRONMENT)
    assert len(Store(tmp_path, "demo").read().records) == 1


def test_skipped_is_said_once_and_not_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    skip = [
        Task(f"{i}", {"case": i}, lambda work: Outcome(skipped="x: not installed; run pip install x"))
        for i in range(3)
    ]
    found = experiment.run(Store(tmp_path, "demo"), skip, ENVIRONMENT)
    assert found.records == ()
    assert capsys.readouterr().err.count("skipped: x: not installed; run pip install x\n") == 1


@pytest.mark.parametrize(
    ("elapsed", "done", "total", "expected"),
    [
        (10, 0, 5, None),
        (10, 1, 5, "40 s"),
        (60, 1, 5, "4 min 00 s"),
        (3600, 1, 4, "3 h 00 min"),
        (5, 5, 5, "0 s"),
    ],
)
def test_time_left(elapsed: float, done: float, total: float, expected: str | None) -> None:
    assert time_left(elapsed, done, total) == expected
