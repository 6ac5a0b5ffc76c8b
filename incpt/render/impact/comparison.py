"""A scene beside its anchor, on the device: what is needed to compare them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.film import Film, Float32Array
from incpt.render.first_hits import Window, first_hits
from incpt.render.impact.anchor import SURROUNDINGS, Anchor
from incpt.render.impact.center_hits import CenterHits
from incpt.render.impact.estimator import Estimator, SeenPair
from incpt.render.impact.exploration import most_blur, windows
from incpt.render.impact.first_sight import FirstSight, rows_columns, widened
from incpt.render.impact.target import KNOWN, Target
from incpt.render.impact.tile_sums import TileSums
from incpt.render.tiles import TileGrid
from incpt.render.tracer import Tracer
from incpt.scene.model import Scene
from incpt.tables.change_tables import ChangeTables, change_tables
from incpt.tables.scene_tables import SceneTables, paired_tables


@dataclass(frozen=True, eq=False)
class Prepared:
    """What comparisons of a session share, and what can be there before the first of them: the estimator, and
    what is seen in scenes that the next one may be of."""

    estimator: Estimator
    hits: tuple[CenterHits, ...] = ()

    @classmethod
    def of(cls, device: Device, size: tuple[int, int], old: Prepared | None) -> Prepared:
        """One for pictures of that size: `old` where it serves. Raises DeviceError where memory runs out."""
        if old is not None and old.estimator.size == size:
            return old
        return cls(Estimator(device, *size))

    def has_hits(self, scene: Scene) -> bool:
        """Whether it knows what is seen in a scene."""
        return any(hits.scene is scene for hits in self.hits)

    def with_hits(self, tracer: Tracer, tables: SceneTables, settings: RenderSettings) -> Prepared:
        """The same, with what is seen in the scene of the tables alone."""
        return replace(self, hits=(center_hits(tracer, tables, settings),))


@dataclass(frozen=True, eq=False)
class Comparison:
    """A scene and its anchor.

    grid         the tiles of the picture.
    anchor       the scene that the kept picture is of.
    tables       the scene as it is now. Both choose their lights from one table.
    changes      what paths can meet of their difference.
    estimator    makes the picture of pairs.
    seen         what the pixels show of both.
    anchor_hits  what is seen in the anchor, and `hits` in the scene.
    first_sight  what to show of the scene where it has no sample yet.
    target       what its picture starts from, if that is not the kept picture.
    """

    grid: TileGrid
    anchor: SceneTables
    tables: SceneTables
    changes: ChangeTables
    estimator: Estimator
    seen: SeenPair
    anchor_hits: CenterHits
    hits: CenterHits
    first_sight: FirstSight
    target: Target | None = None

    @property
    def prepared(self) -> Prepared:
        """What the next comparison can use of it."""
        return Prepared(self.estimator, (self.anchor_hits, self.hits))

    def compares(self, anchor: Scene, scene: Scene) -> bool:
        """Whether it is that of these two scenes."""
        return self.anchor.scene is anchor and self.tables.scene is scene

    def image(self, film: Film) -> Float32Array:
        """(H, W, 4) the picture of what the film has of pairs. It waits for the device."""
        return self.estimator.image(film, self.seen)

    def target_after(self, film: Film, error_left: float) -> Target | None:
        """What the next edit of the same objects starts from: the picture, if no more than KNOWN of the error
        of the change is left in it. It waits for the device."""
        if error_left > KNOWN or not film.is_whole:
            return self.target
        return Target(self.hits, film.with_coverage(self.image(film)))

    def fold(self, film: Film) -> None:
        """Make the picture the kept one of the film, with the samples that its pixels are worth."""
        self.estimator.fold(film, self.seen)

    def tile_sums(self, film: Film) -> TileSums:
        """What the film has of pairs, tile by tile. It waits for the device."""
        return self.estimator.tile_sums(film, self.seen, self.grid)


def compared(
    tracer: Tracer,
    settings: RenderSettings,
    anchor: Anchor,
    scene: Scene,
    tables: SceneTables,
    before: Comparison | None = None,
    prepared: Prepared | None = None,
    target: Target | None = None,
) -> Comparison:
    """The comparison of a scene with its anchor. `tables` are those of the scene before the edit, with which
    the new ones share what they can; `before`: its comparison, or else `prepared`; `target`: what to start
    from. Raises DeviceError."""
    pool, device = tables.pool, tracer.device
    grid = TileGrid(*settings.size, settings.tile_size)
    if before is not None and before.compares(anchor.scene, scene) and before.grid == grid:
        return before
    old, new = paired_tables(pool, anchor.scene, scene, tables)
    prepared = Prepared.of(device, settings.size, prepared if before is None else before.prepared)
    if not prepared.has_hits(anchor.scene):
        prepared = prepared.with_hits(tracer, old, settings)
    anchor_hits = next(hits for hits in prepared.hits if hits.scene is anchor.scene)
    seen = windows(grid, scene.camera, anchor.affected(scene))
    hits = _followed(anchor_hits, tracer, new, settings, seen)
    pair = _seen_pair(anchor, anchor_hits, hits, seen)
    if scene.camera.has_lens:
        reach = most_blur(grid, scene.camera, anchor.affected(scene))
        pair = replace(pair, changed=widened(pair.changed, reach))
    changes = change_tables(device, anchor.scene, scene)
    if target is None:
        sight_before = before.first_sight if before is not None and before.grid == grid else None
        sight = FirstSight(anchor_hits, hits, seen, before=sight_before)
    else:
        pair = replace(pair, target=target.image, in_target=target.shows(hits, grid))
        sight = FirstSight(target.hits, hits, target.windows(scene, grid), target.image)
    return Comparison(grid, old, new, changes, prepared.estimator, pair, anchor_hits, hits, sight, target)


def center_hits(tracer: Tracer, tables: SceneTables, settings: RenderSettings) -> CenterHits:
    """What is seen in a scene."""
    found = first_hits(tracer, tables, settings, settings.size)
    return CenterHits(tables.scene, found.object_id, found.normal, found.albedo)


def _followed(
    before: CenterHits, tracer: Tracer, tables: SceneTables, settings: RenderSettings, seen: list[Window]
) -> CenterHits:
    """What is seen in the scene of `tables`, which shows something else than `before` in the windows `seen`
    only."""
    scene = tables.scene
    objects, normals, colors = before.objects, before.normals.copy(), before.colors.copy()
    if [obj.name for obj in scene.objects] == [obj.name for obj in before.scene.objects]:
        objects = objects.copy()
    else:
        number = {obj.name: i for i, obj in enumerate(scene.objects)}
        # The last place is that of -1.
        objects = np.array([number.get(obj.name, -1) for obj in before.scene.objects] + [-1], np.int32)[
            objects
        ]
    for window in seen:
        found = first_hits(tracer, tables, settings, settings.size, window)
        inside = rows_columns(window)
        objects[inside], normals[inside], colors[inside] = found.object_id, found.normal, found.albedo
    return CenterHits(scene, objects, normals, colors)


def _seen_pair(anchor: Anchor, old: CenterHits, new: CenterHits, seen: list[Window]) -> SeenPair:
    """What the pixel centres show of both scenes: labels are the same where both show the same two
    objects."""
    number = {obj.name: i for i, obj in enumerate(anchor.scene.objects)}
    for obj in new.scene.objects:
        number.setdefault(obj.name, len(number))
    common = np.array([number[obj.name] for obj in new.scene.objects] + [-1], np.int32)
    differs = np.zeros(len(number) + 1, np.bool_)
    # Lights are nothing that pixels show: rays through their centres go on to what is behind.
    touched = anchor.touched(new.scene)
    differs[[number[name] for name in touched if name in number]] = True
    if SURROUNDINGS in touched:
        height, width = old.objects.shape
        differs[-1], seen = True, [(0, 0, width, height)]
    # Outside of the windows both scenes show the same.
    labels = _label(old.objects, old.objects)
    changed = np.zeros(labels.shape, np.bool_)
    for window in seen:
        inside = rows_columns(window)
        before, now = old.objects[inside], common[new.objects[inside]]
        labels[inside] = _label(before, now)
        changed[inside] = (before != now) | differs[before] | differs[now]
    return SeenPair(labels, new.normals, changed)


def _label(before: npt.NDArray[np.int32], now: npt.NDArray[np.int32]) -> npt.NDArray[np.uint32]:
    """A number below 2^30 for two objects. Where there are more than 16,384 of them, a few pixels are
    filtered together by mistake."""
    pair = (before + 1).astype(np.uint32) * np.uint32(1 << 16) + (now + 1).astype(np.uint32)
    return pair & np.uint32(0x3FFFFFFF)
