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


def row_hashes(rows: Floats) -> Hashes:
    """(N,) the same for equal rows (N, width)."""
    hashes = np.zeros(len(rows), np.uint64)
    for column in rows.T:
        # Adding zero makes one of the two zeros.
        with np.errstate(invalid="ignore"):
            hashes = mixed(hashes + (column + np.float32(0)).view(np.uint32))
    return hashes


def welded(corners: Floats) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Vertices (V, width), each of which stands for all corners (C, width) that are equal to it, in the order
    in which these come first; and the number (C,) of each corner's vertex. Where two have one hash, which is
    not to be expected of fewer than a thousand million, some that are equal stay apart."""
    hashes = row_hashes(corners)
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
