"""Boundaries of transparent bodies (cl/shading/dielectric.cl), and the stack of nested ones (medium.cl)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import SIGNIFICANCE, call, direction, direction_p_value, struct_rows, uniforms

from incpt.core import layout

COUNT = 1 << 16
ETAS = (1.5, 1 / 1.5, 1.33, 1 / 2.4)
ANGLES_DEG = (0.0, 30.0, 60.0, 82.0)
Array = npt.NDArray[np.floating]

_BOUNDARY = """Boundary b; b.eta = p[0]; b.alpha = p[1]; b.specular = p[2];
    b.gain = 1.0f; b.transmitted = vec3(1.0f, 1.0f, 1.0f); Vec3 wo = vec3(ox[i], oy[i], oz[i]); """


def _components(prefix: str, w: Array, count: int) -> dict[str, npt.NDArray[np.float32]]:
    w = np.broadcast_to(np.reshape(w, (3, -1)), (3, count)).astype(np.float32)
    return {prefix + axis: np.ascontiguousarray(row) for axis, row in zip("xyz", w, strict=True)}


def _call(body: str, outputs: tuple[str, ...], count: int, eta: float, alpha: float, specular: float,
          **inputs: npt.NDArray[np.generic]) -> list[npt.NDArray[np.float32]]:  # fmt: skip
    parameters = np.float32([eta, alpha, specular])
    return call(("dielectric", "material"), _BOUNDARY + body, count, outputs, p=parameters, **inputs)


def evaluate(eta: float, alpha: float, wo: Array, wi: Array, specular: float = 1.0) -> tuple[Array, Array]:
    """f cos (N,) and pdf (N,) of the rough boundary."""
    count = max(np.reshape(wo, (3, -1)).shape[1], np.reshape(wi, (3, -1)).shape[1])
    body = """BsdfValue v = eval_rough_boundary(&b, wo, vec3(ix[i], iy[i], iz[i]));
        f[i] = v.f_cos.y; pdf[i] = v.pdf;"""
    inputs = _components("o", wo, count) | _components("i", wi, count)
    f, pdf = _call(body, ("f", "pdf"), count, eta, alpha, specular, **inputs)
    return f, pdf


def sample(
    eta: float, alpha: float, wo: Array, count: int = COUNT, specular: float = 1.0
) -> tuple[Array, Array, Array]:
    """wi (3, N), weight (N,), pdf (N,); of the smooth boundary where alpha is 0."""
    u, v, lobe = uniforms(count, 3, 21)
    smooth = "BsdfSample s = sample_smooth_boundary(&b, wo, lobe[i]);"
    rough = """Uniform2 uv; uv.u = u[i]; uv.v = v[i];
        BsdfSample s = sample_rough_boundary(&b, wo, uv, lobe[i]);"""
    body = (rough if alpha else smooth) + (
        "x[i] = s.wi.x; y[i] = s.wi.y; z[i] = s.wi.z; w[i] = s.weight.y; pdf[i] = s.pdf;"
    )
    inputs = _components("o", wo, count) | {"u": u, "v": v, "lobe": lobe}
    x, y, z, w, pdf = _call(body, ("x", "y", "z", "w", "pdf"), count, eta, alpha, specular, **inputs)
    return np.stack([x, y, z]), w, pdf


def wo_at(angle_deg: float) -> npt.NDArray[np.float64]:
    return direction(np.radians(angle_deg), 0.4)


def fresnel(cosine: Array, eta: float) -> Array:
    """Fresnel's equations by complex roots, so that total internal reflection needs no case."""
    cos_t = np.sqrt(1 - (1 - np.asarray(cosine, complex) ** 2) / eta**2)
    s = (cosine - eta * cos_t) / (cosine + eta * cos_t)
    p = (eta * cosine - cos_t) / (eta * cosine + cos_t)
    return np.asarray((np.abs(s) ** 2 + np.abs(p) ** 2) / 2)


@pytest.mark.parametrize("eta", [*ETAS, 1.0, 3.0])
def test_fresnel(eta: float) -> None:
    cosine = np.linspace(1e-3, 1, 4000).astype(np.float32)
    (f,) = call(("dielectric", "material"), "r[i] = fresnel_dielectric(c[i], eta[0]);", len(cosine), c=cosine,
                eta=np.float32([eta]))  # fmt: skip
    # Near the critical angle the slope is infinite, and the rounding of the cosine shows.
    np.testing.assert_allclose(f, fresnel(cosine.astype(float), float(np.float32(eta))), atol=2e-3)
    away = np.abs(1 - (1 - cosine.astype(float) ** 2) / eta**2) > 1e-3
    np.testing.assert_allclose(
        f[away], fresnel(cosine.astype(float), float(np.float32(eta)))[away], atol=2e-5
    )


@pytest.mark.parametrize("eta", ETAS)
@pytest.mark.parametrize("angle", ANGLES_DEG)
def test_smooth_boundary_keeps_all_power_and_refracts_by_snell(eta: float, angle: float) -> None:
    wo = wo_at(angle)
    wi, weight, pdf = sample(eta, 0, wo)
    through = wi[2] < 0
    reflectance = float(fresnel(wo[2], eta))
    assert through.mean() == pytest.approx(1 - reflectance, abs=4.5 * np.sqrt(0.25 / COUNT))
    power = np.where(through, weight * eta**2, weight)
    np.testing.assert_allclose(power, 1, atol=1e-5)
    assert (pdf == 0).all()
    np.testing.assert_allclose(
        wi[:, ~through], np.reshape(wo * [-1, -1, 1], (3, 1)) + 0 * wi[:, ~through], atol=1e-6
    )
    np.testing.assert_allclose(wi[:2, through] + wo[:2, None] / eta, 0, atol=1e-5)


def test_specular_scales_reflection_but_not_total_reflection() -> None:
    outside, _, _ = sample(1.5, 0, wo_at(60), specular=0.25)
    assert (outside[2] > 0).mean() == pytest.approx(0.25 * float(fresnel(0.5, 1.5)), abs=4e-3)
    inside, _, _ = sample(1 / 1.5, 0, wo_at(60), specular=0.0)
    assert (inside[2] > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("eta", ETAS)
@pytest.mark.parametrize("alpha", [0.1, 0.35, 0.9])
def test_samples_of_rough_boundary_follow_the_density(eta: float, alpha: float) -> None:
    for angle in ANGLES_DEG:
        wo = wo_at(angle)
        wi, _, pdf = sample(eta, alpha, wo)
        p_value, total = direction_p_value(
            wi, pdf > 0, lambda d, wo=wo: evaluate(eta, alpha, wo, d)[1], rows=32, columns=16, subdivision=36
        )
        assert total == pytest.approx((pdf > 0).mean(), abs=0.01), angle
        assert p_value > SIGNIFICANCE, angle


@pytest.mark.parametrize("eta", ETAS)
@pytest.mark.parametrize("alpha", [0.05, 0.35, 0.9])
def test_a_sample_weighs_its_value_over_its_density(eta: float, alpha: float) -> None:
    for angle in ANGLES_DEG:
        wi, weight, pdf = sample(eta, alpha, wo_at(angle), 4096)
        valid = pdf > 0
        assert valid.mean() > 0.3
        value, density = evaluate(eta, alpha, wo_at(angle), wi[:, valid])
        # A density of a narrow lobe magnifies the rounding of wi.
        close = np.abs(density / pdf[valid] - 1)
        assert np.median(close) < 1e-4 and np.quantile(close, 0.99) < 0.02
        np.testing.assert_allclose(weight[valid], value / density, rtol=2e-3)
        assert (weight[~valid] == 0).all()


@pytest.mark.parametrize("eta", ETAS)
@pytest.mark.parametrize("alpha", [0.2, 0.6])
def test_reciprocity(eta: float, alpha: float) -> None:
    z, phi, y, psi = (a.astype(np.float64) for a in uniforms(20_000, 4, 22))
    wo = direction(np.arccos(z * 0.95 + 0.05), 6.3 * phi)
    wi = direction(np.arccos(y * 0.95 + 0.05), 6.3 * psi)
    # Reflection: f(wo, wi) = f(wi, wo).
    forward, backward = evaluate(eta, alpha, wo, wi)[0] / wi[2], evaluate(eta, alpha, wi, wo)[0] / wo[2]
    np.testing.assert_allclose(forward, backward, rtol=2e-3, atol=1e-6)
    # Transmission: f / n^2 of the side it arrives on is symmetric; the frame turns over with the side.
    over = np.array([[1], [1], [-1]])
    forward = evaluate(eta, alpha, wo, wi * over)[0] / wi[2]
    backward = evaluate(1 / eta, alpha, wi, wo * over)[0] / wo[2]
    assert (forward > 1e-3).sum() > 100
    np.testing.assert_allclose(forward * eta**2, backward, rtol=5e-3, atol=1e-5)


def single_scattering_share(eta: float, alpha: float, cosine: float) -> float:
    """Power that one meeting with a microfacet sends on, by a sum over facets in double precision: what is
    missing to 1 would meet another facet. D(h) cos_h dh has density 1 in (t, phi)."""
    n, m = 800, 400
    s, phi = (np.arange(n)[:, None] + 0.5) / n, (np.arange(m) + 0.5) * np.pi / m
    t = 1 - (1 - s) ** 2
    cos_h = 1 / np.sqrt(1 + alpha**2 * t / (1 - t))
    o_h = np.sqrt((1 - cosine**2) * (1 - cos_h**2)) * np.cos(phi) + cosine * cos_h
    facing = o_h > 0
    o_h = np.where(facing, o_h, 1)
    reflectance = fresnel(o_h, eta)
    cos_t = np.sqrt(np.maximum(1 - (1 - o_h**2) / eta**2, 0))
    up = 2 * o_h * cos_h - cosine
    down = cosine / eta - (o_h / eta - cos_t) * cos_h

    def lambda_(mu: Array) -> Array:
        mu2 = np.clip(mu, 1e-6, 1) ** 2
        return np.asarray((np.sqrt(1 + alpha**2 * (1 - mu2) / mu2) - 1) / 2)

    of_wo = lambda_(np.asarray(cosine))
    sent = np.where(up > 0, reflectance / (1 + of_wo + lambda_(up)), 0)
    sent += np.where(down > 0, (1 - reflectance) / ((1 + of_wo) * (1 + lambda_(down))), 0)
    return float((np.where(facing, sent * o_h / (cosine * cos_h), 0) * 2 * (1 - s)).mean())


@pytest.mark.slow
@pytest.mark.parametrize("eta", ETAS)
@pytest.mark.parametrize("alpha", [0.04, 0.15, 0.5, 1.0])
def test_furnace_rough_boundary_loses_what_scatters_twice(eta: float, alpha: float) -> None:
    for angle in (0.0, 30.0, 60.0, 80.0):
        wi, weight, _ = sample(eta, alpha, wo_at(angle))
        power = np.where(wi[2] < 0, weight * eta**2, weight).mean(dtype=np.float64)
        expected = single_scattering_share(eta, alpha, float(wo_at(angle)[2]))
        assert power == pytest.approx(expected, abs=5e-3), angle
        assert power <= 1 + 1e-5
        if alpha == 0.04 and angle <= 30:
            assert power > 0.99


def test_rough_boundary_without_step_lets_through_what_is_opposite() -> None:
    wi, weight, _ = sample(1 + 1e-4, 0.3, wo_at(40), 4096)
    np.testing.assert_allclose(wi, -wo_at(40)[:, None] + 0 * wi, atol=2e-3)
    assert weight.mean() == pytest.approx(1, abs=0.03)


# Media


def _stack_after(priorities: list[int], operations: npt.NDArray[np.int32]) -> tuple[Array, Array]:
    """Entries (4, N) of the stack after operations (N, M): m + 1 enters material m, -(m + 1) leaves it;
    and whether the last one found what it was to leave."""
    materials = struct_rows(layout.MATERIAL, [{"priority": p} for p in priorities])
    count, steps = operations.shape
    body = f"""MediumStack s; int found = 0;
        for (uint k = 0; k < MEDIUM_STACK_SIZE; k++) s.entry[k] = MEDIUM_NONE;
        for (uint k = 0; k < {steps}; k++) {{
            int o = operations[{steps} * i + k];
            if (o > 0) enter_medium(&s, materials, o - 1);
            if (o < 0) found = leave_medium(&s, -o - 1);
        }}
        a[i] = s.entry[0]; b[i] = s.entry[1]; c[i] = s.entry[2]; d[i] = s.entry[3]; e[i] = found;"""
    *entries, found = call("medium", body, count, ("a", "b", "c", "d", "e"), materials=materials,
                           operations=operations.ravel())  # fmt: skip
    return np.stack(entries), found


def test_media_are_stacked_by_priority() -> None:
    # Zero wins over all; of equals the later one is seen first.
    priorities = [3, 0, 1, 3, 2, 0]
    rank = [p or 10**9 for p in priorities]
    rng = np.random.default_rng(23)
    operations = np.zeros((400, 9), np.int32)
    expected = np.full((4, 400), layout.MEDIUM_NONE)
    for row in range(400):
        stack: list[int] = []
        for step in range(9):
            material = int(rng.integers(6))
            if len(stack) < 4 and rng.random() < 0.6:
                operations[row, step] = material + 1
                place = next((i for i, m in enumerate(stack) if rank[m] <= rank[material]), len(stack))
                stack.insert(place, material)
            else:
                operations[row, step] = -(material + 1)
                if material in stack:
                    stack.remove(material)
        expected[: len(stack), row] = stack
    entries, _ = _stack_after(priorities, operations)
    np.testing.assert_array_equal(entries, expected)


def test_leaving_tells_whether_the_medium_was_there() -> None:
    _, found = _stack_after([1, 2], np.array([[1, -1], [1, -2], [0, -1]], np.int32))
    np.testing.assert_array_equal(found, [1, 0, 0])


def test_a_full_stack_forgets_the_lowest() -> None:
    entries, _ = _stack_after([1, 2, 3, 4, 5], np.array([[1, 2, 3, 4, 5], [5, 4, 3, 2, 1]], np.int32))
    np.testing.assert_array_equal(entries.T, [[4, 3, 2, 1], [4, 3, 2, 1]])


def test_transmittance_of_a_medium() -> None:
    materials = struct_rows(layout.MATERIAL, [{"absorption": (0.5, 0.0, 2.0)}])
    medium = np.array([0, 0, 0, layout.MEDIUM_NONE], np.uint32)
    distance = np.float32([0, 3, np.inf, 3])
    body = "Vec3 t = transmittance(materials, m[i], d[i]); r[i] = t.x; g[i] = t.y; b[i] = t.z;"
    passed = np.array(call("medium", body, 4, ("r", "g", "b"), materials=materials, m=medium, d=distance))
    expected = [[1, 1, 1], [np.exp(-1.5), 1, np.exp(-6)], [0, 1, 0], [1, 1, 1]]
    np.testing.assert_allclose(passed.T, expected, rtol=1e-5)
