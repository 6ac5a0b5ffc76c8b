"""The source of the editor: short functions, and who may know whom beyond the layers of import-linter."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import incpt.ui

FOLDER = Path(incpt.ui.__path__[0])


def test_no_function_is_long() -> None:
    too_long = []
    for path in sorted(FOLDER.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                length = (node.end_lineno or 0) - node.lineno + 1
                if length > 42:
                    too_long.append(f"{path.name}: {node.name} has {length} lines")
    assert too_long == []


RENDERER = ("moderngl", "glfw", "incpt.viewer.threaded", "incpt.render.session", "incpt.device")


@pytest.mark.parametrize(
    ("folder", "forbidden"),
    [
        ("widgets", (*RENDERER, "incpt.ui.editor", "incpt.scene")),
        ("panels", (*RENDERER, "incpt.ui.display", "incpt.ui.editor.editor")),
        ("dialogs", (*RENDERER, "incpt.ui.display", "incpt.ui.editor.editor")),
        ("viewport", ("moderngl", "glfw", "incpt.render.session", "incpt.device", "incpt.ui.editor.editor")),
    ],
)
def test_what_draws_values_knows_no_editor_and_no_renderer(folder: str, forbidden: tuple[str, ...]) -> None:
    for path in (FOLDER / folder).glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom):
                for name in node.names:
                    assert not f"{node.module}.{name.name}".startswith(forbidden), path
