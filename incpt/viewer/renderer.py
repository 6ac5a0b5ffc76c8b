"""What passes between an editor and its renderer: requests go in, messages come out.

Requests for the picture itself (Export, Copy, Pin) wait until it is whole: at full resolution, and with
nothing left of an edit that it does not show yet. Waiting tells which do. RenderFinal is for another picture,
which is rendered beside it.

`Renderer` is all that an editor needs; `threaded.ThreadedRenderer` is one.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from incpt.core.affine import Vector
from incpt.render.final import FinalSettings
from incpt.scene.model import Scene
from incpt.viewer.view import Frame, View


@dataclass(frozen=True)
class Pick:
    """Which object is at `point`, in units of the image from the top left? `additive` comes back as it is."""

    point: tuple[float, float]
    additive: bool = False


@dataclass(frozen=True)
class PickBox:
    """Which objects are seen in a box, whose corners `low` and `high` are in units of the image from the top
    left? `takes_out` comes back as it is."""

    low: tuple[float, float]
    high: tuple[float, float]
    takes_out: bool = False


@dataclass(frozen=True)
class PickPlace:
    """Which place in the world is seen at `point`, in units of the image from the top left?"""

    point: tuple[float, float]


@dataclass(frozen=True)
class Export:
    """Write the picture: .exr is linear radiance, `aovs` adds auxiliary images; .png is tone-mapped as
    `exposure` and `curve` say. `denoise`: .png is the denoised picture, which .exr has as a layer."""

    path: Path
    aovs: bool = False
    exposure: float = 0.0
    curve: str = "agx"
    denoise: bool = False


@dataclass(frozen=True)
class Copy:
    """Give the picture as an Export to .png would write it."""

    exposure: float = 0.0
    curve: str = "agx"
    denoise: bool = False


@dataclass(frozen=True)
class Pin:
    """Compare with the picture as it is now, or no longer."""

    on: bool


@dataclass(frozen=True)
class TakeNow:
    """Requests that wait for the whole picture take it as it is."""


@dataclass(frozen=True)
class Forget:
    """Requests that wait for the whole picture are given up."""


@dataclass(frozen=True)
class Restart:
    """Throw away what was accumulated."""


@dataclass(frozen=True)
class RenderFinal:
    """Render `scene` into a file, after others that were asked for before. The view goes on meanwhile, and an
    edit is answered first."""

    scene: Scene
    wanted: FinalSettings


@dataclass(frozen=True)
class EndFinal:
    """End the final render under way: `is_kept`, what is done is written, else it is given up."""

    is_kept: bool


Request = (
    Pick | PickBox | PickPlace | Export | Copy | Pin | TakeNow | Forget | Restart | RenderFinal | EndFinal
)


@dataclass(frozen=True)
class Building:
    """`done` of `total` steps of building the kernels are done."""

    done: int
    total: int


@dataclass(frozen=True)
class Picked:
    """The answer to a Pick: the object's name, or None."""

    point: tuple[float, float]
    name: str | None
    additive: bool


@dataclass(frozen=True)
class PickedBox:
    """The answer to a PickBox: the names of the objects, in the order of the scene."""

    names: tuple[str, ...]
    takes_out: bool


@dataclass(frozen=True)
class PickedPlace:
    """The answer to a PickPlace: a point of a surface, world space, or None."""

    place: Vector | None


@dataclass(frozen=True)
class Exported:
    """The picture is in the file; `size` is its width and height, pixels."""

    path: Path
    size: tuple[int, int]


@dataclass(frozen=True, eq=False)
class CopiedPicture:
    """The answer to a Copy: sRGB `pixels` (H, W, 3), or (H, W, 4) with alpha."""

    pixels: npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Waiting:
    """The requests that wait for the whole picture from now on, in their order; none: all are answered."""

    requests: tuple[Request, ...]


@dataclass(frozen=True)
class FinalProgress:
    """How far a final render is.

    path     the file that it will be in.
    share    how much of it is done, from 0 to 1.
    spp      samples of the pixel that has the fewest.
    seconds  how long it has rendered.
    left     seconds until its end, if the view goes on taking as much of the device as so far; None: nobody
             knows yet.
    waiting  how many others come after it.
    """

    path: Path
    share: float = 0.0
    spp: int = 0
    seconds: float = 0.0
    left: float | None = None
    waiting: int = 0


@dataclass(frozen=True)
class Finals:
    """The final render under way; None: there is none any more."""

    current: FinalProgress | None


@dataclass(frozen=True)
class Problem:
    """One line that names the place and the fix. After a fatal one the renderer does nothing more."""

    text: str
    fatal: bool = False


Message = (
    Frame
    | Building
    | Picked
    | PickedBox
    | PickedPlace
    | Exported
    | CopiedPicture
    | Waiting
    | Finals
    | Problem
)


class Renderer(Protocol):
    """What the editor needs of a renderer. No call blocks but `close`."""

    def show(self, view: View) -> None:
        """Render this from now on; of several calls the last one counts."""
        ...

    def request(self, request: Request) -> None:
        """Do this between two steps, in the order of the calls."""
        ...

    def poll(self) -> list[Message]:
        """What came since the last call; of Frames, of Buildings and of Finals, the latest only."""
        ...

    def close(self) -> None:
        """Stop after the step under way and free the device."""
        ...
