"""The one table of commands: menus, keys and the page of help are made from it.

Two sets of keys exist beside each other, as for the mouse (see `bindings`): those of Blender, and plain ones
as in most other tools. Where a command has one `keys`, both sets share it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import version
from typing import Any

from incpt.picture import denoise
from incpt.scene.arranging import ENDS
from incpt.scene.edits import LIGHT_NAMES
from incpt.scene.shapes import SHAPES
from incpt.ui.commands import camera, files, materials, objects, pictures, rendering, views, window
from incpt.ui.commands.command import NO_KEYS, Action, Command, Test
from incpt.ui.dialogs.about import About
from incpt.ui.dialogs.help_page import HelpPage
from incpt.ui.dialogs.preferences_dialog import PreferencesDialog
from incpt.ui.editor.editor import Editor
from incpt.ui.panels.display import OVERLAY_TEXTS, SHADING_HELP, SHADING_TEXTS
from incpt.ui.panels.tool import PIVOTS
from incpt.ui.preferences import PANELS, Preferences

MENUS = ("File", "Edit", "Object", "View", "Render", "Help")
"""The menus of the bar, from left to right."""


def _selected(editor: Editor) -> bool:
    return bool(editor.selection)


def _shows_selected(editor: Editor) -> bool:
    return any(editor.scene.placed(name).visible for name in editor.selection.names)


def _has_objects(editor: Editor) -> bool:
    return bool(editor.scene.names)


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


def _switch_denoise(editor: Editor) -> None:
    denoise.require_denoiser()
    _switch_display("denoise")(editor)


def _displays(name: str) -> Test:
    return lambda editor: bool(getattr(editor.preferences.display, name))


def _overlay(name: str) -> Action:
    return lambda editor: editor.change_display(replace(editor.preferences.display, overlay=name))


def _shows_overlay(name: str) -> Test:
    return lambda editor: editor.preferences.display.overlay == name


def _shade(name: str) -> Action:
    return lambda editor: editor.change_display(replace(editor.preferences.display, shading=name))


def _shades(name: str) -> Test:
    return lambda editor: editor.preferences.display.shading == name


def _navigate(name: str) -> Action:
    return lambda editor: editor.choose_navigation(name)


def _look_from(name: str) -> Action:
    return lambda editor: camera.look_from(editor, name)


def _add(shape: str) -> Action:
    return lambda editor: objects.add_shape(editor, shape)


def _add_light(kind: str) -> Action:
    return lambda editor: objects.add_light(editor, kind)


def _begin(action: str, label: str) -> Action:
    return lambda editor: editor.begin(action, label)


def _align(axis: int, end: str) -> Action:
    return lambda editor: objects.align(editor, axis, end)


def _several(editor: Editor) -> bool:
    return len(editor.selection) > 1


def _clear(part: str) -> Action:
    return lambda editor: objects.clear(editor, part)


def _turn_about(pivot: str) -> Action:
    def use(editor: Editor) -> None:
        editor.tool = replace(editor.tool, pivot=pivot)

    return use


def _turns_about(pivot: str) -> Test:
    return lambda editor: editor.tool.pivot == pivot


def _switch_space(editor: Editor) -> None:
    editor.tool = replace(editor.tool, space="local" if editor.tool.space == "world" else "world")


def _switch_snap(editor: Editor) -> None:
    snap = editor.preferences.snap
    editor.change_snap(replace(snap, enabled=not snap.enabled))


def _switch_panel(name: str) -> Action:
    return lambda editor: window.switch_panel(editor, name)


def _shows_panel(name: str) -> Test:
    return lambda editor: name not in editor.preferences.hidden_panels


def _show_help(editor: Editor) -> None:
    own = dict(editor.preferences.keys)
    editor.dialog = HelpPage(
        lambda name: help_lines(name, own), editor.preferences.navigation, editor.choose_navigation
    )


def _show_preferences(editor: Editor) -> None:
    def change(preferences: Preferences) -> None:
        editor.preferences = preferences

    editor.dialog = PreferencesDialog(editor.preferences, change, key_rows)


def _show_about(editor: Editor) -> None:
    device = editor.frame.device if editor.frame is not None else "no device yet"
    editor.dialog = About(version("incpt"), device)


COMMANDS: tuple[Command, ...] = (
    Command("New", "File", files.new, "Ctrl+N", help="Start a new scene"),
    Command("Open…", "File", files.open_, "Ctrl+O", help="Open a scene file or a mesh"),
    Command("Save", "File", files.save, "Ctrl+S", group=1, help="Write the scene file"),
    Command("Save as…", "File", files.save_as, "Ctrl+Shift+S", group=1, help="Write another scene file"),
    Command("Import mesh…", "File", files.import_mesh, group=2, help="Add a mesh file to the scene"),
    Command("Find missing files…", "File", files.find_missing, group=2, enabled=files.has_missing,
            help="Choose others in place of meshes and images that cannot be read"),
    Command("Export glTF…", "File", files.export_gltf, group=2, help="Write the scene for other programs"),
    Command("Pack…", "File", files.pack_archive, group=2,
            help="Write the scene with its meshes and images into an archive, to hand it over"),
    Command("Export picture…", "File", pictures.export_picture, "Ctrl+E", group=2, enabled=_has_picture,
            help="Write the picture as PNG (as shown) or EXR (linear, with AOVs)"),
    Command("Copy picture", "File", pictures.copy_picture, "Ctrl+Shift+C", group=2, enabled=_has_picture,
            help="Put the picture, as shown, on the clipboard"),
    Command("Quit", "File", files.quit_, "Ctrl+Q", group=3, help="Close the editor"),
    Command("Undo", "Edit", Editor.undo, "Ctrl+Z", enabled=lambda e: e.document.history.can_undo,
            detail=lambda e: e.document.history.undo_label, help="Take the last edit back"),
    Command("Redo", "Edit", Editor.redo, "Ctrl+Shift+Z", plain_keys="Ctrl+Y",
            enabled=lambda e: e.document.history.can_redo, detail=lambda e: e.document.history.redo_label,
            help="Do it again"),
    Command("Select all", "Edit", objects.select_all, "A", plain_keys="Ctrl+A", enabled=_has_objects, group=1,
            help="Select every visible object and light"),
    Command("Select none", "Edit", objects.select_none, "Alt+A", plain_keys="Ctrl+Shift+A", group=1,
            help="Deselect"),
    Command("Box select", "Edit", _begin("box", "Box select"), "B", enabled=_has_objects, group=1,
            help="Select what is seen in a box that the mouse draws; Shift: add it, Ctrl: take it out"),
    Command("Cancel", "Edit", objects.cancel, "Escape", group=1,
            help="Give up a drag; else go back from the picture alone, or from a region; else, in the plain "
                 "set, deselect"),
    Command("Copy", "Edit", objects.copy, "Ctrl+C", enabled=_selected, group=2,
            help="Remember the selected objects and lights, with their materials"),
    Command("Paste", "Edit", objects.paste, "Ctrl+V", enabled=lambda e: bool(e.copied), group=2,
            help="Add what was copied, also from another scene"),
    Command("Move handles", "Edit", _tool("move"), plain_keys="W", group=3, checked=_uses("move"),
            help="Arrows that move what is selected"),
    Command("Rotate handles", "Edit", _tool("rotate"), plain_keys="E", group=3, checked=_uses("rotate"),
            help="Rings that turn it"),
    Command("Scale handles", "Edit", _tool("scale"), plain_keys="R", group=3, checked=_uses("scale"),
            help="Handles that scale it"),
    Command("Local axes", "Edit", _switch_space, "Comma", plain_keys="L", group=4,
            checked=lambda e: e.tool.space == "local",
            help="The handles move and rotate about the object's own axes"),
    *(Command(text, "Edit/Pivot", _turn_about(pivot), checked=_turns_about(pivot), group=4,
              help="Several are turned and scaled about it")
      for pivot, text in PIVOTS),
    Command("Snap", "Edit", _switch_snap, "Shift+Tab", plain_keys="X", group=4,
            checked=lambda e: e.preferences.snap.enabled,
            help="In steps, or to what is under the mouse, as the Object panel says"),
    Command("Preferences…", "Edit", _show_preferences, "Ctrl+Comma", group=5,
            help="How the editor looks and saves, and its keys"),
    Command("Add…", "Object", lambda e: e.open_menu("add"), "Shift+A",
            help="What can be added, in a menu at the mouse"),
    *(Command(shape.capitalize(), "Object/Add", _add(shape), help=f"Add a {shape} where the camera looks")
      for shape in SHAPES),
    *(Command(name.capitalize(), "Object/Add", _add_light(kind), help=f"Add a {name} above what is looked at")
      for kind, name in LIGHT_NAMES.items()),
    Command("Move", "Object/Transform", _begin("move", "Move"), "G", enabled=_shows_selected,
            help="The mouse moves what is selected until a click or Enter; Esc gives it up. X, Y, Z hold it "
                 "along an axis, digits say by how much"),
    Command("Rotate", "Object/Transform", _begin("rotate", "Rotate"), "R", plain_keys="Shift+R",
            enabled=_shows_selected,
            help="The mouse turns it, with the same keys; without an axis about the line of sight, where a "
                 "number is clockwise. In the plain set R alone is for the handles"),
    Command("Scale", "Object/Transform", _begin("scale", "Scale"), "S", enabled=_shows_selected,
            help="The mouse scales it, with the same keys"),
    Command("Aim light", "Object", _begin("aim", "Aim light"), "Shift+T", enabled=objects.has_light,
            help="The selected lights shine at what is clicked next"),
    Command("Duplicate", "Object", objects.duplicate, plain_keys="Ctrl+D", enabled=_selected,
            group=1, help="Copy the selected objects, in their place"),
    Command("Duplicate and move", "Object", objects.duplicate_and_move, "Shift+D", enabled=_selected,
            group=1, help="Copy the selected objects, and move the copies by the mouse"),
    Command("Delete", "Object", objects.delete, "X, Delete", plain_keys="Delete", enabled=_selected, group=1,
            help="Remove the selected objects"),
    Command("Rename…", "Object", objects.rename, "F2", enabled=_selected, group=1, help="Give another name"),
    Command("Hide", "Object", objects.hide, "H", enabled=_selected, group=2,
            help="Hide the selected objects"),
    Command("Hide unselected", "Object", objects.hide_unselected, "Shift+H", plain_keys="", enabled=_selected,
            group=2, help="Hide all objects and lights but the selected ones"),
    Command("Show all", "Object", objects.show_all, "Alt+H", plain_keys="Shift+H", group=2,
            help="Show hidden objects again"),
    Command("Drop to the floor", "Object", objects.drop, "End", enabled=_selected, group=1,
            help="Each of the selected stands on what is below its middle, or on the floor y = 0"),
    *(Command(f"{end.capitalize()} {axis}", "Object/Align", _align(i, end), enabled=_several, group=1,
              help=f"The {end} {axis} of the selected becomes that of the active one")
      for i, axis in enumerate("XYZ") for end in ENDS),
    Command("Delete unused materials", "Object", materials.purge, group=2,
            help="Those that no object has"),
    Command("Clear position", "Object/Clear", _clear("position"), "Alt+G", enabled=_selected, group=3,
            help="To the origin"),
    Command("Clear rotation", "Object/Clear", _clear("rotation"), "Alt+R", enabled=_selected, group=3,
            help="Unturned"),
    Command("Clear scale", "Object/Clear", _clear("scale"), "Alt+S", enabled=_selected, group=3,
            help="At the mesh's own size"),
    Command("Clear all three", "Object/Clear", objects.reset_transform, enabled=_selected, group=3,
            help="Position 0, rotation 0, scale 1"),
    Command("Frame selected", "View", camera.frame_selected, "KeypadDecimal, F",
            enabled=_has_objects, help="Look at what is selected, or at everything"),
    Command("Frame all", "View", camera.frame_all, "Home", plain_keys="Shift+F", enabled=_has_objects,
            help="Look at everything that is shown"),
    Command("Reset camera", "View", camera.reset_camera, plain_keys="Home",
            help="The camera of the opened file"),
    Command("New camera", "View", camera.new_camera, help="Another camera with the view as it is"),
    Command("Through the camera", "View", camera.switch_view, "Keypad0",
            checked=lambda e: not e.viewing.is_free,
            enabled=lambda e: e.viewing.is_free or e.viewing.left is not None,
            help="See the scene through its active camera, or go back to the free view"),
    Command("Camera to view", "View", camera.camera_to_view, "Ctrl+Alt+Keypad0",
            enabled=lambda e: e.viewing.is_free, help="Put the active camera where the free view is"),
    Command("Lock camera to view", "View", camera.switch_lock, checked=lambda e: e.viewing.is_locked,
            help="Moves of the view through the active camera move that camera, and can be undone"),
    Command("Next camera", "View", camera.next_camera, "Ctrl+Keypad0",
            enabled=lambda e: len(e.scene.cameras) > 1, help="See the scene through the next of its cameras"),
    Command("Save view", "View", views.save, "Ctrl+Shift+B", help="Keep the view as it is, under a name"),
    Command("Next saved view", "View", views.go_to_next, "Shift+B", enabled=views.has_saved,
            help="Look as the next of the saved views does"),
    Command("Local view", "View", camera.switch_local, "KeypadDivide, Slash",
            checked=lambda e: e.viewing.local is not None,
            enabled=lambda e: e.viewing.local is not None or bool(e.selection),
            help="See the selected objects alone, with what shines; no edit"),
    Command("Front", "View/Look from", _look_from("front"), "Keypad1"),
    Command("Back", "View/Look from", _look_from("back"), "Ctrl+Keypad1"),
    Command("Right", "View/Look from", _look_from("right"), "Keypad3"),
    Command("Left", "View/Look from", _look_from("left"), "Ctrl+Keypad3"),
    Command("Top", "View/Look from", _look_from("top"), "Keypad7"),
    Command("Bottom", "View/Look from", _look_from("bottom"), "Ctrl+Keypad7"),
    Command("Shading…", "View", lambda e: e.open_menu("shading"), "Z", group=1,
            help="How the scene is shown, in a menu at the mouse"),
    *(Command(text, "View/Shading", _shade(name), checked=_shades(name), group=1, help=SHADING_HELP[name])
      for name, text in SHADING_TEXTS.items()),
    Command("Split view", "View", _switch_display("split"), "F6", group=1, checked=_displays("split"),
            help="Left: restart, right: the chosen strategy, fed with the same edits"),
    Command("Tile grid", "View", _switch_display("tile_grid"), "F7", group=1, checked=_displays("tile_grid"),
            help="Lines between tiles"),
    Command("Outline", "View", _switch_display("outline"), "F8", group=1, checked=_displays("outline"),
            help="Outline around the selection"),
    Command("Floor grid", "View", _switch_display("floor_grid"), group=1, checked=_displays("floor_grid"),
            help="Lines on the floor y = 0"),
    Command("Axes", "View", _switch_display("axes"), group=1, checked=_displays("axes"),
            help="Those of the world, in the corner of the picture; a click looks along one"),
    Command("Denoise", "View", _switch_denoise, "F4", group=1, checked=_displays("denoise"),
            help="Show the picture without its noise; what is rendered stays as it is"),
    *(Command(text, "View/Overlay", _overlay(name), checked=_shows_overlay(name), group=1)
      for name, text in OVERLAY_TEXTS.items()),
    Command("Render region", "View", _begin("region", "Region"), "Ctrl+B", group=2,
            enabled=lambda e: not e.preferences.display.split,
            help="Render a part of the picture alone, in a box that the mouse draws"),
    Command("Clear region", "View", lambda e: e.show_region(None), "Ctrl+Alt+B", group=2,
            enabled=lambda e: e.region is not None, help="Render all of the picture again"),
    Command("Match window", "View", rendering.match_window, group=2,
            help="Render as many pixels as the viewport has"),
    *(Command(name, "View/Panels", _switch_panel(name), checked=_shows_panel(name), group=3)
      for name in PANELS),
    Command("Reset layout", "View", window.reset_layout, group=3, help="Panels as at the first start"),
    Command("Picture alone", "View", window.switch_alone, "Ctrl+Space", group=3,
            checked=lambda e: e.screen.is_alone, help="The picture has the whole window, without panels"),
    Command("Full-screen picture", "View", window.switch_full_screen, "F11", group=3,
            checked=lambda e: e.screen.is_full_screen, help="The picture has the whole screen"),
    Command("Render picture…", "Render", pictures.render_picture, "F12",
            help="Render the scene into a file, of any size, while editing goes on"),
    Command("Pause", "Render", rendering.switch_pause, "F5", group=1, checked=lambda e: e.control.paused,
            help="Stop rendering; edits wait until it goes on"),
    Command("Restart", "Render", Editor.restart, "Ctrl+R", group=1, help="Render the picture from nothing"),
    Command("Pin reference", "Render", rendering.pin, "F9", group=2, enabled=_has_picture,
            checked=lambda e: e.rendering.is_pinned,
            help="Measure the error against the picture as it is now"),
    Command("Keys and mouse", "Help", _show_help, "F1", help="This page"),
    Command("Blender-like", "Help/Bindings", _navigate("blender"),
            checked=lambda e: e.preferences.navigation == "blender"),
    Command("Plain", "Help/Bindings", _navigate("plain"),
            checked=lambda e: e.preferences.navigation == "plain"),
    Command("About incpt", "Help", _show_about, group=1),
)  # fmt: skip
"""All commands, in the order of the menus. Their names are unique."""

SELECTION_MENU: tuple[tuple[str, ...], ...] = (
    ("Move", "Rotate", "Scale"),
    ("Duplicate and move", "Copy", "Paste", "Delete", "Rename…"),
    ("Aim light", "Hide", "Frame selected"),
    ("Clear position", "Clear rotation", "Clear scale"),
)
"""What can be done with what is selected, by names of commands, in groups."""


def key_rows(navigation: str, own: Mapping[str, str]) -> list[tuple[str, tuple[str, ...]]]:
    """The names of all commands whose keys may be changed, with their keys, in the order of the menus."""
    return [(one.name, one.keys_in(navigation, own)) for one in COMMANDS if one.keys != "Escape"]


def command(name: str) -> Command:
    """The command of that name. Raises KeyError."""
    return _BY_NAME[name]


def help_lines(navigation: str, own: Mapping[str, str] = NO_KEYS) -> list[tuple[str, str]]:
    """(keys, what they do) for Help: the commands that have keys in that set, in the order of the menus;
    `own` is that of `Command.keys_in`."""
    lines = [
        (" or ".join(one.printed_keys(navigation, own)), f"{one.name}: {one.help}" if one.help else one.name)
        for one in COMMANDS
    ]
    return [(keys, text) for keys, text in lines if keys]


_BY_NAME = {one.name: one for one in COMMANDS}
assert len(_BY_NAME) == len(COMMANDS), "two commands have the same name"
