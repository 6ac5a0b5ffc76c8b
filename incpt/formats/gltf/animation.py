"""Animations of glTF files: what they say of nodes at a time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from incpt.core.checks import one_of
from incpt.core.errors import InputError
from incpt.formats import import_report
from incpt.formats.gltf.accessors import Accessors
from incpt.formats.gltf.document import Document
from incpt.formats.gltf.nodes import Pose
from incpt.formats.gltf.table import Table
from incpt.scene.checks import LARGEST

_WIDTHS = {"translation": 3, "rotation": 4, "scale": 3, "weights": 1}
"""Numbers of each property; weights are as many as there are morph targets."""
_INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE")
_NEARLY_ALIKE = 0.9995
"""Cosine of half an angle between rotations above which a straight line is as good as an arc."""

Array = npt.NDArray[np.float64]


def pose_at(time: float | None, document: Document, accessors: Accessors) -> Pose:
    """What the animations of a file say, `time` seconds after they began; nothing where it is None. All run
    at once; where two move the same property, the first does. Raises InputError."""
    animations = list(document.root.tables("animations"))
    if time is None:
        if animations:
            what = "1 animation" if len(animations) == 1 else f"{len(animations)} animations"
            import_report.left_out(f"{what}: nothing moves without --time (`time` in Python)")
        return {}
    pose: dict[int, dict[str, Array]] = {}
    count = len(document.root.entries("nodes"))
    for animation in animations:
        label = animation.text("name") or animation.place
        fresh: dict[tuple[int, str], Array] = {}
        for channel in animation.tables("channels"):
            with channel.in_messages():
                target = channel.table("target")
                path, node = target.text("path"), target.index("node")
                if path not in _WIDTHS or node is None:
                    import_report.left_out(f"{path or 'a channel'} of animation {label!r}: cannot be moved")
                    continue
                if node >= count:
                    raise InputError(f"target.node: {node} is not among {count} nodes; the file is damaged")
                if path in pose.get(node, {}):
                    import_report.left_out(f"part of animation {label!r}: another moves the same")
                    continue
                sampler = animation.item("samplers", channel.whole("sampler", 0, 1 << 31))
                fresh[node, path] = _sampled(sampler, path, time, accessors)
        for (node, path), value in fresh.items():
            pose.setdefault(node, {})[path] = value
    return _complete(pose, document)


def _complete(pose: dict[int, dict[str, Array]], document: Document) -> Pose:
    """Without those whose nodes stand by a matrix, which glTF forbids to be animated."""
    for node, properties in pose.items():
        table = document.item("nodes", node)
        if "matrix" in table and properties.keys() - {"weights"}:
            raise InputError(f"{table.place}: stands by a matrix and is animated; the file is damaged")
    return pose


def _sampled(sampler: Table, path: str, time: float, accessors: Accessors) -> Array:
    """The value of a property at a time. Raises InputError."""
    kind = sampler.text("interpolation", "LINEAR")
    with sampler.in_messages():
        one_of("interpolation", kind, _INTERPOLATIONS)
        times = accessors.floats(sampler.whole("input", 0, 1 << 31), 1)[:, 0].astype(np.float64)
        raw = accessors.floats(sampler.whole("output", 0, 1 << 31), _WIDTHS[path]).astype(np.float64)
        if not (np.isfinite(times).all() and np.isfinite(raw).all() and (np.diff(times) > 0).all()):
            raise InputError("holds times that do not grow, or a number that is not finite")
        values = np.clip(raw, -LARGEST, LARGEST)
        per_key = 3 if kind == "CUBICSPLINE" else 1
        width = len(values) // (len(times) * per_key) * _WIDTHS[path]
        if (
            width == 0
            or len(times) * per_key * width != values.size
            or (path != "weights" and width != _WIDTHS[path])
        ):
            raise InputError(f"has {len(values)} values for {len(times)} times; the file is damaged")
        keys = values.reshape(len(times), per_key, width)
    after = int(np.searchsorted(times, time, side="right"))
    if after == 0 or after == len(times):
        # Before the first key and behind the last their values stay.
        found: Array = keys[min(after, len(times) - 1), per_key // 2]
    else:
        found = _between(keys[after - 1], keys[after], times[after - 1 : after + 1], time, kind, path)
    return found


def _between(a: Array, b: Array, times: Array, time: float, kind: str, path: str) -> Array:
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
    return _slerp(first, b[0], t) if path == "rotation" else (1 - t) * first + t * b[0]


def _slerp(a: Array, b: Array, t: float) -> Array:
    cosine = float(a @ b)
    # Of the two ways round, the shorter one.
    b, cosine = (-b, -cosine) if cosine < 0 else (b, cosine)
    if cosine > _NEARLY_ALIKE:
        return (1 - t) * a + t * b
    angle = np.arccos(cosine)
    result: Array = (np.sin((1 - t) * angle) * a + np.sin(t * angle) * b) / np.sin(angle)
    return result
