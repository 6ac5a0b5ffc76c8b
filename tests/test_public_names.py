"""The public names: the same for programs, type checkers and documents, and enough to use what they name."""

from __future__ import annotations

import ast
import inspect
import re
import typing
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import incpt

ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "benchmarks/README.md", "incpt/__init__.py")


def test_type_checkers_read_the_names_that_programs_get() -> None:
    tree = ast.parse((ROOT / "incpt" / "__init__.py").read_text("utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If) and isinstance(node.test, ast.Name))
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    assert len(imports) == len(block.body)
    # Type checkers take `A as A` for a public name, and a plain `A` not.
    found = {
        alias.name: f"{node.module}" for node in imports for alias in node.names if alias.asname == alias.name
    }
    assert found == {name: f"incpt.{home}" for name, home in incpt._HOMES.items()}


@pytest.mark.parametrize("name", incpt.__all__)
def test_a_name_is_what_its_module_defines(name: str) -> None:
    value = getattr(incpt, name)
    assert value is getattr(import_module(f"incpt.{incpt._HOMES[name]}"), name)
    assert value.__module__ == f"incpt.{incpt._HOMES[name]}" and value.__doc__
    assert name in dir(incpt)


def test_other_names_are_refused() -> None:
    with pytest.raises(AttributeError, match="module 'incpt' has no attribute 'Sesion'"):
        incpt.Sesion  # noqa: B018


@pytest.mark.parametrize("document", DOCUMENTS)
def test_documents_use_names_that_there_are(document: str) -> None:
    text = (ROOT / document).read_text("utf-8")
    blocks = re.findall(r"```(?:py|python)\n(.*?)```", text, re.DOTALL)
    used = {name for block in blocks for name in re.findall(r"\bincpt\.(\w+)", block)}
    assert used <= set(incpt.__all__)
    assert bool(used) == (document in ("README.md", "incpt/__init__.py"))


MADE_BY_INCPT = {"Change", "FirstHits", "Mode", "Snapshot", "StepReport"}
"""Values that nobody else makes."""


def _functions(value: Any) -> list[Any]:
    """A function itself, or the public methods of a class."""
    if not inspect.isclass(value):
        return [inspect.unwrap(value)]
    members = inspect.getmembers(value, lambda member: inspect.isfunction(member) or inspect.ismethod(member))
    return [member for name, member in members if name == "__init__" or not name.startswith("_")]


def _named(hint: Any) -> Iterator[type]:
    """The classes of incpt in an annotation."""
    if inspect.isclass(hint) and hint.__module__.startswith("incpt."):
        yield hint
    for part in typing.get_args(hint):
        yield from _named(part)


@pytest.mark.parametrize("name", sorted(set(incpt.__all__) - MADE_BY_INCPT))
def test_what_a_public_call_takes_has_a_public_name(name: str) -> None:
    for function in _functions(getattr(incpt, name)):
        hints = typing.get_type_hints(function)
        taken = {one.__name__ for key, hint in hints.items() if key != "return" for one in _named(hint)}
        assert taken <= set(incpt.__all__), function
