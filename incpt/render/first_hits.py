"""What the rays through pixel centres meet first: as images, and for picking.

These rays are not jittered, and go through the middle of a lens, so that a pixel has one object and an
outline does not flicker. Base colours and normals of the jittered samples of the picture itself are passes of
the film; see `film`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.core import layout
from incpt.core.affine import Vector
from incpt.core.settings import RenderSettings
from incpt.render import tiles
from incpt.render.batch import Batch
from incpt.render.params import aim_at, path_params
from incpt.render.plan import Cursor, Queue, plan_step
from incpt.render.tracer import Tracer
from incpt.scene.camera import Camera
from incpt.scene.light import nearest_seen
from incpt.tables.scene_tables import SceneTables

Window = tuple[int, int, int, int]
"""A part of a picture in pixels: the first column and row, and the column and the row behind the last
ones."""
_SURFACE_PLANES = 7
"""Shading normal, distance, base colour: see cl/film/first_hits.cl."""


@dataclass(frozen=True)
class FirstHits:
    """What the rays through pixel centres meet first, row 0 on top.

    object_id  (H, W) the object's place in `Scene.objects`, or -1.
    normal     (H, W, 3) shading normal, world space; 0 where there is no object.
    depth      (H, W) distance from the camera in metres, or infinity; of an orthographic one from its plane.
    albedo     (H, W, 3) base colour, linear; 0 where there is no object.
    """

    object_id: npt.NDArray[np.int32]
    normal: npt.NDArray[np.float32]
    depth: npt.NDArray[np.float32]
    albedo: npt.NDArray[np.float32]


def first_hits(
    tracer: Tracer,
    tables: SceneTables,
    settings: RenderSettings,
    size: tuple[int, int],
    window: Window | None = None,
) -> FirstHits:
    """Those of a picture of `size` (width, height), or of a window of it only."""
    whole_width, whole_height = size
    params = path_params(tables, settings, size)
    left, top, right, bottom = (0, 0, *size) if window is None else window
    width, height = right - left, bottom - top
    # The window is a picture of its own, of a camera that looks a little aside.
    camera = params["camera"]
    aim_at(params, (left + right) / whole_width - 1, 1 - (top + bottom) / whole_height)
    camera["right"] *= width / whole_width
    camera["up"] *= height / whole_height
    params["width"], params["height"] = width, height
    # Tiles of any size serve; these keep neighbouring rays together.
    params["tile_size"] = RenderSettings.tile_size
    grid = tiles.TileGrid(width, height, RenderSettings.tile_size)
    queue = Queue.even(tiles.base_queue(grid), 1, True)
    plan = plan_step(grid, queue, Cursor(), grid.count, np.zeros(grid.count, np.int64))
    surface, object_ids = _traced(tracer, tables, plan.slots, params)
    surface = surface.reshape(_SURFACE_PLANES, height, width)
    if tables.scene.camera.near > 0:
        surface[3] += _distance_to_near(tables.scene.camera, size, (left, top, right, bottom))
    return FirstHits(
        object_ids.reshape(height, width),
        np.ascontiguousarray(np.moveaxis(surface[:3], 0, 2)),
        surface[3],
        np.ascontiguousarray(np.moveaxis(surface[4:], 0, 2)),
    )


def _distance_to_near(camera: Camera, size: tuple[int, int], window: Window) -> npt.NDArray[np.float32]:
    """(H, W) from the camera to its near plane through the pixels of a window, metres."""
    (width, height), (left, top, right, bottom) = size, window
    x, y = np.meshgrid(np.arange(left, right) + 0.5, np.arange(top, bottom) + 0.5)
    _, directions = camera.rays(np.column_stack([x.ravel() / width, y.ravel() / height]), width / height)
    lengths = np.linalg.norm(directions, axis=1).reshape(x.shape)
    return np.asarray(camera.near * lengths, np.float32)


def object_at(
    tracer: Tracer, tables: SceneTables, settings: RenderSettings, point: tuple[float, float]
) -> str | None:
    """The name of the object or light at a point (x, y) from the top left, in units of the picture, or
    None."""
    scene = tables.scene
    origin, direction, depth, index = _met(tracer, tables, settings, point)
    light = nearest_seen(scene.lights, origin, direction, depth)
    if light is not None:
        return light.name
    return scene.objects[index].name if index >= 0 else None


def place_at(
    tracer: Tracer, tables: SceneTables, settings: RenderSettings, point: tuple[float, float]
) -> Vector | None:
    """The place in world space of the surface at a point (x, y) from the top left, in units of the picture,
    or None."""
    origin, direction, depth, index = _met(tracer, tables, settings, point)
    if index < 0:
        return None
    x, y, z = (float(v) for v in np.asarray(origin) + depth * direction)
    return x, y, z


def _met(
    tracer: Tracer, tables: SceneTables, settings: RenderSettings, point: tuple[float, float]
) -> tuple[Vector, npt.NDArray[np.float64], float, int]:
    """The camera ray through a point: its origin, its direction (of unit length), how far it goes, metres,
    and the index of the object that it meets; -1 where it meets none."""
    params = path_params(tables, settings)
    # The point is the centre of a picture of one pixel.
    aim_at(params, 2 * point[0] - 1, 1 - 2 * point[1])
    params["width"] = params["height"] = params["tile_size"] = 1
    surface, object_ids = _traced(tracer, tables, one_slot(), params)
    camera, (width, height) = tables.scene.camera, settings.size
    origins, directions = camera.rays(np.array([point]), width / height)
    length = float(np.linalg.norm(directions[0]))
    depth = float(surface[3]) + camera.near * length
    return origins[0], directions[0] / length, depth, int(object_ids[0])


def one_slot() -> npt.NDArray[np.void]:
    """(1,) layout.SLOT: a single path for each pixel of the tile at the top left."""
    slot = np.zeros(1, layout.SLOT)
    slot["group_count"] = slot["pixel_step"] = 1
    return slot


def _traced(
    tracer: Tracer, tables: SceneTables, slots: npt.NDArray[np.void], params: npt.NDArray[np.void]
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    """(_SURFACE_PLANES * pixels,) and (pixels,) as cl/film/first_hits.cl fills them."""
    device = tracer.device
    pixels = int(params["width"]) * int(params["height"])
    paths = len(slots) * int(params["tile_size"]) ** 2
    params["pixel_center"] = 1
    params["buffer_stride"] = paths + layout.WORK_GROUP_SIZE
    surface, object_ids = device.empty(4 * _SURFACE_PLANES * pixels), device.empty(4 * pixels)
    radiance = device.empty(12 * (paths + layout.WORK_GROUP_SIZE))
    counters = device.empty(4 * len(layout.Counter))
    batch = Batch(tables, params, device.upload(slots), paths, radiance, counters)
    tracer.first_hits(batch, surface, object_ids)
    return (
        device.read(surface, np.empty(_SURFACE_PLANES * pixels, np.float32)),
        device.read(object_ids, np.empty(pixels, np.int32)),
    )
