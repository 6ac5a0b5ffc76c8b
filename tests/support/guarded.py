"""Buffers of a device behind which no memory may be touched: a kernel that leaves one ends the process."""

from __future__ import annotations

import ctypes
import mmap
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.device.device import Device

_ALIGNMENT = 128
"""Of buffers, in bytes: what kernels may take for granted."""
_GUARD = 1 << 26
"""Bytes on both sides of a buffer that belong to nobody: as far as an index of 16 bits reaches, and more."""
_PROT_NONE = 0

_libc = ctypes.CDLL(None, use_errno=True)
_libc.mmap.restype = ctypes.c_void_p
_libc.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long]
_libc.mprotect.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]


class GuardedDevice(Device):
    """A device on which each buffer ends where readable memory ends. Memory is not given back."""

    def _buffer(self, nbytes: int, array: npt.NDArray[Any] | None = None) -> cl.Buffer:
        memory = guarded(nbytes)
        if array is not None:
            memory[:] = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR
        return cl.Buffer(self.context, flags, hostbuf=memory)


def guarded(nbytes: int) -> npt.NDArray[np.uint8]:
    """(nbytes,) of memory behind which, up to its alignment, nothing may be touched; what lies before it is
    no index of anything."""
    aligned = -(-nbytes // _ALIGNMENT) * _ALIGNMENT
    pages = -(-aligned // mmap.PAGESIZE) * mmap.PAGESIZE
    flags = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
    start = _libc.mmap(None, pages + 2 * _GUARD, _PROT_NONE, flags, -1, 0)
    assert start not in (None, ctypes.c_void_p(-1).value), "no address space is left"
    first = start + _GUARD
    assert _libc.mprotect(first, pages, mmap.PROT_READ | mmap.PROT_WRITE) == 0
    # What is read there nevertheless leads far away.
    ctypes.memset(first, 0x7F, pages)
    place = first + pages - aligned
    return np.ctypeslib.as_array((ctypes.c_uint8 * nbytes).from_address(place))
