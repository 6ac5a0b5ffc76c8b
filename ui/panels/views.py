"""The saved views of a scene: going to one, saving, renaming and deleting."""

from __future__ import annotations

from dataclasses import dataclass

from incpt.ui.widgets import widgets


@dataclass(frozen=True)
class Outcome:
    """What the user asked for: a view to go to, by name, to save the present one, or to rename or delete the
    one that was gone to last."""

    go: str | None = None
    is_save: bool = False
    is_rename: bool = False
    is_delete: bool = False


def draw(names: tuple[str, ...], last: str | None) -> Outcome:
    """The saved views; `last` is the one that was gone to last, if any."""
    options = [(name, name) for name in names]
    shown = last if last in names else ""
    chosen = widgets.choice("Saved view", shown, options, "Kept on this computer, beside the scene file")
    with widgets.row(""):
        is_save = widgets.button("Save view##views", "The view as it is now, under a name")
    with widgets.row(""):
        is_rename = widgets.button("Rename…##views", enabled=bool(shown))
        widgets.same_line()
        is_delete = widgets.button("Delete##views", enabled=bool(shown))
    return Outcome(chosen if chosen != shown else None, is_save, is_rename, is_delete)
