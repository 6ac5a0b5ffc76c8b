"""The files of the scene that could not be read, each with a button to choose another in its place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from imgui_bundle import imgui

from incpt.formats.relink import MissingFile
from incpt.ui.dialogs import modal
from incpt.ui.editor.dialog import Answer, Dialog
from incpt.ui.widgets import widgets

_WIDTH = 620.0
"""Width of the dialog, in points at a scale of 1."""
_MOST_ROWS = 6
"""How many files are seen at once; more are scrolled to."""
_STAND_INS = {
    "mesh": "a cube stands for it",
    "texture": "one colour stands for it",
    "environment": "an even grey stands for it",
}
"""What is seen in place of a file, by its kind."""
_TEXT = "Saving keeps their names. Choose where one of them is; what lies beside it as before is found too."


@dataclass(frozen=True)
class RelinkDialog:
    """`missing` are the files; `choose` gives the dialog that asks for another in place of one."""

    missing: tuple[MissingFile, ...]
    choose: Callable[[MissingFile], Dialog]

    def draw(self) -> Answer | None:
        """See Dialog."""
        if not modal.begin("Missing files", width=_WIDTH):
            return None
        count = len(self.missing)
        files = "1 file" if count == 1 else f"{count:,} files"
        imgui.text_wrapped(f"{files} of the scene cannot be read. {_TEXT}")
        wanted = self._draw_rows()
        is_closed = modal.buttons(["Close"]) is not None
        modal.end()
        if wanted is not None:
            return Answer(lambda: self.choose(wanted))
        return Answer() if is_closed else None

    def _draw_rows(self) -> MissingFile | None:
        wanted = None
        line = imgui.get_text_line_height_with_spacing() + imgui.get_frame_height_with_spacing()
        height = line * min(len(self.missing), _MOST_ROWS) + 2 * imgui.get_style().window_padding.y
        if imgui.begin_child("missing", imgui.ImVec2(0, height), imgui.ChildFlags_.borders):
            for number, one in enumerate(self.missing):
                imgui.push_id(number)
                imgui.align_text_to_frame_padding()
                imgui.text_unformatted(one.path.name)
                imgui.same_line(imgui.get_content_region_avail().x - imgui.calc_text_size("Choose…").x)
                if widgets.button(f"Choose…##{one.path.name}"):
                    wanted = one
                widgets.note(_described(one))
                imgui.pop_id()
        imgui.end_child()
        return wanted


def _described(one: MissingFile) -> str:
    """Of what the file is, where it was, and what is seen in its place, in one line."""
    more = f" and {len(one.users) - 2:,} more" if len(one.users) > 2 else ""
    users = f" of {', '.join(one.users[:2])}{more}" if one.users else ""
    return f"{one.kind.capitalize()}{users}, was in {one.path.parent}; {_STAND_INS[one.kind]}"
