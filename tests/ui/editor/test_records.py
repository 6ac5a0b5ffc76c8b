"""What the plots show: values from frames."""

from __future__ import annotations

from dataclasses import replace

from support.small_scenes import mixed_scene
from support.ui_harness import frame_of

from incpt.ui.editor.records import Records
from incpt.viewer.view import Frame, View

SCENE = mixed_scene(size=(48, 32))
VIEW = View(SCENE)


def frame(error: float | None, seconds: float = 1.0, view: View = VIEW) -> Frame:
    made = frame_of(view, error=error)
    return replace(made, pictures=tuple(replace(one, seconds=seconds) for one in made.pictures))


def test_a_frame_counts_once() -> None:
    first = frame(0.5)
    records = Records().with_frame(first, 10.0).with_frame(first, 11.0)
    assert records.step_ms.x == (10.0,) and records.step_ms.y == (20.0,)
    assert records.errors["impact"].x == (1.0,) and records.errors["impact"].y == (0.5,)


def test_errors_stand_over_rendering_time_that_grows() -> None:
    records = Records()
    for seconds, error in ((1.0, 0.5), (1.0, 0.4), (2.0, 0.3)):
        records = records.with_frame(frame(error, seconds), seconds)
    assert records.errors["impact"].x == (1.0, 2.0) and records.errors["impact"].y == (0.5, 0.3)


def test_another_scene_begins_anew_and_step_times_go_on() -> None:
    records = Records().with_frame(frame(0.5), 1.0)
    records = records.with_frame(frame(0.25, view=View(SCENE.with_camera(fov_y=50))), 2.0)
    assert records.errors["impact"].y == (0.25,) and records.step_ms.x == (1.0, 2.0)


def test_a_split_view_has_two_curves() -> None:
    records = Records().with_frame(frame(0.5), 1.0).with_frame(frame(0.25, view=View(SCENE, split=True)), 2.0)
    assert set(records.errors) == {"restart (left)", "impact"}


def test_without_a_reference_there_is_no_error() -> None:
    assert Records().with_frame(frame(None), 1.0).errors == {}


def test_the_oldest_values_go() -> None:
    records = Records()
    for at in range(605):
        records = records.with_frame(frame(1.0, at + 1.0), float(at))
    assert len(records.step_ms.x) == len(records.errors["impact"].x) == 600 and records.step_ms.x[0] == 5.0
