"""Commands that take the rendered picture out of the editor, or render another one into a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from incpt.core.errors import InputError
from incpt.render.final import FinalSettings
from incpt.scene.model import Scene
from incpt.ui.commands.files import ask_path, folder, stem
from incpt.ui.dialogs.native import FileFilter
from incpt.ui.dialogs.path_dialog import PathDialog
from incpt.ui.dialogs.question import Choice, Question
from incpt.ui.dialogs.render_dialog import FREE_VIEW, RenderDialog, RenderOrder
from incpt.ui.editor.dialog import Answer, Dialog
from incpt.ui.editor.document import absolute_path
from incpt.ui.editor.editor import Editor
from incpt.viewer.renderer import Copy, EndFinal, Export, Forget, RenderFinal, TakeNow

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


def render_picture(editor: Editor) -> None:
    """Ask for a final render, which goes on beside the editing."""
    scene, choice = editor.scene, editor.control.final
    cameras = [(name, name) for name in scene.cameras]
    if editor.viewing.is_free:
        cameras = [(FREE_VIEW, "The free view"), *cameras]
    order = RenderOrder(
        path=str(folder(editor) / f"{stem(editor)}{choice.suffix}"),
        camera=FREE_VIEW if editor.viewing.is_free else scene.camera_name,
        size=scene.settings.size,
        choice=choice,
    )
    editor.dialog = RenderDialog(
        order, cameras, lambda chosen: order_final(editor, chosen), lambda asked: _ask_place(editor, asked)
    )


def order_final(editor: Editor, order: RenderOrder) -> Dialog | None:
    """Begin the final render that was chosen; returns the question whether a file that is there may be
    replaced. Raises InputError and OutputError for what cannot be."""
    if not order.path.strip():
        raise InputError("File: is empty; name a file")
    is_of_home = order.path.startswith("~")
    path = absolute_path(order.path if is_of_home else folder(editor) / order.path)
    choice, display = order.choice, editor.preferences.display
    wanted = FinalSettings(
        path=path if path.suffix else path.with_suffix(choice.suffix),
        spp=choice.spp,
        seconds=choice.seconds or None,
        aovs=choice.aovs,
        denoise=choice.denoise,
        exposure=display.exposure,
        curve=display.curve,
    )
    wanted.check_place()
    scene = _seen_through(editor, order)

    def begin() -> None:
        editor.control = replace(editor.control, final=choice)
        editor.renderer.request(RenderFinal(scene, wanted))

    if not wanted.path.exists():
        begin()
        return None
    text = f"{wanted.path.name} is there already."
    return Question("Replace file", text, (Choice("Replace", Answer(begin)), Choice("Cancel", Answer())))


def end_final(editor: Editor, is_kept: bool) -> None:
    """End the final render under way: write it as it is, or give it up."""
    editor.renderer.request(EndFinal(is_kept))


def _seen_through(editor: Editor, order: RenderOrder) -> Scene:
    scene = editor.shown if order.camera == FREE_VIEW else editor.scene.with_active_camera(order.camera)
    return replace(scene, settings=replace(scene.settings, size=order.size))


def _ask_place(editor: Editor, asked: RenderDialog) -> PathDialog:
    at = folder(editor) / asked.order.path
    place = at.parent if at.parent.is_dir() else folder(editor)
    return PathDialog("Picture file", PICTURES, True, place, asked.take_path, at.name, before=asked)
