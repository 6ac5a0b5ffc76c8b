"""Commands that steer the renderer."""

from __future__ import annotations

from dataclasses import replace

from incpt.ui.editor.editor import Editor
from incpt.viewer.renderer import Pin


def match_window(editor: Editor) -> None:
    """Render as many pixels as the viewport shows."""
    if editor.screen.viewport_size is not None:
        settings = replace(editor.scene.settings, size=editor.screen.viewport_size)
        editor.propose(replace(editor.scene, settings=settings), "Match window")


def switch_pause(editor: Editor) -> None:
    """Stop rendering, or go on."""
    editor.control = replace(editor.control, paused=not editor.control.paused)


def pin(editor: Editor) -> None:
    """Measure errors against the picture as it is once it is whole, or stop measuring."""
    editor.renderer.request(Pin(not editor.rendering.is_pinned))


def pin_again(editor: Editor) -> None:
    """Measure errors against the picture of the scene as it is now, once that is whole."""
    editor.renderer.request(Pin(True))
