"""The OpenCL device: choose one, build the kernels of cl/, launch them, move arrays.

Everything that differs between devices stands in `Tuning`, chosen once by the kind of device.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import arena, layout
from incpt.core.checks import one_of, require, whole
from incpt.core.errors import DeviceError, InputError
from incpt.device import pocl, program

DEVICE_VARIABLE = "INCPT_DEVICE"

_SCALARS = (np.generic, np.ndarray)
"""Arguments of kernels that are passed by value: numbers, and structs as arrays without a dimension."""


_MOST_DEVICES = 1000
"""Indices up to this one are looked for."""

BUILD_SIZES = (1, 1 << 17)
"""Work-items of the launches after which a kernel is built to the end: PoCL translates one to machine code
at its first launch, once for small grids and once for large ones."""


@dataclass(frozen=True)
class Tuning:
    """What suits a kind of device. `chunk_paths`: paths traced at a time, so that their state stays in
    the caches of a CPU and fills a GPU; `work_group`: work-items per group of the path kernels."""

    chunk_paths: int
    work_group: int


_CPU = Tuning(chunk_paths=1 << 17, work_group=layout.WORK_GROUP_SIZE)
_GPU = Tuning(chunk_paths=1 << 20, work_group=layout.WORK_GROUP_SIZE)


class Device:
    """An OpenCL device with the kernels built for it.

    `choice` is an index or a part of the name as `incpt devices` shows them; None takes INCPT_DEVICE,
    else the first GPU, else the first device. `features` (program.FEATURES) are part of every program that it
    builds. Raises InputError where no device has that name, and DeviceError where there is none at all.
    """

    def __init__(self, choice: str | int | None = None, features: tuple[str, ...] = ()) -> None:
        if not isinstance(choice, str | None):
            choice = whole("device (index, or a part of its name)", choice, 0, _MOST_DEVICES)
        require("features", features, (tuple, list), "a list of names")
        for feature in features:
            one_of("features", feature, program.FEATURES)
        self.features = tuple(features)
        self.cl_device = choose(choice)
        pocl.require_linker(self.cl_device)
        self.target = pocl.name_target(self.cl_device)
        try:
            self.context = cl.Context([self.cl_device])
            self.queue = cl.CommandQueue(self.context)
        except cl.Error as error:
            raise DeviceError(
                f"device {self.name!r} cannot be opened: {error}; try another --device"
            ) from error
        self._kernels: dict[tuple[str, tuple[str, ...]], cl.Kernel] = {}
        self._typed: set[cl.Kernel] = set()
        self.built: set[tuple[str, ...]] = set()
        """The variants of the kernels that were built as a whole; see `SceneTables.variant`."""

    @property
    def name(self) -> str:
        return device_name(self.cl_device)

    @property
    def is_cpu(self) -> bool:
        return bool(self.cl_device.type & cl.device_type.CPU)

    @property
    def is_pocl(self) -> bool:
        return "pocl" in self.cl_device.platform.version.lower()

    @property
    def is_clang_cpu(self) -> bool:
        """Whether kernels are compiled for a CPU by a clang whose intrinsics and loop pragmas they may use:
        that of PoCL, and that of Intel's runtime."""
        return self.is_cpu and (self.is_pocl or "intel" in self.cl_device.platform.name.lower())

    @cached_property
    def divides_exactly(self) -> bool:
        """Whether quotients and roots are rounded correctly, where programs are built with
        program.EXACT_DIVISION."""
        exact = cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT
        return bool(self.cl_device.single_fp_config & exact)

    @cached_property
    def block_paths(self) -> int | None:
        """How many paths a block takes (arena.py). None: kernels over blocks, which are made for the
        compilers and caches of CPUs, do not run here, or local memory is too small."""
        return arena.block_paths(self.cl_device.local_mem_size) if self.is_clang_cpu else None

    @cached_property
    def tuning(self) -> Tuning:
        return _CPU if self.is_cpu else _GPU

    def kernel(self, name: str, file: str | None = None, features: tuple[str, ...] = ()) -> cl.Kernel:
        """The kernel `name` of the file of cl/ called `file` (`name` by default), built at its first use.

        `features` are preprocessor names that choose a variant of it. Raises DeviceError with the
        compiler's first error where it does not build.
        """
        if (name, features) not in self._kernels:
            file = file or name
            text = self.program_text(file, features)
            built = self.build(text, f"cl/{program.files()[file]}.cl")
            # cl.Kernel(program, name), fetched once: attribute access makes a new one each time.
            for kernel_name in built.kernel_names.split(";"):
                self._kernels[kernel_name, features] = cl.Kernel(built, kernel_name)
        return self._kernels[name, features]

    def launch(self, kernel: cl.Kernel, size: int, *args: Any, work_group: int | None = None) -> cl.Event:
        """Enqueue `size` work-items, rounded up to whole groups. `args` are buffers and numpy scalars, of the
        same types in every launch of a kernel."""
        group = work_group or self.tuning.work_group
        if kernel not in self._typed:
            self._type(kernel, args)
        try:
            return kernel(self.queue, (-(-size // group) * group,), (group,), *args)
        except cl.Error as error:
            raise DeviceError(_explain(error, f"kernel {kernel.function_name}")) from error

    def _type(self, kernel: cl.Kernel, args: Sequence[Any]) -> None:
        # pyopencl then packs arguments without looking at each: microseconds instead of some ten of them. It
        # keeps how to pack them in a cache on disk, and warns where another version of incpt has left there
        # the same struct with other names of fields; it then goes on as if there was nothing.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            kernel.set_scalar_arg_dtypes([arg.dtype if isinstance(arg, _SCALARS) else None for arg in args])
        self._typed.add(kernel)

    def empty(self, nbytes: int) -> cl.Buffer:
        """An uninitialised buffer, at least 4 bytes. Raises DeviceError where memory runs out."""
        return self._buffer(max(int(nbytes), 4))

    def upload(self, array: npt.NDArray[Any]) -> cl.Buffer:
        """A new buffer with the bytes of `array`. Raises DeviceError where memory runs out."""
        if not array.nbytes:
            return self.empty(0)
        # Filled as it is made: a command would wait for a thread of the driver to wake up.
        return self._buffer(array.nbytes, np.ascontiguousarray(array))

    def _buffer(self, nbytes: int, array: npt.NDArray[Any] | None = None) -> cl.Buffer:
        limit = self.cl_device.max_mem_alloc_size
        if nbytes > limit:
            raise DeviceError(
                f"device memory: one buffer of {nbytes / 2**20:,.0f} MiB is over the "
                f"{limit / 2**20:,.0f} MiB that {self.name} allows; use a smaller image or scene"
            )
        flags = cl.mem_flags.READ_WRITE | (0 if array is None else cl.mem_flags.COPY_HOST_PTR)
        try:
            return cl.Buffer(self.context, flags, nbytes if array is None else 0, array)
        except cl.Error as error:
            raise DeviceError(_explain(error, f"a buffer of {nbytes / 2**20:,.1f} MiB")) from error

    def write(self, buffer: cl.Buffer, array: npt.NDArray[Any], offset: int = 0) -> None:
        """Copy `array` into `buffer`, `offset` bytes from its start."""
        try:
            cl.enqueue_copy(self.queue, buffer, np.ascontiguousarray(array), dst_offset=offset)
        except cl.Error as error:
            raise DeviceError(_explain(error, "an upload")) from error

    def read(self, buffer: cl.Buffer, array: npt.NDArray[Any], offset: int = 0) -> npt.NDArray[Any]:
        """Fill `array` from `buffer`, `offset` bytes from its start, once all earlier work is done."""
        try:
            cl.enqueue_copy(self.queue, array, buffer, src_offset=offset)
        except cl.Error as error:
            raise DeviceError(_explain(error, "a read")) from error
        return array

    def copy(
        self, target: cl.Buffer, source: cl.Buffer, nbytes: int, target_offset: int, source_offset: int
    ) -> None:
        """Copy `nbytes` between buffers, from these offsets in bytes on, once all earlier work is done."""
        try:
            cl.enqueue_copy(
                self.queue, target, source,
                byte_count=nbytes, dst_offset=target_offset, src_offset=source_offset,
            )  # fmt: skip
        except cl.Error as error:
            raise DeviceError(_explain(error, "a copy")) from error

    def read_later(self, buffer: cl.Buffer, array: npt.NDArray[Any], offset: int = 0) -> cl.Event:
        """Fill `array` from `buffer` like `read`, but return at once. It is filled when the event is done."""
        try:
            return cl.enqueue_copy(self.queue, array, buffer, src_offset=offset, is_blocking=False)
        except cl.Error as error:
            raise DeviceError(_explain(error, "a read")) from error

    def fill(self, buffer: cl.Buffer, value: int, nbytes: int, offset: int = 0) -> None:
        """Set `nbytes` of `buffer` to the 32-bit pattern `value`."""
        try:
            cl.enqueue_fill_buffer(self.queue, buffer, np.array(value, np.uint32), offset, nbytes)
        except cl.Error as error:
            raise DeviceError(_explain(error, "a fill")) from error

    def finish(self) -> None:
        """Wait until everything that was enqueued is done."""
        try:
            self.queue.finish()
        except cl.Error as error:
            raise DeviceError(_explain(error, "the device")) from error

    def program_text(self, file: str, features: tuple[str, ...] = ()) -> str:
        """The whole source of the program around the file of cl/ called `file`, as this device builds it."""
        of_device = {"CLANG_CPU": self.is_clang_cpu, "INEXACT_DIVISION": not self.divides_exactly}
        own = dict.fromkeys((*self.features, *(name for name, holds in of_device.items() if holds)))
        paths = self.block_paths or arena.BLOCK_SIZES[0]
        return program.program_text(program.files()[file], (*features, *own), self.target, paths)

    def build(self, text: str, what: str) -> cl.Program:
        """The program of that text; `what` names it in an error. Raises DeviceError with the compiler's first
        error where it does not build."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", cl.CompilerWarning)
                options = [
                    *program.BUILD_OPTIONS,
                    *([program.EXACT_DIVISION] if self.divides_exactly else []),
                ]
                built: cl.Program = cl.Program(self.context, text).build(options=options)
                return built
        except cl.Error as error:
            raise DeviceError(
                f"{what} does not build on {self.name}: {program.first_error(str(error), text)}"
            ) from error


def all_devices() -> list[cl.Device]:
    """Every OpenCL device of the machine, GPUs first, in the order of `incpt devices`."""
    try:
        platforms = cl.get_platforms()
    except cl.Error:
        platforms = []
    found = []
    for platform in platforms:
        try:
            found += platform.get_devices()
        except cl.Error:
            continue  # a platform without a device says so by an error
    return sorted(found, key=lambda device: not device.type & cl.device_type.GPU)


def device_name(cl_device: cl.Device) -> str:
    """Platform and device as a user sees them."""
    return f"{cl_device.platform.name.strip()}: {cl_device.name.strip()}"


def choose(choice: str | int | None = None) -> cl.Device:
    """The device that `choice` (index or part of the name), INCPT_DEVICE or the default order names."""
    devices = all_devices()
    if not devices:
        raise DeviceError('no OpenCL device was found; install one, e.g. pip install "pyopencl[pocl]"')
    origin = "--device"
    if choice is None and os.environ.get(DEVICE_VARIABLE):
        choice, origin = os.environ[DEVICE_VARIABLE], DEVICE_VARIABLE
    if choice is None:
        return devices[0]
    text = str(choice).strip()
    if text.isdecimal() and int(text) < len(devices):
        return devices[int(text)]
    if not text.isdecimal():
        for device in devices:
            if text.lower() in device_name(device).lower():
                return device
    listed = "; ".join(f"{i} = {device_name(device)}" for i, device in enumerate(devices))
    raise InputError(f"{origin}: no device {text!r}; choose one of {listed}")


def _explain(error: cl.Error, what: str) -> str:
    text = str(error)
    if any(
        word in text for word in ("MEM_OBJECT_ALLOCATION_FAILURE", "OUT_OF_RESOURCES", "OUT_OF_HOST_MEMORY")
    ):
        return f"device memory ran out for {what}; use a smaller image or scene, or another --device"
    return f"{what} failed: {text.splitlines()[0]}"
