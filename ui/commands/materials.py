"""Commands on the materials of the scene."""

from __future__ import annotations

from incpt.scene import edits
from incpt.scene.selection import Selection
from incpt.ui.dialogs.replacement import ReplacementDialog
from incpt.ui.dialogs.text_field import TextField
from incpt.ui.editor.editor import Editor


def new_material(editor: Editor) -> None:
    """A new material for the selected objects."""
    scene, name = edits.add_material(editor.scene)
    editor.propose(edits.assign_material(scene, editor.selection.names, name), "New material")


def duplicate_material(editor: Editor, material: str) -> None:
    """A copy of a material for the selected objects."""
    scene, name = edits.duplicate_material(editor.scene, material)
    editor.propose(edits.assign_material(scene, editor.selection.names, name), "Duplicate material")


def copy_material(editor: Editor, material: str) -> None:
    """A copy of a material that no object has yet."""
    editor.propose(edits.duplicate_material(editor.scene, material)[0], "Duplicate material")


def delete_material(editor: Editor, material: str) -> None:
    """Delete a material; where objects have it, ask which one they get in its place. Raises InputError where
    there is no other."""
    users = edits.material_users(editor.scene)[material]
    others = tuple(name for name in editor.scene.materials if name != material)

    def replace_by(replacement: str | None) -> None:
        editor.propose(edits.delete_material(editor.scene, material, replacement), "Delete material")

    if users and others:
        editor.dialog = ReplacementDialog(material, users, others, replace_by)
    else:
        replace_by(None)


def purge(editor: Editor) -> None:
    """Delete the materials that no object has."""
    scene = edits.purge_materials(editor.scene)
    count = len(editor.scene.materials) - len(scene.materials)
    if count:
        editor.propose(scene, "Delete unused materials")
        editor.say(f"{count:,} unused {'material is' if count == 1 else 'materials are'} deleted", "done")


def assign(editor: Editor, material: str) -> None:
    """Give a material to the selected objects."""
    scene = edits.assign_material(editor.scene, editor.selection.names, material)
    editor.propose(scene, "Assign material")


def select_users(editor: Editor, material: str) -> None:
    """Select the objects that have a material."""
    editor.select(Selection(tuple(one.name for one in editor.scene.objects if one.material == material)))


def rename_material(editor: Editor, material: str) -> None:
    """Ask for another name of a material."""

    def give(name: str) -> None:
        editor.propose(edits.rename_material(editor.scene, material, name), "Rename material")

    editor.dialog = TextField("Rename material", "Name", material, give)
