"""One growing buffer of the device, in which ranges of elements come and go."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any
from weakref import WeakSet

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core.errors import DeviceError
from incpt.device.device import Device

_LEAST_CAPACITY = 256
"""Elements of a buffer at least, so that neither the first meshes nor small scenes move it about."""
_ROOM = 1.25
"""How much larger than needed a buffer becomes when it grows. Copies to larger buffers then take a time that
is proportional to what is uploaded."""
_LEAST_USE = 0.25
"""A buffer of which less is taken gives memory back."""


class Range:
    """Elements `first` to `first + count` of a RangeBuffer. They are taken as long as somebody holds this.

    `first` changes when the buffer is packed, see `RangeBuffer.packings`.
    """

    __slots__ = ("__weakref__", "count", "first")

    def __init__(self, first: int, count: int) -> None:
        self.first, self.count = first, count


class RangeBuffer:
    """Elements of a dtype on a device; at most `most` of them, which is what kernels can address.

    Which elements are free follows from the ranges that live: nobody gives one back by hand, so that none is
    forgotten after an error. The queue of a device works in order; commands that were enqueued before a
    range was dropped, or before the buffer was replaced, still find what they need.

    name      what the elements are, for an error.
    buffer    the memory of the device. It is another one whenever it grows or shrinks.
    packings  how often ranges have moved to other places so far.
    """

    def __init__(self, device: Device, name: str, dtype: npt.DTypeLike, most: int) -> None:
        self.name, self.most = name, most
        self.packings = 0
        self._device, self._dtype = device, np.dtype(dtype)
        self._ranges: WeakSet[Range] = WeakSet()
        self._known_count = 0
        self._capacity = min(_LEAST_CAPACITY, most)
        self.buffer = self._empty(self._capacity)

    @property
    def capacity(self) -> int:
        """The elements for which there is memory."""
        return self._capacity

    @property
    def used(self) -> int:
        """The elements in ranges that live."""
        return sum(taken.count for taken in self._ranges)

    def add(self, arrays: Sequence[npt.NDArray[Any]]) -> list[Range]:
        """Upload arrays, none of them empty, by one command; a range for each, in order.

        Raises DeviceError where kernels cannot address so many elements or memory runs out. Ranges that
        live stay valid then.
        """
        if not arrays:
            return []
        first = self._make_room(sum(map(len, arrays)))
        joined = arrays[0] if len(arrays) == 1 else np.concatenate(arrays)
        self._device.write(self.buffer, joined, first * self._dtype.itemsize)
        ranges = []
        for array in arrays:
            ranges.append(Range(first, len(array)))
            first += len(array)
        self._ranges.update(ranges)
        self._known_count = len(self._ranges)
        return ranges

    def shrink(self) -> None:
        """Give memory back where ranges that were dropped leave little of the buffer taken."""
        if len(self._ranges) == self._known_count:
            return
        self._known_count = len(self._ranges)
        ranges = self._in_order()
        used = sum(taken.count for taken in ranges)
        capacity = max(_LEAST_CAPACITY, int(used * _ROOM))
        if used < _LEAST_USE * self._capacity and capacity < self._capacity:
            # Where memory is short the larger buffer serves as well.
            with suppress(DeviceError):
                self._pack(ranges, capacity)

    def _make_room(self, count: int) -> int:
        """Where `count` free elements lie side by side."""
        ranges = self._in_order()
        first = _smallest_gap(ranges, self._capacity, count)
        if first is not None:
            return first
        used = sum(taken.count for taken in ranges)
        needed = used + count
        if needed > self.most:
            raise DeviceError(
                f"device memory: the scene needs {needed:,} {self.name}, and kernels can address "
                f"{self.most:,}; use smaller meshes and images, or fewer of them"
            )
        try:
            self._pack(ranges, max(self._capacity, min(int(needed * _ROOM), self.most)))
        except DeviceError:
            self._pack(ranges, needed)
        return used

    def _pack(self, ranges: Sequence[Range], capacity: int) -> None:
        """Move to a buffer of `capacity` elements, in which all ranges lie side by side from the start on."""
        buffer, size = self._empty(capacity), self._dtype.itemsize
        starts = np.cumsum([0, *(taken.count for taken in ranges)]).tolist()
        # Neighbours are copied together: the first range and those that were moved as far as the one before.
        offsets = [taken.first - start for taken, start in zip(ranges, starts, strict=False)]
        heads = [i for i, offset in enumerate(offsets) if i == 0 or offset != offsets[i - 1]]
        for head, end in pairwise([*heads, len(ranges)]):
            nbytes = (starts[end] - starts[head]) * size
            self._device.copy(buffer, self.buffer, nbytes, starts[head] * size, ranges[head].first * size)
        self.buffer, self._capacity = buffer, capacity
        if any(offsets):
            self.packings += 1
            for taken, start in zip(ranges, starts, strict=False):
                taken.first = start

    def _in_order(self) -> list[Range]:
        return sorted(self._ranges, key=lambda taken: taken.first)

    def _empty(self, count: int) -> cl.Buffer:
        return self._device.empty(count * self._dtype.itemsize)


def _smallest_gap(ranges: Sequence[Range], capacity: int, count: int) -> int | None:
    """Where the smallest gap begins that has room for `count` elements; None where none has. `ranges` lie in
    order below `capacity`."""
    ends = [0, *(taken.first + taken.count for taken in ranges)]
    starts = [*(taken.first for taken in ranges), capacity]
    fitting = [(start - end, end) for end, start in zip(ends, starts, strict=True) if start - end >= count]
    return min(fitting)[1] if fitting else None
