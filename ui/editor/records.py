"""What the renderer's frames told over time: the values that the plots show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from incpt.viewer.view import Frame

_MOST_POINTS = 600
"""How many values of a quantity are kept."""


@dataclass(frozen=True)
class Series:
    """The last values of a quantity: y over x, both as they came."""

    x: tuple[float, ...] = ()
    y: tuple[float, ...] = ()

    def with_point(self, x: float, y: float) -> Series:
        """With one more value; the oldest goes where there are too many."""
        return Series((*self.x, x)[-_MOST_POINTS:], (*self.y, y)[-_MOST_POINTS:])


@dataclass(frozen=True)
class Records:
    """What is plotted.

    step_ms  step times in milliseconds, over seconds of the editor's clock.
    errors   for each strategy the error over its own rendering time, since the last change of the scene.
    """

    step_ms: Series = Series()
    errors: Mapping[str, Series] = field(default_factory=dict)
    _last: Frame | None = None

    def with_frame(self, frame: Frame, at: float) -> Records:
        """With what a frame told that came at that time; the same frame twice counts once."""
        if frame is self._last:
            return self
        is_same_scene = self._last is not None and self._last.view.scene is frame.view.scene
        is_kept = is_same_scene and len(self.errors) == len(frame.pictures)
        errors = dict(self.errors) if is_kept else {}
        for side, picture in enumerate(frame.pictures):
            if picture.error is not None:
                name = picture.strategy if side or len(frame.pictures) == 1 else "restart (left)"
                series = errors.get(name, Series())
                if not series.x or series.x[-1] < picture.seconds:
                    errors[name] = series.with_point(picture.seconds, picture.error)
        return replace(
            self, step_ms=self.step_ms.with_point(at, frame.step_seconds * 1e3), errors=errors, _last=frame
        )
