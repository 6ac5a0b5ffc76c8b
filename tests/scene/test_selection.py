from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.selection import Selection
from incpt.scene.shapes import shape

names = st.text("abc", min_size=1, max_size=2)
selections = st.lists(names).map(lambda chosen: Selection(tuple(chosen)))
SCENE = Scene(
    materials={"m": Material()},
    objects=tuple(Object(name, shape("cube"), "m", visible=name != "b") for name in "abc"),
)


def test_nothing_is_selected_at_first() -> None:
    assert not Selection() and len(Selection()) == 0 and Selection().active is None


@given(st.lists(names))
def test_names_are_unique_and_the_last_is_active(chosen: list[str]) -> None:
    selection = Selection(tuple(chosen))
    assert sorted(selection) == sorted(set(chosen))
    assert selection.active == (chosen[-1] if chosen else None)


@given(selections, names)
def test_a_click_selects_that_object_alone(selection: Selection, name: str) -> None:
    assert selection.clicked(name, additive=False) == Selection((name,))
    assert selection.clicked(None, additive=False) == Selection()


@given(selections, names)
def test_an_additive_click_makes_active_and_keeps_the_others(selection: Selection, name: str) -> None:
    clicked = selection.clicked(name, additive=True)
    assert (name in clicked) == (name != selection.active)
    assert [n for n in clicked if n != name] == [n for n in selection if n != name]
    assert name not in clicked or clicked.active == name
    assert selection.clicked(None, additive=True) is selection


@given(selections, st.lists(names, unique=True))
def test_a_box_adds_or_takes_out_all_of_its_names(selection: Selection, chosen: list[str]) -> None:
    added = selection.boxed(chosen, takes_out=False)
    assert set(added) == {*selection, *chosen} and (not chosen or added.active == chosen[-1])
    taken = selection.boxed(chosen, takes_out=True)
    assert taken.names == tuple(name for name in selection if name not in chosen)


@given(selections, names, names)
def test_renaming_keeps_the_place(selection: Selection, old: str, new: str) -> None:
    renamed = selection.renamed(old, new)
    assert old == new or old not in renamed
    if old in selection and new not in selection:
        assert renamed.names.index(new) == selection.names.index(old) and len(renamed) == len(selection)


def test_names_that_left_the_scene_are_dropped() -> None:
    kept = Selection(("b", "a"))
    assert kept.within(SCENE) is kept
    assert Selection(("b", "x", "a")).within(SCENE) == kept


def test_all_are_those_that_are_shown() -> None:
    assert Selection.all_of(SCENE).names == ("a", "c")


def test_shift_takes_everything_in_between() -> None:
    order = ("a", "b", "c", "d")
    assert Selection(("b",)).extended("d", order).names == ("b", "c", "d")
    assert Selection(("c",)).extended("a", order).names == ("b", "c", "a")
    assert Selection(("d", "b")).extended("c", order).names == ("d", "b", "c")
    assert Selection().extended("c", order).names == ("c",)
    assert Selection(("gone",)).extended("c", order).names == ("c",)
