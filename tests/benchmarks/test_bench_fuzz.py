"""Damaging files at random: the same ones again, and every way in which reading one may go wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from incpt.benchmarks.measures import fuzz
from incpt.core.errors import InputError

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def samples(folder: Path) -> list[Path]:
    (folder / "a.obj").write_text(TRIANGLE)
    (folder / "within").mkdir()
    (folder / "within" / "b.obj").write_text(TRIANGLE + "# another\n")
    (folder / "within" / "c.obj").write_text(TRIANGLE)
    (folder / "notes.txt").write_text("no format")
    (folder / "empty.stl").write_text("")
    return fuzz._samples(folder, None)


def test_samples_are_those_that_say_something(tmp_path: Path) -> None:
    assert [path.name for path in samples(tmp_path)] == ["a.obj", "b.obj"]
    assert fuzz._samples(tmp_path, ".ply") == []


def test_a_damage_can_be_made_again(tmp_path: Path) -> None:
    found = samples(tmp_path)
    made = [fuzz.damaged(found, 7, number) for number in range(50)]
    assert made == [fuzz.damaged(found, 7, number) for number in range(50)]
    assert made != [fuzz.damaged(found, 8, number) for number in range(50)]
    assert {sample for sample, _ in made} == set(found)
    assert all(fuzz._sample(found, 7, number) == sample for number, (sample, _) in enumerate(made))
    assert sum(content != sample.read_bytes() for sample, content in made) > 40


def raising(error: Exception) -> Any:
    def read(path: Path) -> None:
        raise error

    return read


def test_outcomes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sample = samples(tmp_path)[0]

    def outcome(content: bytes) -> str:
        return fuzz._outcome(tmp_path / "work", sample, content)

    assert outcome(TRIANGLE.encode()) == "read"
    assert (tmp_path / "work" / "within").is_symlink(), "what lies beside a file is there"
    assert outcome(b"v 0 0 0\n") == "refused"
    monkeypatch.setattr(fuzz, "_read", raising(InputError("one\ntwo")))
    assert outcome(b"") == r"refused in several lines: 'one\ntwo'"
    monkeypatch.setattr(fuzz, "_read", raising(KeyError("x")))
    assert outcome(b"").rstrip().endswith("KeyError: 'x'")
    monkeypatch.setattr(fuzz, "SLOW_SECONDS", 0.0)
    monkeypatch.setattr(fuzz, "_read", lambda path: None)
    assert outcome(b"") == "took 0 s"
