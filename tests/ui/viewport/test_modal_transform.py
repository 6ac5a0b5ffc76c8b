"""A transform under way, without a window: keys and places of the mouse in, transforms and a text out."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cameras import cameras

from incpt.core import affine
from incpt.core.settings import RenderSettings
from incpt.scene import placing
from incpt.scene.camera import Camera
from incpt.scene.light import Light
from incpt.scene.material import Material
from incpt.scene.model import Object, Placed, Scene
from incpt.scene.shapes import shape
from incpt.scene.transform import SMALLEST_SCALE
from incpt.ui.preferences import SnapSettings
from incpt.ui.rect import Point, Rect
from incpt.ui.viewport import drag_geometry, modal_marks
from incpt.ui.viewport.axis_constraint import AxisConstraint, after_key
from incpt.ui.viewport.modal_transform import FINE, Input, ModalTransform, begun
from incpt.ui.viewport.typed_number import CHARACTERS, TypedNumber

PICTURE = Rect(100.0, 50.0, 600.0, 400.0)
CAMERA = Camera((0.0, 0.0, 10.0), (0.0, 0.0, 0.0), fov_y=40.0)
"""It looks along -z: x is right in its picture, and y up."""
POINTS_PER_METRE = PICTURE.height / (2 * 10 * math.tan(math.radians(20)))
"""In the plane z = 0."""
SHEARED = np.array([[1.0, 0.5, 0.0, 0.0], [0.0, 2.0, 0.25, -1.0], [0.1, 0.0, 1.5, 1.0]])
SCENE = Scene(
    CAMERA,
    materials={"red": Material()},
    objects=(
        Object("cube", shape("cube"), "red", (0.0, 0.0, 0.0), (0, 0, 90), (1, 2, 3)),
        Object("ball", shape("sphere"), "red", (2.0, 0.0, 0.0)),
        Object("odd", shape("cube"), "red", matrix=SHEARED),
        Object("hidden", shape("cube"), "red", visible=False),
    ),
    settings=RenderSettings(size=(600, 400)),
    lights=(Light("lamp", "spot", (-2.0, 0.0, 0.0), (10, 20, 30)),),
)
MIDDLE = (400.0, 250.0)
SNAP = SnapSettings(False, move_m=0.25, rotate_deg=15.0, scale=0.5)


def start(
    operation: str, *names: str, scene: Scene = SCENE, mouse: Point = (MIDDLE[0] + 100.0, MIDDLE[1])
) -> ModalTransform:
    made = begun(scene, names or ("cube",), operation, mouse, SNAP, PICTURE)
    assert made is not None
    return made


def keys(transform: ModalTransform, *pressed: str) -> ModalTransform:
    return transform.after(Input(transform.mouse, pressed))


def typed(transform: ModalTransform, text: str) -> ModalTransform:
    return transform.after(Input(transform.mouse, text=text))


def dragged(transform: ModalTransform, dx: float, dy: float, **held: bool) -> ModalTransform:
    x, y = transform.mouse
    return transform.after(Input((x + dx, y + dy), **held))


def placed(transform: ModalTransform, name: str = "cube") -> Placed:
    return transform.scene.placed(name)


# ---------------------------------------------------------------------------------------------- numbers


@pytest.mark.parametrize(
    ("characters", "value", "shown"),
    [
        ("", 0.0, ""),
        ("1.5", 1.5, "1.5"),
        ("1,5", 1.5, "1.5"),
        ("1.5+2", 3.5, "1.5+2"),
        ("1.5+2-", -3.5, "-(1.5+2)"),
        ("-3", -3.0, "-3"),
        ("-3-", 3.0, "3"),
        ("1..5.", 1.5, "1.5"),
        ("+1++2+", 3.0, "1+2+"),
        (".", 0.0, "."),
        ("-", 0.0, "-"),
        (".5+.25", 0.75, ".5+.25"),
    ],
)
def test_what_is_typed_is_a_number(characters: str, value: float, shown: str) -> None:
    number = TypedNumber()
    for character in characters:
        number = number.after(character)
    assert (number.value, number.shown) == (value, shown)
    assert number.is_there == bool(characters)


@given(st.text(CHARACTERS, max_size=60))
def test_every_text_is_a_finite_number_and_is_erased(characters: str) -> None:
    number = TypedNumber()
    for character in characters:
        number = number.after(character)
    assert math.isfinite(number.value)
    for _ in range(len(characters) + 1):
        number = number.erased()
    assert number == TypedNumber()


def test_backspace_goes_back_to_the_mouse() -> None:
    moved = dragged(start("move"), 60.0, 0.0)
    again = keys(typed(moved, "12"), "backspace", "backspace")
    assert not again.is_typed and again.scene == moved.scene


# ------------------------------------------------------------------------------------------ constraints


def test_an_axis_is_the_worlds_then_the_objects_then_none() -> None:
    pressed = [after_key(None, 1, False)]
    for _ in range(3):
        pressed.append(after_key(pressed[-1], 1, False))
    assert pressed == [
        AxisConstraint(1), AxisConstraint(1, is_local=True), None, AxisConstraint(1)
    ]  # fmt: skip
    assert after_key(AxisConstraint(1, is_local=True), 0, False) == AxisConstraint(0)
    assert after_key(AxisConstraint(1), 1, True) == AxisConstraint(1, is_plane=True)
    assert AxisConstraint(1, True).free == (0, 2) and AxisConstraint(1, True).text == "locking global Y"


# ------------------------------------------------------------------------------------------------- moves


def test_what_is_moved_stays_under_the_mouse() -> None:
    for camera in (CAMERA, replace(CAMERA, projection="orthographic", ortho_height=3.0, shift_x=0.2)):
        begin = start("move", scene=replace(SCENE, camera=camera))
        moved = dragged(begin, 37.0, -21.0)
        at = drag_geometry.place(camera, PICTURE, np.array(placed(moved).position))
        assert at == pytest.approx((begin.start.center[0] + 37.0, begin.start.center[1] - 21.0))


@given(cameras(), st.tuples(st.floats(-200, 200), st.floats(-200, 200)), st.integers(0, 2))
def test_what_is_moved_along_an_axis_is_there_on_the_screen_where_the_mouse_is_nearest(
    camera: Camera, by: Point, axis: int
) -> None:
    point = np.asarray(camera.target, np.float64)
    direction = np.eye(3)[axis]
    metres = drag_geometry.along_axis(camera, PICTURE, point, direction, by)
    assert math.isfinite(metres)
    begin, end = (drag_geometry.place(camera, PICTURE, p) for p in (point, point + metres * direction))
    ahead = np.subtract(drag_geometry.place(camera, PICTURE, point + 1e-4 * direction), begin)
    on_line = ahead / max(float(np.linalg.norm(ahead)), 1e-12)
    eye = camera.image_plane(1.0)[2]
    if np.linalg.norm(np.cross(eye, direction)) < 0.2 or abs(metres) > 100:
        return  # seen from its end, or beyond its horizon
    assert np.subtract(end, begin) @ on_line == pytest.approx(np.dot(by, on_line), abs=0.5, rel=0.02)


def test_beyond_the_horizon_of_an_axis_a_move_is_far_but_has_an_end() -> None:
    camera = Camera((0.0, 1.0, 10.0), (0.0, 0.0, 0.0), fov_y=40.0)
    away = [
        drag_geometry.along_axis(camera, PICTURE, np.zeros(3), np.array([0.0, 0.0, -1.0]), (0.0, -dy))
        for dy in (10.0, 100.0, 150.0, 400.0)
    ]
    assert 0 < away[0] < away[1] < away[2] and math.isfinite(away[3]) and away[3] > 100


def test_an_axis_that_points_at_the_viewer_is_followed_upwards() -> None:
    moved = dragged(keys(start("move"), "z"), 50.0, -POINTS_PER_METRE)
    assert placed(moved).position == pytest.approx((0.0, 0.0, 1.0))


def test_axes_and_planes_hold_a_move() -> None:
    moved = dragged(start("move"), POINTS_PER_METRE, -2 * POINTS_PER_METRE)
    assert placed(moved).position == pytest.approx((1.0, 2.0, 0.0))
    assert placed(keys(moved, "x")).position == pytest.approx((1.0, 0.0, 0.0))
    assert placed(keys(moved, "y")).position == pytest.approx((0.0, 2.0, 0.0))
    assert placed(keys(moved, "shift+z")).position == pytest.approx((1.0, 2.0, 0.0))
    assert placed(keys(moved, "shift+z")).position[2] == 0.0
    # The cube is turned by 90° about z: its own x is the world's y.
    assert placed(keys(moved, "x", "x")).position == pytest.approx((0.0, 2.0, 0.0))
    assert placed(keys(moved, "x", "x", "x")).position == placed(moved).position


def test_each_object_moves_along_its_own_axis() -> None:
    moved = typed(keys(start("move", "ball", "cube"), "x", "x"), "3")
    assert placed(moved, "ball").position == (5.0, 0.0, 0.0)
    assert placed(moved, "cube").position == pytest.approx((0.0, 3.0, 0.0))
    assert moved.header == "D: [3|] = 3.000 m  along local X"


def test_typed_numbers_move_exactly() -> None:
    moved = typed(start("move", "ball"), "1.5+2")
    assert placed(moved, "ball").position == (5.5, 0.0, 0.0)
    assert moved.header == "Dx: [1.5+2|] = 3.500 m  Dy: 0.000 m  Dz: 0.000 m  (3.500 m)"
    moved = typed(keys(moved, "tab"), "-.5")
    assert placed(moved, "ball").position == (5.5, -0.5, 0.0)
    moved = keys(moved, "z")
    assert placed(moved, "ball").position == (2.0, 0.0, -0.5), "the number typed last is kept"
    assert typed(keys(moved, "shift+z"), "5").header.endswith("locking global Z")
    assert placed(dragged(moved, 100.0, 40.0), "ball") == placed(moved, "ball"), "the mouse does not count"


def test_shift_is_finer_and_ctrl_goes_in_steps() -> None:
    begin = keys(start("move"), "x")
    assert placed(dragged(begin, POINTS_PER_METRE, 0.0, is_fine=True)).position[0] == pytest.approx(FINE)
    stepped = dragged(begin, 0.7 * POINTS_PER_METRE, 0.0, is_snapping=True)
    assert placed(stepped).position == (0.75, 0.0, 0.0)
    both = dragged(begin, 7.1 * POINTS_PER_METRE, 0.0, is_snapping=True, is_fine=True)
    assert placed(both).position == (0.7, 0.0, 0.0)
    # Shift that is pressed on the way counts from there on.
    late = dragged(dragged(begin, POINTS_PER_METRE, 0.0), POINTS_PER_METRE, 0.0, is_fine=True)
    assert placed(late).position[0] == pytest.approx(1 + FINE)


# ------------------------------------------------------------------------------------------------- turns


def test_a_turn_follows_the_mouse_around_the_pivot() -> None:
    quarter = [(MIDDLE[0] + 100 * math.cos(t), MIDDLE[1] + 100 * math.sin(t)) for t in np.linspace(0, 2.5, 9)]
    turned = start("rotate", "ball")
    for point in quarter:
        turned = turned.after(Input(point))
    # The mouse went clockwise, which is about -z, as is the line of sight.
    assert turned.start.center != MIDDLE and turned.angle != 0
    turned = start("rotate")
    for point in quarter:
        turned = turned.after(Input(point))
    assert turned.angle == pytest.approx(math.degrees(2.5))
    assert placed(turned).rotation == pytest.approx((0, 0, 90 - math.degrees(2.5)))
    about_z = keys(turned, "z")
    assert placed(about_z).rotation == pytest.approx(placed(turned).rotation), (
        "it follows the mouse there too"
    )
    assert keys(turned, "z").header == "Rotation: 143.24°  along global Z"


def test_a_turn_goes_on_over_more_than_a_round() -> None:
    turned = start("rotate")
    for t in np.linspace(0, 4.5 * math.pi, 40):
        turned = turned.after(Input((MIDDLE[0] + 100 * math.cos(t), MIDDLE[1] + 100 * math.sin(t))))
    assert turned.angle == pytest.approx(810.0)


def test_typed_turns_are_right_handed_about_an_axis() -> None:
    assert placed(typed(keys(start("rotate"), "z"), "45")).rotation == (0.0, 0.0, 135.0)
    assert placed(typed(keys(start("rotate"), "z"), "45-")).rotation == (0.0, 0.0, 45.0)
    assert placed(typed(start("rotate"), "30")).rotation == (0.0, 0.0, 60.0), "clockwise as it is seen"
    both = typed(keys(start("rotate", "ball", "lamp"), "y"), "180")
    assert placed(both, "ball").position == pytest.approx((-2.0, 0.0, 0.0))
    assert placed(both, "lamp").position == pytest.approx((2.0, 0.0, 0.0)), "about the median of both"
    own = typed(keys(start("rotate", "lamp"), "x", "x"), "25")
    assert placed(own, "lamp").rotation == pytest.approx((35.0, 20.0, 30.0))


def test_a_trackball_turns_what_is_in_front_with_the_mouse() -> None:
    front = np.array([0.0, 0.0, 1.0])
    rolled = dragged(keys(start("rotate", "ball"), "r"), 50.0, 0.0)
    turn = affine.rotation_matrix(placed(rolled, "ball").rotation)
    assert rolled.operation == "trackball" and rolled.header == "Trackball: 0.00°  28.65°"
    assert tuple(turn @ front) == pytest.approx((math.sin(0.5), 0.0, math.cos(0.5)))
    down = dragged(keys(start("rotate", "ball"), "r"), 0.0, 30.0)
    turn = affine.rotation_matrix(placed(down, "ball").rotation)
    assert tuple(turn @ front) == pytest.approx((0.0, -math.sin(0.3), math.cos(0.3)))
    both = typed(keys(typed(keys(start("rotate", "ball"), "r"), "90"), "tab"), "30")
    # About y first, then about x.
    expected = affine.rotation_matrix((90, 0, 0)) @ affine.rotation_matrix((0, 30, 0))
    np.testing.assert_allclose(affine.rotation_matrix(placed(both, "ball").rotation), expected, atol=1e-9)
    assert both.header == "Trackball: [90] = 90.00°  [30|] = 30.00°"
    assert keys(rolled, "r").operation == "rotate" and keys(rolled, "r").scene is SCENE
    assert keys(rolled, "y").header == "Rotation: 0.00°  along global Y"


# ---------------------------------------------------------------------------------------------- scalings


def test_a_scaling_goes_by_the_distance_from_the_pivot() -> None:
    assert placed(dragged(start("scale"), 50.0, 0.0)).scale == (1.5, 3.0, 4.5)
    assert placed(dragged(start("scale"), -300.0, 0.0)).scale == (-2.0, -4.0, -6.0), "beyond the pivot"
    at_pivot = start("scale", mouse=MIDDLE)
    assert dragged(at_pivot, 0.5, 0.0).factor == pytest.approx(1.0, abs=0.1)
    stepped = dragged(start("scale"), 70.0, 0.0, is_snapping=True)
    assert stepped.factor == 1.5 and stepped.header == "Scale: 1.500"


def test_axes_and_planes_hold_a_scaling() -> None:
    assert placed(typed(keys(start("scale"), "x", "x"), "2")).scale == (2.0, 2.0, 3.0)
    # Its own y lies along the world's x.
    assert placed(typed(keys(start("scale"), "x"), "2")).scale == (1.0, 4.0, 3.0)
    assert placed(typed(keys(start("scale"), "shift+z"), "2")).scale == (2.0, 4.0, 3.0)
    both = typed(keys(start("scale", "ball", "lamp"), "x"), "0.5")
    assert placed(both, "ball").position == (1.0, 0.0, 0.0) and placed(both, "ball").scale == (0.5, 1.0, 1.0)
    assert placed(both, "lamp").rotation == (10, 20, 30), "a scaling turns nothing"


def test_nothing_is_flattened_or_lost() -> None:
    assert placed(typed(start("scale"), "0")).scale == pytest.approx((SMALLEST_SCALE,) * 3)
    assert placed(typed(start("scale", "odd"), "0"), "odd") == SCENE.placed("odd")
    far = typed(keys(start("move"), "x"), "9" * 20)
    assert placed(far).position[0] == 1e9


def test_what_is_sheared_keeps_its_matrix() -> None:
    world = SCENE.object("odd").world_from_object
    moved = typed(keys(start("move", "odd"), "y"), "2").scene.object("odd")
    np.testing.assert_allclose(moved.world_from_object, np.add(world, [[0] * 4, [0, 0, 0, 2.0], [0] * 4]))
    pivot = world[:, 3]
    scaled = typed(keys(start("scale", "odd"), "x"), "3").scene.object("odd")
    np.testing.assert_allclose(scaled.world_from_object[:, :3], np.diag([3.0, 1, 1]) @ world[:, :3])
    np.testing.assert_allclose(scaled.world_from_object[:, 3], pivot)
    turned = typed(keys(start("rotate", "odd"), "z"), "30").scene.object("odd")
    turn = affine.rotation_matrix((0, 0, 30))
    np.testing.assert_allclose(turned.world_from_object[:, :3], turn @ world[:, :3], atol=1e-12)


# --------------------------------------------------------------------------------------------- the whole


def test_nothing_done_is_the_same_scene() -> None:
    for operation in ("move", "rotate", "scale"):
        begin = start(operation, "cube", "lamp", "odd")
        assert begin.scene is SCENE
        back = dragged(dragged(begin, 30.0, 20.0), -30.0, -20.0)
        assert operation == "rotate" or back.scene is SCENE
        assert begin.after(Input(begin.mouse)) is begin
        assert typed(begin, "1" if operation == "scale" else "0").scene is SCENE


def test_only_what_is_shown_is_transformed() -> None:
    assert begun(SCENE, ("hidden",), "move", MIDDLE, SNAP, PICTURE) is None
    assert begun(SCENE, (), "move", MIDDLE, SNAP, PICTURE) is None
    moved = typed(start("move", "hidden", "cube"), "1")
    assert placed(moved, "hidden") == SCENE.placed("hidden") and placed(moved).position == (1.0, 0.0, 0.0)


def test_another_operation_begins_from_the_start() -> None:
    turned = keys(dragged(keys(start("move"), "x"), 100.0, 0.0), "r")
    assert turned.scene is SCENE and turned.operation == "rotate" and turned.constraint == AxisConstraint(0)
    assert keys(start("move"), "g").operation == "move"


def test_a_pivot_behind_the_camera_is_moved_all_the_same() -> None:
    scene = SCENE.with_object("cube", position=(0.0, 0.0, 20.0))
    for operation, pressed in itertools.product(("move", "rotate", "scale"), ((), ("x",), ("shift+y",))):
        moved = dragged(keys(start(operation, scene=scene), *pressed), 10.0, 10.0)
        assert np.isfinite(placed(moved).transform.world_from_object).all() and moved.scene is not scene
    assert placed(dragged(start("move", scene=scene), 10.0, 0.0)).position[0] > 0, (
        "the way that the mouse goes"
    )


def test_lines_stand_along_the_axes_before_the_camera() -> None:
    assert start("move").lines == []
    (line,) = keys(start("move", "ball", "cube"), "x").lines
    assert tuple(line[0]) == (1.0, 0.0, 0.0) and tuple(line[1]) == (1.0, 0.0, 0.0) and line[2] == 0
    assert len(keys(start("move", "ball", "cube"), "shift+x", "shift+x").lines) == 4
    ends = modal_marks.visible_part(CAMERA, np.zeros(3), np.array([0.0, 0.0, 1.0]))
    assert ends[0, 2] == -10000.0 and 9.0 < ends[1, 2] < 10.0


# What is typed with a constraint, worked out in another way: all matrices, from the start.

EVENTS = st.one_of(
    st.sampled_from(("x", "y", "z", "shift+x", "shift+y", "shift+z", "g", "r", "s", "backspace")),
    st.sampled_from(("text 1", "text 2", "text .", "text +", "text -")),
    st.tuples(st.floats(0, 800), st.floats(0, 500)),
)


class Model:
    """The keys that were pressed, kept in another way."""

    def __init__(self) -> None:
        self.operation, self.text, self.sign = "move", "", 1
        self.pressed: list[tuple[int, bool]] = []
        """Presses of the same axis and plane in a row, at most three."""

    def take(self, event: str) -> None:
        if event in "grs":
            wanted = {"g": "move", "r": "rotate", "s": "scale"}[event]
            if wanted == "rotate" == self.operation:
                wanted, self.pressed = "trackball", []
            if wanted != self.operation:
                self.operation, self.text, self.sign = wanted, "", 1
        elif event == "backspace":
            self.text, self.sign = (self.text[:-1], self.sign) if self.text else ("", 1)
        elif event.startswith("text"):
            self.type(event[-1])
        else:
            if self.operation == "trackball":
                self.operation, self.text, self.sign = "rotate", "", 1
            pressed = "xyz".index(event[-1]), event.startswith("shift")
            again = pressed in self.pressed and len(self.pressed) < 3
            self.pressed = [*self.pressed, pressed] if again else [pressed]

    def type(self, character: str) -> None:
        term = self.text.split("+")[-1]
        if character == "-":
            self.sign = -self.sign
        elif not (character == "+" and term in ("", ".")) and not (character == "." and "." in term):
            self.text = (self.text + character)[:24]

    @property
    def amount(self) -> float | None:
        """None: the mouse decides."""
        if not self.text and self.sign == 1:
            return None
        return self.sign * sum(float(term) for term in self.text.split("+") if term not in ("", "."))

    def worlds(self, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        """(3, 4) matrices, by plain products of matrices."""
        amount, is_held = self.amount or 0.0, len(self.pressed) in (1, 2)
        axis, is_plane = self.pressed[0] if is_held else (0, False)
        pivot = np.mean([SCENE.placed(name).position for name in names], axis=0)
        found = {}
        for name in names:
            world = SCENE.placed(name).transform.world_from_object
            is_local = len(self.pressed) == 2
            frame = affine.rotation_matrix(SCENE.placed(name).rotation) if is_local else np.eye(3)
            free = [a for a in range(3) if not is_held or ((a == axis) != is_plane)]
            linear, offset = np.eye(3), np.zeros(3)
            if self.operation == "move":
                offset = amount * frame[:, free[0]]
            elif self.operation == "trackball":
                linear = placing.turn_matrix((1.0, 0.0, 0.0), amount)
            elif self.operation == "rotate":
                about = frame[:, axis] if is_held else np.array([0.0, 0.0, -1.0])
                linear = placing.turn_matrix(about, amount)
            else:
                linear = frame @ np.diag([amount if a in free else 1.0 for a in range(3)]) @ frame.T
            position = linear @ (world[:, 3] - pivot) + pivot + offset
            found[name] = np.column_stack([linear @ world[:, :3], position])
        return found


@given(st.lists(EVENTS, max_size=24), st.sampled_from((("cube",), ("ball", "cube"))))
def test_any_events_lead_to_what_a_model_says(events: list[str | Point], names: tuple[str, ...]) -> None:
    transform, model = start("move", *names), Model()
    for event in events:
        if not isinstance(event, str):
            transform = transform.after(Input(event))
            continue
        model.take(event)
        transform = typed(transform, event[-1]) if event.startswith("text") else keys(transform, event)
    assert transform.start.scene is SCENE and transform.header and len(transform.lines) <= 4
    assert transform.is_typed == (model.amount is not None)
    for name, world in model.worlds(names).items() if transform.is_typed else ():
        if abs(np.linalg.det(world[:, :3])) > 1e-6:  # else it is held from being flattened
            found = transform.scene.placed(name).transform.world_from_object
            np.testing.assert_allclose(found, world, rtol=1e-6, atol=1e-6)


# ----------------------------------------------------------------------------------------------- the pivot


def about(pivot: str, operation: str) -> ModalTransform:
    made = begun(SCENE, ("cube", "ball"), operation, (500.0, 250.0), SNAP, PICTURE, pivot)
    assert made is not None
    return made


@pytest.mark.parametrize(
    ("pivot", "cube", "ball"),
    [
        ("median", (-1.0, 0.0, 0.0), (3.0, 0.0, 0.0)),
        ("active", (-2.0, 0.0, 0.0), (2.0, 0.0, 0.0)),
        ("individual", (0.0, 0.0, 0.0), (2.0, 0.0, 0.0)),
    ],
)
def test_several_are_scaled_about_the_pivot(pivot: str, cube: Point, ball: Point) -> None:
    done = typed(about(pivot, "scale"), "2").scene
    assert done.object("cube").position == pytest.approx(cube)
    assert done.object("ball").position == pytest.approx(ball)
    assert done.object("ball").scale == (2.0, 2.0, 2.0), "whatever the pivot, the size is the same"


@pytest.mark.parametrize(
    ("pivot", "cube", "ball"),
    [
        ("median", (1.0, -1.0, 0.0), (1.0, 1.0, 0.0)),
        ("active", (2.0, -2.0, 0.0), (2.0, 0.0, 0.0)),
        ("individual", (0.0, 0.0, 0.0), (2.0, 0.0, 0.0)),
    ],
)
def test_several_are_turned_about_the_pivot(pivot: str, cube: Point, ball: Point) -> None:
    done = typed(keys(about(pivot, "rotate"), "z"), "90").scene
    assert done.object("cube").position == pytest.approx(cube)
    assert done.object("ball").position == pytest.approx(ball)
    assert done.object("ball").rotation == pytest.approx((0, 0, 90))


def test_the_mouse_is_measured_from_the_pivot() -> None:
    assert about("active", "rotate").start.center == pytest.approx(
        (MIDDLE[0] + 2 * POINTS_PER_METRE, MIDDLE[1])
    )
    assert about("median", "rotate").start.center == pytest.approx((MIDDLE[0] + POINTS_PER_METRE, MIDDLE[1]))


def test_a_move_is_the_same_about_every_pivot() -> None:
    places = {
        pivot: typed(about(pivot, "move"), "1").scene.object("cube").position
        for pivot in ("median", "active", "individual")
    }
    assert len(set(places.values())) == 1
