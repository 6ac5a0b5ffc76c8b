"""The opaque surface of cl/shading/material.cl and layers.cl: its samples, its symmetry, and its energy."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import SIGNIFICANCE, call, device, direction, direction_p_value, struct_rows, uniforms
from support.parameters import NAMES, unlike_default

from incpt.core import layout
from incpt.core.layout import MaterialTrait
from incpt.scene.material import Material
from incpt.tables import albedo
from incpt.tables.materials import material_tables, traits_of
from incpt.tables.textures import texture_tables

COUNT = 1 << 16
Array = npt.NDArray[np.floating]

MATERIALS = {
    "lambert": Material((0.8, 0.5, 0.2), specular=0.0),
    "white lambert": Material((1, 1, 1), specular=0.0),
    "matte plastic": Material((0.8, 0.3, 0.1), roughness=0.9),
    "plastic": Material((0.8, 0.3, 0.1), roughness=0.5),
    "glossy white plastic": Material((1, 1, 1), roughness=0.3),
    "black plastic": Material((0, 0, 0), roughness=0.4),
    "dense plastic": Material((0.5, 0.5, 0.5), roughness=0.6, ior=2.4),
    "half a layer": Material((0.9, 0.9, 0.9), roughness=0.4, specular=0.5),
    "metal": Material((0.9, 0.6, 0.3), metallic=1.0, roughness=0.4),
    "rough metal": Material((1, 1, 1), metallic=1.0, roughness=1.0),
    "half metal": Material((0.9, 0.6, 0.3), metallic=0.5, roughness=0.7),
    "gold layer": Material((0.2, 0.3, 0.8), roughness=0.4, specular_color=(4.0, 1.5, 0.3)),
    "lacquer": Material((0.7, 0.1, 0.1), roughness=0.8, clearcoat=1.0, clearcoat_roughness=0.3),
    "lacquered metal": Material(
        (0.9, 0.6, 0.3), metallic=1.0, roughness=0.5, clearcoat=0.6, clearcoat_roughness=0.4
    ),
    "velvet": Material((0.3, 0.02, 0.05), roughness=1.0, sheen_color=(0.9, 0.3, 0.4), sheen_roughness=0.4),
    "lacquered cloth": Material(
        (0.5, 0.5, 0.5), sheen_color=(1, 1, 1), sheen_roughness=0.7, clearcoat=0.5, clearcoat_roughness=0.3
    ),
    "brushed metal": Material((0.9, 0.6, 0.3), metallic=1.0, roughness=0.4, anisotropy=0.7),
    "brushed plastic": Material((0.3, 0.6, 0.8), roughness=0.5, anisotropy=1.0),
    "oil": Material((0.2, 0.2, 0.2), roughness=0.3, iridescence=1.0, iridescence_thickness=450.0),
    "anodised": Material((0.8, 0.8, 0.9), metallic=1.0, roughness=0.4, iridescence=0.7, iridescence_ior=1.8),
    "leaf": Material(
        (0.2, 0.5, 0.1), roughness=0.5, diffuse_transmission=0.6, diffuse_transmission_color=(0.6, 0.8, 0.1)
    ),
    "all": Material(
        (0.6, 0.3, 0.2), metallic=0.4, roughness=0.4, specular_color=(1, 0.5, 0.2), clearcoat=0.5,
        clearcoat_roughness=0.3, sheen_color=(0.4, 0.5, 0.6), sheen_roughness=0.5, anisotropy=0.5,
        iridescence=0.5, diffuse_transmission=0.5, diffuse_transmission_color=(0.2, 0.6, 0.9),
    ),
}  # fmt: skip
TRANSMITTING = [name for name, material in MATERIALS.items() if material.diffuse_transmission > 0]
ANGLES_DEG = (0.0, 35.0, 70.0, 86.0)

_SURFACE = """SurfaceMaterial m = plain_material(material);
    AlbedoTables tables = {layer, albedos, stretched};
    LayeredBsdf s = layered_bsdf(&m, tables, multiple[0], vec3(0.0f, 0.0f, 1.0f));
    Vec3 wo = vec3(ox[i], oy[i], oz[i]);"""


def _arguments(material: Material, multiple: float = 1.0) -> dict[str, npt.NDArray[np.generic]]:
    values = {k: v for k, v in asdict(material).items() if k in (layout.MATERIAL.names or ())}
    return {"material": struct_rows(layout.MATERIAL, [values]), "layer": albedo.layer_row(material),
            "albedos": albedo.rows(), "stretched": albedo.stretched_rows(),
            "multiple": np.float32([multiple])}  # fmt: skip


def trait_features(material: Material) -> tuple[str, ...]:
    """The feature by which kernels know what the material has."""
    bits = sum(1 << trait for trait in traits_of(material))
    return (f"TRAITS {bits}u",) if bits else ()


def _components(prefix: str, w: Array, count: int) -> dict[str, npt.NDArray[np.float32]]:
    w = np.broadcast_to(np.reshape(w, (3, -1)), (3, count)).astype(np.float32)
    return {prefix + axis: np.ascontiguousarray(row) for axis, row in zip("xyz", w, strict=True)}


def evaluate(
    material: Material, wo: Array, wi: Array, features: tuple[str, ...] | None = None, multiple: float = 1.0
) -> tuple[Array, Array]:
    """f cos (3, N) and pdf (N,) for directions (3,) or (3, N), by the kernels of what the material has or of
    `features`."""
    count = max(np.reshape(wo, (3, -1)).shape[1], np.reshape(wi, (3, -1)).shape[1])
    features = trait_features(material) if features is None else features
    body = _SURFACE + """BsdfValue b = eval_bsdf(&s, wo, vec3(ix[i], iy[i], iz[i]));
        r[i] = b.f_cos.x; g[i] = b.f_cos.y; b_[i] = b.f_cos.z; pdf[i] = b.pdf;"""  # fmt: skip
    r, g, b, pdf = call(
        "layers", body, count, ("r", "g", "b_", "pdf"), features, **_components("o", wo, count),
        **_components("i", wi, count), **_arguments(material, multiple),
    )  # fmt: skip
    return np.stack([r, g, b]), pdf


def sample(
    material: Material, wo: Array, count: int, seed: int = 11, features: tuple[str, ...] | None = None
) -> tuple[Array, Array, Array]:
    """wi (3, N), weight (3, N), pdf (N,)."""
    u, v, lobe = uniforms(count, 3, seed)
    features = trait_features(material) if features is None else features
    body = _SURFACE + """Uniform2 uv; uv.u = u[i]; uv.v = v[i];
        BsdfSample b = sample_bsdf(&s, wo, uv, lobe[i]); x[i] = b.wi.x; y[i] = b.wi.y; z[i] = b.wi.z;
        r[i] = b.weight.x; g[i] = b.weight.y; b_[i] = b.weight.z; pdf[i] = b.pdf;"""  # fmt: skip
    results = call(
        "layers", body, count, ("x", "y", "z", "r", "g", "b_", "pdf"), features,
        **_components("o", wo, count), u=u, v=v, lobe=lobe, **_arguments(material),
    )  # fmt: skip
    return np.stack(results[:3]), np.stack(results[3:6]), results[6]


def wo_at(angle_deg: float) -> npt.NDArray[np.float64]:
    return direction(np.radians(angle_deg), 0.4)


@pytest.mark.slow
@pytest.mark.parametrize("name", MATERIALS)
def test_samples_follow_the_density(name: str) -> None:
    for angle in ANGLES_DEG:
        wo = wo_at(angle)
        wi, _, pdf = sample(MATERIALS[name], wo, COUNT)
        p_value, total = direction_p_value(
            wi, pdf > 0, lambda d, wo=wo: evaluate(MATERIALS[name], wo, d)[1], rows=32, subdivision=32
        )
        assert p_value > SIGNIFICANCE, angle
        lost = (pdf == 0).mean()  # reflections that a microfacet sends below the surface
        assert total == pytest.approx(1 - lost, abs=0.006), angle


@pytest.mark.parametrize("name", MATERIALS)
def test_a_sample_weighs_its_value_over_its_density(name: str) -> None:
    for angle in ANGLES_DEG:
        wi, weight, pdf = sample(MATERIALS[name], wo_at(angle), 4096)
        value, density = evaluate(MATERIALS[name], wo_at(angle), wi)
        valid = pdf > 0
        np.testing.assert_allclose(density[valid], pdf[valid], rtol=2e-3)
        np.testing.assert_allclose(weight[:, valid], value[:, valid] / density[valid], rtol=2e-3, atol=1e-6)
        assert (weight[:, ~valid] == 0).all()
        np.testing.assert_allclose(np.linalg.norm(wi, axis=0), 1, atol=1e-5)
        assert (wi[2, valid] > 0).all() or name in TRANSMITTING


@pytest.mark.parametrize("name", MATERIALS)
def test_reciprocity(name: str) -> None:
    z, phi, y, psi = (a.astype(np.float64) for a in uniforms(5000, 4, 12))
    wo, wi = (
        direction(np.arccos(z * 0.98 + 0.02), 6.3 * phi),
        direction(np.arccos(y * 0.98 + 0.02), 6.3 * psi),
    )
    forward, backward = (
        evaluate(MATERIALS[name], wo, wi)[0] / wi[2],
        evaluate(MATERIALS[name], wi, wo)[0] / wo[2],
    )
    np.testing.assert_allclose(forward, backward, rtol=1e-3, atol=1e-6)


def test_nothing_below_the_surface() -> None:
    wi = direction(np.linspace(np.pi / 2 + 1e-3, np.pi, 100), 1.0)
    for name, material in MATERIALS.items():
        for wo, w in ((wo_at(30), wi), (-wo_at(30), wi), (wi, wo_at(30)[:, None])):
            value, pdf = evaluate(material, wo, w)
            if name in TRANSMITTING and wo is not wi and wo[2] > 0:
                assert (value > 0).all() and (pdf > 0).all()
            else:
                assert (value == 0).all() and (pdf == 0).all()


@pytest.mark.parametrize("name", TRANSMITTING)
def test_reciprocity_through_the_surface(name: str) -> None:
    """Seen from the other side the surface is the same, so that a ray back is one with both turned over."""
    z, phi, y, psi = (a.astype(np.float64) for a in uniforms(5000, 4, 14))
    wo = direction(np.arccos(z * 0.98 + 0.02), 6.3 * phi)
    wi = direction(np.arccos(-y * 0.98 - 0.02), 6.3 * psi)
    forward = evaluate(MATERIALS[name], wo, wi)[0] / -wi[2]
    backward = evaluate(MATERIALS[name], wi * [[1], [1], [-1]], wo * [[1], [1], [-1]])[0] / wo[2]
    np.testing.assert_allclose(forward, backward, rtol=1e-3, atol=1e-6)


def reflected_share(material: Material, angle_deg: float, count: int = COUNT) -> Array:
    """(3,) of white light from everywhere: by stratified samples, 2^8 x 2^8 in the square."""
    return np.asarray(sample(material, wo_at(angle_deg), count)[1].mean(axis=1, dtype=np.float64))


def test_furnace_lambert_is_exact() -> None:
    for name in ("lambert", "white lambert"):
        for angle in ANGLES_DEG:
            share = reflected_share(MATERIALS[name], angle, 1024)
            np.testing.assert_allclose(share, MATERIALS[name].base_color, rtol=1e-5)


def integral(material: Material, angle_deg: float, multiple: float = 1.0) -> Array:
    """(3,) of f cos over the hemisphere, by the midpoint rule in double resolution around the mirror image
    of wo: spherical coordinates about it, whose polar angle grows with the cube of the grid's."""
    wo = wo_at(angle_deg)
    mirror = wo * [-1, -1, 1]
    n, m = 600, 240
    t = (np.arange(n) + 0.5) / n
    theta, dtheta = np.pi * t**3, 3 * np.pi * t**2 / n
    phi = (np.arange(m) + 0.5) * 2 * np.pi / m
    local = direction(theta[:, None], phi[None, :]).reshape(3, -1)
    tangent = np.cross(mirror, [0.3, -0.7, 0.2])
    tangent /= np.linalg.norm(tangent)
    frame = np.stack([tangent, np.cross(mirror, tangent), mirror], axis=1)
    value = evaluate(material, wo, frame @ local, multiple=multiple)[0].reshape(3, n, m)
    return np.asarray(np.einsum("cij,i->c", value, np.sin(theta) * dtheta * 2 * np.pi / m))


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.2, 0.4, 0.6, 0.8, 1.0])
@pytest.mark.parametrize("ior", [1.2, 1.5, 2.0])
def test_furnace_white_plastic(roughness: float, ior: float) -> None:
    material = Material((1, 1, 1), roughness=roughness, ior=ior)
    for angle in (0.0, 20.0, 45.0, 70.0, 80.0, 87.0):
        np.testing.assert_allclose(integral(material, angle), 1, atol=0.01)


@pytest.mark.parametrize("roughness", [0.05, 0.1])
def test_furnace_polished_white_plastic(roughness: float) -> None:
    # Too narrow a reflection for a grid: by samples.
    material = Material((1, 1, 1), roughness=roughness)
    for angle in (0.0, 45.0, 70.0, 80.0, 87.0):
        np.testing.assert_allclose(reflected_share(material, angle), 1, atol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("angle", ANGLES_DEG)
def test_samples_estimate_the_integral(angle: float) -> None:
    for name in ("plastic", "half a layer", "dense plastic", "metal", "half metal"):
        estimate = reflected_share(MATERIALS[name], angle)
        np.testing.assert_allclose(estimate, integral(MATERIALS[name], angle), rtol=0.01, atol=2e-3)


@cache
def _single_scattering(roughness: float, cosine: float) -> tuple[float, float]:
    """A and B of albedo.table by a sum over the hemisphere of half vectors, in double precision: GGX,
    height-correlated Smith, reflectance 1 (A) and (1 - <wo, h>)^5 (B)."""
    alpha2 = max(roughness**2, layout.MIN_ALPHA) ** 2
    # tan^2 of the half vector's angle by GGX's own distribution, so that all alphas are resolved alike.
    n, m = 1500, 300
    s = (np.arange(n) + 0.5) / n
    t = 1 - (1 - s) ** 2
    tan2 = alpha2 * t / (1 - t)
    cos_h = 1 / np.sqrt(1 + tan2)
    phi = (np.arange(m) + 0.5) * np.pi / m
    sine = np.sqrt(1 - cosine**2)
    o_h = sine * np.sqrt(1 - cos_h**2)[:, None] * np.cos(phi) + cosine * cos_h[:, None]
    mu_i = 2 * o_h * cos_h[:, None] - cosine
    good = (o_h > 0) & (mu_i > 0)
    root_o = np.sqrt(alpha2 + (1 - alpha2) * cosine**2)
    root_i = np.sqrt(alpha2 + (1 - alpha2) * np.where(good, mu_i, 1) ** 2)
    g2 = 2 * cosine * mu_i / (cosine * root_i + mu_i * root_o)
    # f cos_i = D G2 / (4 cos_o) per wi; d wi = 4 o_h d h; D cos_h has density 1 in (t, phi).
    value = np.where(good, g2 * o_h / (cosine * cos_h[:, None]), 0) * (2 * (1 - s))[:, None]
    schlick = (1 - np.clip(o_h, 0, 1)) ** 5
    return float(value.mean()), float((value * schlick).mean())


@pytest.mark.slow
@pytest.mark.parametrize("row", [2, 5, 10, 16, 24, 31])
def test_albedo_table(row: int) -> None:
    table, last = albedo.table(), layout.ALBEDO_TABLE_SIZE - 1
    for column in (1, 3, 8, 16, 24, 31):
        expected = _single_scattering(row / last, column / last)
        np.testing.assert_allclose(table[:, row, column], expected, atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.2, 0.5, 0.8, 1.0])
def test_furnace_metal(roughness: float) -> None:
    """White metal reflects everything, coloured metal at least what it reflects at once; without multiple
    scattering all lose what scatters twice."""
    white = Material((1, 1, 1), metallic=1.0, roughness=roughness)
    gold = Material((1.0, 0.7, 0.3), metallic=1.0, roughness=roughness)
    for angle in (0.0, 45.0, 75.0):
        a, b = _single_scattering(roughness, float(np.cos(np.radians(angle))))
        assert a <= 1
        np.testing.assert_allclose(integral(white, angle), 1, atol=6e-3)
        np.testing.assert_allclose(integral(white, angle, multiple=0), a, atol=4e-3)
        expected = np.array([f0 * (a - b) + b for f0 in gold.base_color])
        np.testing.assert_allclose(integral(gold, angle, multiple=0), expected, atol=4e-3)
        # A second reflection colours light more than the first.
        gained = integral(gold, angle) - expected
        assert (np.diff(gained) < 2e-3).all() and (gained > -5e-3).all()
        assert gained[0] == pytest.approx(1 - a, abs=6e-3) and gained[2] < 0.2 * (1 - a) + 5e-3


@pytest.mark.parametrize("metallic", [0.25, 0.5, 0.75])
def test_furnace_between_metal_and_plastic(metallic: float) -> None:
    material = Material((1, 1, 1), metallic=metallic, roughness=0.7)
    for angle in (0.0, 45.0, 75.0):
        np.testing.assert_allclose(integral(material, angle), 1, atol=8e-3)


@pytest.mark.slow
def test_no_material_reflects_more_than_arrives() -> None:
    rng = np.random.default_rng(13)
    for _ in range(25):
        material = Material(
            (1, 1, 1), metallic=float(rng.random()), roughness=float(0.2 + 0.8 * rng.random()),
            specular=float(rng.random()), ior=float(1 + 2 * rng.random()),
        )  # fmt: skip
        assert integral(material, float(88 * rng.random())).max() < 1.01


ALL_TRAITS = (f"TRAITS {sum(1 << trait for trait in MaterialTrait)}u",)
"""The feature of scenes in which every trait is there."""


def random_white(rng: np.random.Generator) -> Material:
    """A material that absorbs nothing, with everything else at random, and each trait in half of them."""

    def some(high: float = 1.0) -> float:
        return float(high * rng.random() * (rng.random() < 0.5))

    return Material(
        (1, 1, 1), metallic=some(), roughness=float(0.1 + 0.9 * rng.random()), specular=float(rng.random()),
        ior=float(1 + 2 * rng.random()), specular_color=tuple((3 * rng.random(3) ** 2).tolist()),
        clearcoat=some(), clearcoat_roughness=float(0.1 + 0.9 * rng.random()),
        sheen_color=(some(), some(), some()), sheen_roughness=float(rng.random()), anisotropy=some(),
        iridescence=some(), iridescence_ior=float(1 + rng.random()),
        iridescence_thickness=float(1200 * rng.random()), diffuse_transmission=some(),
    )  # fmt: skip


def test_no_layered_material_makes_light() -> None:
    """Also at grazing angles, and whatever is combined; what it takes stays within what layers hide."""
    rng = np.random.default_rng(17)
    least = 1.0
    for _ in range(150):
        material, angle = random_white(rng), float(89 * rng.random())
        wi_count = 1 << 13
        weight = sample(material, wo_at(angle), wi_count, features=ALL_TRAITS)[1].astype(np.float64)
        share, error = weight.mean(axis=1), weight.std(axis=1) / np.sqrt(wi_count)
        assert (share < 1.01 + 4 * error).all(), (material, angle, share)
        least = min(least, float(share.max()))
    assert least > 0.6


@pytest.mark.parametrize("name", MATERIALS)
def test_variant_for_all_traits_is_the_same(name: str) -> None:
    """What a material does not have makes no difference where another one of the scene has it."""
    material = MATERIALS[name]
    u, v = uniforms(4096, 2, 6)
    wi = direction(np.arccos(1 - 2 * u), 2 * np.pi * v)
    for angle in ANGLES_DEG:
        wo = wo_at(angle)
        own, all_ = evaluate(material, wo, wi), evaluate(material, wo, wi, ALL_TRAITS)
        np.testing.assert_allclose(all_[0], own[0], rtol=0.03, atol=2e-4)


@pytest.mark.parametrize("angle_deg", [*ANGLES_DEG, 100.0])
@pytest.mark.parametrize("name", ["lambert", "white lambert"])
def test_variant_for_matte_scenes_is_the_same(name: str, angle_deg: float) -> None:
    """Without a layer and metal, what the variant leaves out makes no difference."""
    material, wo = MATERIALS[name], wo_at(angle_deg)
    u, v = uniforms(COUNT // 16, 2, 5)
    wi = direction(np.arccos(1 - 2 * u), 2 * np.pi * v)
    pairs = zip(evaluate(material, wo, wi), evaluate(material, wo, wi, ("MATTE",)), strict=True)
    for general, variant in pairs:
        assert variant.any() == (angle_deg < 90)
        np.testing.assert_allclose(variant, general, rtol=1e-5, atol=1e-7)
    if angle_deg < 90:
        pairs = zip(sample(material, wo, 4096), sample(material, wo, 4096, features=("MATTE",)), strict=True)
        for general, variant in pairs:
            np.testing.assert_allclose(variant, general, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_scenes_are_matte_where_the_variant_makes_no_difference(name: str) -> None:
    """Whatever parameter a Lambertian surface gets: what is_matte leaves to the variant is shaded by it as
    by the general kernels, and nothing is left to those in vain."""
    material = replace(MATERIALS["lambert"], **{name: unlike_default(name)})
    wi = direction(np.radians([[10.0], [40.0], [80.0]]), np.arange(0.0, 6.0)).reshape(3, -1)
    general, variant = (
        [np.vstack(evaluate(material, wo_at(angle), wi, features)) for angle in ANGLES_DEG]
        for features in (None, ("MATTE",))
    )
    is_same = np.allclose(variant, general, rtol=1e-5, atol=1e-7)
    textures = texture_tables(device(), {"one": material})
    assert material_tables(device(), {"one": material}, {}, textures).is_matte == is_same
