"""A bound on the memory that reading a file takes.

USD's library takes memory for as many values as a crate file says it holds before it compares that with the
file: one of 8 KB can ask for all that there is, and the system then ends the process.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

LEAST = 2 << 30
"""Bytes that any file may take: threads and libraries count too."""
TIMES_ITS_SIZE = 64


@contextmanager
def bounded_memory(size: int) -> Iterator[None]:
    """Inside, the process takes as much more memory as a file of so many bytes may need, and no more: what
    goes beyond fails with a MemoryError. Only Linux knows such a bound; elsewhere there is none."""
    if sys.platform != "linux":
        yield
        return
    import resource

    before = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    bound = pages * resource.getpagesize() + max(LEAST, TIMES_ITS_SIZE * size)
    limits = [limit for limit in (bound, *before) if limit != resource.RLIM_INFINITY]
    try:
        with suppress(ValueError, OSError):  # Someone else has set a lower one.
            resource.setrlimit(resource.RLIMIT_AS, (min(limits), before[1]))
        yield
    finally:
        with suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_AS, before)
