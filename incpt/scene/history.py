"""Undo as a list of scenes with a cursor.

Scenes are immutable and share what an edit did not change, so keeping whole scenes costs what the edits
themselves made, nobody writes inverse operations, and undo cannot forget a part of an edit.

A drag is one entry: while it is under way its latest scene stands beside the list, not in it. It enters
the list when it is settled, so cancelling it, or ending it where it began, leaves the list and what can be
redone as they were.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from incpt.scene.model import Scene

Names = tuple[str, ...]

MAX_ENTRIES = 200
"""Edits that can be undone. Two scenes share every part that is the same in both, so an entry holds little
but the tuple of its objects and, at the worst, one new mesh or image: a count is a fair bound on memory."""


@dataclass(frozen=True)
class Entry:
    """A scene, the edit that led to it, and the names of the selected objects before and after that edit.

    `key` is what the edit belongs to while it is under way: a widget, the gizmo, a move of the camera.
    """

    scene: Scene
    label: str = ""
    key: str | None = None
    selection_before: Names = ()
    selection_after: Names = ()


class History:
    """The scene that is edited, and the scenes before and after it."""

    def __init__(self, scene: Scene) -> None:
        self._entries = [Entry(scene)]
        self._cursor = 0
        self._open: Entry | None = None

    @property
    def scene(self) -> Scene:
        """What is edited and shown now."""
        return self._open.scene if self._open is not None else self._entries[self._cursor].scene

    @property
    def before(self) -> Scene | None:
        """The scene before the entry under way, or None where none is."""
        return None if self._open is None else self._entries[self._cursor].scene

    @property
    def key(self) -> str | None:
        """The key of the entry under way, or None where none is."""
        return None if self._open is None else self._open.key

    def propose(
        self,
        scene: Scene,
        label: str,
        key: str | None = None,
        *,
        selection: Names = (),
        selection_after: Names | None = None,
    ) -> None:
        """Makes `scene` the current one.

        Without a key it is an entry of its own, settled at once. With a key it stays open until `settle`,
        `undo`, `redo` or a proposal under another key, and a proposal under the same key replaces it.
        `selection` is what was selected before the edit, `selection_after` what is selected after it
        (None: the same); undo and redo give them back.
        """
        after = selection if selection_after is None else selection_after
        if key is not None and self._open is not None and self._open.key == key:
            self._open = replace(self._open, scene=scene, label=label, selection_after=after)
            return
        self.settle()
        self._open = Entry(scene, label, key, selection, after)
        if key is None:
            self.settle()

    def settle(self) -> None:
        """Closes the entry under way: one whose scene equals the one before it is dropped, any other can
        be undone from now on, and what could be redone is forgotten."""
        entry, self._open = self._open, None
        if entry is None or entry.scene == self._entries[self._cursor].scene:
            return
        self._entries[self._cursor + 1 :] = [entry]
        del self._entries[: -(MAX_ENTRIES + 1)]
        self._cursor = len(self._entries) - 1

    def cancel(self) -> None:
        """Drops the entry under way: the scene is again what it was before it."""
        self._open = None

    @property
    def _changes(self) -> bool:
        return self._open is not None and self._open.scene != self._entries[self._cursor].scene

    @property
    def can_undo(self) -> bool:
        return self._cursor > 0 or self._changes

    @property
    def can_redo(self) -> bool:
        return self._cursor + 1 < len(self._entries) and not self._changes

    @property
    def undo_label(self) -> str | None:
        """What undo takes back, or None."""
        if self._open is not None and self._changes:
            return self._open.label
        return self._entries[self._cursor].label if self._cursor > 0 else None

    @property
    def redo_label(self) -> str | None:
        """What redo does again, or None."""
        return self._entries[self._cursor + 1].label if self.can_redo else None

    def undo(self) -> Names | None:
        """Takes the last edit back, after settling what is under way. Returns the selection from before
        that edit, or None where there is nothing to undo."""
        self.settle()
        if not self.can_undo:
            return None
        undone = self._entries[self._cursor]
        self._cursor -= 1
        return undone.selection_before

    def redo(self) -> Names | None:
        """Does the edit undone last again, after settling what is under way. Returns the selection from
        after that edit, or None where there is nothing to redo."""
        self.settle()
        if not self.can_redo:
            return None
        self._cursor += 1
        return self._entries[self._cursor].selection_after
