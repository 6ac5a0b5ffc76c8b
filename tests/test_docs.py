"""The manual: it says what the program has, its examples run, and its links lead somewhere."""

from __future__ import annotations

import ast
import os
import re
import shlex
import sys
import tomllib
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import PIL.Image
import pytest

if not os.environ.get("CI"):
    pytest.importorskip("imgui_bundle", reason="the editor's packages are not installed")

from reference import meanings, options, pages, scene_keys

import incpt
from incpt.benchmarks.main import app as bench_app
from incpt.core.settings import RenderSettings
from incpt.formats import edit_script, scene_toml, textures
from incpt.formats.edit_script import load_edits
from incpt.formats.gltf.document import MATERIAL_EXTENSIONS
from incpt.scene.camera import Camera

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = pages.pages()
LINKED = [*PAGES, ROOT / "README.md"]
PIECE = re.compile(r"<!-- from the program: .*?<!-- end -->", re.DOTALL)
BLOCK = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)


def name_of(page: Path) -> str:
    return page.stem


def blocks(text: str, language: str) -> list[str]:
    return [content for found, content in BLOCK.findall(text) if found == language]


def section(page: str, heading: str) -> str:
    """What stands below a heading of any level, up to the next."""
    text = BLOCK.sub("", (DOCS / page).read_text("utf-8"))
    (found,) = re.findall(rf"^#+ {re.escape(heading)}\n(.*?)(?=^#|\Z)", text, re.DOTALL | re.MULTILINE)
    return str(found)


def first_cells(text: str) -> set[str]:
    """The pieces of code in the first column of the tables of a text."""
    rows = [line.split(" | ")[0] for line in text.splitlines() if line.startswith("| `")]
    return set(chain.from_iterable(re.findall(r"`([^`]+)`", row) for row in rows))


# ------------------------------------------------------------------------- what is made from the program


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_a_page_says_what_the_program_has(page: Path) -> None:
    if page.stem == "editor" and sys.platform == "darwin":
        pytest.skip("keys are printed otherwise on a Mac")
    text = page.read_text("utf-8")
    assert pages.rewritten(text) == text, "run ./run docs"


def test_every_piece_stands_in_the_manual_once() -> None:
    used = [name for page in PAGES for name in pages.named(page.read_text("utf-8"))]
    assert sorted(used) == sorted(pages.PIECES)


def test_what_has_gone_stale_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- from the program: shapes -->\nold\n<!-- end -->\nafter\n", "utf-8")
    monkeypatch.setattr(pages, "FOLDER", tmp_path)
    assert pages.main(["--check"]) == 1
    assert "old" in page.read_text("utf-8")
    assert pages.main([]) == 0
    text = page.read_text("utf-8")
    assert '`"cube"`' in text and "old" not in text
    assert text.startswith("before\n") and text.endswith("\nafter\n")
    assert pages.main(["--check"]) == 0


KEYS = {
    "The file": scene_toml._TABLES,
    "Cameras": scene_toml.CAMERA_KEYS,
    "Environment": scene_toml.ENVIRONMENT_KEYS,
    "Sky": scene_toml.SKY_KEYS,
    "Rendering": RenderSettings.names(),
    "Materials": scene_toml.MATERIAL_KEYS,
    "Textures": textures._KEYS,
    "Objects": scene_toml._OBJECT_KEYS,
    "Lights": ("name", *scene_toml.LIGHT_KEYS),
    "Edit scripts": (*edit_script._FILE_KEYS, *edit_script._EDIT_KEYS, *edit_script.KINDS),
}


@pytest.mark.parametrize("heading", KEYS)
def test_every_key_of_scene_files_is_told(heading: str) -> None:
    assert first_cells(section("scene-file.md", heading)) == set(KEYS[heading])


def test_meanings_are_those_of_keys_that_there_are() -> None:
    assert set(meanings.MATERIAL) == set(scene_toml.MATERIAL_KEYS)
    assert set(meanings.ENVIRONMENT) == set(scene_toml.ENVIRONMENT_KEYS)
    assert set(meanings.OBJECT) == set(scene_toml._OBJECT_KEYS)
    assert set(meanings.LIGHT) <= {"name", *scene_toml.LIGHT_KEYS}
    assert set(meanings.CAMERA) <= set(scene_toml.CAMERA_KEYS)


def test_ranges_are_those_of_the_checks() -> None:
    assert scene_keys.allowed(Camera, "fov_y", 40.0) == "number, 0.01 to 179"
    assert scene_keys.allowed(Camera, "blades", 0) == "whole number, 0 to 64"
    assert scene_keys.allowed(Camera, "up", (0.0, 1.0, 0.0)) == "list of 3 numbers, each -1e9 to 1e9"
    assert scene_keys.allowed(Camera, "projection", "perspective") == '`"perspective"` or `"orthographic"`'


@pytest.mark.parametrize("command", options.OPTIONS)
def test_every_option_is_told(command: str) -> None:
    told = first_cells(section("command-line.md", f"incpt {command}"))
    for parameter in options.commands_of(options.app)[command].params:
        names = [parameter.name.upper()] if parameter.param_type_name == "argument" else parameter.opts
        assert told >= set(names)


def test_every_command_is_told() -> None:
    text = (DOCS / "command-line.md").read_text("utf-8")
    assert all(f"## incpt {name}\n" in text for name in options.commands_of(options.app))
    assert all(f"| `incpt bench {name}` |" in text for name in options.commands_of(bench_app))


def test_extensions_of_gltf_materials_are_told() -> None:
    assert first_cells(section("materials-and-lights.md", "glTF")) >= set(MATERIAL_EXTENSIONS)


def test_extras_are_told() -> None:
    with (ROOT / "pyproject.toml").open("rb") as file:
        extras = tomllib.load(file)["project"]["optional-dependencies"]
    table = section("index.md", "Install it without ./run")
    assert {name for name in re.findall(r"`(\w+)`", table) if name != "incpt"} == set(extras)


def test_citations_have_the_version_of_the_program() -> None:
    with (ROOT / "pyproject.toml").open("rb") as file:
        version = tomllib.load(file)["project"]["version"]
    assert f"version: {version}\n" in (ROOT / "CITATION.cff").read_text("utf-8")
    assert f"{{{version}}}" in (DOCS / "citing.md").read_text("utf-8")


# ----------------------------------------------------------------------------------------------- examples


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [page for page in PAGES if "```python" in page.read_text("utf-8")], ids=name_of
)
def test_examples_in_python_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scenes").symlink_to(ROOT / "scenes")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for number, block in enumerate(blocks(page.read_text("utf-8"), "python"), 1):
        exec(compile(block, f"{page.name}, example {number}", "exec"), names)


EXAMPLES = [
    pytest.param(block, id=f"{page.stem}-{number}")
    for page in LINKED
    for number, block in enumerate(blocks(page.read_text("utf-8"), "toml"), 1)
]


@pytest.mark.parametrize("block", EXAMPLES)
def test_examples_of_files_are_read(block: str, tmp_path: Path) -> None:
    for name in re.findall(r'"([\w.]+\.(?:png|jpg))"', block):
        PIL.Image.new("RGB", (2, 2)).save(tmp_path / name)
    path = tmp_path / "example.toml"
    if "[[edits]]" in block:
        path.write_text(block, "utf-8")
        (first, *_) = blocks((DOCS / "scene-file.md").read_text("utf-8"), "toml")
        scene_path = tmp_path / "scene.toml"
        scene_path.write_text(first, "utf-8")
        assert len(load_edits(path, incpt.load(scene_path))) == block.count("[[edits]]")
        return
    path.write_text(block if "version =" in block else f"version = {scene_toml.VERSION}\n{block}", "utf-8")
    assert scene_toml.load_scene_toml(path).cameras


def typed() -> Iterator[list[str]]:
    """The words of every command of incpt in the blocks for a shell."""
    for page in LINKED:
        for line in "\n".join(blocks(page.read_text("utf-8"), "sh")).splitlines():
            words = [word for word in shlex.split(line, comments=True) if "=" not in word]
            if words and words[0] in ("incpt", "./run"):
                yield words


def test_commands_that_are_shown_can_be_typed() -> None:
    known, own = options.commands_of(options.app), (ROOT / "run").read_text("utf-8")
    benches = options.commands_of(bench_app)
    found = list(typed())
    assert len(found) > 20
    for words in found:
        program, name, *rest = words
        if program == "./run" and name not in known:
            assert re.search(rf"^    {name}\)$", own, re.MULTILINE), words
            continue
        if name == "bench":
            assert not rest or rest[0] in benches, words
        parameters = benches[rest[0]].params if name == "bench" and rest else known[name].params
        allowed = {option for parameter in parameters for option in parameter.opts}
        assert {word for word in rest if word.startswith("-")} <= allowed, words
        assert all((ROOT / word).is_file() for word in rest if word.startswith("scenes/")), words


# ---------------------------------------------------------------------------------------- links and lines


def slug(heading: str) -> str:
    """The anchor of a heading, as Python-Markdown and GitHub make it of plain words."""
    return re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", heading.strip()).lower())


def anchors(page: Path) -> list[str]:
    text = BLOCK.sub("", page.read_text("utf-8"))
    return [slug(heading) for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE)]


def links(page: Path) -> Iterator[tuple[Path, str]]:
    """File and anchor of every link that leads to a file."""
    text = re.sub(r"``.*?``|`[^`\n]*`", "", BLOCK.sub("", page.read_text("utf-8")))
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if not target.startswith("https://"):
            name, _, anchor = target.partition("#")
            yield (page.parent / name).resolve() if name else page, anchor


@pytest.mark.parametrize("page", LINKED, ids=name_of)
def test_links_lead_somewhere(page: Path) -> None:
    found = list(links(page))
    for path, anchor in found:
        assert path.is_file(), path
        assert not anchor or anchor in anchors(path), f"{path}#{anchor}"
    assert found or page.stem in ("citing", "api", "devices")


def outside() -> set[Path]:
    """What the site has beside the pages, as docs/hooks.py says it. That imports mkdocs, which tests do
    without."""
    tree = ast.parse((DOCS / "hooks.py").read_text("utf-8"))
    (value,) = [
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "OUTSIDE"
    ]
    return {path for pattern in ast.literal_eval(value) for path in ROOT.glob(pattern)}


def test_the_site_has_what_pages_link_to() -> None:
    wanted = {path for page in PAGES for path, _ in links(page)}
    assert wanted <= {*PAGES, *outside()}


def test_headings_of_a_page_differ() -> None:
    for page in PAGES:
        found = anchors(page)
        assert len(set(found)) == len(found), page


def test_pages_are_reached() -> None:
    config = (ROOT / "mkdocs.yml").read_text("utf-8")
    assert all(f": {page.name}\n" in config for page in PAGES)


def said() -> str:
    """All texts in the code, with … for what is put into them."""
    found = []
    for path in chain((ROOT / "incpt").rglob("*.py"), (ROOT / "ui").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = (part.value if isinstance(part, ast.Constant) else "…" for part in node.values)
                found.append("".join(map(str, parts)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.append(node.value)
    return "\n".join(found)


def test_labels_of_the_editor_are_its_own() -> None:
    text = " ".join(PIECE.sub("", (DOCS / "editor.md").read_text("utf-8")).split())
    found = {label for bold in re.findall(r"\*\*(.+?)\*\*", text) for label in re.split(r" › | \+ ", bold)}
    # Names of menus stand before a slash, those that imgui tells widgets apart by behind two signs.
    texts = {part for text in said().splitlines() for part in re.split("/|##", text)}
    known = texts | {text.capitalize() for text in texts}
    assert len(found) > 50
    assert {label for label in found if label not in known and len(label) > 1} == set()


def test_lines_that_are_explained_are_said() -> None:
    text = (DOCS / "troubleshooting.md").read_text("utf-8")
    lines = [line.strip() for _, line in re.findall(r"^### (`+)(.*?)\1$", text, re.MULTILINE)]
    everything = said()
    assert len(lines) > 40
    assert [line for line in lines if line not in everything] == []
