"""Rules of timing, the fitted exponent, and numbers for people."""

from __future__ import annotations

import subprocess
import sys
import time
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from incpt.benchmarks.kit import timing
from incpt.benchmarks.kit.fit import fitted
from incpt.benchmarks.kit.timing import Load, LoadMeter, interleaved, significant, summary


@given(st.integers(1, 6), st.integers(1, 7))
def test_programs_take_turns(programs: int, repetitions: int) -> None:
    order = interleaved(list(range(programs)), repetitions)
    assert Counter(order) == Counter((r, p) for r in range(repetitions) for p in range(programs))
    assert [r for r, _ in order] == sorted(r for r, _ in order)
    # In every pair of turns each program stands as early as late, so that a drift hits all alike.
    if repetitions % 2 == 0:
        places = [sum(i for i, (_, p) in enumerate(order) if p == q) for q in range(programs)]
        assert len(set(places)) == 1


def test_median_and_spread() -> None:
    found = summary([4.0, 1.0, 2.0])
    assert (found.median, found.low, found.high, found.count) == (2.0, 1.0, 4.0, 3)
    assert found.spread == pytest.approx(0.75)
    assert found.text() == "2.00 ±75 %"
    assert summary([2.0]).text() == "2.00"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.012345, "0.0123"),
        (1.5, "1.50"),
        (99.96, "100.0"),
        (1234567, "1,234,567"),
        (0, "0"),
        (2e-7, "2e-07"),
    ],
)
def test_significant_digits(value: float, text: str) -> None:
    assert significant(value) == text


def test_busy_machine() -> None:
    assert not Load(10, 0.05, 0.1, 2).busy
    assert Load(10, 0.5, 0.1, 2).busy
    assert not Load(0.05, 0.5, 0.1, 2).busy  # of so short a time the ticks of the clock say nothing
    assert Load(10, 0.5, 0.123, 2).as_row() == {"busy": True, "other_cores": 0.5, "load_average": 0.12}


def test_load_is_what_others_had(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = {"machine": 100.0, "own": 10.0, "now": 50.0}
    monkeypatch.setattr(timing, "_machine_seconds", lambda: clock["machine"])
    monkeypatch.setattr(LoadMeter, "_own_seconds", lambda self: clock["own"])
    monkeypatch.setattr(timing.time, "perf_counter", lambda: clock["now"])
    meter = LoadMeter()
    clock.update(machine=118.0, own=25.0, now=60.0)
    assert meter.read().other_cores == pytest.approx(0.3)
    clock.update(own=29.0)  # the two clocks do not tick together
    assert meter.read().other_cores == 0


@pytest.mark.slow
def test_work_of_workers_is_our_own_and_that_of_strangers_is_not() -> None:
    spin = "import time; end = time.process_time() + 0.3\nwhile time.process_time() < end: pass"
    meter = LoadMeter()
    before = meter._own_seconds()
    subprocess.run([sys.executable, "-c", spin], check=True)
    assert meter._own_seconds() - before > 0.25
    # A stranger: the shell that starts it ends at once, so that it is nobody's child here.
    longer = spin.replace("0.3", "1.0")
    subprocess.run(["sh", "-c", '"$0" -c "$1" &', sys.executable, longer], check=True)
    time.sleep(0.2)
    meter = LoadMeter()
    before = meter._own_seconds()
    time.sleep(0.5)
    assert meter._own_seconds() - before < 0.2
    assert meter.read().other_cores > 0.3


@given(
    st.floats(-2, 3),
    st.floats(0.01, 100),
    st.lists(st.integers(1, 10**6), min_size=3, max_size=8, unique=True),
)
def test_exponent_of_a_power_law(exponent: float, factor: float, sizes: list[int]) -> None:
    law = fitted(sizes, [factor * size**exponent for size in sizes])
    assert law is not None
    assert law.exponent == pytest.approx(exponent, abs=1e-6)
    assert law.error == pytest.approx(0, abs=1e-5)
    assert law.at(sizes[0]) == pytest.approx(factor * sizes[0] ** exponent, rel=1e-4)


def test_exponent_needs_two_sizes() -> None:
    assert fitted([], []) is None
    assert fitted([10, 10], [1, 2]) is None
    assert fitted([10, 20], [1, 0]) is None  # a cost of nothing has no logarithm
    two = fitted([10, 100], [1, 10])
    assert two is not None and two.error is None and two.text() == "n^1.00"
    noisy = fitted([1, 10, 100], [1, 12, 90])
    assert noisy is not None and noisy.error is not None and 0 < noisy.error < 0.2
