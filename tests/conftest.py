"""For all tests."""

from __future__ import annotations

from hypothesis import settings

# A shared machine stalls now and then; what takes long shows in the durations that pytest prints.
settings.register_profile("incpt", deadline=None)
settings.load_profile("incpt")
