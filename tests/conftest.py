"""For all tests."""

from __future__ import annotations

import os

import pytest
from hypothesis import settings

from incpt.device.device import Device

# A shared machine stalls now and then; what takes long shows in the durations that pytest prints.
# Under CI examples are the same in each run, so that a commit is judged by what it changes; elsewhere they
# are others each time. Hypothesis has such a profile, but takes it or not by what a machine looks like to it.
_IS_CI = bool(os.environ.get("CI"))
settings.register_profile(
    "incpt", deadline=None, derandomize=_IS_CI, database=None if _IS_CI else settings.default.database
)
settings.load_profile("incpt")


@pytest.fixture(scope="session")
def device() -> Device:
    """The device that all tests render on, with the kernels built so far."""
    return Device()
