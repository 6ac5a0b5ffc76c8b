"""Commands on the objects and lights of the scene."""

from __future__ import annotations

from incpt.scene import edits
from incpt.scene.selection import Selection
from incpt.scene.transform import IDENTITY
from incpt.ui.dialogs.text_field import TextField
from incpt.ui.editor.editor import Editor


def select_all(editor: Editor) -> None:
    """Select every object and light that is shown."""
    editor.select(Selection.all_of(editor.scene))


def add_shape(editor: Editor, shape: str) -> None:
    """A new object of that shape, selected."""
    scene, names = edits.add_shape(editor.scene, shape)
    editor.propose(scene, f"Add {shape}", selection=Selection(names))


def add_light(editor: Editor, kind: str) -> None:
    """A new light of that kind, selected."""
    scene, names = edits.add_light(editor.scene, kind)
    editor.propose(scene, f"Add {edits.LIGHT_NAMES[kind]}", selection=Selection(names))


def duplicate(editor: Editor) -> None:
    """Copies of the selected objects, selected."""
    scene, names = edits.duplicate(editor.scene, editor.selection.names)
    editor.propose(scene, "Duplicate", selection=Selection(names))


def delete(editor: Editor) -> None:
    """Remove the selected objects."""
    editor.propose(edits.delete(editor.scene, editor.selection.names), "Delete", selection=Selection())


def rename(editor: Editor) -> None:
    """Ask for another name of the active object."""
    old = editor.selection.active
    if old is not None:
        editor.dialog = TextField("Rename", "Name", old, lambda new_name: rename_to(editor, old, new_name))


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


def show_all(editor: Editor) -> None:
    """Show every hidden object and light."""
    scene = editor.scene
    hidden = tuple(one.name for one in scene.everything if not one.visible)
    editor.propose(edits.set_visible(editor.scene, hidden, True), "Show all")


def reset_transform(editor: Editor) -> None:
    """The selected objects at the origin, unturned, at their mesh's own size."""
    scene = editor.scene
    for name in editor.selection.names:
        scene = scene.with_placed(name, transform=IDENTITY)
    editor.propose(scene, "Reset transform")
