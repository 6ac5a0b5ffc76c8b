"""Commands on what the window shows around the picture."""

from __future__ import annotations

from dataclasses import replace

from incpt.ui.editor.editor import Editor

_WAY_BACK = "Esc goes back to the panels"


def switch_panel(editor: Editor, name: str) -> None:
    """Show a panel, or no longer."""
    hidden = set(editor.preferences.hidden_panels) ^ {name}
    editor.preferences = replace(editor.preferences, hidden_panels=tuple(hidden))


def switch_alone(editor: Editor) -> None:
    """Leave the whole window to the picture, or bring back what is around it."""
    if editor.screen.is_alone:
        show_panels(editor)
    else:
        editor.screen = replace(editor.screen, is_alone=True)
        editor.say(_WAY_BACK, "done")


def switch_full_screen(editor: Editor) -> None:
    """Leave the whole screen to the picture, or go back to the window as it was."""
    if editor.screen.is_full_screen:
        show_panels(editor)
    else:
        editor.screen = replace(editor.screen, is_alone=True, is_full_screen=True)
        editor.say(_WAY_BACK, "done")


def show_panels(editor: Editor) -> None:
    """Bring back what is around the picture, in a window."""
    editor.screen = replace(editor.screen, is_alone=False, is_full_screen=False)


def reset_layout(editor: Editor) -> None:
    """All panels as at the first start."""
    editor.preferences = replace(editor.preferences, hidden_panels=())
    editor.screen = replace(editor.screen, wants_first_layout=True)
