"""Random cameras of every kind."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from incpt.scene.camera import PROJECTIONS, Camera

units = st.floats(-1, 1)
directions = st.tuples(units, units, units).filter(lambda v: math.hypot(*v) > 0.1)
points = st.tuples(*[st.floats(-50, 50)] * 3)


@st.composite
def cameras(draw: st.DrawFn, tilted: bool = True, shifted: bool = True) -> Camera:
    """One that looks anywhere from anywhere, not quite along its `up`."""
    target = draw(points)
    back = np.array(draw(directions))
    back *= draw(st.floats(0.1, 100)) / np.linalg.norm(back)
    up = draw(directions) if tilted else (0.0, 1.0, 0.0)
    assume(np.linalg.norm(np.cross(back, up)) > 1e-2 * np.linalg.norm(back) * math.hypot(*up))
    position = (np.array(target) + back).tolist()
    shifts = st.floats(-0.5, 0.5) if shifted else st.just(0.0)
    return Camera(
        tuple(position), target, up, draw(st.floats(5, 120)), draw(st.sampled_from(PROJECTIONS)),
        draw(st.floats(0.1, 100)), draw(st.sampled_from([0.0, 35.0])), shift_x=draw(shifts),
        shift_y=draw(shifts),
    )  # fmt: skip
