"""The values that the editor's state is made of, beside the document, the selection and the preferences."""

from __future__ import annotations

from dataclasses import dataclass, replace

from incpt.viewer.renderer import Building, FinalProgress, Finals, Message, Problem, Request, Waiting
from incpt.viewer.view import Frame


@dataclass(frozen=True)
class Tool:
    """How what is selected is moved, turned and scaled.

    operation   what the gizmo does: move, rotate or scale.
    space       along which axes: world or local.
    pivot       about which point several are turned and scaled: median (the mean of their positions), active
                (that of the active one) or individual (each about its own).
    is_uniform  whether fields and handles scale all three axes alike. S does, unless it is held along one.
    """

    operation: str = "move"
    space: str = "world"
    pivot: str = "median"
    is_uniform: bool = True


@dataclass(frozen=True)
class FinalChoice:
    """How pictures are rendered into files: samples per pixel, a limit in seconds (0: none), the format by
    its suffix, whether it is denoised, and whether it gets auxiliary images."""

    spp: int = 256
    seconds: float = 0.0
    suffix: str = ".png"
    denoise: bool = False
    aovs: bool = False


@dataclass(frozen=True)
class Control:
    """What is asked of the renderer, beside the scene, and is forgotten when the editor ends.

    paused      nothing is rendered; edits wait.
    target_spp  samples of every pixel at which rendering rests; None: it never rests.
    point       where the picture was clicked last, in units of it from the top left; None: nowhere yet.
    device      the OpenCL device by name; None: the default.
    final       what the last final render was asked for.
    """

    paused: bool = False
    target_spp: int | None = None
    point: tuple[float, float] | None = None
    device: str | None = None
    final: FinalChoice = FinalChoice()


@dataclass(frozen=True)
class Rendering:
    """What the renderer has told so far.

    frame       the latest frame; None before the first.
    building    how far the kernels are built; None while none are.
    is_pinned   whether errors are measured against a pinned picture.
    is_stale    whether that picture is of another scene.
    waiting     the requests that wait for the whole picture.
    final       how far the final render under way is; None: there is none.
    has_failed  whether the device does nothing more until it is opened again.
    """

    frame: Frame | None = None
    building: Building | None = None
    is_pinned: bool = False
    is_stale: bool = False
    waiting: tuple[Request, ...] = ()
    final: FinalProgress | None = None
    has_failed: bool = False

    def after(self, message: Message) -> Rendering:
        """What is known after one more message."""
        match message:
            case Frame():
                return replace(
                    self,
                    frame=message,
                    building=None,
                    is_pinned=message.is_pinned,
                    is_stale=message.is_stale,
                )
            case Waiting():
                return replace(self, waiting=message.requests)
            case Finals():
                return replace(self, final=message.current)
            case Building():
                return replace(self, building=message if message.done < message.total else None)
            case Problem():
                if message.fatal:
                    return replace(self, has_failed=True, waiting=(), final=None)
        return self


TRANSFORM_KEY = "transform"
"""The key in the history of a transform under way; what is made to be moved at once has it as well."""


@dataclass(frozen=True)
class Beginning:
    """What a command begins in the picture: move, rotate, scale, box, region or aim; `label` is the name of
    the edit."""

    action: str
    label: str


@dataclass(frozen=True)
class Gesture:
    """What the user's hand is doing, from one frame to the next.

    is_held        a widget, the gizmo or the camera is being dragged.
    is_flying      the camera flies: frames are due without an event, and letters are no commands.
    hint           what the keys do while a transform or a box has them, one line; empty while none has.
    beginning      what a command of this frame begins in the picture.
    rest_until     the entry of the history stays open until then, in seconds of the editor's clock.
    is_cancelled   a drag was given up in this frame: whoever holds it lets go.
    """

    is_held: bool = False
    is_flying: bool = False
    rest_until: float = 0.0
    is_cancelled: bool = False
    hint: str = ""
    beginning: Beginning | None = None

    @property
    def takes_keys(self) -> bool:
        """Whether keys steer what is under way, and are no commands."""
        return self.is_flying or bool(self.hint)


@dataclass(frozen=True)
class Screen:
    """What the editor and the window around it have to tell each other.

    viewport_size        pixels that the panels leave for the picture; None before the first frame, and where
                         there is no room for one.
    is_closing           the window is to close.
    wants_first_layout   the panels are to stand again as at the first start.
    wanted_menu          the menu that is to open at the mouse, by name; empty: none.
    is_renaming          the name of the active one is to be typed in the outliner.
    menu_point           where in the picture a menu was asked for, until it is known what is there.
    dropped              the material that was dropped on the picture, and where, until then.
    is_alone             the picture has the whole window.
    is_full_screen       the window has the whole screen.
    """

    viewport_size: tuple[int, int] | None = None
    is_closing: bool = False
    wants_first_layout: bool = False
    wanted_menu: str = ""
    is_renaming: bool = False
    menu_point: tuple[float, float] | None = None
    dropped: tuple[str, tuple[float, float]] | None = None
    is_alone: bool = False
    is_full_screen: bool = False
