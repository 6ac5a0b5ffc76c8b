"""Undo and redo against a naive model that keeps every step in two stacks."""

from __future__ import annotations

from dataclasses import dataclass

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from incpt.scene.history import MAX_ENTRIES, History
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

START = Scene(materials={"grey": Material()}, objects=(Object("cube", shape("cube"), "grey"),))


def moved(x: float) -> Scene:
    return START.with_object("cube", position=(x, 0, 0))


def test_a_drag_is_one_entry() -> None:
    history = History(START)
    for x in (1, 2, 3):
        history.propose(moved(x), "Move cube", "gizmo", selection=("cube",))
        assert history.before is START
    history.settle()
    assert history.before is None and history.scene == moved(3) and history.undo_label == "Move cube"
    assert history.undo() == ("cube",) and history.scene is START and not history.can_undo
    assert history.redo() == ("cube",) and history.scene == moved(3) and not history.can_redo


def test_undo_during_a_drag_takes_the_drag_back() -> None:
    history = History(START)
    history.propose(moved(1), "Move", "gizmo")
    assert history.can_undo and history.undo_label == "Move"
    history.undo()
    assert history.scene is START and history.before is None and history.redo_label == "Move"


def test_a_drag_that_ends_where_it_began_leaves_no_entry_and_keeps_redo() -> None:
    history = History(START)
    history.propose(moved(1), "Move")
    history.undo()
    history.propose(moved(2), "Drag", "gizmo")
    assert not history.can_redo
    history.propose(moved(0), "Drag", "gizmo")
    assert history.can_redo
    history.settle()
    assert not history.can_undo and history.redo_label == "Move"


def test_cancel_returns_to_the_scene_before_the_drag() -> None:
    history = History(START)
    history.propose(moved(1), "Drag", "gizmo")
    history.cancel()
    assert history.scene is START and history.before is None and not history.can_undo
    history.cancel()
    assert history.scene is START


def test_another_key_begins_another_entry() -> None:
    history = History(START)
    history.propose(moved(1), "Drag x", "x")
    history.propose(moved(2), "Drag y", "y")
    assert history.before == moved(1)
    history.undo()
    assert history.scene == moved(1) and history.undo_label == "Drag x" and history.redo_label == "Drag y"


def test_selections_come_back() -> None:
    history = History(START)
    history.propose(START.without_object("cube"), "Delete", selection=("cube",), selection_after=())
    assert history.undo() == ("cube",)
    assert history.redo() == ()
    assert history.redo() is None


def test_the_oldest_entries_are_dropped() -> None:
    history = History(START)
    for x in range(1, MAX_ENTRIES + 11):
        history.propose(moved(x), f"Move {x}")
    undone = 0
    while history.undo() is not None:
        undone += 1
    assert undone == MAX_ENTRIES and history.scene == moved(10)


@dataclass
class Step:
    before: Scene
    after: Scene
    label: str


positions = st.integers(0, 3)
keys = st.sampled_from(["gizmo", "field", "camera"])


class Undoing(RuleBasedStateMachine):
    """The model: done and undone steps as two stacks, and the drag under way as (key, before, after)."""

    def __init__(self) -> None:
        super().__init__()
        self.history = History(START)
        self.scene = START
        self.done: list[Step] = []
        self.undone: list[Step] = []
        self.drag: tuple[str, Step] | None = None

    def push(self, step: Step) -> None:
        if step.before != step.after:
            self.done.append(step)
            self.undone.clear()

    def end_drag(self) -> None:
        if self.drag is not None:
            self.push(self.drag[1])
            self.drag = None

    @rule(x=positions)
    def edit(self, x: int) -> None:
        self.end_drag()
        self.push(Step(self.scene, moved(x), f"edit {x}"))
        self.scene = moved(x)
        self.history.propose(moved(x), f"edit {x}")

    @rule(x=positions, key=keys)
    def drag_to(self, x: int, key: str) -> None:
        if self.drag is None or self.drag[0] != key:
            self.end_drag()
            self.drag = (key, Step(self.scene, moved(x), key))
        else:
            self.drag[1].after = moved(x)
        self.scene = moved(x)
        self.history.propose(moved(x), key, key)

    @rule()
    def settle(self) -> None:
        self.end_drag()
        self.history.settle()

    @precondition(lambda self: self.drag is not None)
    @rule()
    def cancel(self) -> None:
        assert self.drag is not None
        self.scene, self.drag = self.drag[1].before, None
        self.history.cancel()

    @rule()
    def undo(self) -> None:
        self.end_drag()
        if self.done:
            self.undone.append(self.done.pop())
            self.scene = self.undone[-1].before
        self.history.undo()

    @rule()
    def redo(self) -> None:
        self.end_drag()
        if self.undone:
            self.done.append(self.undone.pop())
            self.scene = self.done[-1].after
        self.history.redo()

    @invariant()
    def agrees(self) -> None:
        step = None if self.drag is None else self.drag[1]
        changes = step is not None and step.before != step.after
        assert self.history.scene == self.scene
        assert self.history.before == (None if step is None else step.before)
        assert self.history.can_undo == (bool(self.done) or changes)
        assert self.history.can_redo == (bool(self.undone) and not changes)
        label = step.label if step is not None and changes else self.done[-1].label if self.done else None
        assert self.history.undo_label == label
        assert self.history.redo_label == (self.undone[-1].label if self.history.can_redo else None)


TestUndoing = Undoing.TestCase
TestUndoing.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
