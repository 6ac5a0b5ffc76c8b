"""Spectra as colours, beside what is known of them."""

from __future__ import annotations

import numpy as np
import pytest

from incpt.picture.spectra import blackbody_color, emitted_color, reflected_color

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
EVERYWHERE = (300.0, 900.0)


def test_what_reflects_all_wavelengths_alike_is_grey() -> None:
    np.testing.assert_allclose(reflected_color(EVERYWHERE, (0.3, 0.3)), 0.3, rtol=1e-12)


def test_light_of_all_wavelengths_alike_has_a_luminance_of_1() -> None:
    color = emitted_color(EVERYWHERE, (1.0, 1.0))
    assert color @ LUMINANCE == pytest.approx(1, abs=2e-4)
    # The equal-energy white in linear Rec. 709, for XYZ of 1, 1, 1 (IEC 61966-2-1).
    np.testing.assert_allclose(color, [1.2048, 0.9483, 0.9089], atol=2e-3)


def test_daylight_is_white() -> None:
    # A black body of 6504 K has nearly the colour of D65.
    color = blackbody_color(6504)
    np.testing.assert_allclose(color / color[1], 1, atol=0.07)


def test_a_black_body_has_the_luminance_of_plancks_law() -> None:
    # 2856 K, the illuminant A: x 0.4476, y 0.4074 (CIE 015:2018).
    color = blackbody_color(2856)
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ color
    np.testing.assert_allclose(xyz[:2] / xyz.sum(), [0.4476, 0.4074], atol=1e-3)
    # At 555 nm, about where the eye sees best, it emits 2 h c² / l^5 / (exp(h c / (l k T)) - 1).
    metres = 555e-9
    radiance = 1.191043e-16 / metres**5 / np.expm1(1.438777e-2 / (metres * 2856)) * 1e-9
    assert xyz[1] == pytest.approx(radiance, rel=0.15)


def test_a_spectrum_is_nothing_outside_of_its_wavelengths() -> None:
    np.testing.assert_array_equal(reflected_color((800, 900), (1, 1)), 0)
    red = reflected_color((600, 780), (1, 1))
    assert red[0] > 0.8 and red[2] < 0.01
