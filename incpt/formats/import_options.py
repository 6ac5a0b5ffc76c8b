"""How files are read, where there is a choice: what a user asks for when a scene is opened.

It is set around a call, as a report is gathered around one, because it belongs to the opening as a whole, of
which most readers know nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from types import NoneType

from incpt.core.checks import require_bool
from incpt.scene.checks import LARGEST, set_number


@dataclass(frozen=True)
class ImportOptions:
    """time            seconds into the animations of a file; None: as the file stands without them
    allow_outside   whether a glTF file may name files outside its own folder
    """

    time: float | None = None
    allow_outside: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.time, NoneType):
            set_number(self, "time", 0.0, LARGEST)
        require_bool("allow_outside", self.allow_outside)


_DEFAULT = ImportOptions()
_options: ContextVar[ImportOptions] = ContextVar("options", default=_DEFAULT)


@contextmanager
def reading_with(options: ImportOptions) -> Iterator[None]:
    """Inside, files are read with these options."""
    token = _options.set(options)
    try:
        yield
    finally:
        _options.reset(token)


def current_options() -> ImportOptions:
    """Those that files are read with here."""
    return _options.get()
