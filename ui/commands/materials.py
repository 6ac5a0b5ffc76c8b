"""Commands on the materials of the scene."""

from __future__ import annotations

from incpt.scene import edits
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


def rename_material(editor: Editor, material: str) -> None:
    """Ask for another name of a material."""

    def give(name: str) -> None:
        editor.propose(edits.rename_material(editor.scene, material, name), "Rename material")

    editor.dialog = TextField("Rename material", "Name", material, give)
