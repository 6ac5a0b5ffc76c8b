"""No kernel reads or writes outside of a buffer: under the simulator Oclgrind, which checks every access, and
on a device whose buffers end where memory ends."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.checked import SCENES

_TESTS = Path(__file__).parents[1]
_MEMORY = ["--local-mem-size", "300000", "--global-mem-size", "4000000000"]


@pytest.fixture(scope="module")
def oclgrind() -> str:
    """The program; tests that need it are skipped without it, and fail under CI."""
    found = shutil.which("oclgrind")
    if found is None and not os.environ.get("CI"):
        pytest.skip("oclgrind is not installed")
    assert found is not None, "oclgrind is not installed"
    return found


_RUNS = [(scene, schedule) for scene in SCENES for schedule in ("wavefront", "blocks")]
# The simulator does not know all that clang makes of these, which blocks test against each face.
_SIMULATED = [run for run in _RUNS if run not in (("flat", "blocks"), ("smooth", "blocks"))]
_IN_MEMORY = [
    pytest.param(*run, marks=() if run == ("empty", "wavefront") else pytest.mark.slow) for run in _RUNS
]


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "schedule"), _SIMULATED)
def test_no_kernel_leaves_its_buffers(oclgrind: str, scene: str, schedule: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    command = [oclgrind, "--log", str(log), *_MEMORY, sys.executable, "-m", "support.checked"]
    command += ["simulator", schedule, scene]
    run = subprocess.run(command, cwd=_TESTS, capture_output=True, text=True, timeout=900, check=False)
    assert run.returncode == 0, run.stderr[-3000:]
    found = log.read_text() if log.exists() else ""
    assert "Invalid" not in found and "error" not in found.lower(), found[:3000]


@pytest.mark.parametrize(("scene", "schedule"), _IN_MEMORY)
def test_kernels_survive_where_memory_ends(scene: str, schedule: str) -> None:
    command = [sys.executable, "-m", "support.checked", "memory", schedule, scene]
    run = subprocess.run(command, cwd=_TESTS, capture_output=True, text=True, timeout=300, check=False)
    assert run.returncode == 0, run.stderr[-3000:]
