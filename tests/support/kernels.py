"""Calls device functions of cl/ one by one, over arrays, and judges samples by chi-square."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache

import numpy as np
import numpy.typing as npt
import pyopencl as cl
from scipy import stats

from incpt.core import layout
from incpt.device import program
from incpt.device.device import Device

Array = npt.NDArray[np.floating]

SIGNIFICANCE = 1e-6
"""p-value below which a test fails: 1e-4 for about a hundred chi-square tests together (Bonferroni).
Seeds are fixed, so a test that passes goes on passing."""

_C_TYPES = {np.dtype(np.float32): "float", np.dtype(np.uint32): "uint", np.dtype(np.int32): "int"}
_C_TYPES |= {dtype: name for name, dtype in layout.STRUCTS.items()}


@cache
def device() -> Device:
    return Device()


@cache
def _kernel(files: tuple[str, ...], text: str, features: tuple[str, ...]) -> cl.Kernel:
    included: set[str] = set()
    paths = [program.files()[file] for file in files[1:]]
    first = device().program_text(files[0], features)
    program.source(program.files()[files[0]], included)
    code = "".join(program.source(path, included) for path in paths if path not in included)
    return cl.Kernel(device().build(f"{first}\n{code}\n{text}", "the test"), "test")


def call(
    files: str | Sequence[str],
    body: str,
    count: int,
    outputs: Sequence[str] = ("r",),
    features: tuple[str, ...] = (),
    **inputs: npt.NDArray[np.generic],
) -> list[npt.NDArray[np.float32]]:
    """Runs the OpenCL statements `body` for i = 0 .. count - 1, after the functions of cl/`files`.

    Every input is a buffer of its name (float32, uint32, int32 or a struct of layout), every output one
    of float32 with `count` places, which the body fills, as in "r[i] = hash(x[i]);".
    """
    typed = {
        n: np.ascontiguousarray(a, np.float32 if a.dtype.kind == "f" else None) for n, a in inputs.items()
    }
    parameters = [f"__global const {_C_TYPES[a.dtype]} *{n}" for n, a in typed.items()]
    parameters += [f"__global float *{name}" for name in outputs]
    text = (
        f"__kernel void test(const uint count, {', '.join(parameters)}) {{\n"
        f"    const uint i = get_global_id(0);\n    if (i >= count)\n        return;\n{body}\n}}\n"
    )
    kernel = _kernel((files,) if isinstance(files, str) else tuple(files), text, features)
    buffers = [device().upload(a) for a in typed.values()]
    results = [device().empty(4 * count) for _ in outputs]
    device().launch(kernel, count, np.uint32(count), *buffers, *results)
    return [device().read(result, np.empty(count, np.float32)) for result in results]


def uniforms(count: int, columns: int, seed: int) -> list[npt.NDArray[np.float32]]:
    """`columns` arrays of `count` numbers in [0, 1), as the kernels draw them: multiples of 2^-24."""
    bits = np.random.default_rng(seed).integers(0, 1 << 24, (columns, count))
    return list((bits * 2.0**-24).astype(np.float32))


def direction(theta: npt.ArrayLike, phi: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """(3, ...) unit vectors by angle from +z and azimuth, radians."""
    theta, phi = np.broadcast_arrays(theta, phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def chi_square(observed: Array, expected: Array) -> float:
    """p-value; bins that expect fewer than five samples are joined to one."""
    observed, expected = np.ravel(observed), np.ravel(expected)
    few = expected < 5
    pairs = [(observed[~few], expected[~few])]
    if expected[few].sum() >= 5:
        pairs.append((observed[few].sum(keepdims=True), expected[few].sum(keepdims=True)))
    elif observed[few].sum() > 40:
        return 0.0  # many samples where there should be next to none
    seen, due = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    return float(stats.chi2.sf(((seen - due) ** 2 / due).sum(), max(len(due) - 1, 1)))


def direction_p_value(
    samples: npt.NDArray[np.floating],
    valid: npt.NDArray[np.bool_],
    pdf: Callable[[npt.NDArray[np.float64]], Array],
    rows: int = 16,
    columns: int = 24,
    subdivision: int = 32,
) -> tuple[float, float]:
    """(p-value, integral of the pdf) of directions (3, N) against a density per solid angle.

    The sphere is cut into `rows` by polar angle and `columns` by azimuth, and the density integrated over
    each by the midpoint rule; samples that are not valid fall into a bin of their own, which expects what
    the density leaves of 1.
    """
    theta = (np.arange(rows * subdivision) + 0.5) * np.pi / (rows * subdivision)
    phi = (np.arange(columns * subdivision) + 0.5) * 2 * np.pi / (columns * subdivision)
    grid = direction(theta[:, None], phi[None, :]).reshape(3, -1)
    area = np.pi / len(theta) * 2 * np.pi / len(phi) * np.sin(theta)
    mass = np.asarray(pdf(grid), np.float64).reshape(len(theta), len(phi)) * area[:, None]
    expected = mass.reshape(rows, subdivision, columns, subdivision).sum(axis=(1, 3))
    x, y, z = np.asarray(samples, np.float64)[:, valid]
    row = np.minimum((np.arctan2(np.hypot(x, y), z) / np.pi * rows).astype(int), rows - 1)
    column = np.minimum((np.arctan2(y, x) / (2 * np.pi) % 1 * columns).astype(int), columns - 1)
    observed = np.bincount(row * columns + column, minlength=rows * columns)
    count, total = valid.size, float(expected.sum())
    p_value = chi_square(
        np.append(observed, count - valid.sum()), np.append(expected, max(1 - total, 0)) * count
    )
    return p_value, total


def struct_rows(dtype: np.dtype, rows: Sequence[Mapping[str, object]]) -> npt.NDArray[np.void]:
    """An array of a layout struct from field values; what is not given is 0."""
    result = np.zeros(len(rows), dtype)
    for row, values in zip(result, rows, strict=True):
        for name, value in values.items():
            row[name] = value
    return result
