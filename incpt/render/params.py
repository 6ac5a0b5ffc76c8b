"""What every kernel of the path tracer is told of picture, settings and scene."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from incpt.core import layout, stages
from incpt.core.settings import RenderSettings
from incpt.tables.scene_tables import SceneTables


def path_params(
    tables: SceneTables, settings: RenderSettings, size: tuple[int, int] | None = None
) -> npt.NDArray[np.void]:
    """() layout.PARAMS that say which paths there are: the camera, the picture of `size` (width, height; that
    of the settings by default), the order of its pixels, and how long paths may be. The caller fills in
    buffer_stride, a tracer what chooses a chunk of the paths, and `launch_params` all that depends on the
    scene that they are traced in."""
    width, height = settings.size if size is None else size
    camera = tables.scene.camera
    params = np.zeros((), layout.PARAMS)
    right, up, forward = camera.image_plane(width / height)
    params["camera"] = (camera.position, right, up, forward)
    params["width"], params["height"] = width, height
    params["in_squares"] = tables.has_trees
    for name in ("tile_size", "seed", "max_bounces", "transmission_bounces", "roulette_depth",
                 "multiple_scattering"):  # fmt: skip
        params[name] = getattr(settings, name)
    return params


def launch_params(params: npt.NDArray[np.void], tables: SceneTables) -> npt.NDArray[np.void]:
    """A copy of `params` with what kernels are told of the scene that the paths are traced in: lights,
    environment, and what the stages of a ray depend on."""
    params, environment = params.copy(), tables.scene.environment
    params["last_ray"] = stages.last_ray(int(params["max_bounces"]), tables.has_media)
    params["camera_media"] = tables.camera_media
    shaped = tables.lights.shaped
    params["sees_sky"] = any(tables.environment_radiance) or shaped.sun_count > 0
    params["light_count"] = tables.light_count
    params["shaped_count"], params["sun_count"] = shaped.count, shaped.sun_count
    params["shaped_probability"] = shaped.probability
    params["environment_probability"] = tables.environment_probability
    params["environment_color"] = tables.environment_radiance
    if environment.image is not None:
        params["environment_height"], params["environment_width"] = environment.image.pixels.shape[:2]
    params["environment_rotation"] = environment.rotation_y / 360 % 1
    return params
