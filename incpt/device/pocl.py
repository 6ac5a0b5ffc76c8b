"""Makes the embedded PoCL device work well on processors that are younger than it.

PoCL 3.0 asks its LLVM 14 for the processor's name and hands it to clang as the target. LLVM answers
"generic" for a processor that it does not know (AMD family 26, for one), and clang refuses just that
name: "unknown target CPU 'generic'", so no kernel builds (PoCL issue 1049; later versions have
POCL_LLVM_CPU_NAME, this one has no setting). A newer member of a family that it knows it takes for the
latest that it has heard of: Zen 4 for "znver3", which has no AVX-512, so that half of the lanes stay empty.
The x86-64 micro-architecture levels are names that clang 14 knows and that any processor can be sorted into
by its feature flags, so this module puts the right level into the one place of PoCL's device structure that
holds the name.
"""

from __future__ import annotations

import ctypes
import shutil
from pathlib import Path
from typing import Any

from incpt.core.errors import DeviceError

_UNKNOWN = "generic"
_WITHOUT_AVX512 = ("znver3",)
"""Names that LLVM 14 gives to processors with AVX-512 too."""

# The name stands about 640 bytes from the start; further on, stale copies of the pointer may lie about.
_DEVICE_STRUCT_BYTES = 1024
_POINTER_BYTES = ctypes.sizeof(ctypes.c_void_p)

# System V ABI, x86-64 micro-architecture levels, in the words of /proc/cpuinfo.
_LEVELS = (
    ("x86-64-v4", {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}),
    ("x86-64-v3", {"avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"}),
    ("x86-64-v2", {"cx16", "popcnt", "sse4_1", "sse4_2", "ssse3"}),
)

# By address of the device; PoCL keeps pointers into the texts for the life of the process.
_targets: dict[int, Any] = {}


def name_target(cl_device: Any) -> str | None:
    """Give PoCL a target that its clang knows, where it has none, or one with AVX-512, where the processor
    has it and LLVM's name for it has not; return that name, else None.

    Does nothing where the processor is known, or where the structure does not look as expected.
    """
    if "pocl" not in cl_device.platform.version.lower() or not Path("/proc/self/mem").exists():
        return None
    address = cl_device.int_ptr
    if address not in _targets:
        level = target_name(_cpu_flags())
        places = [place for name in misnomers(level) for place in _pointers_to(name, address)]
        if len(places) != 1:
            return None
        text = ctypes.create_string_buffer(level.encode())
        ctypes.c_void_p.from_address(places[0]).value = ctypes.addressof(text)
        _targets[address] = text
    name: str = _targets[address].value.decode()
    return name


def require_linker(cl_device: Any) -> None:
    """Raises DeviceError where PoCL 3 could build no kernel: it links each with the system's `ld`, and
    aborts the process without one."""
    if "pocl 3." in cl_device.platform.version.lower() and shutil.which("ld") is None:
        raise DeviceError(
            "PoCL builds kernels with the system's linker `ld`, which is missing; install it "
            "(Debian, Ubuntu: apt install gcc libc6-dev) or choose another --device"
        )


def target_name(flags: set[str]) -> str:
    """The highest x86-64 level whose features, and those of the levels below, are all in `flags`."""
    for i, (name, _) in enumerate(_LEVELS):
        if all(needed <= flags for _, needed in _LEVELS[i:]):
            return name
    return "x86-64"


def misnomers(level: str) -> tuple[str, ...]:
    """LLVM's names for processors that are better called by this x86-64 level."""
    return (_UNKNOWN, *_WITHOUT_AVX512) if level == _LEVELS[0][0] else (_UNKNOWN,)


def _cpu_flags() -> set[str]:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("flags"):
            return set(line.partition(":")[2].split())
    return set()


def _pointers_to(name: str, address: int) -> list[int]:
    # Read by way of /proc/self/mem, which answers a wild pointer with an error instead of a crash.
    found, text = [], name.encode() + b"\0"
    with open("/proc/self/mem", "rb", buffering=0) as memory:

        def read(start: int, size: int) -> bytes:
            try:
                memory.seek(start)
                return memory.read(size)
            except (OSError, ValueError, OverflowError):
                return b""

        for place in range(address, address + _DEVICE_STRUCT_BYTES, _POINTER_BYTES):
            word = read(place, _POINTER_BYTES)
            if len(word) < _POINTER_BYTES:
                break
            if read(int.from_bytes(word, "little"), len(text)) == text:
                found.append(place)
    return found
