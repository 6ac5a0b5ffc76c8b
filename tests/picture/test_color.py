"""Linear values and sRGB."""

from __future__ import annotations

import numpy as np

from incpt.picture.color import linear_from_srgb, srgb_from_linear


def test_values_of_the_standard() -> None:
    np.testing.assert_allclose(linear_from_srgb([0, 0.04045, 0.5, 1]), [0, 0.0031308, 0.21404, 1], rtol=1e-4)
    np.testing.assert_allclose(srgb_from_linear([0, 0.0031308, 0.21404, 1]), [0, 0.04045, 0.5, 1], rtol=1e-4)


def test_there_and_back_is_the_same() -> None:
    """Also below 0, where people type by mistake, and above 1, as radiance may be."""
    x = np.concatenate([np.linspace(-2, 0, 9), np.linspace(0, 1, 400), np.linspace(1, 50, 50)])
    np.testing.assert_allclose(linear_from_srgb(srgb_from_linear(x)), x, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(srgb_from_linear(linear_from_srgb(x)), x, rtol=1e-12, atol=1e-15)
