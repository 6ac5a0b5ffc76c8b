"""On what a result was measured: machine, device, driver, versions, commit."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import pyopencl as cl

from incpt.benchmarks.kit.content import code_digest, digest
from incpt.device.device import Device

_PACKAGES = ("incpt", "numpy", "pyopencl", "pocl-binary-distribution", "mitsuba", "embreex", "bpy",
             "flip-evaluator")  # fmt: skip


def describe(device: Device | None) -> dict[str, Any]:
    """What a result depends on beside its settings, and `id`, a digest of it.

    The commit is told too but is not part of `id`: the digest of the sources (`code`) says more.
    """
    identity: dict[str, Any] = {**_machine(), **_device(device), **_versions(), "code": code_digest()}
    return {"id": digest(identity), **identity, **_commit()}


@cache
def _machine() -> dict[str, Any]:
    return {
        "machine": _processor(),
        "cores": usable_cores(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
    }


def usable_cores() -> int:
    """Logical cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or "unknown processor"


def _device(device: Device | None) -> dict[str, Any]:
    if device is None:
        return {}
    cl_device: cl.Device = device.cl_device
    return {
        "device": device.name,
        "driver": f"{cl_device.platform.version.strip()}, {cl_device.driver_version.strip()}",
        "compute_units": int(cl_device.max_compute_units),
    }


@cache
def _versions() -> dict[str, str]:
    found = {}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return {"versions": ", ".join(f"{name} {version}" for name, version in found.items())}


@cache
def _commit() -> dict[str, str]:
    folder = Path(__file__).resolve().parents[2]
    if not (folder / ".git").exists():
        return {"commit": "not in a checkout"}
    try:
        commit, changed = (
            subprocess.run(
                ["git", "-C", str(folder), *arguments], check=True, capture_output=True, text=True, timeout=30
            ).stdout.strip()
            for arguments in (("rev-parse", "--short=12", "HEAD"), ("status", "--porcelain", "incpt", "cl"))
        )
    except (OSError, subprocess.SubprocessError):
        return {"commit": "unknown"}
    return {"commit": commit + (" and changes" if changed else "")}


def command_line() -> str:
    """The command as it was typed, without the folder of the program."""
    program = Path(sys.argv[0]).name
    return " ".join(["incpt" if program == "__main__.py" else program, *sys.argv[1:]])
