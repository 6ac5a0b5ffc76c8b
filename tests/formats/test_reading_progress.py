"""How far reading is: what is told, and that it is the objects of the outer file that count."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh

from incpt.formats import registry
from incpt.formats.reading_progress import each, watched_by


def test_shares_of_what_is_counted() -> None:
    told: list[float] = []
    with watched_by(told.append):
        assert list(each([1, 2, 3, 4])) == [1, 2, 3, 4]
        assert list(each([])) == []
    assert told == [0, 0.25, 0.5, 0.75]
    assert list(each([5])) == [5] and len(told) == 4


def test_few_shares_of_many_objects() -> None:
    told: list[float] = []
    with watched_by(told.append):
        assert len(list(each(range(100_000)))) == 100_000
    assert len(told) == 100 and told == sorted(told)


def test_what_is_within_one_of_them_does_not_count() -> None:
    told: list[float] = []
    with watched_by(told.append):
        for _ in each("ab"):
            list(each(range(7)))
    assert told == [0, 0.5]


def test_one_that_fails_ends_its_count() -> None:
    told: list[float] = []
    with watched_by(told.append):
        with pytest.raises(ValueError):  # noqa: PT012 (the loop is what fails)
            for _ in each("abcd"):
                raise ValueError
        assert list(each("ab")) == ["a", "b"]
    assert told == [0, 0, 0.5]


def test_scene_files_and_gltf_tell_how_far_they_are(tmp_path: Path) -> None:
    boxes = trimesh.Scene([trimesh.creation.box(), trimesh.creation.icosphere(subdivisions=1)])
    boxes.export(tmp_path / "a.glb")
    objects = '[[objects]]\nname = "{}"\nmesh = "a.glb"\nmaterial = "m"\n'
    (tmp_path / "a.toml").write_text("version = 2\n[materials.m]\n" + "".join(map(objects.format, "xyzw")))
    for name, expected in (("a.glb", [0, 0.5]), ("a.toml", [0, 0.25, 0.5, 0.75])):
        told: list[float] = []
        with watched_by(told.append):
            registry.load(tmp_path / name)
        assert told == expected
