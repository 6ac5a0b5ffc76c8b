"""The cameras: which of them the scene is seen through, and all that one has."""

from __future__ import annotations

from dataclasses import dataclass

from incpt.scene.camera import MOST_BLADES, Camera
from incpt.ui.widgets import widgets
from incpt.ui.widgets.refusals import Refusals

_ANGLE, _LENGTH = "angle", "length"
_USUAL_F_STOP = 2.8
"""What a lens is opened to at first."""
_PROJECTIONS = (("perspective", "Perspective"), ("orthographic", "Orthographic"))
_FITS = (("auto", "Larger side"), ("horizontal", "Width"), ("vertical", "Height"))


@dataclass(frozen=True)
class CameraRequest:
    """What the user asked for about the camera, besides its fields."""

    is_frame: bool = False
    is_reset: bool = False
    is_focus: bool = False


@dataclass(frozen=True)
class Outcome:
    """What the user asked for about the cameras of the scene: see through another, make, rename or delete
    one; see through the active one, put it where the free view is, lock it to the view or no longer."""

    activate: str | None = None
    is_new: bool = False
    is_rename: bool = False
    is_delete: bool = False
    is_through: bool = False
    is_to_view: bool = False
    is_lock: bool = False


def draw_choice(names: tuple[str, ...], active: str, is_free: bool, is_locked: bool) -> Outcome:
    """The camera that the scene is rendered through, and buttons for others. `is_free`: the view is beside
    it; `is_locked`: moves of the view move it."""
    options = [(name, name) for name in names]
    chosen = widgets.choice("Active camera", active, options, "The scene is rendered through it")
    with widgets.row("Free view" if is_free else "Seen through it", "Moving a free view is no edit"):
        is_through = widgets.button("Look through##camera", "As it will be rendered", enabled=is_free)
        widgets.same_line()
        is_to_view = widgets.button(
            "Camera to view##camera", "Put it where the free view is", enabled=is_free
        )
    lock = widgets.checkbox("Lock to view", is_locked, "Moves of the view through it move it, as edits")
    with widgets.row("", ""):
        is_new = widgets.button("New from view##camera", "Another camera with the view as it is")
    with widgets.row("", ""):
        is_rename = widgets.button("Rename…##camera")
        widgets.same_line()
        is_delete = widgets.button(
            "Delete##camera", "The scene is seen through the first of the others", enabled=len(names) > 1
        )
    return Outcome(
        chosen if chosen != active else None, is_new, is_rename, is_delete, is_through, is_to_view,
        lock != is_locked,
    )  # fmt: skip


def draw(camera: Camera, aspect: float, refusals: Refusals) -> tuple[Camera, CameraRequest]:
    """Fields of the camera, for pictures of that aspect (width by height); returns it after this frame, and
    what is asked for."""
    position = widgets.vector(
        "Camera", camera.position, speed=0.02, unit=" m", tip="Position of the camera, world space"
    )
    camera = refusals.changed(camera, position=position)
    target = widgets.vector("Target", camera.target, speed=0.02, unit=" m", tip="The point it looks at")
    camera = refusals.changed(camera, target=target)
    projection = widgets.choice(
        "Projection", camera.projection, _PROJECTIONS, "Orthographic: all rays are parallel"
    )
    if projection != camera.projection:
        camera = _projected(camera, projection, aspect, refusals)
    camera = (_draw_height if camera.is_orthographic else _draw_angle)(camera, aspect, refusals)
    camera = _draw_shift(camera, refusals)
    near = widgets.number(
        "Near", camera.near, high=1e6, speed=0.01, unit=" m", tip="Nothing nearer along the view is seen"
    )
    camera = refusals.changed(camera, near=near)
    camera, is_focus = _draw_depth_of_field(camera, refusals)
    is_frame = widgets.button("Frame selected##camera")
    widgets.same_line()
    return camera, CameraRequest(is_frame, widgets.button("Reset##camera"), is_focus)


def _projected(camera: Camera, projection: str, aspect: float, refusals: Refusals) -> Camera:
    """The camera with another projection; what lies at its target keeps its size in the picture."""
    distance = sum((a - b) ** 2 for a, b in zip(camera.position, camera.target, strict=True)) ** 0.5
    if projection == "orthographic":
        half_height = float((camera.image_plane(aspect)[1] ** 2).sum() ** 0.5)
        return refusals.changed(camera, projection=projection, ortho_height=2 * half_height * distance)
    return refusals.changed(camera, projection=projection)


def _draw_height(camera: Camera, aspect: float, refusals: Refusals) -> Camera:
    height = widgets.number(
        "View height", camera.ortho_height, low=1e-3, high=1e6, speed=0.02, unit=" m",
        tip="What the picture shows from its top to its bottom",
    )  # fmt: skip
    return refusals.changed(camera, ortho_height=height)


def _draw_angle(camera: Camera, aspect: float, refusals: Refusals) -> Camera:
    """The field of view, as an angle or by focal length and sensor."""
    way = _LENGTH if camera.focal_length else _ANGLE
    options = ((_ANGLE, "Angle"), (_LENGTH, "Focal length"))
    chosen = widgets.choice("Lens", way, options, "How the field of view is said")
    if chosen != way:
        length = camera.focal_length_at(aspect) if chosen == _LENGTH else 0.0
        camera = refusals.changed(camera, fov_y=camera.fov_y_at(aspect), focal_length=length)
    if not camera.focal_length:
        angle = widgets.number(
            "Field of view", camera.fov_y, low=1.0, high=150.0, speed=0.2, unit="°", decimals=1,
            tip="Full vertical angle",
        )  # fmt: skip
        return refusals.changed(camera, fov_y=angle)
    length = widgets.number(
        "Focal length", camera.focal_length, low=1.0, high=2000.0, speed=0.2, unit=" mm", decimals=1,
        tip="Longer shows less",
    )  # fmt: skip
    # Nought would stand for the angle.
    camera = refusals.changed(camera, focal_length=length or camera.focal_length)
    fit = widgets.choice(
        "Sensor fit", camera.sensor_fit, _FITS, "The side of the picture that the sensor has"
    )
    camera = refusals.changed(camera, sensor_fit=fit)
    side = "height" if fit == "vertical" else "width"
    size = widgets.number(
        "Sensor", getattr(camera, f"sensor_{side}"), low=1.0, high=200.0, speed=0.1, unit=" mm", decimals=1,
        tip=f"Its {side}",
    )  # fmt: skip
    return refusals.changed(camera, **{f"sensor_{side}": size})


def _draw_shift(camera: Camera, refusals: Refusals) -> Camera:
    for axis, way in (("x", "right"), ("y", "up")):
        shift = widgets.number(
            f"Shift {axis.upper()}", getattr(camera, f"shift_{axis}"), low=-2.0, high=2.0, speed=0.005,
            tip=f"How far the picture is moved {way}, as a fraction of its larger side",
        )  # fmt: skip
        camera = refusals.changed(camera, **{f"shift_{axis}": shift})
    return camera


def _draw_depth_of_field(camera: Camera, refusals: Refusals) -> tuple[Camera, bool]:
    """The fields of the lens where it is open; also whether the selection is to be sharp."""
    is_open = widgets.checkbox("Depth of field", camera.has_lens, "Off: a pinhole, for which all is sharp")
    if is_open != camera.has_lens:
        camera = refusals.changed(camera, f_stop=_USUAL_F_STOP if is_open else 0.0)
    if not camera.has_lens:
        return camera, False
    f_stop = widgets.number(
        "F-stop", camera.f_stop, low=0.01, high=64.0, speed=0.01, decimals=2, logarithmic=True,
        tip="Focal length by the width of the aperture; less is blurrier",
    )  # fmt: skip
    camera = refusals.changed(camera, f_stop=f_stop or camera.f_stop)
    distance = widgets.number(
        "Focus distance", camera.focus_distance, high=1e6, speed=0.01, unit=" m",
        tip="Along the view, to what is sharp; 0: to the target",
    )  # fmt: skip
    camera = refusals.changed(camera, focus_distance=distance)
    with widgets.row("", ""):
        is_focus = widgets.button("Focus on selected##camera", "What is selected becomes sharp")
    blades = widgets.whole_number(
        "Blades", camera.blades, low=0, high=MOST_BLADES, speed=0.05, tip="Corners of the aperture; 0: round"
    )
    # There is no aperture of one or two corners, and a drag passes by them.
    blades = blades if blades not in (1, 2) else (3 if blades > camera.blades else 0)
    camera = refusals.changed(camera, blades=blades)
    turn = widgets.number(
        "Blade turn",
        camera.blade_rotation,
        speed=0.5,
        unit="°",
        decimals=1,
        tip="Of the aperture in the camera",
    )
    return refusals.changed(camera, blade_rotation=turn), is_focus
