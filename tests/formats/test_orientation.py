"""Mesh files that are meant with another axis up, or in another unit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from incpt.cli.main import main
from incpt.core.errors import InputError
from incpt.formats import registry, scene_save
from incpt.formats.orientation import unit_of


def tower(folder: Path, suffix: str = "stl") -> Path:
    """1 x 2 x 30 mm, z up."""
    path = folder / f"tower.{suffix}"
    trimesh.creation.box(bounds=[[0, 0, 0], [1, 2, 30]]).export(path)
    return path


def bounds(path: Path, **options: object) -> np.ndarray:
    scene = registry.load(path, **options)  # type: ignore[arg-type]
    return np.round(np.stack([obj.world_bounds for obj in scene.objects])[0], 6)


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off"])
def test_up_and_unit(tmp_path: Path, suffix: str) -> None:
    path = tower(tmp_path, suffix)
    np.testing.assert_array_equal(bounds(path), [[0, 0, 0], [1, 2, 30]])
    # What is up comes up, what is to the right stays, and what is in front comes to the front.
    np.testing.assert_allclose(bounds(path, up="z"), [[0, 0, -2], [1, 30, 0]], atol=1e-5)
    np.testing.assert_allclose(bounds(path, up="z", unit=1e-3), [[0, 0, -0.002], [0.001, 0.03, 0]], atol=1e-6)
    np.testing.assert_array_equal(bounds(path, up="y"), bounds(path))


def test_meshes_stay_as_they_are_and_objects_are_turned(tmp_path: Path) -> None:
    scene = registry.load(tower(tmp_path), up="z", unit=0.001)
    (obj,) = scene.objects
    assert obj.rotation == (-90, 0, 0) and obj.scale == (0.001,) * 3
    scene_save.save(scene, tmp_path / "a.toml")
    again = registry.load(tmp_path / "a.toml")
    np.testing.assert_array_equal(again.objects[0].world_bounds, obj.world_bounds)


def test_files_that_say_it_themselves_are_asked_for_nothing(tmp_path: Path) -> None:
    trimesh.creation.box().export(tmp_path / "a.glb")
    with pytest.raises(InputError, match=r"a\.glb: the file says itself where up is"):
        registry.load(tmp_path / "a.glb", up="z")
    scene_save.save(registry.load(tower(tmp_path)), tmp_path / "a.toml")
    with pytest.raises(InputError, match=r"unit: .*a\.toml is a scene, whose y is up"):
        registry.load(tmp_path / "a.toml", unit=0.1)


@pytest.mark.parametrize(("text", "metres"), [("mm", 1e-3), (" In ", 0.0254), ("0.5", 0.5), ("FT", 0.3048)])
def test_units_by_name_and_number(text: str, metres: float) -> None:
    assert unit_of(text) == pytest.approx(metres)


@pytest.mark.parametrize("text", ["", "parsec", "0", "-1", "nan", "inf", "1e-9"])
def test_what_is_no_unit(text: str) -> None:
    with pytest.raises(
        InputError, match=r"unit: .* is none; use mm, cm, m, km, in, ft, or a number of metres"
    ):
        unit_of(text)


def test_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(tower(tmp_path)), "--up", "z", "--unit", "mm"]) == 0
    assert "(0, 0, -0.002) to (0.001, 0.03, 0) metres" in capsys.readouterr().out.replace("-0,", "0,")
    for options, word in ((["--up", "x"], "up: 'x'"), (["--unit", "ell"], "--unit: 'ell' is none")):
        assert main(["check", str(tower(tmp_path)), *options]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert word in line
