"""The gizmo (ImGuizmo): handles in the picture that move, rotate and scale what is selected.

During a drag the handles work on a matrix of their own, and every frame applies its whole way since the
start to the objects as they were at the start: rounding does not add up, and several objects keep their
places relative to one another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from imgui_bundle import imgui, imguizmo

from incpt.core import affine
from incpt.scene import edits, placing
from incpt.scene.camera import Camera
from incpt.scene.model import Scene
from incpt.ui.editor.state import Tool
from incpt.ui.preferences import SnapSettings
from incpt.ui.rect import Rect
from incpt.ui.viewport import pivot
from incpt.ui.widgets import places

Matrix = npt.NDArray[np.float64]
"""(4, 4), for columns."""

_gizmo = imguizmo.im_guizmo
_OPERATIONS = {
    "move": _gizmo.OPERATION.translate,
    "rotate": _gizmo.OPERATION.rotate,
    "scale": _gizmo.OPERATION.scale,
}
"""ImGuizmo's operations, by those of `Tool`."""
_NEAR, _FAR = 0.01, 10000.0
"""The nearest and the farthest distance from the camera at which handles are drawn, in metres."""


@dataclass
class _Drag:
    scene: Scene
    start: Matrix
    matrix: Matrix


class Gizmo:
    """Handles for the selection. `is_using` tells whether one is being dragged, `is_over` whether the mouse
    is on one."""

    def __init__(self) -> None:
        self._drag: _Drag | None = None
        self._is_given_up = False
        self.is_using = False
        self.is_over = False

    def draw(
        self,
        scene: Scene,
        names: tuple[str, ...],
        tool: Tool,
        snap: SnapSettings,
        picture: Rect[float],
        *,
        is_enabled: bool = True,
    ) -> Scene:
        """Draw the handles over the picture, which lies at `picture` in points, and return the scene after
        this frame. Where they are not enabled, the mouse is at something else."""
        _gizmo.begin_frame()
        _gizmo.enable(is_enabled)
        visible = tuple(name for name in names if scene.placed(name).visible)
        if not visible:
            self.is_using = self.is_over = False
            self._drag = None
            return scene
        matrix = self._drag.matrix if self._drag is not None else handles(scene, visible, tool)
        _gizmo.set_drawlist(imgui.get_background_draw_list())
        _gizmo.set_rect(*picture)
        _gizmo.set_gizmo_size_clip_space(0.14)
        _gizmo.set_orthographic(scene.camera.is_orthographic)
        view = view_matrix(scene.camera)
        projection = projection_matrix(scene.camera, picture.width / picture.height)
        flat = _flat(matrix)
        # What handles hold is an axis, and the mouse points at nothing beside it.
        has_steps = snap.enabled and (tool.operation != "move" or snap.target == "steps")
        is_local = tool.space == "local" or tool.operation == "scale"
        step = {"move": snap.move_m, "rotate": snap.rotate_deg, "scale": snap.scale}[tool.operation]
        _gizmo.manipulate(
            _flat(view), _flat(projection), _OPERATIONS[tool.operation],
            _gizmo.MODE.local if is_local else _gizmo.MODE.world,
            flat, None, _gizmo.Matrix3([step] * 3) if has_steps else None,
        )  # fmt: skip
        _note_place(view, projection, matrix, picture)
        moved = np.array(flat.values, np.float64).reshape(4, 4).T
        return self._follow(scene, visible, tool, matrix, moved)

    def give_up(self) -> None:
        """Do nothing more until the handle is let go."""
        self._drag = None
        self._is_given_up = self.is_using

    def _follow(self, scene: Scene, names: tuple[str, ...], tool: Tool, old: Matrix, new: Matrix) -> Scene:
        self.is_using, self.is_over = _gizmo.is_using(), _gizmo.is_over()
        if not self.is_using:
            self._is_given_up = False
        if not self.is_using or self._is_given_up:
            self._drag = None
            return scene
        if self._drag is None:
            self._drag = _Drag(scene, old, old)
        if tool.operation == "scale" and tool.is_uniform:
            new = _alike(self._drag.start, new)
        if np.array_equal(new, self._drag.matrix) or not np.isfinite(new).all():
            return scene
        self._drag.matrix = new
        delta = new @ np.linalg.inv(self._drag.start)
        if tool.pivot == "individual" and tool.operation != "move":
            delta[:3, 3] = 0.0
            old_ones = {name: self._drag.scene.placed(name) for name in names}
            turned = {n: placing.transformed(o, delta, np.array(o.position)) for n, o in old_ones.items()}
            return edits.with_all(self._drag.scene, turned)
        return edits.transform_objects(self._drag.scene, names, delta)


def handles(scene: Scene, names: tuple[str, ...], tool: Tool) -> Matrix:
    """(4, 4) where the handles stand: the object's own matrix, without shear, which ImGuizmo would take out
    of what it returns; for several objects the pivot that they share, with the axes of the active one (local)
    or of the world."""
    active = scene.placed(names[-1])
    matrix = np.eye(4)
    if len(names) == 1:
        matrix[:3] = affine.compose(active.position, active.rotation, active.scale)
    else:
        if tool.space == "local":
            matrix[:3, :3] = affine.rotation_matrix(active.rotation)
        matrix[:3, 3] = pivot.shared_point(scene, names, tool.pivot)
    return matrix


def _alike(start: Matrix, scaled: Matrix) -> Matrix:
    """(4, 4) `start` with all three axes scaled by the factor of the one that `scaled` scales most."""
    factors = np.linalg.norm(scaled[:3, :3], axis=0) / np.linalg.norm(start[:3, :3], axis=0)
    alike = start.copy()
    alike[:3, :3] *= factors[np.argmax(np.abs(np.log(np.maximum(factors, 1e-9))))]
    return alike


def view_matrix(camera: Camera) -> Matrix:
    """(4, 4) camera from world; the camera looks along -z, as OpenGL has it."""
    right, up, forward = camera.image_plane(1.0)
    rows = np.array([right / np.linalg.norm(right), up / np.linalg.norm(up), -forward])
    matrix = np.eye(4)
    matrix[:3, :3] = rows
    matrix[:3, 3] = -rows @ camera.position
    return matrix


def projection_matrix(camera: Camera, aspect: float) -> Matrix:
    """(4, 4) clip space from camera space, as OpenGL has it."""
    right, up, _ = camera.image_plane(aspect)
    shift_x, shift_y = camera.shift_at(aspect)
    matrix = np.zeros((4, 4))
    matrix[0, 0], matrix[1, 1] = 1.0 / np.linalg.norm(right), 1.0 / np.linalg.norm(up)
    if camera.is_orthographic:
        matrix[:2, 3] = -shift_x, -shift_y
        matrix[2, 2], matrix[2, 3] = 2.0 / (_NEAR - _FAR), (_FAR + _NEAR) / (_NEAR - _FAR)
        matrix[3, 3] = 1.0
        return matrix
    matrix[:2, 2] = shift_x, shift_y
    matrix[2, 2], matrix[2, 3] = (_FAR + _NEAR) / (_NEAR - _FAR), 2.0 * _FAR * _NEAR / (_NEAR - _FAR)
    matrix[3, 2] = -1.0
    return matrix


def _flat(matrix: Matrix) -> imguizmo.im_guizmo.Matrix16:
    # OpenGL's matrices lie in memory column by column.
    return _gizmo.Matrix16(matrix.T.ravel().tolist())


def _note_place(view: Matrix, projection: Matrix, matrix: Matrix, picture: Rect[float]) -> None:
    clip = projection @ view @ matrix[:, 3]
    if clip[3] > 0:
        x = picture.left + (clip[0] / clip[3] + 1) / 2 * picture.width
        y = picture.top + (1 - clip[1] / clip[3]) / 2 * picture.height
        places.note_rect("gizmo", Rect(float(x), float(y), 0.0, 0.0))
