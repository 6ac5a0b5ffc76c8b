"""From where the scene is looked at in the window: through its active camera, or freely beside it.

A free view is no part of the scene: moving it is no edit, and saving does not keep it. What is shown is a
scene all the same, the edited one with the view's camera in place of the active one, so that the renderer,
handles and marks need to know of one camera only.

Of a region of the picture the renderer is shown a scene too, whose camera sees that part alone.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from incpt.scene import camera_moves, edits
from incpt.scene.camera import Camera
from incpt.scene.model import Object, Scene
from incpt.ui.rect import Rect

_MOST_KNOWN = 8
"""How many shown scenes are kept: the one before a drag, and those of the frames around the present one."""
LEAST_REGION = 16
"""The least width and height of a region, pixels."""
_LEAST_SHARE = 1 / 64
"""The least width and height of a region, as a share of the picture's."""


@dataclass(frozen=True)
class Viewing:
    """camera      that of a free view; None: the scene is seen through its active camera.
    left        the free view that was left last, to which `switched` goes back.
    is_locked   whether moves of the view through the active camera move that camera, which are edits then.
    region      the part of the picture that alone is rendered, in units of it; None: all of it is.
    local       the names of the objects that alone are seen, beside what shines; None: all are.
    saved       cameras of views that were saved, by name; `last_saved` is the one that was gone to last.
    """

    camera: Camera | None = None
    left: Camera | None = None
    is_locked: bool = False
    region: Rect[float] | None = None
    local: frozenset[str] | None = None
    saved: Mapping[str, Camera] = field(default_factory=dict)
    last_saved: str | None = None

    @property
    def is_free(self) -> bool:
        return self.camera is not None

    def moved(self, camera: Camera) -> Viewing:
        """Free, with that camera."""
        return replace(self, camera=camera)

    def through_camera(self) -> Viewing:
        """Through the active camera of the scene."""
        return self if self.camera is None else replace(self, camera=None, left=self.camera)

    def switched(self) -> Viewing:
        """From the free view to the camera, or back to the free view that was left."""
        return self.through_camera() if self.is_free else replace(self, camera=self.left)


class ShownScenes:
    """Edited scenes as they are shown, and back. The same scene and camera give the very same shown scene,
    so that nobody takes it for an edit."""

    def __init__(self) -> None:
        self._known: OrderedDict[tuple[int, int], tuple[Scene, Camera, Scene]] = OrderedDict()
        self._rendered: OrderedDict[
            tuple[int, Rect[float] | None, frozenset[str] | None], tuple[Scene, Scene]
        ]
        self._rendered = OrderedDict()

    def of(self, scene: Scene, camera: Camera | None) -> Scene:
        """`scene` as it is shown by a view's camera, or through its own (None)."""
        if camera is None:
            return scene
        key = (id(scene), id(camera))
        if key not in self._known:
            self._keep(scene, camera, replace(scene, camera=camera))
        self._known.move_to_end(key)
        return self._known[key][2]

    def rendered(self, shown: Scene, region: Rect[float] | None, local: frozenset[str] | None) -> Scene:
        """What the renderer is to show of a shown scene: a region of its picture, or all of it (None), and of
        its objects those with these names and what shines, or all (None)."""
        if region is None and local is None:
            return shown
        key = id(shown), region, local
        if key not in self._rendered:
            alone = shown if local is None else _alone(shown, local)
            self._rendered[key] = shown, alone if region is None else _cropped(alone, region)
        self._rendered.move_to_end(key)
        while len(self._rendered) > _MOST_KNOWN:
            self._rendered.popitem(last=False)
        return self._rendered[key][1]

    def edited(self, shown: Scene, camera: Camera | None, own: Camera) -> Scene:
        """The edited scene of one that was made from a shown scene: with `own`, its own active camera, in
        place of the view's. A scene that was made with another camera is an edited one already."""
        if camera is None or shown.camera is not camera:
            return shown
        for scene, _, known in self._known.values():
            if known is shown:
                return scene
        scene = replace(shown, camera=own)
        self._keep(scene, camera, shown)
        return scene

    def _keep(self, scene: Scene, camera: Camera, shown: Scene) -> None:
        # What is kept holds the scene and the camera, so no other can have their ids.
        self._known[id(scene), id(camera)] = (scene, camera, shown)
        while len(self._known) > _MOST_KNOWN:
            self._known.popitem(last=False)


def region_of(box: Rect[float], size: tuple[int, int]) -> Rect[float] | None:
    """The whole pixels of a picture of `size` that a box in units of it touches, in the same units; None
    where they are too few to be a region."""
    left, top, right, bottom = _pixels(box, size)
    least = [max(LEAST_REGION, side * _LEAST_SHARE) for side in size]
    if right - left < least[0] or bottom - top < least[1]:
        return None
    width, height = size
    return Rect(left / width, top / height, (right - left) / width, (bottom - top) / height)


def _alone(scene: Scene, names: frozenset[str]) -> Scene:
    def stays(one: Object) -> bool:
        return one.name in names or scene.materials[one.material].is_emissive

    hidden = [one.name for one in scene.objects if one.visible and not stays(one)]
    return edits.set_visible(scene, hidden, False)


def _cropped(scene: Scene, region: Rect[float]) -> Scene:
    size = scene.settings.size
    box = left, top, right, bottom = _pixels(region, size)
    settings = replace(scene.settings, size=(right - left, bottom - top))
    return replace(scene, camera=camera_moves.cropped(scene.camera, size, box), settings=settings)


def _pixels(box: Rect[float], size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of the pixels that a box touches, one at least. A billionth of a pixel is
    none, which rounding makes of whole ones."""
    ends = []
    for low, length, side in ((box.left, box.width, size[0]), (box.top, box.height, size[1])):
        start = min(max(math.floor(low * side + 1e-9), 0), side - 1)
        ends.append((start, min(max(math.ceil((low + length) * side - 1e-9), start + 1), side)))
    (left, right), (top, bottom) = ends
    return left, top, right, bottom
