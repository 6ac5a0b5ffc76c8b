"""What is installed: one import package with everything in it, and a renderer without a window."""

from __future__ import annotations

import ast
import subprocess
import sys
import zipfile
from importlib import resources
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
WINDOW = {"glfw", "imgui_bundle", "moderngl"}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Names of the files in a wheel that is built from this checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    # Of a copy: setuptools leaves build/ and egg-info in the folder that it builds.
    names = [ROOT / name for name in ("pyproject.toml", "README.md", "LICENSE")]
    names += [ROOT / name for name in ("incpt", "cl", "ui", "scenes", "benchmarks")]
    copy = folder / "incpt"
    copy.mkdir()
    subprocess.run(["cp", "-r", *map(str, names), str(copy)], check=True)
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--quiet", "-w", str(folder), str(copy)]
    try:
        import setuptools

        if int(setuptools.__version__.split(".")[0]) >= 77:
            command.insert(4, "--no-build-isolation")
    except ImportError:
        pass
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    (path,) = folder.glob("*.whl")
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


@pytest.mark.slow
def test_wheel_has_one_package(wheel: list[str]) -> None:
    top = {name.split("/")[0] for name in wheel}
    assert {name for name in top if not name.endswith(".dist-info")} == {"incpt"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("folder", "pattern"),
    [
        ("cl", "**/*.cl"),
        ("scenes", "*.toml"),
        ("incpt", "**/*.py"),
        ("ui", "**/*.py"),
        ("benchmarks", "**/*.py"),
        ("benchmarks", "**/*.cl"),
        ("incpt", "py.typed"),
    ],
)
def test_wheel_has_every_file(wheel: list[str], folder: str, pattern: str) -> None:
    prefix = "incpt" if folder == "incpt" else f"incpt/{folder}"
    found = (ROOT / folder).glob(pattern)
    expected = {f"{prefix}/{path.relative_to(ROOT / folder).as_posix()}" for path in found}
    assert expected
    assert expected <= set(wheel)


@pytest.mark.slow
def test_wheel_has_what_the_scenes_name(wheel: list[str]) -> None:
    ours = [path for path in (ROOT / "scenes").iterdir() if path.is_file()]
    assert {f"incpt/scenes/{path.name}" for path in ours} <= set(wheel)


def test_kernels_and_scenes_are_found_as_resources() -> None:
    assert (resources.files("incpt.cl") / "path/generate.cl").is_file()
    assert any(item.name.endswith(".toml") for item in resources.files("incpt.scenes").iterdir())


@pytest.mark.slow
def test_importing_incpt_opens_no_window_library() -> None:
    code = "import sys, incpt.cli.main; from incpt import *; print(*sys.modules)"
    modules = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    loaded = {name.split(".")[0] for name in modules.split()} | set(modules.split())
    assert "incpt.cli.main" in loaded
    assert not loaded & (WINDOW | {"incpt.ui", "incpt.benchmarks"})


LATE = ("trimesh", "scipy", "OpenEXR", "PIL", "tomlkit", "rich", "typer")
"""Libraries that only some files and the command line need."""


SCENES_ONLY = "import incpt; incpt.Scene(); incpt.load, incpt.save, incpt.RenderSettings()"
HELP = "from incpt.cli.main import main; main(['--help']); main(['--version']); main(['render', '--help'])"


@pytest.mark.parametrize(
    ("code", "absent", "present"),
    [
        ("import incpt", {*LATE, "numpy", "pyopencl"}, {"incpt"}),
        (HELP, {*LATE, "numpy", "pyopencl"} - {"typer"}, {"typer"}),
        (SCENES_ONLY, {*LATE, "pyopencl"}, {"numpy"}),
        ("from incpt import *", set(LATE), {"numpy", "pyopencl"}),
    ],
)
def test_libraries_are_loaded_when_they_are_needed(code: str, absent: set[str], present: set[str]) -> None:
    code += "\nimport sys; print('loaded:', *sys.modules)"
    output = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    loaded = set(output.rpartition("loaded:")[2].split())
    assert not loaded & absent and present <= loaded


WITHOUT_LIBRARIES = f"""
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {LATE}:
            raise ModuleNotFoundError(f"no {{name}}", name=name)

sys.meta_path.insert(0, Missing())
import incpt

lamp = incpt.Material(emission=(1, 1, 1))
scene = incpt.Scene(
    incpt.Camera((0, 0, 3), (0, 0, 0)),
    materials={{"lamp": lamp}},
    objects=[incpt.Object("cube", incpt.shape("cube"), "lamp")],
)
session = incpt.Session(scene, size=(16, 16))
session.render(spp=1)
print(session.image()[8, 8, 0], incpt.tone_map(session.image()).shape)
try:
    incpt.write_png("a.png", session.image())
except ModuleNotFoundError as error:
    print(error)
"""


def test_a_scene_made_in_python_is_rendered_without_these_libraries(tmp_path: Path) -> None:
    command = [sys.executable, "-c", WITHOUT_LIBRARIES]
    run = subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True)
    assert run.stdout.splitlines() == ["1.0 (16, 16, 3)", "no PIL"]


def test_no_module_names_the_window() -> None:
    for path in (ROOT / "incpt").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                names = {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names = {f"{node.module}.{alias.name}" for alias in node.names}
            else:
                continue
            for name in names:
                assert not name.startswith(("incpt.ui", "incpt.benchmarks")), path
                assert name.split(".")[0] not in WINDOW, path
