"""The random numbers of cl/base/rng.cl: what they are, how well they fill the square, and that nothing is
correlated with anything."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import SIGNIFICANCE, call, chi_square

Uints = npt.NDArray[np.uint32]

_BODY = "Uniform2 x = uniform_2d(pixel_seed(pixel[i], seed[i]), sample[i], pair[i]); u[i] = x.u; v[i] = x.v;"


def _points(pixel: object, sample: object, pair: object, seed: object) -> npt.NDArray[np.float64]:
    """(2, N) from the device, for any mixture of arrays and numbers."""
    columns = [np.asarray(a, np.uint32) for a in (pixel, sample, pair, seed)]
    pixel, sample, pair, seed = (np.ravel(a) for a in np.broadcast_arrays(*columns))
    u, v = call("rng", _BODY, len(pixel), ("u", "v"), pixel=pixel, sample=sample, pair=pair, seed=seed)
    return np.stack([u, v]).astype(np.float64)


# The construction once more, from its definitions: direction numbers, and bits reversed one by one.


def _reverse(x: Uints) -> Uints:
    bits = (x[..., None] >> np.arange(32, dtype=np.uint32)) & np.uint32(1)
    return np.asarray((bits << np.arange(31, -1, -1, dtype=np.uint32)).sum(axis=-1, dtype=np.uint32))


def _hash(x: Uints) -> Uints:
    x = (x ^ (x >> np.uint32(16))) * np.uint32(0x7FEB352D)
    x = (x ^ (x >> np.uint32(15))) * np.uint32(0x846CA68B)
    return x ^ (x >> np.uint32(16))


def _owen(x: Uints, seed: Uints) -> Uints:
    x = _reverse(x)
    x = x ^ (x * np.uint32(0x3D20ADEA))
    x = (x + seed) * ((seed >> np.uint32(16)) | np.uint32(1))
    x = x ^ (x * np.uint32(0x05526C56))
    return _reverse(x ^ (x * np.uint32(0x53A22864)))


def _sobol(index: Uints, dimension: int) -> Uints:
    """Direction numbers: 2^(31 - k), and for the second dimension (polynomial x + 1, Bratley and Fox 1988)
    v_k = v_(k-1) xor v_(k-1) / 2."""
    result, number = np.zeros_like(index), np.uint32(1 << 31)
    for bit in range(32):
        result ^= np.where(index >> np.uint32(bit) & np.uint32(1), number, np.uint32(0))
        number = number >> np.uint32(1) if dimension == 0 else number ^ (number >> np.uint32(1))
    return result


def _reference(pixel: Uints, sample: Uints, pair: Uints, seed: Uints) -> npt.NDArray[np.float64]:
    golden = np.uint32(0x9E3779B9)
    of_pair = _hash(_hash(pixel ^ _hash(seed + golden)) + pair * golden)
    index = _owen(sample, of_pair)
    u = _owen(_sobol(index, 0), _hash(of_pair + np.uint32(1)))
    v = _owen(_sobol(index, 1), _hash(of_pair + np.uint32(2)))
    return np.stack([u >> np.uint32(8), v >> np.uint32(8)]) * 2.0**-24


def test_equals_sobol_by_direction_numbers_with_owen_scrambling() -> None:
    arguments = np.random.default_rng(1).integers(0, 1 << 32, (4, 2000), np.uint32)
    np.testing.assert_array_equal(_points(*arguments), _reference(*arguments))


def test_scrambling_is_owens() -> None:
    # Nested: a bit of the result depends on that bit and on the ones before it; so x -> x is a bijection of
    # every prefix. Not the same for all: the flip of a bit varies with what stands before it.
    x, seed = np.random.default_rng(2).integers(0, 1 << 32, (2, 4000), np.uint32)
    for length in (1, 2, 5, 12, 24):
        other = x ^ (np.uint32(1) << np.uint32(31 - length))
        difference = _owen(x, seed) ^ _owen(other, seed)
        assert (difference >> np.uint32(31 - length) == 1).all()
        flipped = (_owen(x, seed) ^ x) >> np.uint32(31 - length) & np.uint32(1)
        assert 0.45 < flipped.mean() < 0.55


def test_bounds_mean_and_variance() -> None:
    points = _points(np.arange(1 << 16), np.arange(1 << 16) // 7, 3, 5)
    assert points.min() >= 0 and points.max() < 1
    np.testing.assert_allclose(points.mean(axis=1), 0.5, atol=5e-3)
    np.testing.assert_allclose(points.var(axis=1), 1 / 12, atol=1e-3)


@pytest.mark.parametrize("power", [0, 1, 2, 3, 4, 6, 8, 10])
def test_aligned_powers_of_two_are_nets(power: int) -> None:
    count = 1 << power
    first = np.array([0, 1, 2, 5, 1000])[:, None] * count
    blocks = [(pixel, pair, seed) for pixel in (0, 77, 920_000) for pair in (0, 1, 6, 200) for seed in (0, 9)]
    pixel, pair, seed = np.repeat(np.array(blocks).T, first.size, axis=1)[..., None]
    sample = np.tile(first, (len(blocks), 1)) + np.arange(count)
    points = _points(pixel, sample, pair, seed).reshape(2, -1, count)
    for columns in range(power + 1):
        x = (points[0] * 2**columns).astype(int)
        y = (points[1] * 2 ** (power - columns)).astype(int)
        cells = np.sort(x + (y << columns), axis=1)
        assert (cells == np.arange(count)).all()


def _pairs() -> list[tuple[str, npt.NDArray[np.float64], npt.NDArray[np.float64]]]:
    """Numbers that must know nothing of each other."""
    n = np.arange(1 << 14)
    base = _points(n, 0, 1, 0)
    late = _points(n, 37, 1, 0)
    walk = _points(3, n, 1, 0)
    return [
        ("u and v", base[0], base[1]),
        ("u and v of a later sample", late[0], late[1]),
        ("neighbouring pixels", base[0][:-1], base[0][1:]),
        ("pixels one row apart", base[0][:-64], base[0][64:]),
        ("seeds", base[0], _points(n, 0, 1, 1)[0]),
        ("distant seeds", base[1], _points(n, 0, 1, 1 << 31)[1]),
        ("dimensions", base[0], _points(n, 0, 2, 0)[0]),
        ("dimensions of a later ray", base[1], _points(n, 0, 5, 0)[1]),
        ("samples", base[0], late[0]),
        ("pixel and seed swapped", _points(n, 0, 1, 5)[0], _points(5, 0, 1, n)[0]),
        ("dimensions along a pixel's samples", walk[0], _points(3, n, 2, 0)[0]),
        ("pixels along their samples", walk[1], _points(4, n, 1, 0)[1]),
    ]


def test_numbers_are_not_correlated() -> None:
    for name, a, b in _pairs():
        correlation = np.corrcoef(a, b)[0, 1]
        assert abs(correlation) < 4.5 / np.sqrt(len(a)), name


def test_pairs_of_numbers_fill_the_square_evenly() -> None:
    for name, a, b in _pairs():
        observed = np.histogram2d(a, b, bins=16, range=[[0, 1], [0, 1]])[0]
        assert chi_square(observed, np.full((16, 16), len(a) / 256)) > SIGNIFICANCE, name
