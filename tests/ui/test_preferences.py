"""What the editor remembers, and that no file of it keeps the editor from starting."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from incpt.core.errors import InputError, OutputError
from incpt.ui import preferences as stored
from incpt.ui.preferences import DisplaySettings, Preferences, SnapSettings


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    chosen = tmp_path / "config"
    monkeypatch.setenv(stored.CONFIG_DIR, str(chosen))
    return chosen


def write(text: str | bytes) -> Path:
    path = stored.preferences_path()
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def changed(kind: type, ui_scale: float | None) -> Any:
    """An instance in which every field differs from its default."""
    other: Mapping[str, Any] = {
        "display": lambda: changed(DisplaySettings, None),
        "snap": lambda: changed(SnapSettings, None),
        "window_size": lambda: (800, 600),
        "ui_scale": lambda: ui_scale,
        "keys": lambda: (("Hide", "Ctrl+H"), ("Move", "")),
        "hidden_panels": lambda: ("Object", "Method"),
        "recent": lambda: ("/a.toml", '/ü "b".toml'),
    }
    values = {}
    for field in fields(kind):
        default = field.default
        if field.name in other:
            values[field.name] = other[field.name]()
        elif isinstance(default, bool):
            values[field.name] = not default
        elif isinstance(default, str):
            values[field.name] = stored.CHOICES[field.name][-1]
        else:
            low, high = stored.RANGES[field.name]
            values[field.name] = type(default)(high if default != high else low)
    return kind(**values)


def test_nothing_kept_is_the_defaults(folder: Path) -> None:
    assert stored.load() == (Preferences(), []) and not folder.exists()


def test_everything_comes_back(folder: Path) -> None:
    preferences = changed(Preferences, 1.5)
    default = asdict(Preferences())
    assert all(value != default[name] for name, value in asdict(preferences).items())
    stored.save(preferences)
    assert stored.load() == (preferences, [])
    assert [p.name for p in folder.iterdir()] == ["preferences.toml"]


def test_ui_scale_may_be_unset_again() -> None:
    stored.save(Preferences(ui_scale=2.0))
    stored.save(Preferences())
    assert stored.load() == (Preferences(), [])


def test_comments_and_keys_of_other_versions_stay() -> None:
    path = write("# mine\nfuture = 3\nstep_ms = 50.0 # slow machine\n[display]\nhdr = true\n")
    preferences, messages = stored.load()
    assert preferences == Preferences(step_ms=50.0) and not messages
    stored.save(replace(preferences, drag_nor=32))
    text = path.read_text()
    assert "# mine" in text and "# slow machine" in text
    assert tomllib.loads(text)["future"] == 3 and tomllib.loads(text)["display"]["hdr"] is True
    assert stored.load() == (Preferences(step_ms=50.0, drag_nor=32), [])


@pytest.mark.parametrize(
    ("line", "place"),
    [
        ("step_ms = 'fast'", "step_ms"),
        ("step_ms = nan", "step_ms"),
        ("step_ms = -1", "step_ms"),
        ("drag_nor = 2.5", "drag_nor"),
        ("drag_nor = true", "drag_nor"),
        ("drag_nor = 1" + "0" * 400, "drag_nor"),
        ("navigation = 'emacs'", "navigation"),
        ("navigation = [1]", "navigation"),
        ("window_size = [1]", "window_size"),
        ("window_size = [1e999, 3]", "window_size"),
        ("recent = [1]", "recent"),
        ("recent = 'a.toml'", "recent"),
        ("ui_scale = 0", "ui_scale"),
        ("display = 3", "display"),
        ("display.curve = 'aces'", "display.curve"),
        ("display.outline = 1", "display.outline"),
        ("snap.rotate_deg = 1e30", "snap.rotate_deg"),
    ],
)
def test_a_bad_value_becomes_its_default_and_is_told(line: str, place: str) -> None:
    write(f"fly_speed = 7.0\n{line}\n")
    preferences, messages = stored.load()
    assert preferences == Preferences(fly_speed=7.0)
    assert len(messages) == 1 and messages[0].startswith(f"preferences: {place}: ")


@pytest.mark.parametrize("text", ["= 3", b"\xff\xfe", b"a = [" + b"[" * 100_000])
def test_a_file_that_is_no_toml_is_kept_aside(text: str | bytes, folder: Path) -> None:
    path = write(text)
    content = path.read_bytes()
    preferences, messages = stored.load()
    assert preferences == Preferences() and len(messages) == 1 and "\n" not in messages[0]
    assert (folder / "preferences.broken.toml").read_bytes() == content
    stored.save(preferences)
    assert stored.load() == (preferences, [])


def test_a_folder_in_place_of_the_file_is_told() -> None:
    stored.preferences_path().mkdir(parents=True)
    preferences, messages = stored.load()
    assert preferences == Preferences() and "is a folder" in messages[0]
    with pytest.raises(OutputError):
        stored.save(preferences)


def test_a_file_in_place_of_the_folder_is_told(folder: Path) -> None:
    folder.write_text("x")
    with pytest.raises(OutputError):
        stored.save(Preferences())


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=80, deadline=None)
@given(
    st.dictionaries(
        st.sampled_from([field.name for field in fields(Preferences)]),
        st.one_of(
            st.booleans(),
            st.integers(-(2**63), 2**63 - 1),
            st.floats(),
            st.text(st.characters(codec="ascii", categories=["L", "N"])),
            st.lists(st.one_of(st.integers(-9, 9), st.text("ab")), max_size=3),
        ),
    )
)
def test_any_value_gives_preferences(values: dict[str, Any]) -> None:
    write("".join(f"{name} = {_toml(value)}\n" for name, value in values.items()))
    preferences, _ = stored.load()
    stored.save(preferences)
    assert stored.load() == (preferences, [])


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return repr(value)


@pytest.mark.parametrize(
    "values", [{"step_ms": 0.0}, {"navigation": "x"}, {"window_size": (1, 1)}, {"display": None}]
)
def test_values_out_of_range_are_refused(values: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        Preferences(**values)


def test_recent_files_are_unique_latest_first_at_most_ten_and_there(tmp_path: Path) -> None:
    preferences = Preferences()
    for number in range(12):
        (tmp_path / f"{number}.toml").write_text("x")
        preferences = preferences.with_recent(tmp_path / f"{number}.toml")
    preferences = preferences.with_recent(tmp_path / "5.toml")
    assert [Path(p).stem for p in preferences.recent] == ["5", "11", "10", "9", "8", "7", "6", "4", "3", "2"]
    (tmp_path / "11.toml").unlink()
    assert [p.stem for p in preferences.recent_files] == ["5", "10", "9", "8", "7", "6", "4", "3", "2"]


def test_recent_paths_are_absolute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert Preferences().with_recent("a.toml").recent == (os.path.join(tmp_path, "a.toml"),)


def test_the_size_of_a_minimised_window_is_not_remembered() -> None:
    preferences = Preferences().with_window_size(800, 600)
    assert preferences.window_size == (800, 600)
    assert preferences.with_window_size(0, 0) is preferences


def test_the_layout_is_kept_in_the_same_folder(folder: Path) -> None:
    assert stored.layout_path().parent == folder == stored.config_folder()


def test_without_the_variable_the_folder_is_the_users(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(stored.CONFIG_DIR)
    assert stored.config_folder().name == "incpt"
