"""Kernels take what the host binds, in the same order."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import resources
from typing import Any

import numpy as np
import pyopencl as cl
import pytest

from incpt.core import bindings
from incpt.core.bindings import BLOCK, KERNELS, Argument, Group
from incpt.device import program
from incpt.device.device import Device

KERNEL = re.compile(r"__kernel\b[^{;]*?(\w+)\([A-Z_]+_PARAMETERS")


def files_of_kernels() -> dict[str, str]:
    """The file of cl/ that each kernel is defined in."""
    found: dict[str, str] = {}
    for file, path in program.files().items():
        text = (resources.files("incpt.cl") / f"{path}.cl").read_text()
        names = KERNEL.findall(text)
        assert len(names) == text.count("__kernel"), (
            f"cl/{path}.cl: a kernel whose parameters are not declared"
        )
        found |= dict.fromkeys(names, file)
    return found


FILES = files_of_kernels()
FEATURES = dict.fromkeys(("sample_lights", "touch_lights"), ("TRIANGLE_LIGHTS",))
FEATURES["trace_blocks"] = ("TRIANGLE_LIGHTS", "MEDIA", "AOVS")
FEATURES["choose_lights"] = ("TRIANGLE_LIGHTS", "LIGHT_TREE")


def declared(device: Device, name: str) -> list[tuple[str, str]]:
    """Type and name of every argument of a kernel, as the compiler has read them."""
    text = device.program_text(FILES[name], FEATURES.get(name, ()))
    options = [*program.BUILD_OPTIONS, "-cl-kernel-arg-info"]
    kernel = cl.Kernel(cl.Program(device.context, text).build(options=options), name)
    info = cl.kernel_arg_info
    return [
        (kernel.get_arg_info(i, info.TYPE_NAME), kernel.get_arg_info(i, info.NAME))
        for i in range(kernel.num_args)
    ]


def bound(groups: tuple[Group, ...]) -> list[tuple[str, str]]:
    arguments = bindings.parameters(groups)
    plain = [
        a.c_type.removeprefix("__global ").removeprefix("__local ").removeprefix("const ") for a in arguments
    ]
    return [(c_type.replace(" ", ""), a.name) for c_type, a in zip(plain, arguments, strict=True)]


def test_every_kernel_is_declared() -> None:
    assert FILES.keys() == KERNELS.keys()


def test_files_of_kernels_are_known() -> None:
    assert {name: bindings.FILES.get(name, name) for name in KERNELS} == FILES
    assert bindings.FILES.keys() <= KERNELS.keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(KERNELS))
def test_kernels_declare_what_is_bound(device: Device, name: str) -> None:
    if name == "trace_blocks" and device.block_paths is None:
        pytest.skip("no blocks on this device")
    assert declared(device, name) == bound(KERNELS[name])


def test_another_order_is_noticed(device: Device) -> None:
    frame, paths, *others = KERNELS["intersect"]
    assert declared(device, "intersect") != bound((frame, *others, paths))


class Buffers:
    """A scene whose buffers are their names."""

    cluster_count = 3

    def buffer(self, name: str) -> Any:
        return name.upper()


def test_arguments_are_found_by_name() -> None:
    groups = (bindings.LIST, bindings.BRUTE_FORCE)
    values: Mapping[str, Any] = {
        "list": "mine",
        "lengths": "all",
        "length_place": 7,
        "quads": "others",
        "unused": 1,
    }
    found = bindings.arguments(groups, values, Buffers())
    assert found == ["all", 7, "mine", "others", "PARALLELEPIPEDS", "CLUSTERS", 3]
    assert isinstance(found[1], np.uint32) and isinstance(found[-1], np.uint32)


def test_an_argument_that_nothing_is_bound_to_is_named() -> None:
    with pytest.raises(KeyError, match=r"'top_nodes': the tree over objects"):
        bindings.arguments((bindings.GEOMETRY,), {})
    with pytest.raises(KeyError, match="'memory'"):
        bindings.arguments(BLOCK, {}, Buffers())


def test_a_group_in_c() -> None:
    group = Group("PAIR", "Pair", (Argument("a", "uint", "one"), Argument("b", "__local float *", "two")))
    assert bindings.c_header((group,)) == (
        "#define PAIR_PARAMETERS const uint a, __local float *b\n"
        "#define PAIR_ARGUMENTS a, b\n"
        "typedef struct {\n    uint a; // one\n    __local float *b; // two\n} Pair;\n"
    )


def test_names_stand_for_one_thing() -> None:
    """No argument is declared twice with another type, and no kernel has two of a name."""
    every = [argument for group in bindings.GROUPS for argument in group.arguments]
    assert len({a.name for a in every}) == len(every)
    for groups in KERNELS.values():
        names = [a.name for a in bindings.parameters(groups)]
        assert len(set(names)) == len(names)
