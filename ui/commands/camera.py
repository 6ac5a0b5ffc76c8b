"""Commands that move the camera."""

from __future__ import annotations

from dataclasses import replace

from incpt.scene import camera_moves, edits
from incpt.ui.editor.editor import Editor


def frame_selected(editor: Editor) -> None:
    """Look at what is selected, or at everything."""
    bounds = edits.bounds_of(editor.scene, editor.selection.names)
    if bounds is not None:
        width, height = editor.scene.settings.size
        camera = camera_moves.frame(editor.scene.camera, bounds, width / height)
        editor.propose(replace(editor.scene, camera=camera), "Frame selected")


def reset_camera(editor: Editor) -> None:
    """The camera of the file, or of the scene that the document began with."""
    editor.propose(replace(editor.scene, camera=editor.document.first_scene.camera), "Reset camera")


def look_from(editor: Editor, side: str) -> None:
    """Look along an axis at the same target."""
    camera = camera_moves.set_view(editor.scene.camera, side)
    editor.propose(replace(editor.scene, camera=camera), f"Look from {side}")
