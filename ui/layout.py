"""Where the panels stand: docked to the right of the picture, until the user moves them."""

from __future__ import annotations

from imgui_bundle import imgui

from incpt.ui.rect import Rect

_RIGHT_SHARE, _OUTLINER_SHARE = 0.25, 0.28
"""Width of the panels as a share of the window's, and height of the outliner as a share of theirs."""
_LEAST_WIDTH = 340.0
"""Least width of the panels, in points at a scale of 1: every tab can be seen."""


class Layout:
    """The dock space of the window. imgui keeps where panels stand, also from one start to the next."""

    def __init__(self) -> None:
        self._is_laid_out = False
        self._wants_first_tab = False

    def dock(self, is_reset: bool) -> Rect[float]:
        """Make room for the panels, which stand as at the first start where `is_reset`; returns what is left
        for the picture, in points."""
        root = imgui.get_id("incpt workspace")
        is_known = imgui.internal.dock_builder_get_node(root) is not None
        if is_reset or not (self._is_laid_out or is_known):
            _lay_out(root)
            self._wants_first_tab = True
        self._is_laid_out = True
        imgui.dock_space_over_viewport(root, None, imgui.DockNodeFlags_.passthru_central_node)
        node = imgui.internal.dock_builder_get_central_node(root)
        return Rect(node.pos.x, node.pos.y, node.size.x, node.size.y)

    def show_first_tab(self) -> None:
        """Once the panels are drawn after a reset: bring the first of the tabs to the front."""
        if self._wants_first_tab:
            imgui.set_window_focus("Object")
            self._wants_first_tab = False


def _lay_out(root: int) -> None:
    builder = imgui.internal
    builder.dock_builder_remove_node(root)
    builder.dock_builder_add_node(root, builder.DockNodeFlagsPrivate_.dock_space)
    builder.dock_builder_set_node_size(root, imgui.get_main_viewport().work_size)
    least = _LEAST_WIDTH * imgui.get_style().font_scale_dpi / imgui.get_main_viewport().work_size.x
    share = min(max(_RIGHT_SHARE, least), 0.5)
    _, right, _ = builder.dock_builder_split_node_py(root, imgui.Dir.right, share)
    _, top, bottom = builder.dock_builder_split_node_py(right, imgui.Dir.up, _OUTLINER_SHARE)
    builder.dock_builder_dock_window("Outliner", top)
    for name in ("Object", "Materials", "Scene", "Render", "Method"):
        builder.dock_builder_dock_window(name, bottom)
    builder.dock_builder_finish(root)
