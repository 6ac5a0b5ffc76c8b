"""Which rays cross the boxes around what changed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import call

from incpt.core import layout

Array = npt.NDArray[np.float64]
COUNT = 200_000


def crossed(
    change: npt.NDArray[np.void], origin: Array, direction: Array, limit: Array
) -> npt.NDArray[np.bool_]:
    """(N,) whether rays from (3, N) to (3, N) cross a box of the change."""
    rays = {f"o{i}": origin[i] for i in range(3)} | {f"d{i}": direction[i] for i in range(3)}
    body = """
    const Change own = change[0];
    Ray ray;
    ray.origin = vec3(o0[i], o1[i], o2[i]);
    ray.direction = vec3(d0[i], d1[i], d2[i]);
    r[i] = (float)crosses_boxes(&own, 0u, ray, limit[i]);"""
    (found,) = call("changes", body, len(limit), change=change.reshape(1), limit=limit, **rays)
    return found > 0


def exactly(box: Array, origin: Array, direction: Array, limit: Array) -> npt.NDArray[np.bool_]:
    """(N,) whether rays cross a box (2, 3) up to their limits, by slabs in double precision."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a = (box[0][:, None] - origin) / direction
        b = (box[1][:, None] - origin) / direction
    between = (box[0][:, None] <= origin) & (origin <= box[1][:, None])
    along = direction != 0
    enter = np.where(along, np.minimum(a, b), np.where(between, -np.inf, np.inf)).max(axis=0)
    leave = np.where(along, np.maximum(a, b), np.where(between, np.inf, -np.inf)).min(axis=0)
    return np.asarray((enter <= leave) & (leave >= 0) & (enter <= limit))


def rays(random: np.random.Generator, away: float) -> tuple[Array, Array, Array]:
    """Origins, directions, limits, as floats hold them: towards the boxes, along axes, and anywhere."""
    origin = random.uniform(-6, 6, (3, COUNT))
    origin[:, ::5] *= away
    direction = random.normal(size=(3, COUNT))
    aimed = random.uniform(-4, 4, (3, COUNT)) - origin
    direction = np.where(random.random(COUNT) < 0.8, aimed, direction)
    direction[random.random((3, COUNT)) < 0.05] = 0
    direction[0, (direction == 0).all(axis=0)] = 1
    length = np.linalg.norm(direction, axis=0)
    limit = np.where(random.random(COUNT) < 0.4, np.inf, random.uniform(0, 2, COUNT) * length)
    return tuple(np.asarray(v, np.float32).astype(np.float64) for v in (origin, direction / length, limit))  # type: ignore[return-value]


@pytest.mark.parametrize("away", [1, 1000])
def test_rays_cross_boxes(away: float) -> None:
    random = np.random.default_rng(away)
    boxes = np.array([[[-1, 0.5, -2], [1, 3, -0.5]], [[0.2, -3, 1], [0.7, -3, 3]]])  # the second is flat
    change = np.zeros((), layout.CHANGE)
    change["box_count"], change["padding"], change["reach"] = 2, 2.0**-19, 3
    change["least"][:2], change["greatest"][:2] = boxes[:, 0], boxes[:, 1]
    origin, direction, limit = rays(random, away)
    found = crossed(change, origin, direction, limit)
    certain = np.any([exactly(box, origin, direction, limit) for box in boxes], axis=0)
    assert not (certain & ~found).any()
    pad = 3 * 2.0**-19 * (3 + 6 * away)
    padded = [box + np.array([[-pad], [pad]]) for box in boxes]
    possible = np.any([exactly(box, origin, direction, limit + pad) for box in padded], axis=0)
    assert not (found & ~possible).any()
    assert 0.05 < certain.mean() < 0.9 and (possible != certain).mean() < 0.02
    for box in range(2):
        change["least"][1 - box], change["greatest"][1 - box] = 1e6, 1e6
        alone = crossed(change, origin, direction, limit)
        assert 0.002 < alone.mean() < found.mean()
        change["least"][:2], change["greatest"][:2] = boxes[:, 0], boxes[:, 1]
