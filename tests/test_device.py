"""Choosing a device, building kernels, and what a user reads when either fails."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyopencl as cl
import pytest
from small_scenes import mixed_scene

from incpt import device as device_module
from incpt import layout, pocl
from incpt.device import DEVICE_VARIABLE, Device, all_devices, choose, device_name, source
from incpt.errors import DeviceError, InputError
from incpt.scene import Image
from incpt.session import Session


def test_choice_by_index_name_and_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(DEVICE_VARIABLE, raising=False)
    first = all_devices()[0]
    assert choose() == choose(0) == choose("0") == choose(device_name(first)[2:9].upper()) == first
    monkeypatch.setenv(DEVICE_VARIABLE, "no such")
    with pytest.raises(InputError, match=rf"{DEVICE_VARIABLE}: no device 'no such'; choose one of 0 = "):
        choose()
    assert choose(0) == first


@pytest.mark.parametrize("choice", ["gpu of dreams", 99, "-1"])
def test_device_that_is_not_there(choice: str | int) -> None:
    with pytest.raises(InputError, match="--device: no device"):
        Device(choice)


def test_no_device_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cl, "get_platforms", list)
    with pytest.raises(DeviceError, match="no OpenCL device was found; install one"):
        choose()


def test_gpus_come_first(monkeypatch: pytest.MonkeyPatch) -> None:
    class Fake:
        def __init__(self, kind: int) -> None:
            self.type = kind

    class Platform:
        def __init__(self, *kinds: int) -> None:
            self.kinds = kinds

        def get_devices(self) -> list[Fake]:
            if not self.kinds:
                raise cl.RuntimeError("DEVICE_NOT_FOUND")
            return [Fake(kind) for kind in self.kinds]

    kinds = cl.device_type
    platforms = [Platform(kinds.CPU), Platform(), Platform(kinds.GPU, kinds.ACCELERATOR)]
    monkeypatch.setattr(cl, "get_platforms", lambda: platforms)
    assert [d.type for d in all_devices()] == [kinds.GPU, kinds.CPU, kinds.ACCELERATOR]


def test_kernel_that_does_not_build_names_file_and_line(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        device_module, "source", lambda file: f'#line 7 "{file}.cl"\n__kernel void k() {{ oops; }}'
    )
    with pytest.raises(DeviceError, match=r"^cl/new\.cl does not build on .*: .*new\.cl:7:\d+: .*oops"):
        device.kernel("new")


def test_includes_are_put_in_once_with_their_lines() -> None:
    text = source("shade")
    assert "#include" not in text
    assert text.count("typedef struct {\n    float x, y, z;\n} Vec3;") == 1
    lines = text.splitlines()
    place = next(i for i, line in enumerate(lines) if line.startswith("__kernel void shade"))
    marker = max(i for i in range(place) if lines[i].startswith("#line"))
    number = int(lines[marker].split()[1])
    original = (Path(layout.__file__).parent.parent / "cl" / "shade.cl").read_text().splitlines()
    assert original[number - 1 + place - marker - 1] == lines[place]


def test_buffers_hold_what_was_written(device: Device) -> None:
    array = np.arange(10, dtype=np.uint32)
    buffer = device.upload(array)
    device.write(buffer, np.array([77], np.uint32), offset=8)
    device.fill(buffer, 5, 4, offset=12)
    assert device.read(buffer, np.empty(3, np.uint32), offset=4).tolist() == [1, 77, 5]
    assert device.upload(np.empty(0, np.float32)).size >= 4


def test_buffer_beyond_the_limit_of_the_device(device: Device) -> None:
    with pytest.raises(DeviceError, match=r"device memory: one buffer of .* use a smaller image or scene"):
        device.empty(1 << 60)


def test_memory_that_runs_out(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise cl.MemoryError("clCreateBuffer failed: MEM_OBJECT_ALLOCATION_FAILURE")

    session = Session(mixed_scene(), device=device)
    session.render(1)
    before = session.image()
    with monkeypatch.context() as patch:
        patch.setattr(cl, "Buffer", fail)
        with pytest.raises(
            DeviceError, match=r"device memory ran out for a buffer of .*; use a smaller image"
        ):
            session.edit(session.scene.with_environment(image=Image(np.ones((4, 8, 3)))))
    # Nothing is lost: the old scene goes on.
    np.testing.assert_array_equal(session.image(), before)
    session.render(2)


@pytest.mark.parametrize("operation", ["write", "read", "fill"])
def test_transfers_that_fail_are_one_line(device: Device, operation: str) -> None:
    buffer = device.upload(np.zeros(1, np.uint32))
    array = np.zeros(100, np.uint32)
    with pytest.raises(DeviceError, match=r"failed: .*INVALID_VALUE"):
        {
            "write": lambda: device.write(buffer, array),
            "read": lambda: device.read(buffer, array),
            "fill": lambda: device.fill(buffer, 0, 400),
        }[operation]()


def test_launch_that_fails_is_one_line(device: Device) -> None:
    kernel = device.kernel("resolve")
    buffer = device.upload(np.zeros(400, np.float32))
    with pytest.raises(DeviceError, match="kernel resolve failed"):
        device.launch(kernel, 10, np.uint32(1), buffer, buffer, work_group=1 << 20)


def test_target_is_the_highest_level_that_the_processor_has() -> None:
    v2 = {"cx16", "popcnt", "sse4_1", "sse4_2", "ssse3"}
    v3 = v2 | {"avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"}
    avx512 = {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}
    assert pocl.target_name(set()) == "x86-64"
    assert pocl.target_name(v2) == "x86-64-v2"
    assert pocl.target_name(v3 | avx512 - {"avx512bw"}) == "x86-64-v3"
    assert pocl.target_name(v3 | avx512) == "x86-64-v4"
    assert pocl.target_name(avx512) == "x86-64"


def test_unknown_processor_is_looked_for_without_harm() -> None:
    import ctypes

    text = ctypes.create_string_buffer(b"generic")
    struct = (ctypes.c_void_p * 200)()
    struct[3], struct[7] = 8, ctypes.addressof(text)  # a wild pointer, and the one
    assert pocl._pointers_to_unknown(ctypes.addressof(struct)) == [ctypes.addressof(struct) + 56]
    assert pocl._pointers_to_unknown(16) == []


def test_two_devices_in_a_process_build_the_same_source(device: Device) -> None:
    assert Device(0).program_text("shade") == device.program_text("shade")


def test_devices_agree(device: Device) -> None:
    """Every device makes the same picture, within rounding; where there is one only, with itself."""
    session = Session(mixed_scene(base_nor=16), device=device)
    session.render(16)
    for index in range(len(all_devices())):
        other = Session(mixed_scene(base_nor=16), device=index)
        other.render(16)
        difference = np.abs(other.image() - session.image())
        assert np.median(difference) < 1e-4 and abs(other.image().mean() / session.image().mean() - 1) < 0.01


VECTORIZED = """
import sys
import numpy as np
from incpt import layout
from incpt.device import Device

device = Device()
floats = device.upload(np.zeros(1 << 18, np.float32))
slots = np.zeros(64, layout.SLOT)
slots["group_count"] = 1
params = np.zeros((), layout.PARAMS)
params["path_stride"] = params["buffer_stride"] = 1000
for name in ("light_count", "environment_width", "environment_height", "tile_size", "width", "height"):
    params[name] = 4
for variant in {variants!r}:
    name, *features = variant.split()
    print("VARIANT", variant, file=sys.stderr, flush=True)
    kernel = device.kernel(name, features=tuple(features))
    first = (device.upload(slots),) if name == "generate" else (np.uint32(512),)
    device.launch(kernel, 512, params, *first, *[floats] * (kernel.num_args - 2))
    device.finish()
"""
VARIANTS = [
    "generate",
    "escape",
    "escape ENVIRONMENT_IMAGE",
    "illuminate ENVIRONMENT_IMAGE",
    "illuminate TRIANGLE_LIGHTS",
    "illuminate ENVIRONMENT_IMAGE TRIANGLE_LIGHTS",
    "shade",
    "shade TRIANGLE_LIGHTS",
    "shade EMISSION_ONLY",
]


def has_avx512() -> bool:
    info = Path("/proc/cpuinfo")
    return info.exists() and "avx512vl" in info.read_text()


@pytest.mark.skipif(not has_avx512(), reason="LLVM 14's vectoriser was tuned and seen with AVX-512 only")
def test_pocl_runs_shading_in_simd_lanes(device: Device, tmp_path: Path) -> None:
    """What most paths take is vectorised over work-items, eight wide; the compiler's remarks say so."""
    if not device.is_pocl:
        pytest.skip("PoCL's compiler is the one that needs it")
    environment = {
        **os.environ,
        "POCL_VECTORIZER_REMARKS": "1",
        "POCL_CACHE_DIR": str(tmp_path),
        "PYOPENCL_NO_CACHE": "1",
        DEVICE_VARIABLE: "Portable",
    }
    script = VECTORIZED.format(variants=VARIANTS)
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=True,
    )
    parts = done.stdout.decode(errors="replace").split("VARIANT ")[1:]
    remarks = dict(part.split("\n", 1) for part in parts)
    assert list(remarks) == VARIANTS
    for variant, text in remarks.items():
        assert "vectorized loop (vectorization width: 8" in text, variant


def test_kernels_build_without_warnings(device: Device) -> None:
    lights = ("ENVIRONMENT_IMAGE", "TRIANGLE_LIGHTS")
    variants = [(), lights[:1], lights[1:], lights, ("EMISSION_ONLY",), ("MEDIA",)]
    for file in sorted(path.stem for path in (Path(layout.__file__).parent.parent / "cl").glob("*.cl")):
        if "__kernel" not in source(file):
            continue
        for features in variants if "LIGHT_SAMPLING" in source(file) else [()]:
            if file == "illuminate" and not set(features) & set(lights):
                continue  # launched only where there is something to sample
            program = cl.Program(device.context, device.program_text(file, features))
            program.build(options=["-Werror"])
            log = program.get_build_info(device.cl_device, cl.program_build_info.LOG)
            assert "warning" not in log, (file, features, log)
