"""The panels of the editor, and how what they return becomes edits: the one place that joins the two."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from imgui_bundle import imgui

from incpt.device.device import all_devices, device_name
from incpt.render.strategies import strategy_of
from incpt.scene import edits, several
from incpt.scene.light import Light
from incpt.scene.model import Object, Placed
from incpt.ui.commands import camera, command, files, materials, menus, objects, pictures, rendering, views
from incpt.ui.editor.editor import Editor
from incpt.ui.editor.records import Records
from incpt.ui.layout import Layout
from incpt.ui.panels import camera as camera_panel
from incpt.ui.panels import display as display_panel
from incpt.ui.panels import environment as environment_panel
from incpt.ui.panels import light as light_panel
from incpt.ui.panels import material as material_panel
from incpt.ui.panels import materials as materials_panel
from incpt.ui.panels import name as name_panel
from incpt.ui.panels import notices, outliner, plots, render, tool, transform
from incpt.ui.panels import textures as textures_panel
from incpt.ui.panels import views as views_panel
from incpt.ui.panels.materials import MaterialsState
from incpt.ui.panels.outliner import OutlinerState
from incpt.ui.preferences import PANELS
from incpt.ui.rect import Rect
from incpt.ui.widgets import focus, mixed, places, widgets
from incpt.ui.widgets.refusals import Refusals
from incpt.ui.widgets.thumbnails import Thumbnails


class Workspace:
    """The panels around the viewport, with what they remember between two frames."""

    def __init__(self) -> None:
        self.records = Records()
        self._outliner = OutlinerState()
        self._materials = MaterialsState()
        self._devices: list[str] | None = None
        self._thumbnails = Thumbnails()
        self._layout = Layout()

    def draw(self, editor: Editor) -> Rect[float]:
        """Draw menus, panels and dialogs, and take what they return; returns the rectangle that is left for
        the picture, in points."""
        places.begin_frame()
        focus.begin_frame()
        self._thumbnails.begin_frame()
        is_alone = editor.screen.is_alone
        chosen = (None if is_alone else menus.draw_menu_bar(editor)) or menus.draw_popups(editor)
        if chosen is not None:
            editor.attempt(lambda: chosen(editor))
        area = self._layout.keep() if is_alone else self._draw_around(editor)
        _draw_notices(editor, area)
        _draw_dialog(editor)
        for remark in widgets.take_remarks():
            editor.say(remark, "warning")
        pressed = menus.pressed_command(editor)
        if pressed is not None:
            command.run(editor, pressed)
        return area

    def _draw_around(self, editor: Editor) -> Rect[float]:
        """The status bar and the panels; returns what they leave for the picture."""
        status = notices.status_text(
            editor.frame, editor.control.paused, editor.selection, editor.viewing.is_free
        )
        if not editor.is_rendered:
            status = notices.shaded_text(
                editor.preferences.display.shading, editor.selection, editor.viewing.is_free
            )
        if editor.viewing.local is not None:
            status = f"Local view   |   {status}"
        asked = notices.draw_status_bar(editor.gesture.hint or status, editor.rendering.final)
        if asked is not None:
            pictures.end_final(editor, is_kept=asked == "keep")
        area = self._layout.dock(editor.screen.wants_first_layout)
        editor.screen = replace(editor.screen, wants_first_layout=False)
        if editor.screen.is_renaming:
            imgui.set_window_focus("Outliner")
        drawn: dict[str, Callable[[Editor], None]] = {
            "Outliner": self._draw_outliner,
            "Object": self._draw_object,
            "Materials": self._draw_materials,
            "Scene": self._draw_scene,
            "Render": self._draw_render,
            "Method": self._draw_method,
        }
        for name in PANELS:
            if name not in editor.preferences.hidden_panels:
                self._window(name, editor, drawn[name])
        self._layout.show_tabs()
        return area

    def _window(self, name: str, editor: Editor, draw: Callable[[Editor], None]) -> None:
        # A panel that the layout of an earlier version does not know stands beside the object's.
        beside = imgui.internal.find_window_by_name("Object")
        if beside is not None:
            imgui.set_next_window_dock_id(beside.dock_id, imgui.Cond_.first_use_ever)
        if imgui.begin(name, None, imgui.WindowFlags_.no_collapse)[0]:
            self._layout.note_front(name)
            draw(editor)
        imgui.end()

    # ---------------------------------------------------------------------------------- one panel each

    def _draw_outliner(self, editor: Editor) -> None:
        active = editor.selection.active
        if editor.screen.is_renaming and active is not None:
            self._outliner = self._outliner.begun_renaming(active)
        editor.screen = replace(editor.screen, is_renaming=False)
        outcome, self._outliner = outliner.draw(editor.scene, editor.selection, self._outliner)
        if outcome.selection != editor.selection:
            editor.select(outcome.selection)
        if outcome.switched is not None:
            is_shown = editor.scene.placed(outcome.switched).visible
            scene = edits.set_visible(editor.scene, (outcome.switched,), not is_shown)
            editor.propose(scene, "Hide" if is_shown else "Show")
        if outcome.made_of is not None:
            name, material = outcome.made_of
            scene = edits.assign_material(editor.scene, (name,), material)
            editor.propose(scene, "Assign material")
        if outcome.renamed is not None:
            old, new = outcome.renamed
            editor.attempt(lambda: objects.rename_to(editor, old, new))

    def _draw_object(self, editor: Editor) -> None:
        name = editor.selection.active
        if name is None:
            name_panel.draw_hint()
            return
        new_name = name_panel.draw(name, len(editor.selection))
        if new_name is not None:
            editor.attempt(lambda: objects.rename_to(editor, name, new_name))
            return
        refusals = Refusals()
        with widgets.section("Gizmo", is_open=False) as is_open:
            if is_open:
                editor.tool, snap = tool.draw(editor.tool, editor.preferences.snap, refusals)
                editor.change_snap(snap)
        one = editor.scene.placed(name)
        with widgets.section("Transform") as is_open:
            if is_open:
                self._draw_transform(editor, one, refusals)
        if name in editor.scene.light_index:
            _draw_light(editor, name, refusals)
        else:
            self._draw_material(editor, name, refusals)
        _tell(editor, refusals)

    def _draw_transform(self, editor: Editor, one: Placed, refusals: Refusals) -> None:
        is_uniform, others = editor.tool.is_uniform, _others(editor)
        with mixed.marking(lambda placed: transform.draw(placed, is_uniform, Refusals()), one, others):
            new, is_uniform = transform.draw(one, is_uniform, refusals)
        editor.tool = replace(editor.tool, is_uniform=is_uniform)
        given = [transform.COMPONENTS[label] for label in mixed.given()]
        if new is one and not given:
            return
        # A drag moves all of them as far; what is typed, and a button, holds for all.
        is_dragged = imgui.is_mouse_down(imgui.MouseButton_.left) and not focus.is_typing()
        alike = partial(several.transformed_alike, one, new, is_relative=is_dragged, given=given)
        changed = {one.name: new, **{other.name: alike(other) for other in others}}
        editor.propose(edits.with_all(editor.scene, changed), "Transform", _key())

    def _draw_material(self, editor: Editor, name: str, refusals: Refusals) -> None:
        scene = editor.scene
        material = scene.object(name).material
        objects = [one for one in _others(editor) if isinstance(one, Object)]
        others = list(dict.fromkeys(one.material for one in objects if one.material != material))
        with widgets.section("Material") as is_open:
            if not is_open:
                return
            users = sum(o.material == material for o in scene.objects)
            names = tuple(scene.materials)
            with mixed.marking(lambda one: material_panel.draw_choice(names, one, 0), material, others):
                outcome = material_panel.draw_choice(names, material, users)
            materials = dict(scene.materials)
            old, beside = materials[material], [materials[other] for other in others]
            with mixed.marking(lambda one: material_panel.draw(one, Refusals()), old, beside):
                new = material_panel.draw(old, refusals)
            for other in others if new is not old else ():
                materials[other] = several.material_alike(old, new, materials[other])
            new, wanted = textures_panel.draw(new, material, self._thumbnails, refusals)
        if new is not old:
            materials[material] = new
            editor.propose(replace(scene, materials=materials), f"Material {material}", _key())
        editor.attempt(lambda: _apply_material_outcome(editor, material, outcome))
        if wanted.choose is not None:
            files.choose_texture(editor, material, wanted.choose)

    def _draw_materials(self, editor: Editor) -> None:
        refusals, scene = Refusals(), editor.scene
        selected = [scene.objects[scene.object_index[n]] for n in editor.selection if n in scene.object_index]
        followed = selected[-1].material if selected else None
        state = self._materials.following(followed, scene.materials)
        users = edits.material_users(scene)
        outcome, self._materials = materials_panel.draw(
            scene.materials, users, state, bool(selected), self._thumbnails
        )
        chosen = self._materials.chosen
        if chosen is not None:
            with widgets.section(f"{chosen}###chosen") as is_open:
                if is_open:
                    old = scene.materials[chosen]
                    new = material_panel.draw(old, refusals)
                    new, wanted = textures_panel.draw(new, chosen, self._thumbnails, refusals)
                    if new is not old:
                        changed = replace(scene, materials={**scene.materials, chosen: new})
                        editor.propose(changed, f"Material {chosen}", _key())
                    if wanted.choose is not None:
                        files.choose_texture(editor, chosen, wanted.choose)
        editor.attempt(lambda: _apply_materials_outcome(editor, outcome))
        _tell(editor, refusals)

    def _draw_scene(self, editor: Editor) -> None:
        refusals = Refusals()
        with widgets.section("Camera") as is_open:
            if is_open:
                _draw_camera(editor, refusals)
        with widgets.section("Views", is_open=bool(editor.viewing.saved)) as is_open:
            if is_open:
                asked_view = views_panel.draw(tuple(editor.viewing.saved), editor.viewing.last_saved)
                editor.attempt(lambda: _apply_view_outcome(editor, asked_view))
        scene = editor.scene
        with widgets.section("Environment") as is_open:
            if is_open:
                environment, asked = environment_panel.draw(scene.environment, self._thumbnails, refusals)
                if environment is not scene.environment:
                    editor.propose(replace(scene, environment=environment), "Environment", _key())
                if asked.is_choose:
                    files.choose_environment(editor)
                if asked.is_remove:
                    editor.propose(editor.scene.with_environment(image=None), "Remove image")
        _tell(editor, refusals)

    def _draw_render(self, editor: Editor) -> None:
        render.draw_state(editor.frame)
        self._draw_device(editor)
        imgui.separator()
        refusals = Refusals()
        editor.control, editor.preferences, is_restart = render.draw_control(
            editor.control, editor.preferences, strategy_of(editor.scene.settings).uses_nor, refusals
        )
        if is_restart:
            editor.restart()
        with widgets.section("Settings of the scene") as is_open:
            if is_open:
                settings = render.draw_settings(editor.scene.settings, refusals)
                if settings is not editor.scene.settings:
                    editor.propose(replace(editor.scene, settings=settings), "Render settings", _key())
        _tell(editor, refusals)

    def _draw_device(self, editor: Editor) -> None:
        if self._devices is None and editor.frame is not None:
            self._devices = [device_name(one) for one in all_devices()]
        current = editor.frame.device if editor.frame is not None else ""
        chosen = render.draw_device(self._devices or [current], current)
        if chosen is not None:
            editor.change_device(chosen)

    def _draw_method(self, editor: Editor) -> None:
        refusals = Refusals()
        with widgets.section("Display") as is_open:
            if is_open:
                editor.change_display(display_panel.draw(editor.preferences.display, refusals))
        _tell(editor, refusals)
        with widgets.section("Measurements") as is_open:
            if is_open:
                if editor.frame is not None:
                    self.records = self.records.with_frame(editor.frame, editor.now())
                told = editor.rendering
                asked = plots.draw_reference(told.is_pinned, told.is_stale, editor.frame is not None)
                if asked.is_switch:
                    rendering.pin(editor)
                if asked.is_again:
                    rendering.pin_again(editor)
                plots.draw(self.records, editor.preferences.step_ms)


def _draw_camera(editor: Editor, refusals: Refusals) -> None:
    scene = editor.scene
    chosen = camera_panel.draw_choice(
        tuple(scene.cameras), scene.camera_name, editor.viewing.is_free, editor.viewing.is_locked
    )
    width, height = scene.settings.size
    new, wanted = camera_panel.draw(scene.camera, width / height, refusals)
    if new is not scene.camera:
        editor.propose(replace(scene, camera=new), "Camera", _key())
    if wanted.is_focus:
        camera.focus_selected(editor)
    if wanted.is_frame:
        camera.frame_selected(editor)
    if wanted.is_reset:
        camera.reset_camera(editor)
    editor.attempt(lambda: _apply_camera_outcome(editor, chosen))


def _draw_light(editor: Editor, name: str, refusals: Refusals) -> None:
    with widgets.section("Light") as is_open:
        if is_open:
            light = editor.scene.light(name)
            others = [one for one in _others(editor) if isinstance(one, Light)]
            with mixed.marking(lambda one: light_panel.draw(one, Refusals()), light, others):
                new = light_panel.draw(light, refusals)
            if new is not light:
                alike = {other.name: several.light_alike(light, new, other) for other in others}
                editor.propose(edits.with_all(editor.scene, {name: new, **alike}), f"Light {name}", _key())


def _others(editor: Editor) -> list[Placed]:
    """What is selected beside the active one."""
    return [editor.scene.placed(name) for name in editor.selection.names[:-1]]


def _draw_notices(editor: Editor, area: Rect[float]) -> None:
    editor.notices = editor.notices.current(editor.now())
    dismissed = notices.draw_notices(editor.notices.said, area, editor.now())
    if dismissed is not None:
        editor.notices = editor.notices.without(dismissed)
    building = editor.rendering.building
    if building is not None and not editor.rendering.has_failed:
        notices.draw_building(building.done, building.total, area)
    given_up = notices.draw_jobs([(job.label, job.seconds, job.share) for job in editor.jobs], area)
    if given_up is not None:
        editor.give_up_job(editor.jobs[given_up])
    waiting = editor.rendering.waiting
    if waiting and editor.frame is not None:
        answer = notices.draw_waiting(len(waiting), editor.frame, editor.control.paused, area)
        if answer == "now":
            pictures.take_now(editor)
        elif answer == "forget":
            pictures.forget(editor)


def _draw_dialog(editor: Editor) -> None:
    answer = editor.dialog.draw() if editor.dialog is not None else None
    if answer is not None:
        editor.answer(answer)


def _key() -> str:
    """What the edits of one drag or one typing have in common: the widget that changed its value. Not the
    active one: that is the next field already when Tab ends the typing, and none when Escape ends a drag."""
    return f"widget {widgets.edited()}"


def _tell(editor: Editor, refusals: Refusals) -> None:
    # A refusal is no line in the panel: it lasts for one frame only, and the panel may be scrolled.
    for message in refusals.messages:
        editor.say(message, "warning")


def _apply_camera_outcome(editor: Editor, outcome: camera_panel.Outcome) -> None:
    if outcome.is_lock:
        camera.switch_lock(editor)
    if outcome.is_through:
        camera.switch_view(editor)
    if outcome.is_to_view:
        camera.camera_to_view(editor)
    if outcome.activate is not None:
        camera.activate(editor, outcome.activate)
    if outcome.is_new:
        camera.new_camera(editor)
    if outcome.is_rename:
        camera.rename_camera(editor)
    if outcome.is_delete:
        camera.delete_camera(editor)


def _apply_view_outcome(editor: Editor, outcome: views_panel.Outcome) -> None:
    if outcome.go is not None:
        views.go(editor, outcome.go)
    if outcome.is_save:
        views.save(editor)
    if outcome.is_rename:
        views.rename(editor)
    if outcome.is_delete:
        views.delete(editor)


def _apply_material_outcome(editor: Editor, material: str, outcome: material_panel.Outcome) -> None:
    if outcome.assign is not None:
        materials.assign(editor, outcome.assign)
    if outcome.is_new:
        materials.new_material(editor)
    if outcome.is_duplicate:
        materials.duplicate_material(editor, material)
    if outcome.is_delete:
        materials.delete_material(editor, material)
    if outcome.is_rename:
        materials.rename_material(editor, material)


def _apply_materials_outcome(editor: Editor, outcome: materials_panel.Outcome) -> None:
    if outcome.is_new:
        materials.new_material(editor)
    if outcome.is_purge:
        materials.purge(editor)
    for wanted, act in (
        (outcome.duplicate, materials.copy_material),
        (outcome.rename, materials.rename_material),
        (outcome.delete, materials.delete_material),
        (outcome.assign, materials.assign),
        (outcome.select, materials.select_users),
    ):
        if wanted is not None:
            act(editor, wanted)
