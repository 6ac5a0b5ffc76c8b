"""Digests of what is measured, so that results and reference pictures are found again by their content."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import resources
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from incpt.device.program import files
from incpt.scene.mesh import Mesh

DIGEST_CHARACTERS = 16

# Where something came from, and how a scene proposes to be rendered, is not what it looks like.
_NOT_CONTENT = ("source", "settings")

_MEASURED = (
    "core", "picture", "scene", "formats", "formats.appearance", "formats.gltf", "formats.gltf_writer",
    "formats.mitsuba", "formats.obj", "formats.pbrt", "formats.ply", "formats.threemf", "formats.usd",
    "device", "accel", "tables",
    "render", "render.impact", "viewer",
)  # fmt: skip
"""Packages of incpt that a result may depend on; what only puts things on the terminal is left out."""
_OF_STRATEGIES = ("impact/",)
"""Folders of cl/ that only strategies use, and no converged picture."""

_meshes: WeakKeyDictionary[Mesh, str] = WeakKeyDictionary()


def digest(*parts: Any) -> str:
    """A short hash of numbers, texts, arrays, dataclasses, and mappings and sequences of them.

    Equal content has an equal digest in any process. Raises TypeError for anything else.
    """
    state = hashlib.sha256()
    for part in parts:
        _feed(state, part)
    return state.hexdigest()[:DIGEST_CHARACTERS]


def _feed(state: Any, value: Any) -> None:
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        # A whole number counts as the same whether it was written 1 or 1.0.
        plain = int(value) if isinstance(value, float) and value.is_integer() else value
        state.update(f"{type(plain).__name__}:{plain!r};".encode())
    elif isinstance(value, np.ndarray):
        state.update(f"array:{value.dtype.str}:{value.shape};".encode())
        state.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, Mapping):
        _feed_all(state, "mapping", [part for key in sorted(value) for part in (key, value[key])])
    elif isinstance(value, list | tuple):
        _feed_all(state, "sequence", value)
    elif isinstance(value, Mesh):
        # Hashing millions of vertices takes a while.
        if value not in _meshes:
            _meshes[value] = digest("mesh", value.vertices, value.faces, value.normals)
        state.update(_meshes[value].encode())
    elif is_dataclass(value):
        names = [field.name for field in fields(value) if field.name not in _NOT_CONTENT]
        _feed_all(state, type(value).__name__, [p for n in names for p in (n, getattr(value, n))])
    else:
        raise TypeError(f"{type(value).__name__} has no digest")


def _feed_all(state: Any, kind: str, parts: Sequence[Any]) -> None:
    state.update(f"{kind}:{len(parts)};".encode())
    for part in parts:
        _feed(state, part)


@cache
def code_digest() -> str:
    """Of the renderer's own sources: a result of other code is another result."""
    sources = {
        f"{package}/{item.name}": item.read_text("utf-8")
        for package in (f"incpt.{name}" for name in _MEASURED)
        for item in resources.files(package).iterdir()
        if item.name.endswith(".py")
    }
    return digest(sources | _kernels())


@cache
def kernel_digest() -> str:
    """Of the kernels that decide how a converged picture looks."""
    return digest({path: text for path, text in _kernels().items() if not path.startswith(_OF_STRATEGIES)})


def _kernels() -> dict[str, str]:
    folder = resources.files("incpt.cl")
    return {path: (folder / f"{path}.cl").read_text("utf-8") for path in files().values()}
