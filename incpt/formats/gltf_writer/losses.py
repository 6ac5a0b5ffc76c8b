"""What glTF has no place for, told once for all things that lose the same: there may be thousands."""

from __future__ import annotations

from collections.abc import Iterable

from incpt.formats import import_report

_MOST_NAMES = 4


class Losses:
    """Notes what is lost of which things by their names."""

    def __init__(self) -> None:
        self._names: dict[tuple[str, str], list[str]] = {}
        self._glowing: dict[str, list[str]] = {}

    def note(self, kind: str, name: str, lost: Iterable[str]) -> None:
        """Notes what a thing of a kind ("camera") loses ("shift")."""
        for what in lost:
            self._names.setdefault((what, kind), []).append(name)

    def note_glowing(self, kind: str, name: str) -> None:
        """Notes a light of a kind that becomes a surface."""
        self._glowing.setdefault(kind, []).append(name)

    def tell(self) -> None:
        """Tells of all."""
        for (what, kind), names in self._names.items():
            import_report.left_out(f"the {what} of {kind} {_listed(names)}: glTF has no place for it")
        for kind, names in self._glowing.items():
            text = f"light {_listed(names)}: is a surface that glows, because glTF has no {kind}"
            import_report.changed(text)


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _MOST_NAMES:,} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(map(repr, names[:_MOST_NAMES])) + more
