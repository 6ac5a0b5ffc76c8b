"""Commands on the objects and lights of the scene."""

from __future__ import annotations

from dataclasses import replace

from incpt.scene import arranging, edits
from incpt.scene.light import DIRECTED
from incpt.scene.selection import Selection
from incpt.scene.transform import IDENTITY
from incpt.ui.commands.window import show_panels, switch_panel
from incpt.ui.editor.editor import Editor
from incpt.ui.editor.state import TRANSFORM_KEY


def select_all(editor: Editor) -> None:
    """Select every object and light that is shown."""
    editor.select(Selection.all_of(editor.scene))


def select_none(editor: Editor) -> None:
    """Deselect."""
    editor.select(Selection())


def cancel(editor: Editor) -> None:
    """Give up the drag under way; without one, go back from the picture alone, or else from the region that
    alone is rendered; without any of these, deselect in the plain set, as other tools do."""
    if editor.cancel_drag():
        return
    if editor.screen.is_alone:
        show_panels(editor)
        return
    if editor.region is not None:
        editor.show_region(None)
    elif editor.preferences.navigation == "plain":
        select_none(editor)


def add_shape(editor: Editor, shape: str) -> None:
    """A new object of that shape, selected."""
    scene, names = edits.add_shape(editor.shown, shape)
    editor.propose(scene, f"Add {shape}", selection=Selection(names))


def has_light(editor: Editor) -> bool:
    """Whether a light is selected that shines in one direction."""
    lights = editor.scene.light_index
    return any(
        name in lights and editor.scene.light(name).kind in DIRECTED for name in editor.selection.names
    )


def add_light(editor: Editor, kind: str) -> None:
    """A new light of that kind, selected."""
    scene, names = edits.add_light(editor.shown, kind)
    editor.propose(scene, f"Add {edits.LIGHT_NAMES[kind]}", selection=Selection(names))


def duplicate(editor: Editor) -> None:
    """Copies of the selected objects, selected."""
    scene, names = edits.duplicate(editor.scene, editor.selection.names)
    editor.propose(scene, "Duplicate", selection=Selection(names))


def duplicate_and_move(editor: Editor) -> None:
    """Copies of the selected objects, selected, that the mouse moves at once: one edit in the history."""
    scene, names = edits.duplicate(editor.scene, editor.selection.names)
    editor.propose(scene, "Duplicate", TRANSFORM_KEY, selection=Selection(names))
    editor.begin("move", "Duplicate")


def copy(editor: Editor) -> None:
    """Remember the selected objects and lights, with their materials."""
    editor.copied = edits.copied(editor.scene, editor.selection.names)


def paste(editor: Editor) -> None:
    """Add what was copied, selected."""
    scene, names = edits.paste(editor.scene, editor.copied)
    editor.propose(scene, "Paste", selection=Selection(names))


def delete(editor: Editor) -> None:
    """Remove the selected objects."""
    editor.propose(edits.delete(editor.scene, editor.selection.names), "Delete", selection=Selection())


def rename(editor: Editor) -> None:
    """Have another name of the active object typed, in its row of the outliner."""
    show_panels(editor)
    if "Outliner" in editor.preferences.hidden_panels:
        switch_panel(editor, "Outliner")
    editor.screen = replace(editor.screen, is_renaming=True)


def rename_to(editor: Editor, old: str, new_name: str) -> None:
    """Give an object another name."""
    scene = edits.rename(editor.scene, old, new_name)
    before = editor.scene
    if old in before.light_index:
        given = scene.lights[before.light_index[old]].name
    else:
        given = scene.objects[before.object_index[old]].name
    editor.propose(scene, "Rename", selection=editor.selection.renamed(old, given))


def hide(editor: Editor) -> None:
    """Hide the selected objects."""
    editor.propose(edits.set_visible(editor.scene, editor.selection.names, False), "Hide")


def hide_unselected(editor: Editor) -> None:
    """Hide all but the selected objects and lights."""
    others = tuple(name for name in editor.scene.names if name not in editor.selection)
    editor.propose(edits.set_visible(editor.scene, others, False), "Hide unselected")


def drop(editor: Editor) -> None:
    """Each of the selected onto what is below it."""
    editor.propose(arranging.dropped(editor.scene, editor.selection.names), "Drop to the floor")


def align(editor: Editor, axis: int, end: str) -> None:
    """The selected in line with the active one; see `arranging.aligned`."""
    *others, active = editor.selection.names
    editor.propose(arranging.aligned(editor.scene, others, active, axis, end), "Align")


def show_all(editor: Editor) -> None:
    """Show every hidden object and light."""
    scene = editor.scene
    hidden = tuple(one.name for one in scene.everything if not one.visible)
    editor.propose(edits.set_visible(editor.scene, hidden, True), "Show all")


def clear(editor: Editor, part: str) -> None:
    """The position, rotation or scale of the selected objects as that of a new one."""
    new = {part: getattr(IDENTITY, part)}
    changed = {name: replace(editor.scene.placed(name), **new) for name in editor.selection.names}
    editor.propose(edits.with_all(editor.scene, changed), f"Clear {part}")


def reset_transform(editor: Editor) -> None:
    """The selected objects at the origin, unturned, at their mesh's own size."""
    scene = editor.scene
    for name in editor.selection.names:
        scene = scene.with_placed(name, transform=IDENTITY)
    editor.propose(scene, "Clear all three")
