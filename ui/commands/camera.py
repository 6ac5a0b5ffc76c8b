"""Commands that move the camera."""

from __future__ import annotations

from dataclasses import replace

from incpt.scene import camera_moves, edits
from incpt.ui.dialogs.text_field import TextField
from incpt.ui.editor.editor import Editor


def frame_selected(editor: Editor) -> None:
    """Look at what is selected, or at everything."""
    _frame(editor, editor.selection.names, "Frame selected")


def frame_all(editor: Editor) -> None:
    """Look at everything that is shown."""
    _frame(editor, (), "Frame all")


def _frame(editor: Editor, names: tuple[str, ...], label: str) -> None:
    bounds = edits.bounds_of(editor.scene, names)
    if bounds is not None:
        width, height = editor.scene.settings.size
        editor.look(camera_moves.frame(editor.shown.camera, bounds, width / height), label)


def switch_view(editor: Editor) -> None:
    """See the scene through its active camera, or from there by the free view that was left last."""
    editor.viewing = editor.viewing.switched()


def switch_local(editor: Editor) -> None:
    """See the selected objects alone, or all again."""
    local = None if editor.viewing.local is not None else frozenset(editor.selection.names)
    editor.viewing = replace(editor.viewing, local=local)


def camera_to_view(editor: Editor) -> None:
    """Put the active camera where the free view is."""
    camera = editor.shown.camera
    editor.look_through_camera()
    editor.propose(replace(editor.scene, camera=camera), "Camera to view")


def switch_lock(editor: Editor) -> None:
    """Let moves of the view move the active camera, or no longer."""
    editor.viewing = replace(editor.viewing, is_locked=not editor.viewing.is_locked)


def reset_camera(editor: Editor) -> None:
    """The active camera as in the file, or in the scene that the document began with, and the view through
    it; one that was not there gets the view that was active then."""
    editor.look_through_camera()
    first = editor.document.first_scene
    camera = first.cameras.get(editor.scene.camera_name, first.camera)
    editor.propose(replace(editor.scene, camera=camera), "Reset camera")


def focus_selected(editor: Editor) -> None:
    """Make the middle of what is selected sharp, or of everything."""
    bounds = edits.bounds_of(editor.scene, editor.selection.names)
    if bounds is None:
        return
    camera = editor.scene.camera
    depth = float((bounds.mean(axis=0) - camera.position) @ camera.image_plane(1.0)[2])
    if depth <= 0:
        editor.say("It lies behind the camera; turn the camera to it first", "warning")
        return
    editor.propose(editor.scene.with_camera(focus_distance=depth), "Focus on selected")


def new_camera(editor: Editor) -> None:
    """Another camera with the view as it is, through which the scene is seen."""
    camera = editor.shown.camera
    editor.look_through_camera()
    scene, _ = edits.add_camera(editor.scene, camera, editor.scene.camera_name)
    editor.propose(scene, "New camera")


def next_camera(editor: Editor) -> None:
    """See the scene through the next of its cameras."""
    names = list(editor.scene.cameras)
    name = names[(names.index(editor.scene.camera_name) + 1) % len(names)]
    activate(editor, name)


def activate(editor: Editor, name: str) -> None:
    """See the scene through a camera."""
    editor.look_through_camera()
    editor.propose(editor.scene.with_active_camera(name), f"Camera {name}")


def delete_camera(editor: Editor) -> None:
    """Delete the active camera."""
    editor.propose(editor.scene.without_camera(editor.scene.camera_name), "Delete camera")


def rename_camera(editor: Editor) -> None:
    """Ask for another name of the active camera."""
    old = editor.scene.camera_name

    def give(name: str) -> None:
        editor.propose(edits.rename_camera(editor.scene, old, name), "Rename camera")

    editor.dialog = TextField("Rename camera", "Name", old, give)


def look_from(editor: Editor, side: str) -> None:
    """Look along an axis at the same target."""
    editor.look(camera_moves.set_view(editor.shown.camera, side), f"Look from {side}")
