"""What the Render panel tells of a picture."""

from __future__ import annotations

from dataclasses import replace

from support.small_scenes import mixed_scene
from support.ui_harness import desk, frame_of, tell


def test_paths_that_ended_in_glass_are_told_where_they_are_many() -> None:
    with desk(mixed_scene(size=(48, 32))) as user:
        user.panel("Render")
        frame = frame_of(user.editor.view)
        for share, is_told in ((0.0, False), (0.009, False), (0.032, True), (0.0, False)):
            tell(user, replace(frame, cut_off=share))
            assert user.shows("Speed") and user.shows("Ended in glass") == is_told


def test_memory_of_textures_is_told_once_there_is_a_picture() -> None:
    with desk(mixed_scene(size=(48, 32))) as user:
        user.panel("Render")
        assert not user.shows("Textures")
        tell(user, frame_of(user.editor.view))
        assert user.shows("Textures")
