"""The one table of commands: menus, keys and the page of help are made from it.

Two sets of keys exist beside each other, as for the mouse (see `bindings`): those of Blender, and plain ones
as in most other tools. Where a command has one `keys`, both sets share it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from incpt.scene.shapes import SHAPES
from incpt.ui.commands import actions
from incpt.ui.dialogs.dialogs import HelpPage
from incpt.ui.editor.editor import Editor

Action = Callable[[Editor], object]
Test = Callable[[Editor], bool]

MENUS = ("File", "Edit", "Object", "View", "Render", "Help")


@dataclass(frozen=True)
class Command:
    """`menu` may name a submenu after a slash; a line is drawn in menus where `group` changes. `keys` such
    as "Ctrl+Shift+S"; `plain_keys` where the plain set differs. `checked` for what is on or off;
    `detail` stands behind the name in menus: what would be undone."""

    name: str
    menu: str
    action: Action
    keys: str = ""
    plain_keys: str | None = None
    enabled: Test | None = None
    checked: Test | None = None
    detail: Callable[[Editor], str | None] | None = None
    group: int = 0
    help: str = ""

    def keys_in(self, navigation: str) -> str:
        """The keys in one of the two sets; empty where it has none."""
        return self.plain_keys if navigation == "plain" and self.plain_keys is not None else self.keys

    def is_enabled(self, editor: Editor) -> bool:
        return self.enabled is None or self.enabled(editor)


def _selected(editor: Editor) -> bool:
    return bool(editor.selection)


def _has_objects(editor: Editor) -> bool:
    return bool(editor.scene.objects)


def _has_picture(editor: Editor) -> bool:
    return editor.frame is not None


def _tool(operation: str) -> Action:
    def use(editor: Editor) -> None:
        editor.tool = replace(editor.tool, operation=operation)

    return use


def _uses(operation: str) -> Test:
    return lambda editor: editor.tool.operation == operation


def _switch_display(name: str) -> Action:
    def switch(editor: Editor) -> None:
        display = editor.preferences.display
        changes: dict[str, Any] = {name: not getattr(display, name)}
        editor.change_display(replace(display, **changes))

    return switch


def _displays(name: str) -> Test:
    return lambda editor: bool(getattr(editor.preferences.display, name))


def _overlay(name: str) -> Action:
    return lambda editor: editor.change_display(replace(editor.preferences.display, overlay=name))


def _shows_overlay(name: str) -> Test:
    return lambda editor: editor.preferences.display.overlay == name


def _navigate(name: str) -> Action:
    return lambda editor: editor.choose_navigation(name)


def _look_from(name: str) -> Action:
    return lambda editor: actions.look_from(editor, name)


def _add(shape: str) -> Action:
    return lambda editor: actions.add_shape(editor, shape)


def _show_help(editor: Editor) -> None:
    editor.dialog = HelpPage(COMMANDS)


OVERLAY_NAMES = {
    "none": "None",
    "queue": "Order of the queue",
    "replaced": "Replaced tiles",
    "spp": "Samples per pixel",
    "object_ids": "Object ids",
    "normals": "Normals",
    "albedo": "Albedo",
    "depth": "Depth",
}

COMMANDS: tuple[Command, ...] = (
    Command("New", "File", actions.new, "Ctrl+N", help="Start a new scene"),
    Command("Open…", "File", actions.open_, "Ctrl+O", help="Open a scene file or a mesh"),
    Command("Save", "File", actions.save, "Ctrl+S", group=1, help="Write the scene file"),
    Command("Save as…", "File", actions.save_as, "Ctrl+Shift+S", group=1, help="Write another scene file"),
    Command("Import mesh…", "File", actions.import_mesh, group=2, help="Add a mesh file to the scene"),
    Command("Export picture…", "File", actions.export_picture, "Ctrl+E", group=2, enabled=_has_picture,
            help="Write the picture as PNG (as shown) or EXR (linear, with AOVs)"),
    Command("Copy picture", "File", actions.copy_picture, "Ctrl+Shift+C", group=2, enabled=_has_picture,
            help="Put the picture, as shown, on the clipboard"),
    Command("Quit", "File", actions.quit_, "Ctrl+Q", group=3, help="Close the editor"),
    Command("Undo", "Edit", Editor.undo, "Ctrl+Z", enabled=lambda e: e.document.history.can_undo,
            detail=lambda e: e.document.history.undo_label, help="Take the last edit back"),
    Command("Redo", "Edit", Editor.redo, "Ctrl+Shift+Z", plain_keys="Ctrl+Y",
            enabled=lambda e: e.document.history.can_redo, detail=lambda e: e.document.history.redo_label,
            help="Do it again"),
    Command("Select all", "Edit", actions.select_all, "A", plain_keys="Ctrl+A", enabled=_has_objects, group=1,
            help="Select every visible object"),
    Command("Select none", "Edit", Editor.cancel, "Escape", group=1,
            help="Deselect; during a drag: give it up"),
    Command("Move", "Edit", _tool("move"), "G", plain_keys="W", group=2, checked=_uses("move"),
            help="Arrows that move what is selected"),
    Command("Rotate", "Edit", _tool("rotate"), "R", plain_keys="E", group=2, checked=_uses("rotate"),
            help="Rings that turn it"),
    Command("Scale", "Edit", _tool("scale"), "S", plain_keys="R", group=2, checked=_uses("scale"),
            help="Handles that scale it"),
    Command("Local axes", "Edit", actions.switch_space, "Comma", plain_keys="L", group=3,
            checked=lambda e: e.tool.space == "local", help="Move and rotate about the object's own axes"),
    Command("Snap", "Edit", actions.switch_snap, "Shift+Tab", plain_keys="X", group=3,
            checked=lambda e: e.preferences.snap.enabled, help="Move, rotate and scale in steps"),
    *(Command(shape.capitalize(), "Object/Add", _add(shape), help=f"Add a {shape} where the camera looks")
      for shape in SHAPES),
    Command("Duplicate", "Object", actions.duplicate, "Shift+D", plain_keys="Ctrl+D", enabled=_selected,
            group=1, help="Copy the selected objects"),
    Command("Delete", "Object", actions.delete, "Delete", enabled=_selected, group=1,
            help="Remove the selected objects"),
    Command("Rename…", "Object", actions.rename, "F2", enabled=_selected, group=1, help="Give another name"),
    Command("Hide", "Object", actions.hide, "H", enabled=_selected, group=2,
            help="Hide the selected objects"),
    Command("Show all", "Object", actions.show_all, "Alt+H", plain_keys="Shift+H", group=2,
            help="Show hidden objects again"),
    Command("Reset transform", "Object", actions.reset_transform, "Alt+G", plain_keys="", enabled=_selected,
            group=3, help="Position 0, rotation 0, scale 1"),
    Command("Frame selected", "View", actions.frame_selected, "KeypadDecimal", plain_keys="F",
            enabled=_has_objects, help="Look at what is selected, or at everything"),
    Command("Reset camera", "View", actions.reset_camera, "Home", help="The camera of the opened file"),
    Command("Front", "View/Look from", _look_from("front"), "Keypad1"),
    Command("Back", "View/Look from", _look_from("back"), "Ctrl+Keypad1"),
    Command("Right", "View/Look from", _look_from("right"), "Keypad3"),
    Command("Left", "View/Look from", _look_from("left"), "Ctrl+Keypad3"),
    Command("Top", "View/Look from", _look_from("top"), "Keypad7"),
    Command("Bottom", "View/Look from", _look_from("bottom"), "Ctrl+Keypad7"),
    Command("Split view", "View", _switch_display("split"), "F6", group=1, checked=_displays("split"),
            help="Left: restart, right: the chosen strategy, fed with the same edits"),
    Command("Tile grid", "View", _switch_display("tile_grid"), "F7", group=1, checked=_displays("tile_grid"),
            help="Lines between tiles"),
    Command("Outline", "View", _switch_display("outline"), "F8", group=1, checked=_displays("outline"),
            help="Outline around the selection"),
    *(Command(text, "View/Overlay", _overlay(name), checked=_shows_overlay(name), group=1)
      for name, text in OVERLAY_NAMES.items()),
    Command("Match window", "View", actions.match_window, group=2,
            help="Render as many pixels as the viewport has"),
    Command("Reset layout", "View", actions.reset_layout, group=2, help="Panels as at the first start"),
    Command("Pause", "Render", actions.switch_pause, "F5", checked=lambda e: e.paused,
            help="Stop rendering; edits wait until it goes on"),
    Command("Restart", "Render", actions.restart, "Ctrl+R", help="Render the picture from nothing"),
    Command("Pin reference", "Render", actions.pin, "F9", group=1, enabled=_has_picture,
            checked=lambda e: e.is_pinned, help="Measure the error against the picture as it is now"),
    Command("Keys and mouse", "Help", _show_help, "F1", help="This page"),
    Command("Blender-like", "Help/Bindings", _navigate("blender"),
            checked=lambda e: e.preferences.navigation == "blender"),
    Command("Plain", "Help/Bindings", _navigate("plain"),
            checked=lambda e: e.preferences.navigation == "plain"),
    Command("About incpt", "Help", actions.show_about, group=1),
)  # fmt: skip
"""In the order of the menus. Names are unique."""


def command(name: str) -> Command:
    """The command of that name. Raises KeyError."""
    return _BY_NAME[name]


def run(editor: Editor, one: Command) -> None:
    """Do what a command says, where it is enabled; what it refuses becomes a message."""
    if one.is_enabled(editor):
        editor.attempt(lambda: one.action(editor))


_BY_NAME = {one.name: one for one in COMMANDS}
assert len(_BY_NAME) == len(COMMANDS), "two commands have the same name"
