"""Which objects and lights are selected: names in the order of selecting, the last of them the active one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from incpt.scene.model import Scene


@dataclass(frozen=True)
class Selection:
    """Names of objects and lights, each once. The active one, the last, is what the inspector shows."""

    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        # The later place counts, so that adding a name makes it active.
        latest = dict.fromkeys(reversed(self.names))
        object.__setattr__(self, "names", tuple(reversed(latest)))

    def __bool__(self) -> bool:
        return bool(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    @property
    def active(self) -> str | None:
        """The object selected last, or None."""
        return self.names[-1] if self.names else None

    def clicked(self, name: str | None, additive: bool) -> Selection:
        """After a click on an object, or on none. `additive` (Shift, Ctrl) makes it the active one beside the
        others, or takes it out where it is that already, as in Blender; a click on nothing deselects all
        unless it is additive."""
        if additive and name is not None:
            return self.toggled(name) if name == self.active else Selection((*self.names, name))
        if additive:
            return self
        return Selection() if name is None else Selection((name,))

    def toggled(self, name: str) -> Selection:
        """With that name if it was not selected, else without it."""
        if name in self.names:
            return Selection(tuple(n for n in self.names if n != name))
        return Selection((*self.names, name))

    def boxed(self, names: Sequence[str], takes_out: bool) -> Selection:
        """With all of those names, the last of them active, or without them."""
        if takes_out:
            return Selection(tuple(name for name in self.names if name not in names))
        return Selection((*self.names, *names)) if names else self

    def extended(self, name: str, order: Sequence[str]) -> Selection:
        """With everything between the active name and that one in a list, as by Shift."""
        if self.active not in order:
            return Selection((name,))
        first, last = order.index(self.active), order.index(name)
        between = order[min(first, last) : max(first, last) + 1]
        return Selection((*self.names, *between, name))

    def renamed(self, old: str, new: str) -> Selection:
        """The same objects after one was given another name."""
        return Selection(tuple(new if n == old else n for n in self.names))

    def within(self, scene: Scene) -> Selection:
        """Without the names that are not in the scene; the same Selection where all are."""
        kept = tuple(n for n in self.names if n in scene.object_index or n in scene.light_index)
        return self if kept == self.names else Selection(kept)

    @classmethod
    def all_of(cls, scene: Scene) -> Selection:
        """Every object and light that is shown."""
        return cls(tuple(one.name for one in scene.everything if one.visible))
