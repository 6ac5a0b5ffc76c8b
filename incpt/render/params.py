"""What every kernel of the path tracer is told of picture, settings and scene."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from incpt.core import layout, stages
from incpt.core.settings import RenderSettings
from incpt.scene.camera import Camera
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
    _set_camera(params["camera"], camera, width / height)
    params["width"], params["height"] = width, height
    params["in_squares"] = tables.has_trees
    for name in ("tile_size", "seed", "max_bounces", "transmission_bounces", "roulette_depth",
                 "multiple_scattering", "clamp_indirect"):  # fmt: skip
        params[name] = getattr(settings, name)
    params["first_sky_ray"] = int(settings.transparent)
    return params


def aim_at(params: npt.NDArray[np.void], x: float, y: float) -> None:
    """Move the middle of the picture to where (x, y) was, halves of its width to the right and of its height
    up."""
    camera = params["camera"]
    moved = "position" if camera["orthographic"] else "forward"
    camera[moved] += x * camera["right"]
    camera[moved] += y * camera["up"]


def _set_camera(params: npt.NDArray[np.void], camera: Camera, aspect: float) -> None:
    """Fill () layout.CAMERA for a picture of that aspect (width by height)."""
    right, up, forward = camera.image_plane(aspect)
    radius = camera.lens_radius(aspect)
    for name, axis in (("right", right), ("up", up)):
        params[name] = axis
        params[f"lens_{name}"] = radius / np.linalg.norm(axis) * axis
    params["position"], params["forward"] = camera.position, forward
    params["inverse_focus"] = 1 / camera.sharp_distance
    params["near"], params["blades"] = camera.near, camera.blades
    params["blade_turns"] = camera.blade_rotation / 360 % 1
    params["orthographic"] = camera.is_orthographic
    shift_x, shift_y = camera.shift_at(aspect)
    if shift_x or shift_y:
        across = shift_x * right + shift_y * up
        moved = "position" if camera.is_orthographic else "forward"
        params[moved] = (camera.position if camera.is_orthographic else forward) + across


def launch_params(params: npt.NDArray[np.void], tables: SceneTables) -> npt.NDArray[np.void]:
    """A copy of `params` with what kernels are told of the scene that the paths are traced in: lights,
    environment, and what the stages of a ray depend on."""
    params, environment = params.copy(), tables.scene.environment
    params["last_ray"] = stages.last_ray(int(params["max_bounces"]), tables.has_media)
    params["camera_media"] = tables.camera_media
    shaped = tables.lights.shaped
    if not any(tables.environment_radiance) and shaped.sun_count == 0:
        params["first_sky_ray"] = layout.MOST_RAYS
    params["light_count"] = tables.light_count
    params["shaped_count"], params["sun_count"] = shaped.count, shaped.sun_count
    params["shaped_probability"] = shaped.probability
    params["tree_probability"], params["light_levels"] = (
        tables.lights.tree.probability,
        tables.lights.tree.levels,
    )
    params["environment_probability"] = tables.environment_probability
    params["environment_color"] = tables.environment_radiance
    if environment.picture is not None:
        params["environment_height"], params["environment_width"] = environment.picture.pixels.shape[:2]
    params["environment_rotation"] = environment.rotation_y / 360 % 1
    if environment.sky is not None and environment.has_sun:
        x, y, z = environment.sky.sun_direction
        angle = math.radians(environment.rotation_y)
        sine, cosine = math.sin(angle), math.cos(angle)
        params["sun_direction"] = (x * cosine + z * sine, y, z * cosine - x * sine)
        params["sun_radiance"], params["sun_chord"] = environment.sky.sun_radiance, environment.sky.sun_chord
        params["sun_probability"] = tables.sun_probability
    return params
