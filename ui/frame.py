"""One frame of the editor: what is drawn, and what becomes of the user's hand."""

from __future__ import annotations

from imgui_bundle import imgui

from incpt.ui.display.display import Display
from incpt.ui.display.outline import Outlined
from incpt.ui.display.overlays import Overlay
from incpt.ui.editor.editor import Editor
from incpt.ui.panels import materials
from incpt.ui.rect import Rect
from incpt.ui.viewport import captions
from incpt.ui.viewport.viewport import Outcome, Viewport, picture_rect, pixels_in
from incpt.ui.workspace import Workspace
from incpt.viewer.renderer import PickBox


def take_frame(
    editor: Editor, workspace: Workspace, viewport: Viewport, overlay: Overlay | None = None
) -> Rect[float]:
    """The part of a frame between imgui's begin and end: draw all but the picture, and take the edits.
    `overlay` is what lies over the picture. Returns what the panels leave for the picture, in points."""
    area = workspace.draw(editor)
    picture = picture_rect(area, editor.scene.settings.size)
    editor.resize_viewport(pixels_in(area))
    if editor.gesture.is_cancelled:
        viewport.let_go()
    if editor.region is not None:
        captions.draw_region(picture, editor.region)
    outcome = viewport.update(
        editor.shown,
        editor.selection,
        editor.tool,
        editor.preferences,
        picture,
        is_blocked=editor.dialog is not None,
        beginning=editor.gesture.beginning,
    )
    _take_outcome(editor, outcome)
    _take_material(editor, picture)
    rendered = picture if editor.region is None else picture.part(editor.region)
    if editor.is_rendered:
        captions.draw(editor.frame, overlay, editor.preferences.display, rendered)
    if editor.is_rendered and not editor.has_light:
        captions.draw_darkness(picture)
    editor.settle(viewport.is_held or imgui.is_any_item_active(), viewport.is_flying, viewport.hint)
    return area


def draw_picture(
    editor: Editor, display: Display, area: Rect[float], framebuffer_size: tuple[int, int], scale: float
) -> None:
    """Draw the picture into the framebuffer that is bound, below the panels. `area` is what they leave for
    it, in points; `scale` is framebuffer pixels per point."""
    selection = None
    if editor.selection:
        names = frozenset(editor.selection.names)
        selection = Outlined(editor.shown, names, editor.selection.active)
    display.draw(
        picture_rect(area, editor.scene.settings.size).scaled(scale),
        editor.preferences.display,
        framebuffer_size=framebuffer_size,
        clip_px=area.scaled(scale),
        selection=selection,
        scale=scale,
        scene=editor.seen,
    )


def _take_material(editor: Editor, picture: Rect[int]) -> None:
    """A material that is dragged out of its list, and let go over the picture."""
    carried = materials.carried(tuple(editor.scene.materials))
    mouse = imgui.get_mouse_pos()
    is_over_panel = imgui.is_window_hovered(imgui.HoveredFlags_.any_window)
    is_let_go = imgui.is_mouse_released(imgui.MouseButton_.left)
    if carried is not None and is_let_go and not is_over_panel and picture.contains((mouse.x, mouse.y)):
        editor.drop_material(carried, picture.relative((mouse.x, mouse.y)))


def _take_outcome(editor: Editor, outcome: Outcome) -> None:
    for one in outcome.proposals:
        if one.scene.camera is editor.shown.camera:
            editor.propose(one.scene, one.label, one.key, rest_seconds=one.rest_seconds)
        else:
            editor.look(one.scene.camera, one.label, one.key, one.rest_seconds)
    if outcome.selection != editor.selection:
        editor.select(outcome.selection)
    if outcome.region is not None:
        editor.show_region(outcome.region)
    if outcome.aim is not None:
        editor.aim(outcome.aim)
    editor.change_display(outcome.display)
    if isinstance(outcome.pick, PickBox):
        editor.pick_box(outcome.pick)
    elif outcome.pick is not None:
        editor.pick(outcome.pick, outcome.wants_menu)
    elif outcome.wants_menu:
        editor.open_menu("selection")
