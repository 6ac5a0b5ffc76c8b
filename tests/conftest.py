"""For all tests."""

from __future__ import annotations

import pytest
from hypothesis import settings

from incpt.device.device import Device

# A shared machine stalls now and then; what takes long shows in the durations that pytest prints.
settings.register_profile("incpt", deadline=None)
settings.load_profile("incpt")


@pytest.fixture(scope="session")
def device() -> Device:
    """The device that all tests render on, with the kernels built so far."""
    return Device()
