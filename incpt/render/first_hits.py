"""What the rays through pixel centres meet first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Aovs:
    """First-hit values of the rays through pixel centres: index of the object or -1 (H, W), shading normal
    in world space (H, W, 3), distance from the camera in metres or infinity (H, W), base colour (H, W, 3)."""

    object_id: npt.NDArray[np.int32]
    normal: npt.NDArray[np.float32]
    depth: npt.NDArray[np.float32]
    albedo: npt.NDArray[np.float32]
