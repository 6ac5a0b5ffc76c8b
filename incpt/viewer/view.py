"""What a viewer asks for, a `View`, and what it gets, a `Frame`: values that pass between threads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.render import tiles
from incpt.render.first_hits import FirstHits
from incpt.render.impact.findings import Findings
from incpt.render.modes import Mode
from incpt.scene.model import Scene

Float32Image = npt.NDArray[np.float32]


@dataclass(frozen=True)
class View:
    """What a viewer wants to see; handing in an equal one again does nothing.

    scene             its settings say how to render.
    before            the scene before the drag of which `scene` is one step; None: no drag is under way.
    point             clicked last, (x, y) from the top left in units of the image.
    resolution_scale  the picture has the settings' size times this.
    target_spp        samples per pixel at which refining stops.
    step_ms           what a step aims at.
    drag_nor          the most repetitions of a tile while a drag is under way.
    split             also render under "restart", fed with the same edits.
    first_hits        whether first hits are wanted.
    denoise           whether a denoised picture is wanted, see `denoising.py`.
    region            which part of a larger picture `scene` is for whoever shows it: left, top, width and
                      height in units of that; it comes back as it is.
    """

    scene: Scene
    before: Scene | None = None
    point: tuple[float, float] | None = None
    resolution_scale: float = 1.0
    paused: bool = False
    target_spp: int | None = None
    step_ms: float = 33.0
    drag_nor: int = 16
    split: bool = False
    first_hits: bool = False
    denoise: bool = False
    region: tuple[float, float, float, float] | None = None

    @property
    def needs_first_hits(self) -> bool:
        """Whether first hits are traced: they help a denoiser too."""
        return self.first_hits or (self.denoise and not self.scene.camera.has_lens)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height to render, pixels."""
        width, height = (max(1, round(side * self.resolution_scale)) for side in self.scene.settings.size)
        return width, height


@dataclass(frozen=True, eq=False)
class Picture:
    """One side.

    image       (h, w, 4) float32 mean radiance, linear, row 0 on top; alpha 0 where there is no sample of
                this size yet, unless it is `transparent`: see `Session.image`. The same array again in the
                next Frame where nothing new was read.
    queue       (n,) int32 tiles in order; `queue_done` of them are finished.
    tile_spp    (count,) int64 samples behind each tile.
    replaced    (count,) bool: tiles finished since the last change of the scene.
    seconds     rendering time since the last change of the scene.
    error       normalized RMSE against the pinned reference, or None.
    error_left  the share of the visible error of an edit that is left, as `Session.error_left` has it.
    findings    what is known of the edit, tile by tile; None: nothing yet.
    transparent whether the picture can be seen through, as the setting says.
    denoised    (h, w, 4) what is shown in place of `image`, or None.
    """

    image: Float32Image
    grid: tiles.TileGrid
    mode: Mode
    queue: npt.NDArray[np.int32]
    queue_done: int
    tile_spp: npt.NDArray[np.int64]
    replaced: npt.NDArray[np.bool_]
    seconds: float
    error: float | None
    strategy: str
    error_left: float | None = None
    findings: Findings | None = None
    transparent: bool = False
    denoised: Float32Image | None = None

    @property
    def shown(self) -> Float32Image:
        """(h, w, 4) what is shown."""
        return self.image if self.denoised is None else self.denoised


@dataclass(frozen=True, eq=False)
class Frame:
    """What there is to show.

    view         what it shows.
    pictures     the one under the chosen strategy; with a split view that under "restart" before it.
    is_preview   rendered at a reduced resolution, because everything started over and the view does not rest.
    first_hits   those of a picture of the view's size, or smaller while changes stream in; None: not there
                 yet, or not wanted.
    nonfinite    samples since the last change of the scene that were not finite and count as black.
    cut_off      the share of the paths since then that ended because `transmission_bounces` was used up,
                 though they still carried something.
    resting      paused, or the target is reached: nothing is under way.
    is_pinned    there is a reference to compare with, or there will be once the picture is whole.
    is_stale     that is of another scene.
    """

    view: View
    pictures: tuple[Picture, ...]
    is_preview: bool
    step_seconds: float
    paths_per_second: float
    device: str
    first_hits: FirstHits | None
    nonfinite: int
    cut_off: float
    resting: bool
    is_pinned: bool = False
    is_stale: bool = False
