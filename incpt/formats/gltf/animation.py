"""Animations of glTF files: what they say at a time is put into the JSON, in place of what the file says."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from incpt.core.checks import one_of
from incpt.core.errors import InputError
from incpt.formats import import_report
from incpt.formats.gltf.accessors import Accessors
from incpt.formats.gltf.document import Document
from incpt.formats.gltf.table import Table
from incpt.scene.checks import LARGEST

_POINTER = "KHR_animation_pointer"
_WIDTHS = {"translation": 3, "rotation": 4, "scale": 3, "weights": 1}
"""Numbers of each property of a node; weights are as many as there are morph targets."""
_MOVABLE = re.compile(r"/(nodes|materials|cameras|meshes|extensions)/.+")
_INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE")
_NEARLY_ALIKE = 0.9995
"""Cosine of half an angle between rotations above which a straight line is as good as an arc."""

Array = npt.NDArray[np.float64]


def animate(time: float | None, clip: str | None, document: Document, accessors: Accessors) -> None:
    """Puts what the animations of a file say, `time` seconds after they began, into its JSON; nothing where
    it is None. The one of the name `clip` runs, or all at once, where that is None; where two move the same
    property, the first does. Raises InputError."""
    animations = list(document.root.tables("animations"))
    if time is None:
        if animations:
            what = "1 animation" if len(animations) == 1 else f"{len(animations)} animations"
            import_report.left_out(f"{what}: nothing moves without --time (`time` in Python)")
        return
    if clip is not None and animations:
        animations = [_chosen(clip, animations)]
    moved: dict[str, float | bool | list[float]] = {}
    for animation in animations:
        label = animation.text("name") or animation.place
        fresh = {}
        for channel in animation.tables("channels"):
            with channel.in_messages():
                pointer = _pointer(channel.table("target"), document)
                if pointer is None:
                    import_report.left_out(f"part of animation {label!r}: moves what cannot be moved")
                elif pointer in moved:
                    import_report.left_out(f"part of animation {label!r}: another moves the same")
                else:
                    sampler = animation.item("samplers", channel.whole("sampler", 0, 1 << 31))
                    fresh[pointer] = _value(pointer, _sampled(sampler, pointer, time, accessors))
        moved |= fresh
    for pointer, value in moved.items():
        document.put(pointer, value)


def _chosen(clip: str, animations: list[Table]) -> Table:
    """The animation of that name, or of that number from 0 on, as files without names have them. Raises
    InputError."""
    names = [animation.text("name") or str(number) for number, animation in enumerate(animations)]
    one_of("clip", clip, names)
    return animations[names.index(clip)]


def _pointer(target: Table, document: Document) -> str | None:
    """The JSON pointer (RFC 6901) to what a channel moves; None where that cannot be. Raises InputError."""
    path, node = target.text("path"), target.index("node")
    if path == "pointer":
        pointer = target.extension(_POINTER).text("pointer")
        return pointer if _MOVABLE.fullmatch(pointer) else None
    if path not in _WIDTHS or node is None:
        return None
    count = len(document.root.entries("nodes"))
    if node >= count:
        raise InputError(f"target.node: {node} is not among {count} nodes; the file is damaged")
    if path != "weights" and "matrix" in document.item("nodes", node):
        raise InputError(f"target.node: {node} stands by a matrix and is animated; the file is damaged")
    return f"/nodes/{node}/{path}"


def _value(pointer: str, numbers: Array) -> float | bool | list[float]:
    """Numbers as the JSON has them at a pointer."""
    if pointer.endswith("/weights") or len(numbers) > 1:
        return [float(number) for number in numbers]
    return bool(numbers[0] != 0) if pointer.endswith("/visible") else float(numbers[0])


def _sampled(sampler: Table, pointer: str, time: float, accessors: Accessors) -> Array:
    """The numbers of a property at a time. Raises InputError."""
    kind = sampler.text("interpolation", "LINEAR")
    with sampler.in_messages():
        one_of("interpolation", kind, _INTERPOLATIONS)
        times = accessors.doubles(sampler.whole("input", 0, 1 << 31), 1)[:, 0]
        raw = accessors.doubles(sampler.whole("output", 0, 1 << 31), 1, 2, 3, 4)
        if not (np.isfinite(times).all() and np.isfinite(raw).all() and (np.diff(times) > 0).all()):
            raise InputError("holds times that do not grow, or a number that is not finite")
        per_key = 3 if kind == "CUBICSPLINE" else 1
        width = raw.size // (len(times) * per_key)
        name = pointer.rsplit("/", 1)[1] if pointer.startswith("/nodes/") else ""
        # Weights are as many as there are morph targets.
        fits = name == "weights" or width == _WIDTHS.get(name, raw.shape[1])
        if not fits or width == 0 or len(times) * per_key * width != raw.size:
            raise InputError(f"has {len(raw)} values for {len(times)} times; the file is damaged")
        keys = np.clip(raw, -LARGEST, LARGEST).reshape(len(times), per_key, width)
    after = int(np.searchsorted(times, time, side="right"))
    if after == 0 or after == len(times):
        # Before the first key and behind the last their values stay.
        found: Array = keys[min(after, len(times) - 1), per_key // 2]
        return found
    is_rotation = name == "rotation"
    return _between(keys[after - 1], keys[after], times[after - 1 : after + 1], time, kind, is_rotation)


def _between(a: Array, b: Array, times: Array, time: float, kind: str, is_rotation: bool) -> Array:
    """Between two keys; appendix C of the specification of glTF 2.0."""
    start, length = float(times[0]), float(times[1] - times[0])
    t = (time - start) / length
    if kind == "CUBICSPLINE":
        # Each key has a tangent that arrives, a value, and a tangent that leaves.
        value: Array = (2 * t**3 - 3 * t**2 + 1) * a[1] + length * (t**3 - 2 * t**2 + t) * a[2]
        value += (-2 * t**3 + 3 * t**2) * b[1] + length * (t**3 - t**2) * b[0]
        return value
    first: Array = a[0]
    if kind == "STEP":
        return first
    return _slerp(first, b[0], t) if is_rotation else (1 - t) * first + t * b[0]


def _slerp(a: Array, b: Array, t: float) -> Array:
    cosine = float(a @ b)
    # Of the two ways round, the shorter one.
    b, cosine = (-b, -cosine) if cosine < 0 else (b, cosine)
    if cosine > _NEARLY_ALIKE:
        return (1 - t) * a + t * b
    angle = np.arccos(cosine)
    result: Array = (np.sin((1 - t) * angle) * a + np.sin(t * angle) * b) / np.sin(angle)
    return result
