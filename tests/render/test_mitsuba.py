"""Renders against Mitsuba 3, whose pictures tests/support/references/make_references.py has stored."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from support import reference_scenes
from support.reference_scenes import REFERENCES, SIZE
from support.renders import blocks, repeat

pytestmark = pytest.mark.slow

Array = npt.NDArray[np.float64]
_FOLDER = Path(reference_scenes.__file__).parent / "references"
RENDERS = 8


@pytest.mark.parametrize("name", REFERENCES)
def test_same_picture_as_mitsuba(name: str) -> None:
    reference = REFERENCES[name]
    with np.load(_FOLDER / f"{name}.npz") as stored:
        expected, expected_error = (stored[key].astype(np.float64) for key in ("mean", "error"))
    images = repeat(
        reference.scene(), reference.spp // RENDERS, RENDERS, size=SIZE, max_bounces=reference.max_bounces,
        transmission_bounces=60, roulette_depth=255, multiple_scattering=False,
    )  # fmt: skip
    image = images.mean(axis=0)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=0.01)

    # Pixel by pixel: Student's t with about 7 degrees of freedom lies within 1 for 65 % and within 4.5 for
    # 99.7 %. Half floats and textures of edges leave half a per cent of a pixel's value.
    z = standardised(image - expected, images, expected_error, 0.005 * expected)
    lit = expected > 0
    assert (np.abs(z[lit]) < 1).mean() > 0.6
    assert (np.abs(z[lit]) < 4.5).mean() > 0.99
    assert np.count_nonzero(image[~lit]) <= 0.01 * np.count_nonzero(~lit)

    # No region is off: blocks of 8 x 8 pixels, 1 % of their value allowed beside the noise.
    error = np.sqrt(blocks(expected_error**2, 8) / 64)
    z = standardised(
        blocks(image, 8) - blocks(expected, 8), blocks(images, 8), error, 0.01 * blocks(expected, 8)
    )
    assert np.abs(z).max() < 5
    assert abs(np.mean(z)) < 0.5


def standardised(
    difference: Array, images: Array, reference_error: Array, allowed: Array
) -> npt.NDArray[np.float64]:
    """Differences in units of their standard error, which the renders' own scatter tells."""
    variance = images.var(axis=0, ddof=1) / len(images) + reference_error**2 + allowed**2
    return difference / np.sqrt(variance + 1e-12)
