"""Along what a transform is held while it is under way: one axis, or the plane of the other two."""

from __future__ import annotations

from dataclasses import dataclass, replace

AXES = "XYZ"


@dataclass(frozen=True)
class AxisConstraint:
    """`axis` is 0, 1 or 2. `is_plane`: everything but along it. `is_local`: of each object's own axes."""

    axis: int
    is_plane: bool = False
    is_local: bool = False

    @property
    def free(self) -> tuple[int, ...]:
        """The axes along which something may happen."""
        others = tuple(axis for axis in range(3) if axis != self.axis)
        return others if self.is_plane else (self.axis,)

    @property
    def text(self) -> str:
        """In words: "along global X"; a plane is said by the axis that it locks, as in Blender."""
        space = "local" if self.is_local else "global"
        return f"{'locking' if self.is_plane else 'along'} {space} {AXES[self.axis]}"


def after_key(current: AxisConstraint | None, axis: int, is_plane: bool) -> AxisConstraint | None:
    """After a press of the key of an axis: the axis of the world, pressed again the object's own, pressed a
    third time none."""
    pressed = AxisConstraint(axis, is_plane)
    if current == pressed:
        return replace(pressed, is_local=True)
    return None if current == replace(pressed, is_local=True) else pressed
