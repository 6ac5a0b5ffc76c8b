"""OpenGL without a window, for what draws."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="module")
def context() -> Iterator[Any]:
    import moderngl  # Tests that need it are skipped where the editor's packages are not installed.

    try:
        made = moderngl.create_context(standalone=True, backend="egl", require=330)
    except Exception as error:
        if os.environ.get("CI"):
            raise
        pytest.skip(f"no offscreen OpenGL context can be made here: {error}")
    # Left current it would keep a window's context, in another test, from becoming so.
    with made:
        yield made
    made.release()
