"""Which edits keep the anchor."""

from __future__ import annotations

import numpy as np
from support.small_scenes import mixed_scene

from incpt.render.impact.anchor import Anchor

BEFORE = mixed_scene()
ANCHOR = Anchor(BEFORE, np.zeros(1, np.int64))


def test_the_same_object_again_keeps_the_anchor() -> None:
    once = BEFORE.with_object("red cube", position=(0.2, 0.5, 0.4))
    again = once.with_object("red cube", position=(0.3, 0.5, 0.4), visible=False)
    assert ANCHOR.serves(once, again)
    assert {obj.name for obj in ANCHOR.affected(once)} == {"red cube"} and len(ANCHOR.affected(once)) == 2


def test_another_object_does_not() -> None:
    once = BEFORE.with_object("red cube", position=(0.2, 0.5, 0.4))
    assert not ANCHOR.serves(once, once.with_object("grey drum", position=(0.3, 0.5, 0.4)))


def test_a_material_stands_for_the_objects_that_wear_it() -> None:
    name = BEFORE.object("red cube").material
    wearing = {obj.name for obj in BEFORE.objects if obj.material == name}
    moved = BEFORE.with_object("red cube", position=(0.2, 0.5, 0.4))
    recoloured = moved.with_material(name, base_color=(0.1, 0.2, 0.3))
    assert ANCHOR.serves(moved, recoloured) == (wearing == {"red cube"})
    once = BEFORE.with_material(name, base_color=(0.1, 0.2, 0.3))
    assert ANCHOR.serves(once, once.with_object("red cube", position=(0.2, 0.5, 0.4)))


def test_undone_is_unaffected() -> None:
    once = BEFORE.with_object("red cube", position=(0.2, 0.5, 0.4))
    undone = once.with_object("red cube", position=BEFORE.object("red cube").transform.position)
    assert ANCHOR.serves(once, undone) and ANCHOR.affected(undone) == ()
