"""The anchor: the scene that the kept picture is of, with which edited scenes are compared.

Each edit is compared afresh with the anchor, not with the edit before it: in a drag of twenty steps the
errors of twenty comparisons would pile up (docs of the strategy, section "Drags"). The same objects edited
once more keep the anchor, also after the drag. Where others are edited, the picture as it is shown becomes
the anchor: it is *folded*.
"""

from __future__ import annotations

from dataclasses import dataclass

from incpt.render.plan import CountArray
from incpt.scene.change import affected_objects, diff
from incpt.scene.light import Light
from incpt.scene.model import Placed, Scene

SURROUNDINGS = ""
"""The environment, among names of objects, which have at least a letter."""


@dataclass(frozen=True, eq=False)
class Anchor:
    """The scene that the film's radiance is of, and the samples (tiles,) that each tile of it is worth."""

    scene: Scene
    worth: CountArray

    def looks_like(self, scene: Scene) -> bool:
        """Whether `scene` gives the same picture."""
        change = diff(self.scene, scene)
        return not change.is_global and not affected_objects(self.scene, scene, change)

    def affected(self, scene: Scene) -> tuple[Placed, ...]:
        """The objects and lights that look different in `scene`, as they are here and as they are there,
        without those that are far away."""
        return affected(self.scene, scene)

    def touched(self, scene: Scene) -> frozenset[str]:
        """See `touched`."""
        return touched(self.scene, scene)

    def serves(self, scene: Scene, edited: Scene) -> bool:
        """Whether an edit that makes `edited` of `scene` changes only what differs from the anchor already,
        so that the anchor serves for what comes as well."""
        return touched(scene, edited) <= self.touched(scene)


def affected(old: Scene, new: Scene) -> tuple[Placed, ...]:
    """The objects and lights that look different in both scenes, as they are in each, without those that are
    far away."""
    found = affected_objects(old, new, diff(old, new))
    return tuple(one for one in found if not (isinstance(one, Light) and one.is_far))


def touched(old: Scene, new: Scene) -> frozenset[str]:
    """The names of the objects and lights that differ, or that wear a material that does; and SURROUNDINGS,
    if they differ."""
    change = diff(old, new)
    wearing = {obj.name for scene in (old, new) for obj in scene.objects if obj.material in change.materials}
    around = {SURROUNDINGS} if change.surroundings else set()
    return change.objects | change.lights | wearing | around
