"""The public names: the same for programs, type checkers and documents, and enough to use what they name."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from pathlib import Path

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
