"""What every kernel of the path tracer is told of scene, picture and settings."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from incpt.core import layout
from incpt.core.settings import RenderSettings
from incpt.tables.scene_tables import SceneTables


def launch_params(
    tables: SceneTables, settings: RenderSettings, size: tuple[int, int] | None = None
) -> npt.NDArray[np.void]:
    """() layout.PARAMS for a picture of `size` (width, height; that of the settings by default). The caller
    fills in what depends on its buffers: buffer_stride, and what chooses a chunk of the paths."""
    width, height = settings.size if size is None else size
    scene = tables.scene
    camera, environment = scene.camera, scene.environment
    params = np.zeros((), layout.PARAMS)
    right, up, forward = camera.image_plane(width / height)
    params["camera"] = (camera.position, right, up, forward)
    params["width"], params["height"] = width, height
    params["in_squares"] = tables.has_trees
    for name in ("tile_size", "seed", "max_bounces", "transmission_bounces", "roulette_depth"):
        params[name] = getattr(settings, name)
    params["light_count"] = tables.light_count
    params["environment_probability"] = tables.environment_probability
    params["environment_color"] = tables.environment_radiance
    if environment.image is not None:
        params["environment_height"], params["environment_width"] = environment.image.pixels.shape[:2]
    params["environment_rotation"] = environment.rotation_y / 360 % 1
    return params
