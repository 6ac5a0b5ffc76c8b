"""Where the panels stand: docked to the right of the picture, until the user moves them."""

from __future__ import annotations

from imgui_bundle import imgui

from incpt.ui.preferences import PANELS
from incpt.ui.rect import Rect

_RIGHT_SHARE, _OUTLINER_SHARE = 0.25, 0.28
"""Width of the panels as a share of the window's, and height of the outliner as a share of theirs."""
_LEAST_WIDTH = 340.0
"""Least width of the panels, in points at a scale of 1: every tab can be seen."""


_UNSEEN = (
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.no_background
    | imgui.WindowFlags_.no_inputs
    | imgui.WindowFlags_.no_docking
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_focus_on_appearing
)


class Layout:
    """The dock space of the window. imgui keeps where panels stand, also from one start to the next."""

    def __init__(self) -> None:
        self._is_laid_out = False
        self._wanted_tabs: tuple[str, ...] = ()
        self._front: list[str] = []
        self._scale = 0.0
        """That of texts when panels were made as wide as they have to be."""

    def dock(self, is_reset: bool) -> Rect[float]:
        """Make room for the panels, which stand as at the first start where `is_reset`; returns what is left
        for the picture, in points."""
        root = imgui.get_id("incpt workspace")
        is_known = imgui.internal.dock_builder_get_node(root) is not None
        if is_reset or not (self._is_laid_out or is_known):
            _lay_out(root)
            self._wanted_tabs = ("Object",)
        self._is_laid_out, self._front = True, []
        scale = imgui.get_style().font_scale_dpi
        if scale != self._scale:
            _widen(_LEAST_WIDTH * scale)
            self._scale = scale
        imgui.dock_space_over_viewport(root, None, imgui.DockNodeFlags_.passthru_central_node)
        node = imgui.internal.dock_builder_get_central_node(root)
        return Rect(node.pos.x, node.pos.y, node.size.x, node.size.y)

    def keep(self) -> Rect[float]:
        """Leave the whole window to the picture, and the panels where they will be again."""
        self._wanted_tabs = tuple(self._front)
        root = imgui.get_id("incpt workspace")
        # A dock space belongs to a window; this one is not there for the mouse.
        imgui.begin("##kept", None, _UNSEEN)
        imgui.dock_space(root, imgui.ImVec2(0, 0), imgui.DockNodeFlags_.keep_alive_only)
        imgui.end()
        viewport = imgui.get_main_viewport()
        return Rect(viewport.pos.x, viewport.pos.y, viewport.size.x, viewport.size.y)

    def note_front(self, name: str) -> None:
        """A panel is seen in this frame, in front of others."""
        self._front.append(name)

    def show_tabs(self) -> None:
        """Once the panels are drawn: bring those to the front that were there before the picture was alone,
        or after a reset the first one."""
        for name in self._wanted_tabs:
            imgui.set_window_focus(name)
        self._wanted_tabs = ()


def _widen(least: float) -> None:
    """Give the panels that width at least, where they stand beside the picture; what is wider stays so."""
    window = imgui.internal.find_window_by_name("Object")
    node = None if window is None else window.dock_node
    while node is not None and node.parent_node is not None:
        is_beside = node.parent_node.split_axis == imgui.internal.Axis.x
        if is_beside and node.size.x < least:
            size = imgui.ImVec2(least, node.size.y)
            imgui.internal.dock_builder_set_node_size(node.id_, size)
        if is_beside:
            return
        node = node.parent_node


def _lay_out(root: int) -> None:
    builder = imgui.internal
    builder.dock_builder_remove_node(root)
    builder.dock_builder_add_node(root, builder.DockNodeFlagsPrivate_.dock_space)
    builder.dock_builder_set_node_size(root, imgui.get_main_viewport().work_size)
    least = _LEAST_WIDTH * imgui.get_style().font_scale_dpi / imgui.get_main_viewport().work_size.x
    share = min(max(_RIGHT_SHARE, least), 0.5)
    _, right, _ = builder.dock_builder_split_node_py(root, imgui.Dir.right, share)
    _, top, bottom = builder.dock_builder_split_node_py(right, imgui.Dir.up, _OUTLINER_SHARE)
    for name in PANELS:
        builder.dock_builder_dock_window(name, top if name == "Outliner" else bottom)
    builder.dock_builder_finish(root)
