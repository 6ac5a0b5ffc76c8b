"""The command line: what it writes, what it says, and how it ends."""

from __future__ import annotations

import errno
import importlib
import os
import signal
import subprocess
import sys
import types
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import PIL.Image
import pytest
from support.gltf_files import GltfBuilder

from incpt.cli.console import PathProgress, interruption, path_progress
from incpt.cli.main import main
from incpt.core.errors import DeviceError, OutputError
from incpt.device.device import all_devices
from incpt.formats import registry, scene_save
from incpt.picture import denoise
from incpt.picture.tone_mapping import tone_map
from incpt.render.session import Session, StepReport

SCENE = """
version = 1
[environment]
color = [0.5, 0.6, 0.7]
[render]
size = [40, 24]
max_bounces = 1
tile_size = 8
[materials.red]
base_color = [0.8, 0.1, 0.1]
[[objects]]
name = "red cube"
shape = "cube"
position = [0, 1, 0]
material = "red"
"""


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return path


def run(*arguments: object) -> int:
    return main([str(argument) for argument in arguments])


def read_exr(path: Path) -> np.ndarray:
    return np.asarray(OpenEXR.File(str(path)).channels()["RGB"].pixels)


def only_line(text: str) -> str:
    (line,) = text.splitlines()
    return line


# ------------------------------------------------------------------------------------------- render


@pytest.mark.slow
def test_render_puts_aovs_into_an_exr(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("render", scene_file, "-o", tmp_path / "a.exr", "--spp", 1, "--aovs") == 0
    channels = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).channels()
    scene = registry.load(scene_file)
    session = Session(scene, settings=replace(scene.settings, aovs=True))
    session.render(1)
    expected = session.first_hits()
    ids = np.asarray(channels["object_id"].pixels)
    np.testing.assert_array_equal(ids.view(np.int32), expected.object_id)
    assert set(np.unique(ids)) == {0, 0xFFFFFFFF}
    np.testing.assert_array_equal(np.asarray(channels["depth.Z"].pixels), expected.depth)
    # Base colours and normals are those of the samples, which differ from pixel centres along outlines.
    for layer, axes in (("albedo", "RGB"), ("normal", "XYZ")):
        planes = [np.asarray(channels[f"{layer}.{axis}"].pixels) for axis in axes]
        np.testing.assert_array_equal(np.stack(planes, axis=2), session.pass_image(layer))
    assert (session.pass_image("normal") != expected.normal).any()
    capsys.readouterr()
    assert run("render", scene_file, "-o", tmp_path / "a.png", "--aovs") == 2
    assert "--aovs: " in capsys.readouterr().err and not (tmp_path / "a.png").exists()


@pytest.mark.slow
def test_a_scene_that_asks_for_aovs_needs_no_option(scene_file: Path, tmp_path: Path) -> None:
    scene = registry.load(scene_file)
    scene_save.save(replace(scene, settings=replace(scene.settings, aovs=True)), tmp_path / "b.toml")
    for file, has_layers in ((tmp_path / "b.toml", True), (scene_file, False)):
        assert run("render", file, "-o", tmp_path / "a.exr", "--spp", 1) == 0
        layers = OpenEXR.File(str(tmp_path / "a.exr")).channels()
        assert ({"albedo", "normal.X", "depth.Z", "object_id"} <= set(layers)) == has_layers
    assert run("render", tmp_path / "b.toml", "-o", tmp_path / "a.png", "--spp", 1) == 0


@pytest.mark.slow
def test_render_writes_what_the_session_renders(scene_file: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.exr"
    assert run("render", scene_file, "-o", output, "--spp", 4) == 0
    session = Session(registry.load(scene_file))
    session.render(4)
    assert np.array_equal(read_exr(output), session.image())


def test_the_command_line_wins_over_the_scene(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "out.png"
    arguments = ("--size", "33x17", "--seed", 3, "--max-bounces", 0, "--strategy", "restart", "--spp", 3)
    assert run("render", scene_file, "-o", output, *arguments) == 0
    assert PIL.Image.open(output).size == (33, 17)
    assert only_line(capsys.readouterr().out) == f"{output}: 33 x 17, 3 samples per pixel"


def test_a_camera_is_chosen_by_its_name(scene_file: Path, tmp_path: Path) -> None:
    scene = registry.load(scene_file).with_camera("top", position=(0, 9, 0.1))
    two = tmp_path / "two.toml"
    scene_save.save(scene, two)
    assert run("render", two, "-o", tmp_path / "a.exr", "--spp", 1, "--camera", "top") == 0
    session = Session(scene.with_active_camera("top"))
    session.render(1)
    assert np.array_equal(read_exr(tmp_path / "a.exr"), session.image())
    assert run("render", two, "-o", tmp_path / "b.exr", "--camera", "side") == 2


@pytest.mark.slow
def test_the_seed_chooses_the_samples(scene_file: Path, tmp_path: Path) -> None:
    pictures = []
    for seed, name in ((0, "a"), (0, "b"), (1, "c")):
        assert run("render", scene_file, "-o", tmp_path / f"{name}.exr", "--seed", seed, "--spp", 1) == 0
        pictures.append(read_exr(tmp_path / f"{name}.exr"))
    assert np.array_equal(pictures[0], pictures[1])
    assert not np.array_equal(pictures[0], pictures[2])


def test_ctrl_c_keeps_what_is_done(
    scene_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    advance = PathProgress.advance
    calls: list[int] = []

    def press_in_third_step(self: PathProgress, paths: int) -> None:
        advance(self, paths)
        calls.append(paths)
        if len(calls) == 3:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(PathProgress, "advance", press_in_third_step)
    output = tmp_path / "out.exr"
    assert run("render", scene_file, "-o", output, "--spp", 1000) == 130
    assert "stopped at 3 of 1000" in only_line(capsys.readouterr().err)
    session = Session(registry.load(scene_file))
    session.render(3)
    assert np.array_equal(read_exr(output), session.image())


def test_the_second_ctrl_c_does_not_wait() -> None:
    before = signal.getsignal(signal.SIGINT)
    with interruption() as stop:
        signal.raise_signal(signal.SIGINT)
        assert stop.requested
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            stop.check()
    assert signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_outside_of_a_step(
    scene_file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(registry, "load_with_report", interrupted)
    assert run("check", scene_file) == 130
    assert only_line(capsys.readouterr().err) == "incpt: stopped"


def test_samples_that_are_not_finite_are_told(
    scene_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    step = Session.step

    def step_with_bad_samples(self: Session, slots: int | None = None) -> StepReport:
        report = step(self, slots)
        return StepReport(**{**vars(report), "nonfinite": 7})

    monkeypatch.setattr(Session, "step", step_with_bad_samples)
    assert run("render", scene_file, "-o", tmp_path / "out.png", "--spp", 2) == 0
    assert "14 samples were not finite" in only_line(capsys.readouterr().err)


@pytest.mark.parametrize(("passages", "is_told"), [(0, True), (12, False)])
def test_paths_that_ended_in_glass_are_told(
    passages: int, is_told: bool, scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    glass = SCENE.replace("max_bounces = 1", f"max_bounces = 1\ntransmission_bounces = {passages}")
    scene_file.write_text(glass.replace("base_color = [0.8, 0.1, 0.1]", "transmission = 1\nroughness = 0"))
    assert run("render", scene_file, "-o", tmp_path / "out.png", "--spp", 2) == 0
    told = capsys.readouterr().err
    if is_told:
        assert "% of the paths ended in glass; raise transmission_bounces" in only_line(told)
    else:
        assert told == ""


def test_the_bar_shows_rate_and_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich takes it for a terminal
    with path_progress("rendering", 1000, 100) as progress:
        progress.advance(250)
        progress.describe("something else")
        (task,) = progress._progress.tasks
    assert (task.completed, task.total, task.fields["spp"]) == (250, 1000, "2 spp")
    assert task.fields["rate"].endswith(" Mpaths/s")
    assert task.description == "something else"


# ------------------------------------------------------------------------------------ errors, one line


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["render", "missing.toml", "-o", "out.png"], 2, "missing.toml: no such file"),
        (["render", "scene.toml", "-o", "out.jpg"], 2, "use .exr or .png"),
        (["render", "scene.toml", "-o", "nowhere/out.png"], 1, "nowhere: no such folder"),
        (["render", "scene.toml", "-o", "folder.png"], 1, "is a folder"),
        (["render", "scene.toml"], 2, "-o"),
        (["render"], 2, "scene_file"),
        (["rendr"], 2, "rendr"),
        (["render", "scene.toml", "-o", "out.png", "--ssp", "3"], 2, "--ssp"),
        (["render", "scene.toml", "-o", "out.png", "--spp", "0"], 2, "--spp"),
        (["render", "scene.toml", "-o", "out.png", "--spp", "many"], 2, "--spp"),
        (["render", "scene.toml", "-o", "out.png", "--size", "40"], 2, "write it like 960x540"),
        (["render", "scene.toml", "-o", "out.png", "--size", "0x40"], 2, "--size (width): 0"),
        (["render", "scene.toml", "-o", "out.png", "--size", "999999x999999"], 2, "--size"),
        (["render", "scene.toml", "-o", "out.png", "--strategy", "zigzag"], 2, "restart, spiral"),
        (["render", "scene.toml", "-o", "out.png", "--max-bounces", "-1"], 2, "--max-bounces: -1"),
        (["render", "scene.toml", "-o", "out.png", "--seed", "-1"], 2, "--seed"),
        (["render", "scene.toml", "-o", "out.png", "--device", "abacus"], 2, "abacus"),
        (["devices", "--device", "99"], 2, "99"),
        (["check", "folder.png"], 2, "folder.png"),
        (["replay", "scene.toml", "missing.toml", "-o", "out"], 2, "missing.toml"),
        (["replay", "scene.toml", "edits.toml", "-o", "scene.toml"], 1, "scene.toml: cannot be made"),
        (["replay", "scene.toml", "edits.toml", "-o", "out", "--strategy", "zigzag"], 2, "--strategy"),
        (["replay", "scene.toml", "edits.toml", "-o", "out", "--nor", "0"], 2, "--nor: 0"),
    ],
)
def test_errors_are_one_line_and_leave_nothing(
    scene_file: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    status: int,
    said: str,
) -> None:
    monkeypatch.chdir(scene_file.parent)
    Path("folder.png").mkdir()
    Path("edits.toml").write_text('[[edits]]\nobject = "red cube"\nposition = [0, 0, 0]\n')
    before = sorted(Path().iterdir())
    assert main(arguments) == status
    captured = capsys.readouterr()
    assert said in only_line(captured.err)
    assert captured.err.startswith("incpt: ")
    assert captured.out == ""
    assert sorted(Path().iterdir()) == before


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (DeviceError("no device;\nbuy one"), 1, "no device; buy one"),
        (OutputError("disk full"), 1, "disk full"),
        (OSError(errno.ENOSPC, "No space left on device", "out.png"), 1, "out.png: No space left"),
        (MemoryError(), 1, "memory ran out"),
        (ZeroDivisionError("oops"), 1, "unexpected ZeroDivisionError: oops; --debug"),
    ],
)
def test_failures_are_one_line(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: Exception,
    status: int,
    said: str,
) -> None:
    def fail(*_: object, **options: object) -> None:
        raise error

    monkeypatch.setattr(registry, "load_with_report", fail)
    assert run("check", "scene.toml") == status
    assert said in only_line(capsys.readouterr().err)
    assert run("check", "scene.toml", "--debug") == status
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission(scene_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = scene_file.parent / "locked"
    folder.mkdir(mode=0o500)
    assert run("render", scene_file, "-o", folder / "out.png") == 1
    assert "cannot be written" in only_line(capsys.readouterr().err)


def test_input_warnings_are_one_line(scene_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene_file.write_text("version = 1\n")
    assert run("check", scene_file) == 0
    assert all(line.startswith("incpt: warning: ") for line in capsys.readouterr().err.splitlines())


# ----------------------------------------------------------------------------------- other commands


def test_devices_lists_and_tries(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("devices", "--test") == 0
    out = capsys.readouterr().out
    assert out.count("taken") == 1
    assert "the kernels build and run" in out


def test_a_linker_that_is_not_there(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    if not any("PoCL 3." in one.platform.version for one in all_devices()[:1]):
        pytest.skip("only PoCL 3 asks for it")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert run("devices", "--test") == 1
    assert "apt install gcc libc6-dev" in only_line(capsys.readouterr().err)


def test_check_tells_what_is_in_a_scene(scene_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("check", scene_file) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"{scene_file}: valid"
    assert "  objects: 1" in lines


def test_check_takes_a_mesh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mesh = tmp_path / "one.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert run("check", mesh) == 0
    assert "1 triangles placed" in capsys.readouterr().out


GLTF = GltfBuilder()
QUAD = GLTF.quad()


def gltf_file(folder: Path) -> Path:
    """A file of which two things are left out."""
    points, lines = ({**QUAD, "mode": mode} for mode in (0, 1))
    return GLTF.write(folder / "a.glb", [QUAD, points, lines])


def test_check_tells_what_became_of_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = gltf_file(tmp_path)
    assert run("check", path) == 0
    said = capsys.readouterr()
    assert said.out.endswith(
        f"{path}:\n  left out: points of mesh 'mesh 0': have no area\n"
        "  left out: lines of mesh 'mesh 0': have no area\n  read: 1 object, 1 mesh\n"
    )
    assert said.err == ""


@pytest.mark.parametrize("command", ["check", "render"])
def test_strict_refuses_what_is_not_read_whole(
    tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    more = ("-o", tmp_path / "a.png") if command == "render" else ()
    path = gltf_file(tmp_path)
    assert run(command, path, *more, "--strict") == 2
    assert only_line(capsys.readouterr().err) == (
        f"incpt: {path}: left out points of mesh 'mesh 0': have no area (and 1 more); "
        "leave --strict away to go on without"
    )
    assert not (tmp_path / "a.png").exists()
    assert run("check", GLTF.write(tmp_path / "whole.glb", [QUAD]), "--strict") == 0


@pytest.mark.slow
def test_frames_are_the_pictures_of_their_times(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A quad moves by a morph target, so that its mesh is another one in each frame, with the same faces. It
    is seen through a camera of the file; without one, as in the first frame."""
    quad = {**QUAD, "targets": [{"POSITION": GLTF.accessor(np.float32([[0, 1, 0]] * 4))}]}
    times, weights = (GLTF.accessor(np.float32(values)) for values in ([0, 1], [0, 1]))
    channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
    more = {
        "meshes": [{"primitives": [quad], "weights": [0]}],
        "animations": [{"samplers": [{"input": times, "output": weights}], "channels": [channel]}],
    }
    seen = {
        "nodes": [{"mesh": 0}, {"camera": 0, "name": "camera", "translation": [0, 0, 5]}],
        "scenes": [{"nodes": [0, 1]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
    }
    options = ("--spp", 2, "--size", "16x16")
    for name, camera in (("seen", seen), ("framed", {})):
        path = GLTF.write(tmp_path / f"{name}.glb", [quad], **more, **camera)
        assert run("render", path, "-o", tmp_path / "f.exr", "--frames", "0-2", "--fps", 2, *options) == 0
        frames = [read_exr(tmp_path / f"f.000{number}.exr") for number in range(3)]
        assert run("render", path, "-o", tmp_path / "t.exr", "--time", 1, *options) == 0
        assert not np.array_equal(frames[0], frames[2])
        assert np.array_equal(read_exr(tmp_path / "t.exr"), frames[2]) == (name == "seen")
    capsys.readouterr()
    for wrong, said in (("4-2", "is no first and last frame"), ("all", "is no first"), ("1-2", "--time: ")):
        time = ("--time", 1) if wrong == "1-2" else ()
        assert run("render", path, "-o", tmp_path / "f.exr", "--frames", wrong, *time) == 2
        assert said in only_line(capsys.readouterr().err)


@pytest.mark.slow
def test_render_tells_once_what_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = gltf_file(tmp_path)
    assert run("render", path, "-o", tmp_path / "a.png", "--spp", 1, "--size", "8x8") == 0
    assert only_line(capsys.readouterr().err) == (
        f"incpt: warning: {path}: left out points of mesh 'mesh 0': have no area "
        "(and 1 more; `incpt check` tells all)"
    )


@pytest.mark.parametrize(
    ("option", "said"), [("--version", "incpt "), ("--help", "replay"), ("-h", "replay")]
)
def test_version_and_help(option: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(option) == 0
    assert said in capsys.readouterr().out


@pytest.mark.slow
def test_it_runs_as_a_module() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "incpt", "check", "nothing.toml"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert only_line(done.stderr).startswith("incpt: nothing.toml: no such file")


# ------------------------------------------------------------- the doors to the editor and benchmarks


@pytest.mark.parametrize(
    ("arguments", "module", "passed_on"),
    [
        ([], "incpt.ui.app", (None, None)),
        (["edit"], "incpt.ui.app", (None, None, {"up": None, "unit": None})),
        (
            ["edit", "a.toml", "--device", "0"],
            "incpt.ui.app",
            (Path("a.toml"), "0", {"up": None, "unit": None}),
        ),
        (
            ["edit", "a.stl", "--up", "z", "--unit", "mm"],
            "incpt.ui.app",
            (Path("a.stl"), None, {"up": "z", "unit": 0.001}),
        ),
        (["bench", "rays", "-h"], "incpt.benchmarks.main", (["rays", "-h"],)),
    ],
)
def test_editor_and_benchmarks_are_entered(
    monkeypatch: pytest.MonkeyPatch, arguments: list[str], module: str, passed_on: tuple[Any, ...]
) -> None:
    received: list[Any] = []
    fake = types.ModuleType(module)
    fake.main = lambda *given: received.append(given) or 5  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module, fake)
    assert main(arguments) == 5
    assert received == [passed_on]


def test_an_editor_without_a_library_of_the_system(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def find(name: str) -> None:
        raise ImportError("libGL.so.1: cannot open shared object file: No such file or directory")

    monkeypatch.setattr(importlib, "import_module", find)
    assert main(["edit"]) == 1
    line = only_line(capsys.readouterr().err)
    assert "libGL.so.1" in line and "libgl1" in line


@pytest.mark.parametrize(
    ("missing", "said"),
    [
        ("incpt.ui.app", "the editor: is not part of this installation"),
        ("incpt.ui", "the editor: is not part of this installation"),
        ("moderngl", 'moderngl is not installed; run pip install "incpt[ui]"'),
    ],
)
def test_an_editor_that_is_not_there(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], missing: str, said: str
) -> None:
    def find(name: str) -> None:
        raise ModuleNotFoundError(name=missing)

    monkeypatch.setattr(importlib, "import_module", find)
    assert main(["edit"]) == 1
    assert said in only_line(capsys.readouterr().err)


# ------------------------------------------------------------------------------------------ denoise


def half_as_bright(image: np.ndarray, albedo: np.ndarray, normal: np.ndarray) -> np.ndarray:
    assert albedo.shape == normal.shape == image.shape and albedo.any()
    return image / 2


@pytest.mark.slow
def test_a_denoised_picture_is_shown_in_png_and_a_layer_of_exr(
    scene_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(denoise, "is_available", lambda: True)
    monkeypatch.setattr(denoise, "denoise", half_as_bright)
    for suffix in ("exr", "png"):
        assert run("render", scene_file, "-o", tmp_path / f"a.{suffix}", "--spp", 2, "--denoise") == 0
    channels = OpenEXR.File(str(tmp_path / "a.exr")).channels()
    rendered, shown = (np.asarray(channels[name].pixels) for name in ("RGB", "denoised"))
    session = Session(registry.load(scene_file))
    session.render(2)
    np.testing.assert_array_equal(rendered, session.image())
    # So few samples are all noise.
    np.testing.assert_allclose(shown, rendered / 2, rtol=1e-4, atol=1e-6)
    assert {"albedo", "normal.X", "depth.Z"}.isdisjoint(channels)
    with PIL.Image.open(tmp_path / "a.png") as file:
        assert np.abs(np.asarray(file).astype(int) - tone_map(shown)).max() <= 1
    assert run("render", scene_file, "-o", tmp_path / "b.exr", "--spp", 256, "--denoise") == 0
    channels = OpenEXR.File(str(tmp_path / "b.exr")).channels()
    rendered, shown = (np.asarray(channels[name].pixels) for name in ("RGB", "denoised"))
    # Many have nearly none, so that next to nothing is taken of what has another brightness.
    assert 0.99 < shown.mean() / rendered.mean() <= 1


def test_without_the_denoiser_nothing_is_rendered(
    scene_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(denoise, "is_available", lambda: False)
    assert run("render", scene_file, "-o", tmp_path / "a.png", "--denoise") == 2
    assert 'pip install "incpt[denoise]"' in only_line(capsys.readouterr().err)
    assert not (tmp_path / "a.png").exists()
