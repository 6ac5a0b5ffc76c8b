"""Commands that take the rendered picture out of the editor."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from incpt.core.errors import InputError
from incpt.ui.commands.files import ask_path, stem
from incpt.ui.dialogs.native import FileFilter
from incpt.ui.editor.editor import Editor
from incpt.viewer.renderer import Copy, Export, Forget, TakeNow

PICTURES = FileFilter("Pictures", (".png", ".exr"))
"""Files that the picture can be written to."""


def export_picture(editor: Editor) -> None:
    """Ask for a place and write the picture there."""
    ask_path(
        editor, "Export picture", PICTURES, True, lambda path: export_to(editor, path), f"{stem(editor)}.png"
    )


def export_to(editor: Editor, path: Path) -> None:
    """Write the picture, once it is whole: PNG as it is shown, EXR linear with the AOVs, and denoised too
    where that is shown."""
    if path.suffix.lower() not in PICTURES.suffixes:
        raise InputError(f"{path}: ends in no known format; use .exr or .png")
    display = editor.preferences.display
    request = Export(path, aovs=True, exposure=display.exposure, curve=display.curve)
    editor.renderer.request(replace(request, denoise=editor.view.denoise))


def copy_picture(editor: Editor) -> None:
    """Put the picture on the clipboard as it is shown, once it is whole."""
    display = editor.preferences.display
    editor.renderer.request(Copy(display.exposure, display.curve, editor.view.denoise))


def take_now(editor: Editor) -> None:
    """Take the picture as it is, for all that waits until it is whole."""
    editor.renderer.request(TakeNow())


def forget(editor: Editor) -> None:
    """Give up what waits until the picture is whole."""
    editor.renderer.request(Forget())
