"""What the editor says: the bar at the bottom, notices over the picture, the building of kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence

from imgui_bundle import imgui

from incpt.scene.selection import Selection
from incpt.ui.editor.notices import Notice
from incpt.ui.panels.display import SHADING_TEXTS
from incpt.ui.panels.render import MODE_TEXTS, found_text
from incpt.ui.rect import Rect
from incpt.ui.widgets import icons, places, theme, widgets
from incpt.viewer.renderer import FinalProgress
from incpt.viewer.view import Frame, Picture

_ROLES = {"done": "quiet", "warning": "warning", "error": "error"}
"""Roles of the text of notices, by level: see `theme.text_color`."""
_FINAL_LINES = 18.0
"""Width of the bar of a final render, in heights of a line."""
_JOB_LINES = 22.0
"""Width of the bar of what is read, in heights of a line."""
_FLOATING = (
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.no_docking
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_focus_on_appearing
    | imgui.WindowFlags_.no_nav
    | imgui.WindowFlags_.always_auto_resize
)
"""Windows over the picture that a user cannot move."""


def draw_status_bar(text: str, final: FinalProgress | None = None) -> str | None:
    """One line at the bottom of the window, with the final render under way at its right. Returns "keep"
    where that shall be written as it is, "forget" where it is given up."""
    flags = (
        imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.menu_bar
    )
    height, answer = imgui.get_frame_height(), None
    viewport = imgui.get_main_viewport()
    is_shown = imgui.internal.begin_viewport_side_bar("##status", viewport, imgui.Dir.down, height, flags)
    if is_shown and imgui.begin_menu_bar():
        imgui.text_unformatted(text)
        places.note("status")
        answer = _draw_final(final) if final is not None else None
        imgui.end_menu_bar()
    imgui.end()
    return answer


def _draw_final(final: FinalProgress) -> str | None:
    style, answer = imgui.get_style(), None
    width = imgui.get_text_line_height() * _FINAL_LINES
    labels = ("Write now", "Give up")
    buttons = sum(imgui.calc_text_size(one).x + 2 * style.frame_padding.x for one in labels)
    imgui.same_line(imgui.get_window_width() - width - buttons - 4 * style.item_spacing.x)
    imgui.progress_bar(final.share, imgui.ImVec2(width, 0), final_text(final))
    places.note("final")
    imgui.set_item_tooltip(
        f"{final.path}\n{final.spp:,} samples per pixel, {final.seconds:,.0f} s of rendering"
    )
    if imgui.small_button(labels[0]):
        answer = "keep"
    places.note("final: Write now")
    if imgui.small_button(labels[1]):
        answer = "forget"
    places.note("final: Give up")
    return answer


def final_text(final: FinalProgress) -> str:
    """The file, how far it is, how long it will take, and how many others wait."""
    text = f"{final.path.name}: {math.floor(100 * final.share)} %"
    if final.left is not None:
        left = round(final.left)
        text += f", {left // 60}:{left % 60:02d} left"
    return text + (f", {final.waiting} more" if final.waiting else "")


def status_text(
    frame: Frame | None, is_paused: bool, selection: Selection, is_free_view: bool = False
) -> str:
    """Whether the view is a free one, the region that alone is rendered, mode or how much of an edit is
    found, samples, selection: what one looks for without opening a panel."""
    parts = ["Free view"] if is_free_view else []
    if frame is not None:
        picture = frame.pictures[-1]
        if frame.view.region is not None:
            width, height = frame.view.size
            parts.append(f"Region of {width} × {height} pixels, Esc clears it")
        found = found_text(picture)
        if is_paused or found is None:
            parts.append("Paused" if is_paused else MODE_TEXTS[picture.mode])
        if found is not None:
            parts.append(found)
        parts.append(_samples_text(picture, found is not None) + _denoised_text(picture))
        if picture.error is not None:
            parts.append(f"RMSE {picture.error:.5f}" + (" to a stale reference" if frame.is_stale else ""))
    return "   |   ".join([*parts, *_selection_text(selection)])


def shaded_text(shading: str, selection: Selection, is_free_view: bool) -> str:
    """The same while the scene is shaded and not rendered."""
    parts = [*(["Free view"] if is_free_view else []), f"{SHADING_TEXTS[shading]}, not rendered"]
    return "   |   ".join([*parts, *_selection_text(selection)])


def _selection_text(selection: Selection) -> list[str]:
    names = selection.names
    if len(names) < 2:
        return list(names)
    return [f"{len(names)} objects selected"]


def _samples_text(picture: Picture, is_finding: bool) -> str:
    if is_finding:
        # The least counts for nothing: tiles that the edit leaves alone are looked at last.
        return f"worth {picture.tile_spp.mean():,.0f} samples per pixel on average"
    samples = int(picture.tile_spp.min())
    return f"{samples:,} {'sample' if samples == 1 else 'samples'} per pixel"


def _denoised_text(picture: Picture) -> str:
    return "" if picture.denoised is None else ", denoised"


def draw_notices(notices: Sequence[Notice], picture: Rect[float], now: float) -> Notice | None:
    """Notices, at the top left of the picture, below one another; returns the one that was dismissed. `now`
    is the time of the editor's clock, in seconds. What is no good news can be copied to the clipboard."""
    if not notices:
        return None
    line = imgui.get_text_line_height()
    imgui.set_next_window_pos(imgui.ImVec2(picture.left + line * 0.6, picture.top + line * 0.6))
    limit = imgui.ImVec2(max(picture.width - 1.2 * line, 120.0), max(picture.height - 1.2 * line, 60.0))
    imgui.set_next_window_size_constraints(imgui.ImVec2(0, 0), limit)
    imgui.set_next_window_bg_alpha(0.9)
    dismissed = None
    if imgui.begin("##notices", None, _FLOATING)[0]:
        imgui.push_text_wrap_pos(max(picture.width - 6 * line, 100.0))
        for i, notice in enumerate(notices):
            imgui.push_id(i)
            imgui.push_style_var(imgui.StyleVar_.alpha, max(notice.opacity(now), 0.01))
            if imgui.small_button("×"):
                dismissed = notice
            places.note(f"dismiss {i}")
            imgui.same_line()
            if notice.level != "done":
                if imgui.small_button(icons.COPY):
                    imgui.set_clipboard_text(notice.text)
                places.note(f"copy {i}")
                imgui.set_item_tooltip("Copy this line")
                imgui.same_line()
            imgui.text_colored(imgui.ImVec4(*theme.text_color(_ROLES[notice.level])), notice.text)
            imgui.pop_style_var()
            imgui.pop_id()
        imgui.pop_text_wrap_pos()
    imgui.end()
    return dismissed


def draw_jobs(jobs: Sequence[tuple[str, float, float | None]], picture: Rect[float]) -> int | None:
    """What is read, for how many seconds, and how much of it is done, in the middle of the picture; returns
    the number of the one that was given up. Where it is not known yet how much, the bar tells that it is at
    work."""
    if not jobs:
        return None
    place = imgui.ImVec2(picture.middle[0], picture.top + picture.height / 3)
    imgui.set_next_window_pos(place, imgui.Cond_.always, imgui.ImVec2(0.5, 0.5))
    given_up = None
    if imgui.begin("##jobs", None, _FLOATING)[0]:
        for number, (label, seconds, share) in enumerate(jobs):
            imgui.push_id(number)
            width = imgui.get_text_line_height() * _JOB_LINES
            done = -imgui.get_time() if share is None else share
            imgui.progress_bar(done, imgui.ImVec2(width, 0), f"{label}, {seconds:.0f} s")
            places.note(f"job {number}")
            imgui.same_line()
            if widgets.button("Give up##job"):
                given_up = number
            imgui.pop_id()
    imgui.end()
    return given_up


def draw_waiting(count: int, frame: Frame, is_paused: bool, picture: Rect[float]) -> str | None:
    """How far the picture is that `count` requests wait for, at the bottom of it; returns "now" where they
    shall take it as it is, "forget" where they are given up."""
    pivot = imgui.ImVec2(0.5, 1.0)
    bottom = picture.top + picture.height - imgui.get_text_line_height()
    imgui.set_next_window_pos(imgui.ImVec2(picture.middle[0], bottom), imgui.Cond_.always, pivot)
    answer = None
    if imgui.begin("##waiting", None, _FLOATING)[0]:
        what = "1 picture waits" if count == 1 else f"{count} pictures wait"
        imgui.text_unformatted(f"{what} until all of it shows the scene as it is now")
        width = imgui.get_item_rect_size().x
        share, text = _whole_share(frame)
        imgui.progress_bar(share, imgui.ImVec2(width, 0), "Paused" if is_paused else text)
        places.note("waiting")
        if widgets.button("Take it as it is"):
            answer = "now"
        widgets.same_line()
        if widgets.button("Give up##waiting"):
            answer = "forget"
    imgui.end()
    return answer


def _whole_share(frame: Frame) -> tuple[float, str]:
    """Which share of the picture is there, and in words."""
    picture = frame.pictures[-1]
    if frame.is_preview:
        return 0.0, "Preview"
    if picture.error_left:
        return 1 - picture.error_left, found_text(picture) or ""
    done, total = picture.queue_done, len(picture.queue)
    return done / max(total, 1), f"{done:,} of {total:,} tiles"


def draw_building(done: int, total: int, picture: Rect[float]) -> None:
    """A bar while kernels are compiled, in the middle of the picture: `done` of `total` steps are."""
    pivot = imgui.ImVec2(0.5, 0.5)
    imgui.set_next_window_pos(imgui.ImVec2(*picture.middle), imgui.Cond_.always, pivot)
    if imgui.begin("##building", None, _FLOATING)[0]:
        imgui.text_unformatted("Compiling the kernels for this device; they are kept for the next start")
        width = imgui.get_item_rect_size().x
        imgui.progress_bar(done / max(total, 1), imgui.ImVec2(width, 0), f"{done} of {total}")
        places.note("building")
    imgui.end()
