"""The report of what became of files, and how it reaches those who did not ask for it."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest

from incpt.core.errors import InputError, InputWarning
from incpt.formats import import_report, registry
from incpt.formats.import_options import ImportOptions, current_options, reading_with
from incpt.formats.import_report import Fate, ImportReport, Remark, gathered, in_file


def test_what_is_told_is_gathered_once_and_in_order() -> None:
    with warnings.catch_warnings(), gathered() as found, in_file("a.gltf"):
        warnings.simplefilter("error")
        import_report.read("2 meshes")
        for _ in range(2):
            import_report.left_out("3 lines: have no area")
        with in_file("b.png"):
            import_report.changed("colours:\nare   \x1blinear\ud800")
    report = found.report
    assert report.remarks == (
        Remark(Fate.READ, "a.gltf", "2 meshes"),
        Remark(Fate.LEFT_OUT, "a.gltf", "3 lines: have no area"),
        Remark(Fate.CHANGED, "b.png", "colours: are ?linear?"),
    )
    assert report.lines() == [
        "a.gltf:", "  read: 2 meshes", "  left out: 3 lines: have no area",
        "b.png:", "  changed: colours: are ?linear?",
    ]  # fmt: skip
    assert not report.is_whole and ImportReport(report.remarks[::2]).is_whole
    with pytest.raises(InputError, match=r"^a\.gltf: left out 3 lines: have no area; leave --strict away"):
        report.check_whole()


def test_without_anybody_who_gathers_it_is_a_warning() -> None:
    with in_file("a.gltf"):
        import_report.read("2 meshes")
        with pytest.warns(InputWarning) as caught:
            import_report.left_out("3 lines: have no area")
    assert [str(one.message) for one in caught] == ["a.gltf: left out 3 lines: have no area"]


def test_a_scene_file_tells_of_the_files_it_names(tmp_path: Path) -> None:
    """Of each once, however many objects use it."""
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 1 2\n")
    objects = "".join(f"[[objects]]\nname = '{n}'\nmesh = 'a.obj'\nmaterial = 'm'\n" for n in "pq")
    (tmp_path / "s.toml").write_text(f"version = 2\n[materials.m]\n{objects}")
    scene, report = registry.load_with_report(tmp_path / "s.toml")
    assert len(scene.objects) == 2
    assert [(r.file, r.text) for r in report.of(Fate.LEFT_OUT)] == [
        (str(tmp_path / "a.obj"), "1 of 2 faces: 1 with zero area")
    ]


def test_options_belong_to_the_reading_around_them() -> None:
    assert current_options() == ImportOptions()
    with reading_with(ImportOptions(time=2, allow_outside=True)):
        assert current_options() == ImportOptions(2.0, True)
    assert current_options().time is None
    for wrong in (-1, float("nan"), "now"):
        with pytest.raises(InputError, match="time: "):
            ImportOptions(time=wrong)  # type: ignore[arg-type]
