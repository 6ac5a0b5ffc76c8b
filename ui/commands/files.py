"""Commands that open, save and import files, and that end the document under edit. Those that lose unsaved
changes ask first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from incpt.core.layout import TextureSlot
from incpt.formats import bitmaps, import_report, insert, mesh_files, registry, relink
from incpt.formats.bitmaps import load_bitmap
from incpt.formats.gltf_writer.export import export
from incpt.formats.pack import pack
from incpt.formats.registry import FileKind
from incpt.formats.relink import MissingFile
from incpt.scene.material import texture_name
from incpt.scene.selection import Selection
from incpt.scene.texture import Texture
from incpt.ui import saved_views
from incpt.ui.dialogs.native import FileFilter
from incpt.ui.dialogs.path_dialog import PathDialog
from incpt.ui.dialogs.question import Choice, Question
from incpt.ui.dialogs.relink_dialog import RelinkDialog
from incpt.ui.editor.dialog import Answer
from incpt.ui.editor.document import SUFFIX, Document, collected_warnings
from incpt.ui.editor.editor import Editor
from incpt.ui.editor.recovery import Recovery, find_left_behind

SCENE_FILES = FileFilter("Scenes", registry.suffixes(FileKind.SCENE))
"""Files that hold a whole scene."""
SAVED_SCENES = FileFilter("Scenes", (SUFFIX,))
"""Those that a scene is saved to."""
MESH_FILES = FileFilter("Meshes", registry.suffixes(FileKind.MESH))
"""Files that hold a mesh."""
ENVIRONMENTS = FileFilter("Environments", registry.suffixes(FileKind.IMAGE))
"""Images that may surround the scene."""
GLTF_FILES = FileFilter("glTF", (".glb",))
"""What scenes are exported as."""
ARCHIVES = FileFilter("Archives", (".zip",))
"""What scenes are packed into."""
TEXTURES = FileFilter("Images", bitmaps.SUFFIXES)
"""Images that may lie on surfaces."""


def new(editor: Editor) -> None:
    """A new scene, once unsaved changes are cared for."""
    _when_saved(editor, lambda: start_over(editor, Document.new()))


def open_(editor: Editor) -> None:
    """Ask for a scene file or a mesh and open it."""
    everything = FileFilter("Scenes and meshes", SCENE_FILES.suffixes + MESH_FILES.suffixes)
    _when_saved(
        editor, lambda: ask_path(editor, "Open", everything, False, lambda path: _open_now(editor, path))
    )


def open_file(editor: Editor, path: Path) -> None:
    """Open that file, once unsaved changes are cared for."""
    _when_saved(editor, lambda: _open_now(editor, path))


def save(editor: Editor) -> None:
    """Write the scene file; asks for a place where it has none."""
    if editor.document.path is None:
        save_as(editor)
    else:
        save_to(editor, editor.document.path)


def save_as(editor: Editor, then: Callable[[], None] | None = None) -> None:
    """Ask for a place and write the scene file there, then do what waits for it."""

    def write(path: Path) -> None:
        save_to(editor, path)
        if then is not None:
            then()

    ask_path(editor, "Save as", SAVED_SCENES, True, write, f"{stem(editor)}{SUFFIX}")


def save_to(editor: Editor, path: Path) -> None:
    """Write the scene file there, and say so."""
    written = editor.document.save(path)
    editor.preferences = editor.preferences.with_recent(written)
    if editor.viewing.saved:
        saved_views.keep(written, editor.viewing.saved)
    told = "; this view is no part of it, unless View › Camera to view" if editor.viewing.is_free else ""
    editor.say(f"{written} is saved{told}", "done")


def import_mesh(editor: Editor) -> None:
    """Ask for a mesh file and add it to the scene."""
    ask_path(editor, "Import mesh", MESH_FILES, False, lambda path: drop(editor, path))


def export_gltf(editor: Editor) -> None:
    """Ask for a place and write the scene there as glTF; say what that cannot hold."""

    def write(path: Path) -> None:
        with collected_warnings() as warnings:
            export(editor.scene, path)
        for warning in warnings:
            editor.say(warning, "warning")
        editor.say(f"{path} is written", "done")

    ask_path(editor, "Export glTF", GLTF_FILES, True, write, f"{stem(editor)}.glb")


def pack_archive(editor: Editor) -> None:
    """Ask for a place and write an archive there, with all that the scene needs."""

    def write(path: Path) -> None:
        pack(editor.scene, path)
        editor.say(f"{path} is written", "done")

    ask_path(editor, "Pack", ARCHIVES, True, write, f"{stem(editor)}.zip")


def choose_environment(editor: Editor) -> None:
    """Ask for the image of the environment."""

    def use(path: Path) -> None:
        editor.propose(insert.set_environment_image(editor.scene, path), "Environment image")

    ask_path(editor, "Environment image", ENVIRONMENTS, False, use)


def choose_texture(editor: Editor, material: str, slot: TextureSlot) -> None:
    """Ask for an image and put it into a slot of a material."""
    ask_path(editor, "Texture", TEXTURES, False, lambda path: use_texture(editor, material, slot, path))


def use_texture(editor: Editor, material: str, slot: TextureSlot, path: Path) -> None:
    """Put an image into a slot of a material. An emission that is black becomes white, else the image would
    not be seen."""
    values: dict[str, Any] = {texture_name(slot): Texture(load_bitmap(path))}
    if slot is TextureSlot.EMISSION and not editor.scene.materials[material].is_emissive:
        values["emission"] = (1.0, 1.0, 1.0)
    editor.propose(editor.scene.with_material(material, **values), "Texture")


def drop(editor: Editor, path: Path, slot: tuple[str, TextureSlot] | None = None) -> None:
    """Take a file that was dropped on the window: open a scene, add a mesh, use an environment image; or, on
    the row of a texture's slot, put it there into the material of that name."""
    if slot is not None and slot[0] in editor.scene.materials:
        use_texture(editor, *slot, path)
        return
    if insert.file_kind(path) is FileKind.SCENE:
        open_file(editor, path)
        return
    if insert.file_kind(path) is FileKind.MESH:
        # What was read is at hand as long as it is in use, so that adding it reads nothing again.
        editor.begin_job(
            f"Reading {path.name}", lambda: _read_mesh(path), lambda _kept: _add_file(editor, path)
        )
    else:
        _add_file(editor, path)


def _read_mesh(path: Path) -> object:
    with import_report.gathered():
        return mesh_files.load_file(path)


def _add_file(editor: Editor, path: Path) -> None:
    with collected_warnings() as warnings:
        scene, names = insert.drop_file(editor.shown, path)
    for warning in warnings:
        editor.say(warning, "warning")
    selection = Selection(names) if names else editor.selection
    editor.propose(scene, f"Add {path.name}", selection=selection)


def quit_(editor: Editor) -> None:
    """Close the window, once unsaved changes and a final render under way are cared for."""

    def close() -> None:
        editor.screen = replace(editor.screen, is_closing=True)

    def close_if_idle() -> None:
        final = editor.rendering.final
        if final is None:
            close()
            return
        editor.dialog = Question(
            "A picture is being rendered",
            f"{final.path.name} is not done yet.",
            (Choice("Give up and quit", Answer(close)), Choice("Keep rendering", Answer())),
        )

    _when_saved(editor, close_if_idle)


def offer_recovery(editor: Editor, kept: Recovery) -> None:
    """Ask what to do with the latest of what crashes left behind, where there is something."""
    found = next(iter(find_left_behind()), None)
    if found is None:
        return
    editor.dialog = Question(
        "Recover",
        f"The editor ended without saving {found.name}. Open what it had on {found.saved_at}?",
        (
            Choice("Recover", Answer(lambda: start_over(editor, kept.recover(found)))),
            Choice("Discard", Answer(found.remove)),
            Choice("Later", Answer()),
        ),
    )


def ask_path(
    editor: Editor,
    title: str,
    kind: FileFilter,
    is_saving: bool,
    then: Callable[[Path], None],
    name: str = "",
) -> None:
    """Ask for a file, and do something with it. `name` is a file to propose, in the document's own folder."""
    editor.dialog = PathDialog(title, kind, is_saving, folder(editor), then, name)


def folder(editor: Editor) -> Path:
    """Where files beside the document go."""
    return editor.document.path.parent if editor.document.path is not None else Path.cwd()


def stem(editor: Editor) -> str:
    """The name of the document without its suffix: what a file beside it is called."""
    return editor.document.name.removesuffix(".toml")


def start_over(editor: Editor, document: Document, opened: Path | None = None) -> None:
    """Edit another document from now on; where files of it are missing, ask for them."""
    editor.start_over(document, opened)
    if has_missing(editor):
        find_missing(editor)


def has_missing(editor: Editor) -> bool:
    """Whether files of the scene could not be read."""
    return bool(relink.missing_files(editor.scene))


def find_missing(editor: Editor) -> None:
    """Show the files of the scene that could not be read, and ask for others in their place."""
    missing = relink.missing_files(editor.scene)
    editor.dialog = RelinkDialog(missing, lambda one: _path_of_missing(editor, one))


def use_in_place(editor: Editor, missing: MissingFile, path: Path) -> None:
    """Use a file in place of one that is missing, and what is found beside it in place of others; what is
    still missing is asked for again."""
    before = len(relink.missing_files(editor.scene))
    with collected_warnings() as warnings:
        scene = relink.relinked(editor.scene, missing.path, path)
    for warning in warnings:
        editor.say(warning, "warning")
    editor.propose(scene, f"Find {missing.path.name}")
    left = len(relink.missing_files(editor.scene))
    found = "1 file is" if before - left == 1 else f"{before - left} files are"
    editor.say(f"{found} found, {left} missing" if left else f"{found} found, none is missing", "done")
    if left:
        find_missing(editor)


def _path_of_missing(editor: Editor, missing: MissingFile) -> PathDialog:
    kind = {"mesh": MESH_FILES, "texture": TEXTURES, "environment": ENVIRONMENTS}[missing.kind]
    folder = next((one for one in missing.path.parents if one.is_dir()), Path.cwd())
    return PathDialog(
        f"Find {missing.path.name}", kind, False, folder, lambda path: use_in_place(editor, missing, path)
    )


def _open_now(editor: Editor, path: Path) -> None:
    before = editor.document, editor.scene

    def show(document: Document) -> None:
        # What was edited while the file was read is not lost without a question.
        if (editor.document, editor.scene) == before:
            start_over(editor, document, opened=path)
        else:
            _when_saved(editor, lambda: start_over(editor, document, opened=path))

    editor.begin_job(f"Opening {path.name}", lambda: Document.open(path), show)


def _when_saved(editor: Editor, then: Callable[[], None]) -> None:
    """Do something that loses the document; first ask where it has changes that are not saved."""
    if not editor.document.is_dirty:
        then()
        return

    def save_first() -> None:
        if editor.document.path is None:
            save_as(editor, then)
        elif editor.attempt(lambda: save(editor)):
            then()

    editor.dialog = Question(
        "Unsaved changes",
        f"{editor.document.name} has changes that are not saved.",
        (Choice("Save", Answer(save_first)), Choice("Do not save", Answer(then)), Choice("Cancel", Answer())),
    )
