"""Programs: the features that choose their variants, and which folders of cl/ may use which."""

from __future__ import annotations

import re
from importlib import resources

import pytest

from incpt.device import program
from incpt.device.device import Device

FLOORS = ({"base"}, {"scene", "shading"}, {"accel"}, {"path"}, {"cpu", "film"}, {"impact"})
"""Folders of cl/ from the lowest: files include files of lower floors, and of their own folder."""


def floor_of(folder: str) -> int:
    return next(i for i, folders in enumerate(FLOORS) if folder in folders)


def source_of(path: str) -> str:
    return resources.files("incpt.cl").joinpath(f"{path}.cl").read_text("utf-8")


@pytest.mark.parametrize("path", sorted(program.files().values()))
def test_folders_include_lower_folders_only(path: str) -> None:
    folder = path.split("/")[0]
    for included in re.findall(r'#include "(\w+)/\w+\.cl"', source_of(path)):
        assert included == folder or floor_of(included) < floor_of(folder), (path, included)


def test_features_that_kernels_ask_for_are_declared() -> None:
    text = "".join(source_of(path) for path in program.files().values())
    asked = set(re.findall(r"#ifn?def (\w+)", text)) | set(re.findall(r"defined\((\w+)\)", text))
    defined = set(re.findall(r"#define (\w+)", text))
    compilers = {name for name in asked if name.startswith("__")}
    assert asked - defined - compilers <= set(program.FEATURES)
    assert set(program.FEATURES) <= asked


def test_a_feature_that_no_kernel_knows() -> None:
    with pytest.raises(KeyError, match="MATT"):
        program.program_text("path/shade", ("MATT",))


def test_features_of_a_device_are_part_of_all_its_programs(device: Device) -> None:
    own = Device(features=("MIS_ONLY_BSDF",))
    assert "#define MIS_ONLY_BSDF\n" in own.program_text("shade")
    assert "#define MIS_ONLY_BSDF\n" not in device.program_text("shade")


def test_places_in_the_whole_text_become_places_in_files(device: Device) -> None:
    """NVIDIA's compiler counts lines of the whole text, whatever #line says."""
    text = device.program_text("shade")
    for path, words in (("path/shade", "__kernel void shade("), ("base/scalar", "INLINE Vec3 vec3(")):
        number = next(i for i, line in enumerate(text.splitlines(), 1) if words in line)
        own = next(i for i, line in enumerate(source_of(path).splitlines(), 1) if words in line)
        log = f"1 error generated.\n<kernel>:{number}:9: error: no such thing\n"
        assert program.first_error(log, text) == f"{path}.cl:{own}:9: error: no such thing"
    assert program.first_error("out of registers", text) == "out of registers"
