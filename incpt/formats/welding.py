"""Equal vertices: formats that share none repeat them for each face."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]
Hashes = npt.NDArray[np.uint64]


def mixed(values: Hashes) -> Hashes:
    """SplitMix64's finalizer (Steele, Lea and Flood 2014)."""
    values = (values ^ (values >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    values = (values ^ (values >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    result: Hashes = values ^ (values >> np.uint64(31))
    return result


def position_hashes(vertices: Floats) -> Hashes:
    """(V,) the same for equal positions (V, 3)."""
    # Adding zero makes one of the two zeros.
    with np.errstate(invalid="ignore"):
        bits = (vertices + np.float32(0)).view(np.uint32).astype(np.uint64)
    return mixed(mixed(mixed(bits[:, 0]) + bits[:, 1]) + bits[:, 2])


def welded(corners: Floats) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Vertices (V, 3), each of which stands for all corners (C, 3) at its place, in the order in which these
    come first; and the number (C,) of each corner's vertex. Where two places have one hash, which is not to
    be expected of fewer than a thousand million, some that are equal stay apart."""
    hashes = position_hashes(corners)
    order = np.argsort(hashes, kind="stable")
    ordered, hashes = corners[order], hashes[order]
    begins = np.ones(len(corners), bool)
    begins[1:] = (hashes[1:] != hashes[:-1]) | (ordered[1:] != ordered[:-1]).any(axis=1)
    # The sort is stable, so the first of equal corners comes first.
    first = order[begins]
    in_order = np.argsort(first)
    number = np.empty(len(first), np.int64)
    number[in_order] = np.arange(len(first))
    numbers = np.empty(len(corners), np.int64)
    numbers[order] = number[np.cumsum(begins) - 1]
    return corners[first[in_order]], numbers
