"""What the commands do: functions of the editor. What they refuse they raise; the editor shows it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

from incpt.core.errors import InputError
from incpt.formats import insert, mesh_files
from incpt.picture import tone_mapping
from incpt.scene import camera_moves, edits
from incpt.scene.model import Object
from incpt.scene.selection import Selection
from incpt.ui.dialogs.dialogs import About, Choice, PathDialog, Question, TextField
from incpt.ui.editor import clipboard
from incpt.ui.editor.document import Document, collected_warnings
from incpt.ui.editor.editor import Editor
from incpt.ui.editor.recovery import Recovery, find_left_behind
from incpt.viewer.threaded import Export, Pin

SCENE_FILES = ("Scenes", insert.SCENE_SUFFIXES)
MESH_FILES = ("Meshes", tuple(f".{name}" for name in mesh_files.mesh_suffixes()))
PICTURES = ("Pictures", (".png", ".exr"))
ENVIRONMENTS = ("Environments", insert.ENVIRONMENT_SUFFIXES)

# ------------------------------------------------------------------------------------------------ files


def new(editor: Editor) -> None:
    """An empty scene, once unsaved changes are cared for."""
    _when_saved(editor, lambda: editor.start_over(Document.new()))


def open_(editor: Editor) -> None:
    """Ask for a scene file or a mesh and open it."""
    everything = ("Scenes and meshes", SCENE_FILES[1] + MESH_FILES[1])
    _when_saved(
        editor, lambda: _ask_path(editor, "Open", everything, False, lambda path: _open_now(editor, path))
    )


def open_file(editor: Editor, path: Path) -> None:
    """Open that file, once unsaved changes are cared for."""
    _when_saved(editor, lambda: _open_now(editor, path))


def _open_now(editor: Editor, path: Path) -> None:
    editor.start_over(Document.open(path), opened=path)


def save(editor: Editor) -> None:
    """Write the scene file; asks where to where it has none."""
    if editor.document.path is None:
        save_as(editor)
    else:
        _save_to(editor, editor.document.path)


def save_as(editor: Editor, then: Callable[[], object] | None = None) -> None:
    """Ask for a place and write the scene file there, then do what waits for it."""

    def write(path: Path) -> None:
        _save_to(editor, path)
        if then is not None:
            then()

    _ask_path(editor, "Save as", SCENE_FILES, True, write, f"{_stem(editor)}.toml")


def _save_to(editor: Editor, path: Path) -> None:
    written = editor.document.save(path)
    editor.preferences = editor.preferences.with_recent(written)
    editor.messages.add(f"{written} is saved", "done")


def import_mesh(editor: Editor) -> None:
    """Ask for a mesh file and add it to the scene."""
    _ask_path(editor, "Import mesh", MESH_FILES, False, lambda path: drop(editor, path))


def drop(editor: Editor, path: Path) -> None:
    """Take a file that was dropped on the window: open a scene, add a mesh, use an environment image."""
    if insert.file_kind(path) is insert.FileKind.SCENE:
        open_file(editor, path)
        return
    with collected_warnings() as warnings:
        scene, names = insert.drop_file(editor.scene, path)
    for warning in warnings:
        editor.messages.add(warning, "warning")
    selection = Selection(names) if names else editor.selection
    editor.propose(scene, f"Add {path.name}", selection=selection)


def export_picture(editor: Editor) -> None:
    """Ask for a place and write the picture there."""
    _ask_path(
        editor, "Export picture", PICTURES, True, lambda path: export_to(editor, path), f"{_stem(editor)}.png"
    )


def export_to(editor: Editor, path: Path) -> None:
    """Write the picture: PNG as it is shown, EXR linear with the AOVs."""
    if path.suffix.lower() not in PICTURES[1]:
        raise InputError(f"{path}: ends in no known format; use .exr or .png")
    display = editor.preferences.display
    editor.renderer.request(Export(path, aovs=True, exposure=display.exposure, curve=display.curve))


def copy_picture(editor: Editor) -> None:
    """Put the picture on the clipboard as it is shown."""
    assert editor.frame is not None
    display = editor.preferences.display
    linear = editor.frame.pictures[-1].image[..., :3]
    clipboard.copy_picture(tone_mapping.tone_map(linear, display.exposure, display.curve))
    editor.messages.add("the picture is on the clipboard", "done")


def quit_(editor: Editor) -> None:
    """Close the window, once unsaved changes are cared for."""

    def close() -> None:
        editor.is_closing = True

    _when_saved(editor, close)


def offer_recovery(editor: Editor, kept: Recovery) -> None:
    """Ask what to do with the latest of what crashes left behind, where there is something."""
    found = next(iter(find_left_behind()), None)
    if found is None:
        return
    editor.dialog = Question(
        "Recover",
        f"The editor ended without saving {found.name}. Open what it had on {found.saved_at}?",
        (
            Choice("Recover", lambda: editor.start_over(kept.recover(found))),
            Choice("Discard", found.remove),
            Choice("Later", lambda: None),
        ),
    )


def _when_saved(editor: Editor, then: Callable[[], object]) -> None:
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
        (Choice("Save", save_first), Choice("Do not save", then), Choice("Cancel", lambda: None)),
    )


def _ask_path(
    editor: Editor,
    title: str,
    kind: tuple[str, tuple[str, ...]],
    is_saving: bool,
    then: Callable[[Path], object],
    name: str = "",
) -> None:
    start = editor.document.path.parent if editor.document.path is not None else Path.cwd()
    editor.dialog = PathDialog(title, kind, is_saving, start, then, name)


def _stem(editor: Editor) -> str:
    return editor.document.name.removesuffix(".toml")


# --------------------------------------------------------------------------------------- selection, tool


def select_all(editor: Editor) -> None:
    """Select every object that is shown."""
    editor.select(Selection.all_of(editor.scene))


def switch_space(editor: Editor) -> None:
    """World axes or the object's own."""
    editor.tool = replace(editor.tool, space="local" if editor.tool.space == "world" else "world")


def switch_snap(editor: Editor) -> None:
    """Snapping on or off."""
    snap = editor.preferences.snap
    editor.preferences = replace(editor.preferences, snap=replace(snap, enabled=not snap.enabled))


# ----------------------------------------------------------------------------------------------- objects


def add_shape(editor: Editor, shape: str) -> None:
    """A new object of that shape, selected."""
    scene, names = edits.add_shape(editor.scene, shape)
    editor.propose(scene, f"Add {shape}", selection=Selection(names))


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
    given = scene.objects[editor.scene.object_index[old]].name
    editor.propose(scene, "Rename", selection=editor.selection.renamed(old, given))


def hide(editor: Editor) -> None:
    """Hide the selected objects."""
    editor.propose(edits.set_visible(editor.scene, editor.selection.names, False), "Hide")


def show_all(editor: Editor) -> None:
    """Show every hidden object."""
    hidden = tuple(o.name for o in editor.scene.objects if not o.visible)
    editor.propose(edits.set_visible(editor.scene, hidden, True), "Show all")


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


def choose_environment(editor: Editor) -> None:
    """Ask for the image of the environment."""

    def use(path: Path) -> None:
        editor.propose(insert.set_environment_image(editor.scene, path), "Environment image")

    _ask_path(editor, "Environment image", ENVIRONMENTS, False, use)


def reset_transform(editor: Editor) -> None:
    """The selected objects at the origin, unturned, at their mesh's own size."""
    scene = editor.scene
    for name in editor.selection.names:
        scene = scene.with_object(
            name, position=Object.position, rotation=Object.rotation, scale=Object.scale
        )
    editor.propose(scene, "Reset transform")


# ------------------------------------------------------------------------------------------------ camera


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


# --------------------------------------------------------------------------------------- render and help


def match_window(editor: Editor) -> None:
    """Render as many pixels as the viewport shows."""
    if editor.viewport_size is not None:
        settings = replace(editor.scene.settings, size=editor.viewport_size)
        editor.propose(replace(editor.scene, settings=settings), "Match window")


def reset_layout(editor: Editor) -> None:
    """Panels as at the first start."""
    editor.asked_layout_reset = True


def switch_pause(editor: Editor) -> None:
    """Stop rendering, or go on."""
    editor.paused = not editor.paused


def restart(editor: Editor) -> None:
    """Throw the picture away and render it from nothing."""
    editor.restart()


def pin(editor: Editor) -> None:
    """Measure errors against the picture as it is now, or stop measuring."""
    editor.renderer.request(Pin(not editor.is_pinned))


def show_about(editor: Editor) -> None:
    """Version, device, licence."""
    device = editor.frame.device if editor.frame is not None else "no device yet"
    editor.dialog = About(version("incpt"), device)
