"""A dialog that asks for a final render: of which view, how large and how good, and into which file."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from imgui_bundle import imgui

from incpt.picture import denoise
from incpt.ui.dialogs import modal
from incpt.ui.editor.dialog import Answer, Dialog
from incpt.ui.editor.state import FinalChoice
from incpt.ui.widgets import focus, places, widgets

FREE_VIEW = ""
"""What stands for the free view among the names of cameras."""
FORMATS = ((".png", "PNG, as it is shown"), (".exr", "OpenEXR, linear"))
"""The formats by their suffix, and how the dialog names them."""
_LARGEST = 16384
_LIMIT_TIP = "Of rendering: what edits take does not count. Without one it takes as long as the samples do"
_PASSES_TIP = "Base colour, normal, depth and object ids, as layers of the file"
_DENOISE_TIP = "As far as there is noise; an OpenEXR file gets a layer of it"
_NO_DENOISER = 'Open Image Denoise is not installed; run: pip install "incpt[denoise]"'


@dataclass(frozen=True)
class RenderOrder:
    """What was chosen: the file, the camera by its name or FREE_VIEW, the size in pixels, and the rest."""

    path: str
    camera: str
    size: tuple[int, int]
    choice: FinalChoice


class RenderDialog:
    """`order` is what it begins with, `cameras` what can be looked through as (name, text). `then` takes
    what was chosen; where it refuses it, the reason stands in the dialog, which stays. `ask_place` gives
    the dialog that asks for a file and hands it to its argument."""

    def __init__(
        self,
        order: RenderOrder,
        cameras: Sequence[tuple[str, str]],
        then: Callable[[RenderOrder], Dialog | None],
        ask_place: Callable[[RenderDialog], Dialog],
    ) -> None:
        self.order, self._cameras, self._then, self._ask_place = order, cameras, then, ask_place
        self._keeps_proportions = True
        self._refusal = ""

    def take_path(self, path: Path) -> None:
        """Another file, whose suffix chooses the format."""
        suffix = path.suffix.lower()
        known = suffix if suffix in dict(FORMATS) else self.order.choice.suffix
        choice = replace(self.order.choice, suffix=known)
        self.order = replace(self.order, path=str(path), choice=choice)

    def draw(self) -> Answer | None:
        """See Dialog."""
        if not modal.begin("Render picture"):
            return None
        if len(self._cameras) > 1:
            camera = widgets.choice("Seen through", self.order.camera, self._cameras)
            self.order = replace(self.order, camera=camera)
        self._draw_size()
        self._draw_quality()
        is_place_wanted = self._draw_file()
        if self._refusal:
            widgets.note(self._refusal, "warning")
        # Enter and Escape that end the typing of a number are not for the dialog.
        chosen = modal.buttons(["Render", "Cancel"], takes_keys=not focus.is_typing())
        modal.end()
        if is_place_wanted:
            return Answer(lambda: self._ask_place(self))
        if chosen is None:
            return None
        return Answer() if chosen == 1 else Answer(lambda: self._then(self.order), self, self._explain)

    def _explain(self, reason: str) -> None:
        self._refusal = reason

    def _draw_size(self) -> None:
        old = self.order.size
        width = widgets.whole_number("Width", old[0], low=1, high=_LARGEST, speed=2.0, tip="Pixels")
        height = widgets.whole_number("Height", old[1], low=1, high=_LARGEST, speed=2.0, tip="Pixels")
        self._keeps_proportions = widgets.checkbox("Keep proportions", self._keeps_proportions)
        size = proportional(old, (width, height)) if self._keeps_proportions else (width, height)
        self.order = replace(self.order, size=size)

    def _draw_quality(self) -> None:
        choice = self.order.choice
        spp = widgets.whole_number("Samples", choice.spp, low=1, high=1 << 20, speed=1.0, tip="Per pixel")
        seconds = widgets.number(
            "Time limit",
            choice.seconds,
            high=1e6,
            speed=0.5,
            unit=" s",
            decimals=0,
            tip=_LIMIT_TIP,
            zero="none",
        )
        suffix = widgets.choice("Format", choice.suffix, FORMATS)
        denoised = widgets.checkbox("Denoise", choice.denoise and denoise.is_available(), _DENOISE_TIP)
        if denoised and not denoise.is_available():
            denoised, self._refusal = False, _NO_DENOISER
        aovs = choice.aovs
        if suffix == ".exr":
            aovs = widgets.checkbox("Passes", aovs, _PASSES_TIP)
        if suffix != choice.suffix:
            self.order = replace(self.order, path=str(Path(self.order.path or "picture").with_suffix(suffix)))
        limit = seconds if math.isfinite(seconds) else 0.0
        new = FinalChoice(spp, max(limit, 0.0), suffix, denoised, aovs)
        self.order = replace(self.order, choice=new)

    def _draw_file(self) -> bool:
        """The field of the file; returns whether the button beside it was pressed."""
        with widgets.row("File") as field:
            button = imgui.calc_text_size("Choose…").x + 2 * imgui.get_style().frame_padding.x
            room = imgui.get_content_region_avail().x - button - imgui.get_style().item_inner_spacing.x
            imgui.set_next_item_width(room)
            _, path = imgui.input_text(field, self.order.path)
            places.note("File")
            self.order = replace(self.order, path=path)
            widgets.same_line()
            return widgets.button("Choose…##file")


def proportional(old: tuple[int, int], new: tuple[int, int]) -> tuple[int, int]:
    """`new`, of which one side differs from `old`, with the other one in the same proportion to it."""
    width, height = new
    if width != old[0]:
        height = round(width * old[1] / old[0])
    elif height != old[1]:
        width = round(height * old[0] / old[1])
    return max(min(width, _LARGEST), 1), max(min(height, _LARGEST), 1)
