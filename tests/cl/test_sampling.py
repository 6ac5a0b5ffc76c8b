"""cl/base/sampling.cl and the mathematics of cl/base/scalar.cl, against formulas in double precision."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import SIGNIFICANCE, call, chi_square, direction, direction_p_value, uniforms

COUNT = 1 << 17
Array = npt.NDArray[np.floating]


def test_sine_and_cosine_of_turns() -> None:
    turns = np.linspace(0, 1, 1 << 18).astype(np.float32)
    turns = np.concatenate([turns, np.arange(9, dtype=np.float32) / 8, np.float32([1e-30, 1 - 2**-24])])
    body = "float a, b; sincos_turns(x[i], &a, &b); s[i] = a; c[i] = b;"
    sine, cosine = call("scalar", body, len(turns), ("s", "c"), x=turns)
    angle = 2 * np.pi * turns.astype(np.float64)
    assert np.abs(sine - np.sin(angle)).max() < 2e-7
    assert np.abs(cosine - np.cos(angle)).max() < 2e-7


def test_angle_of_a_point_in_turns() -> None:
    angle = np.linspace(-np.pi, np.pi, 1 << 18)
    radius = np.tile([1e-20, 1e-3, 1.0, 1e15], len(angle) // 4)
    y, x = (radius * np.sin(angle)).astype(np.float32), (radius * np.cos(angle)).astype(np.float32)
    axes = np.float32([[0, 1, 0, -1, 0], [1, 0, -1, 0, 0]])
    y, x = np.append(y, axes[0]), np.append(x, axes[1])
    (turns,) = call("scalar", "r[i] = atan2_turns(y[i], x[i]);", len(y), y=y, x=x)
    exact = np.arctan2(y.astype(np.float64), x.astype(np.float64)) / (2 * np.pi)
    error = np.abs(turns - exact)
    assert np.minimum(error, np.abs(error - 1)).max() < 1e-6
    assert turns.min() >= -0.5 and turns.max() <= 0.5
    assert turns[-1] == 0


def test_frames_are_orthonormal_and_right_handed() -> None:
    n = np.random.default_rng(3).normal(size=(3, 5000))
    n[:, :6] = [[1, -1, 0, 0, 0, 0], [0, 0, 1, -1, 0, 0], [0, 0, 0, 0, 1, -1]]
    n[:, 6] = [1e-4, -1e-4, -1]
    n /= np.linalg.norm(n, axis=0)
    x, y, z = n.astype(np.float32)
    names = [a + b for a in "tbn" for b in "xyz"]
    body = "Frame f = frame_of(vec3(x[i], y[i], z[i]));" + "".join(
        f"{axis[0] + b}[i] = f.{axis}.{b};" for axis in ("tangent", "bitangent", "normal") for b in "xyz"
    )
    frames = np.array(call("sampling", body, n.shape[1], names, x=x, y=y, z=z)).reshape(3, 3, -1)
    gram = np.einsum("aki,bki->abi", frames, frames)
    np.testing.assert_allclose(gram, np.repeat(np.eye(3)[..., None], n.shape[1], 2), atol=2e-6)
    np.testing.assert_allclose(np.cross(frames[0], frames[1], axis=0), frames[2], atol=2e-6)


def test_cosine_hemisphere() -> None:
    u, v = uniforms(COUNT, 2, 4)
    body = "Vec3 w = sample_cosine_hemisphere(u[i], v[i]); x[i] = w.x; y[i] = w.y; z[i] = w.z;"
    w = np.array(call("sampling", body, COUNT, ("x", "y", "z"), u=u, v=v))
    np.testing.assert_allclose(np.linalg.norm(w, axis=0), 1, atol=1e-6)
    p_value, total = direction_p_value(w, w[2] >= 0, lambda d: np.maximum(d[2], 0) / np.pi)
    assert p_value > SIGNIFICANCE
    assert total == pytest.approx(1, abs=1e-3)


def visible_normal_pdf(wo: Array, alpha: float, h: Array) -> Array:
    """G1(wo) D(h) <wo, h> / wo.z per solid angle; h (3, N). Heitz 2014."""
    a2 = alpha**2
    d = np.where(h[2] > 0, 1 / (np.pi * a2 * ((h[0] ** 2 + h[1] ** 2) / a2 + h[2] ** 2) ** 2), 0)
    lambda_ = (np.sqrt(1 + a2 * (1 - wo[2] ** 2) / wo[2] ** 2) - 1) / 2
    return np.asarray(d * np.maximum(wo @ h, 0) / ((1 + lambda_) * wo[2]))


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [0.06, 0.25, 0.7, 1.0])
@pytest.mark.parametrize("theta_deg", [0.0, 30.0, 65.0, 88.0])
def test_visible_normals(alpha: float, theta_deg: float) -> None:
    wo = direction(np.radians(theta_deg), 0.7)
    u, v = uniforms(COUNT, 2, 5)
    body = f"""Vec3 wo = vec3({wo[0]:.9f}f, {wo[1]:.9f}f, {wo[2]:.9f}f);
        Vec3 h = sample_visible_normal(wo, {alpha:.9f}f, u[i], v[i]); x[i] = h.x; y[i] = h.y; z[i] = h.z;"""
    h = np.array(call("sampling", body, COUNT, ("x", "y", "z"), u=u, v=v))
    p_value, total = direction_p_value(
        h, h[2] >= 0, lambda d: visible_normal_pdf(wo, alpha, d), rows=32, columns=16, subdivision=24
    )
    assert total == pytest.approx(1, abs=3e-3)
    assert p_value > SIGNIFICANCE


def test_points_of_a_triangle_are_uniform() -> None:
    u, v = uniforms(COUNT, 2, 6)
    b1, b2 = call("sampling", "float a, b; sample_triangle(u[i], v[i], &a, &b); p[i] = a; q[i] = b;", COUNT,
                  ("p", "q"), u=u, v=v)  # fmt: skip
    assert min(b1.min(), b2.min()) >= 0 and (b1 + b2).max() <= 1 + 1e-6
    # Cells of a square grid; the diagonal cuts those on it in half.
    cells = 16
    column, row = (b1 * cells).astype(int), (b2 * cells).astype(int)
    inside = column + row < cells
    observed = np.bincount(column[inside] * cells + row[inside], minlength=cells**2).reshape(cells, cells)
    i, j = np.indices((cells, cells))
    expected = np.select([i + j < cells - 1, i + j == cells - 1], [2.0, 1.0], 0.0) * COUNT / cells**2
    assert chi_square(observed[i + j < cells], expected[i + j < cells]) > SIGNIFICANCE


@pytest.mark.parametrize("count", [1, 2, 3, 7, 100, 1024, 4095, 4096])
def test_find_cell_is_a_binary_search(count: int) -> None:
    rng = np.random.default_rng(count)
    weights = rng.random(count) * (rng.random(count) < 0.7)  # some cells are empty
    weights[rng.integers(count)] += 1.0
    cdf = np.append(0, np.cumsum(weights) / weights.sum()).astype(np.float32)
    cdf[cdf >= cdf[-1]] = 1
    u = np.concatenate([rng.random(20_000).astype(np.float32), cdf[cdf < 1], [0, 1 - 2**-24]]).astype(
        np.float32
    )
    (cell,) = call(
        "sampling", "r[i] = (float)find_cell(cdf, size[0], u[i]);", len(u), cdf=cdf, u=u,
        size=np.array([count], np.uint32),
    )  # fmt: skip
    np.testing.assert_array_equal(cell, np.searchsorted(cdf, u, side="right") - 1)
    assert (np.diff(cdf)[cell.astype(int)] > 0).all()  # never an empty cell


def test_mis_weights_sum_to_one() -> None:
    a, b = (10 ** (12 * x - 6) for x in uniforms(4096, 2, 7))
    a[:3], b[:3] = [1e-30, 1e30, 1], [1e30, 1e-30, 0]
    x, y = call("sampling", "x[i] = mis_weight(a[i], b[i]); y[i] = mis_weight(b[i], a[i]);", len(a),
                ("x", "y"), a=a, b=b)  # fmt: skip
    np.testing.assert_allclose((x + y)[b > 0], 1, atol=1e-6)
    assert x[2] == 1
    expected = a.astype(float) ** 2 / (a.astype(float) ** 2 + b.astype(float) ** 2)
    np.testing.assert_allclose(x[3:], expected[3:], atol=1e-5)


def test_russian_roulette_waits_for_its_depth() -> None:
    share = np.float32([0, 0.01, 0.3, 0.9, 1, 7])
    body = """Vec3 t = vec3(0.0f, s[i], 0.0f);
        a[i] = survival_probability(t, 2u, 3u); b[i] = survival_probability(t, 3u, 3u);"""
    before, after = call("sampling", body, len(share), ("a", "b"), s=share)
    np.testing.assert_array_equal(before, 1)
    np.testing.assert_allclose(after, np.clip(share, 0.05, 1))
