"""What decides, for blocks of paths and for the wavefront alike, which stages a ray goes through.

The order of the stages stands in both (cl/cpu/trace_blocks.cl, wavefront.py); what may be left out of it
stands in the parameters of a launch, so that it is decided once.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from incpt.core import layout
from incpt.tables.scene_tables import SceneTables


def scheduled(params: npt.NDArray[np.void], tables: SceneTables) -> npt.NDArray[np.void]:
    """A copy of `params` with last_ray and sees_sky filled in."""
    filled = params.copy()
    # Without media every ray is a scattering event, so that all paths end with the same one.
    last = layout.MOST_RAYS - 1 if tables.has_media else int(params["max_bounces"]) + 1
    filled["last_ray"] = min(last, layout.MOST_RAYS - 1)
    filled["sees_sky"] = any(tables.environment_radiance)
    return filled
