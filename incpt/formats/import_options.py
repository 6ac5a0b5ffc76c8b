"""How files are read, where there is a choice: what a user asks for when a scene is opened.

It is set around a call, as a report is gathered around one, because it belongs to the opening as a whole, of
which most readers know nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from types import NoneType

from incpt.core.checks import one_of, require, require_bool
from incpt.core.errors import InputError
from incpt.scene.checks import LARGEST, set_number

UP_AXES = ("y", "z")
SMALLEST_UNIT = 1e-6
"""Metres; a smaller one would flatten objects."""


@dataclass(frozen=True)
class ImportOptions:
    """time            seconds into the animations of a file; None: as the file stands without them
    allow_outside   whether files may name others outside their own folders
    up              the axis that is up in mesh files that do not say it, "y" or "z"; None: y
    unit            the metres of their unit; None: one
    clip            of several animations of a glTF file the name of the one that runs; None: all do at once
    parameters      values of parameters of Mitsuba scenes, by their names, in place of their defaults
    materials       whether mesh files bring their materials; scenes of other renderers have their own
    allow_missing   whether placeholders stand for meshes and images of a scene file that cannot be read; what
                    is read is the same, so that files are not read again for it
    """

    time: float | None = None
    allow_outside: bool = False
    up: str | None = None
    unit: float | None = None
    clip: str | None = None
    parameters: tuple[tuple[str, str], ...] = ()
    materials: bool = True
    allow_missing: bool = field(default=False, compare=False)

    def __post_init__(self) -> None:
        if not isinstance(self.time, NoneType):
            set_number(self, "time", 0.0, LARGEST)
        for name in ("allow_outside", "materials", "allow_missing"):
            require_bool(name, getattr(self, name))
        require("clip", self.clip, (str, NoneType), "the name of an animation")
        if self.clip is not None and self.time is None:
            raise InputError("clip: says what moves, and no time is given; give it one")
        for name, value in self.parameters:
            require("parameters", name, str, "a name")
            require("parameters", value, str, "a text; write numbers as texts, too")
        if self.up is not None:
            one_of("up", self.up, UP_AXES)
        if self.unit is not None:
            set_number(self, "unit", SMALLEST_UNIT, LARGEST)


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
