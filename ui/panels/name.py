"""Which object or light the panel of the object shows."""

from __future__ import annotations

from incpt.ui.widgets import widgets


def draw_hint() -> None:
    """What to do where nothing is selected."""
    widgets.note("Select an object or a light: click it in the picture or in the outliner.")


def draw(name: str, selected: int) -> str | None:
    """The name of the active one of so many selected objects; returns another one when it was typed."""
    typed = widgets.text("Name", name)
    if typed is None and selected > 1:
        widgets.note(f"{selected:,} are selected; what is changed below is changed for all of them.")
    return typed
