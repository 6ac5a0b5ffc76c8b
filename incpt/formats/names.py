"""Names that differ, for things of a file that may have any, or the same."""

from __future__ import annotations


class Names:
    """Gives each name once, and those that are `taken` never; counts on where one is used already."""

    def __init__(self, *taken: str) -> None:
        self._used = set(taken)
        self._counts: dict[str, int] = {}

    def new(self, wanted: str) -> str:
        """The wanted name, or "wanted.2" and so on."""
        return self._taken(wanted) if wanted not in self._used else self._counted(wanted, 2)

    def numbered(self, stem: str) -> str:
        """ "stem.1", then "stem.2" and so on."""
        return self._counted(stem, 1)

    def _counted(self, stem: str, first: int) -> str:
        # Where counting ended is kept, because thousands may want one name.
        count = max(first, self._counts.get(stem, 0) + 1)
        while f"{stem}.{count}" in self._used:
            count += 1
        self._counts[stem] = count
        return self._taken(f"{stem}.{count}")

    def _taken(self, name: str) -> str:
        self._used.add(name)
        return name
