"""Commands on saved views."""

from __future__ import annotations

from dataclasses import replace

from incpt.core.errors import InputError
from incpt.scene.camera import Camera
from incpt.scene.edits import unique_name
from incpt.ui import saved_views
from incpt.ui.dialogs.text_field import TextField
from incpt.ui.editor.editor import Editor


def save(editor: Editor) -> None:
    """Save the view as it is now, under a name of its own."""
    saved = editor.viewing.saved
    name = unique_name(f"View {len(saved) + 1}", saved)
    _keep(editor, {**saved, name: editor.shown.camera}, name)
    editor.say(f"{name} is saved: View › Next saved view, and the Scene panel, go to it", "done")


def go(editor: Editor, name: str) -> None:
    """Look as a saved view does. This is no edit, unless the view is locked to the active camera."""
    editor.look(editor.viewing.saved[name], f"View {name}")
    editor.viewing = replace(editor.viewing, last_saved=name)


def go_to_next(editor: Editor) -> None:
    """Look as the saved view does that follows the one that was gone to last."""
    names = list(editor.viewing.saved)
    last = editor.viewing.last_saved
    go(editor, names[(names.index(last) + 1) % len(names)] if last in names else names[0])


def rename(editor: Editor) -> None:
    """Ask for another name of the view that was gone to last."""
    old = editor.viewing.last_saved
    if old is None or old not in editor.viewing.saved:
        return

    def give(typed: str) -> None:
        new, saved = typed.strip(), editor.viewing.saved
        if not new:
            raise InputError("Name: is empty; type one")
        if new != old and new in saved:
            raise InputError(f"Name: {new} is taken; type another")
        _keep(editor, {new if name == old else name: camera for name, camera in saved.items()}, new)

    editor.dialog = TextField("Rename view", "Name", old, give)


def delete(editor: Editor) -> None:
    """Forget the view that was gone to last."""
    last, saved = editor.viewing.last_saved, dict(editor.viewing.saved)
    if last is not None and saved.pop(last, None) is not None:
        _keep(editor, saved, None)


def has_saved(editor: Editor) -> bool:
    """Whether there is a saved view."""
    return bool(editor.viewing.saved)


def _keep(editor: Editor, saved: dict[str, Camera], last: str | None) -> None:
    """Where the scene has no file yet, they are kept once it is saved."""
    editor.viewing = replace(editor.viewing, saved=saved, last_saved=last)
    if editor.document.path is not None:
        saved_views.keep(editor.document.path, saved)
