"""Ranges of one growing buffer: what lives keeps its contents, what was dropped makes room."""

from __future__ import annotations

import gc

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from incpt.core.errors import DeviceError
from incpt.device.device import Device
from incpt.tables import range_buffer
from incpt.tables.range_buffer import Range, RangeBuffer

Words = npt.NDArray[np.uint32]


@pytest.fixture(autouse=True)
def _small_buffers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Buffers that grow and shrink from the first elements on."""
    monkeypatch.setattr(range_buffer, "_LEAST_CAPACITY", 4)


def words(count: int, first: int = 0) -> Words:
    return np.arange(first, first + count, dtype=np.uint32)


def read(device: Device, buffer: RangeBuffer, taken: Range) -> Words:
    return device.read(buffer.buffer, np.empty(taken.count, np.uint32), 4 * taken.first)


def buffer_of(device: Device, most: int = 1 << 20) -> RangeBuffer:
    return RangeBuffer(device, "words", np.uint32, most)


STEPS = st.lists(
    st.tuples(st.just("add"), st.lists(st.integers(1, 40), min_size=1, max_size=3))
    | st.tuples(st.just("drop"), st.lists(st.integers(0, 99), min_size=1, max_size=3))
    | st.just(("shrink", list[int]())),
    max_size=25,
)


@settings(max_examples=60, deadline=None)
@given(STEPS)
def test_what_lives_keeps_its_contents(device: Device, steps: list[tuple[str, list[int]]]) -> None:
    buffer, living = buffer_of(device), list[tuple[Range, Words]]()
    for step, (kind, numbers) in enumerate(steps):
        if kind == "add":
            arrays = [words(count, 1000 * step + 100 * i) for i, count in enumerate(numbers)]
            living += zip(buffer.add(arrays), arrays, strict=True)
        elif kind == "drop":
            for number in numbers[: len(living)]:
                del living[number % len(living)]
        else:
            buffer.shrink()
        check(device, buffer, living)


def check(device: Device, buffer: RangeBuffer, living: list[tuple[Range, Words]]) -> None:
    used = sum(len(array) for _, array in living)
    assert buffer.used == used <= buffer.capacity == buffer.buffer.size // 4
    for taken, array in living:
        np.testing.assert_array_equal(read(device, buffer, taken), array)


def test_a_gap_that_fits_is_used_again(device: Device) -> None:
    buffer = buffer_of(device)
    first, second, third = buffer.add([words(30), words(10), words(20)])
    memory, place = buffer.buffer, second.first
    del second
    (again,) = buffer.add([words(9, 500)])
    assert again.first == place and buffer.buffer is memory and buffer.packings == 0
    np.testing.assert_array_equal(read(device, buffer, first), words(30))
    np.testing.assert_array_equal(read(device, buffer, third), words(20))


def test_the_smallest_gap_that_fits_is_taken(device: Device) -> None:
    buffer = buffer_of(device)
    ranges = buffer.add([words(count) for count in (9, 1, 5, 1, 7, 1)])
    place = ranges[2].first
    del ranges[4], ranges[2], ranges[0]
    (taken,) = buffer.add([words(4)])
    assert taken.first == place


def test_gaps_that_are_too_small_are_joined(device: Device) -> None:
    """Half of the buffer is free, but in pieces: what lives moves together instead of growing the buffer."""
    buffer = buffer_of(device)
    ranges = buffer.add([words(10, 100 * i) for i in range(20)])
    capacity = buffer.capacity
    del ranges[::2]
    (large,) = buffer.add([words(60, 9000)])
    assert buffer.capacity == capacity and buffer.packings == 1
    check(
        device,
        buffer,
        [(taken, words(10, 100 * (2 * i + 1))) for i, taken in enumerate(ranges)]
        + [(large, words(60, 9000))],
    )
    np.testing.assert_array_equal(read(device, buffer, large), words(60, 9000))


def test_growing_alone_moves_nothing(device: Device) -> None:
    buffer = buffer_of(device)
    ranges = [buffer.add([words(50, 100 * i)])[0] for i in range(30)]
    assert buffer.packings == 0
    assert [taken.first for taken in ranges] == [50 * i for i in range(30)]


def test_copies_to_larger_buffers_are_few(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    copied = []
    copy = device.copy
    monkeypatch.setattr(device, "copy", lambda *args: (copied.append(args[2]), copy(*args)))
    buffer, ranges = buffer_of(device), []
    for _ in range(500):
        ranges += buffer.add([words(20)])
    assert sum(copied) < 5 * 4 * buffer.used


def test_memory_is_given_back(device: Device) -> None:
    buffer = buffer_of(device)
    large, small = buffer.add([words(10_000), words(10, 7)])
    buffer.shrink()
    assert buffer.capacity >= 10_010
    del large
    buffer.shrink()
    assert buffer.capacity < 20
    np.testing.assert_array_equal(read(device, buffer, small), words(10, 7))
    del small
    gc.collect()
    buffer.shrink()
    assert buffer.used == 0 and buffer.capacity == 4


def test_what_kernels_cannot_address_is_an_error(device: Device) -> None:
    buffer = buffer_of(device, most=100)
    kept = buffer.add([words(60)])
    with pytest.raises(
        DeviceError, match=r"the scene needs 101 words, and kernels can address 100; use smaller"
    ):
        buffer.add([words(41)])
    kept += buffer.add([words(40, 60)])
    assert buffer.capacity == 100
    np.testing.assert_array_equal(device.read(buffer.buffer, np.empty(100, np.uint32)), words(100))


def test_short_of_memory_nothing_is_lost(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    buffer = buffer_of(device)
    kept = buffer.add([words(100)])
    empty = device.empty

    def limited(nbytes: int) -> object:
        if nbytes > 4 * limit:
            raise DeviceError("device memory ran out")
        return empty(nbytes)

    limit = 150
    monkeypatch.setattr(device, "empty", limited)
    with pytest.raises(DeviceError, match="ran out"):
        buffer.add([words(51)])
    assert buffer.used == 100
    kept += buffer.add([words(50, 100)])  # exactly what is needed, since there is no room to spare
    np.testing.assert_array_equal(device.read(buffer.buffer, np.empty(150, np.uint32)), words(150))
    del kept[0]
    limit = 0
    buffer.shrink()
    np.testing.assert_array_equal(read(device, buffer, kept[0]), words(50, 100))


def test_launches_with_the_buffers_before_stay_right(device: Device) -> None:
    """A buffer that was replaced keeps what it had, and nothing is written to it any more."""
    buffer = buffer_of(device)
    kept = buffer.add([words(100)])
    before, place = buffer.buffer, kept[0].first
    kept += buffer.add([words(5000, 100)])
    assert buffer.buffer is not before
    np.testing.assert_array_equal(device.read(before, np.empty(100, np.uint32), 4 * place), words(100))
