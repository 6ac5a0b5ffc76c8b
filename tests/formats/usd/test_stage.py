"""What USD files consist of: layers, references, files outside their folder, and damage."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from support.usd_files import METRES, QUAD_MESH, load_usda, write_usda

from incpt.core.errors import InputError
from incpt.formats import bitmaps, mesh_files, registry
from incpt.formats.import_report import Fate
from incpt.formats.registry import load_with_report
from incpt.scene.texture import Bitmap

pxr = pytest.importorskip("pxr")

from incpt.formats.usd import probe  # noqa: E402 (needs the library)
from incpt.formats.usd.memory import bounded_memory  # noqa: E402


def chair(folder: Path, name: str = "chair.usda") -> Path:
    folder.mkdir(exist_ok=True)
    return write_usda(folder / name, f'def Xform "chair" {{ {QUAD_MESH} }}', 'defaultPrim = "chair"')


def refers(asset: str, how: str = "references") -> str:
    return f'def "a" ({how} = @{asset}@) {{ }}'


def test_references_within_the_folder(tmp_path: Path) -> None:
    chair(tmp_path / "parts")
    scene, report = load_usda(tmp_path, refers("parts/chair.usda"))
    assert [one.name for one in scene.objects] == ["a/a/quad"] and report.is_whole
    assert mesh_files.load_file(tmp_path / "a.usda").files == (tmp_path / "parts" / "chair.usda",)


@pytest.mark.parametrize("how", ["references", "payload"])
def test_references_outside_the_folder_are_refused(tmp_path: Path, how: str) -> None:
    chair(tmp_path)
    (tmp_path / "scene").mkdir()
    with pytest.raises(InputError, match=r"a\.usda: '\.\./chair\.usda' leads out of the folder"):
        load_usda(tmp_path / "scene", refers("../chair.usda", how))
    scene, _ = load_usda(tmp_path / "scene", refers("../chair.usda", how), allow_outside=True)
    assert len(scene.objects) == 1


def test_sublayers_variants_and_links_outside_are_refused(tmp_path: Path) -> None:
    outside, folder = chair(tmp_path), tmp_path / "scene"
    folder.mkdir()
    with pytest.raises(InputError, match="leads out of the folder"):
        load_usda(folder, QUAD_MESH, f"{METRES}\nsubLayers = [@../chair.usda@]")
    # A variant that is not chosen counts too, because it is in the file.
    variants = f"""def "a" (variants = {{ string v = "one" }}
        prepend variantSets = "v") {{ {QUAD_MESH}
        variantSet "v" = {{ "one" {{ }} "two" (references = @../chair.usda@) {{ }} }} }}"""
    with pytest.raises(InputError, match="leads out of the folder"):
        load_usda(folder, variants)
    os.symlink(outside, folder / "link.usda")
    with pytest.raises(InputError, match="leads out of the folder"):
        load_usda(folder, refers("link.usda"))
    # One file on the way names the next.
    write_usda(folder / "between.usda", refers("../chair.usda"), 'defaultPrim = "a"')
    with pytest.raises(InputError, match="leads out of the folder"):
        load_usda(folder, refers("between.usda"))


def test_computed_names_outside_are_refused(tmp_path: Path) -> None:
    """Where a variable of one layer leads in another is known when they are composed."""
    chair(tmp_path)
    folder = tmp_path / "scene"
    chair(folder, "inner.usda")
    (folder / "between.usda").write_text("""#usda 1.0
(
    defaultPrim = "a"
    expressionVariables = {
        string WHERE = "inner"
    }
)
def "a" (references = @`"${WHERE}.usda"`@) {
}
""")
    head = METRES + '\nexpressionVariables = {\nstring WHERE = "%s"\n}'
    assert len(load_usda(folder, refers("between.usda"), head % "inner")[0].objects) == 1
    with pytest.raises(InputError, match="leads out of the folder"):
        load_usda(folder, refers("between.usda"), head % "../chair")


def test_a_file_of_the_working_folder_is_outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The library looks there for names without a folder."""
    chair(tmp_path / "elsewhere")
    monkeypatch.chdir(tmp_path / "elsewhere")
    (tmp_path / "scene").mkdir()
    with pytest.raises(InputError, match="leads out of the folder"):
        load_usda(tmp_path / "scene", refers("chair.usda"))


def test_textures_outside_are_left_out(tmp_path: Path) -> None:
    from support.usd_files import bound_quad, preview_surface, uv_texture

    (tmp_path / "image.png").write_bytes(b"secret")
    (tmp_path / "scene").mkdir()
    color = "color3f inputs:diffuseColor.connect = </look/image.outputs:rgb>"
    body = preview_surface(color, uv_texture("../image.png")) + bound_quad()
    _, report = load_usda(tmp_path / "scene", body)
    assert "leads out of the folder" in report.of(Fate.LEFT_OUT)[0].text


def test_names_of_windows_and_old_bindings(tmp_path: Path) -> None:
    """Exporters write backslashes, and bind materials without the schema for it; nothing is lost."""
    from support.usd_files import bound_quad, preview_surface, uv_texture

    (tmp_path / "textures").mkdir()
    bitmaps.write_bitmap(tmp_path / "textures" / "a.png", Bitmap(np.zeros((1, 1, 3), np.uint8)))
    color = "color3f inputs:diffuseColor.connect = </look/image.outputs:rgb>"
    quad = bound_quad().replace('(prepend apiSchemas = ["MaterialBindingAPI"])', "")
    scene, report = load_usda(tmp_path, preview_surface(color, uv_texture(r".\textures\a.png")) + quad)
    assert report.is_whole and scene.materials["look"].base_color_texture is not None


def test_what_is_missing_is_said(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    _, report = load_usda(tmp_path, f"{QUAD_MESH}\n{refers('gone.usda')}")
    (said,) = [one.text for one in report.of(Fate.LEFT_OUT)]
    assert said.startswith("In </a>: Could not open asset @gone.usda@ for reference")
    assert capfd.readouterr() == ("", "")


def test_other_files_beside_are_read_anew(tmp_path: Path) -> None:
    part = chair(tmp_path)
    load_usda(tmp_path, refers("chair.usda"))
    part.write_text(part.read_text().replace("(1, 1, 0)", "(1, 9, 0)"))
    scene, _ = load_with_report(tmp_path / "a.usda")
    assert scene.objects[0].world_bounds[1, 1] == 9


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        (
            "a.usda",
            b"#usda 1.0\ndef Mesh {",
            r"is no USD file, or a damaged one \(a\.usda, line 2: not understood",
        ),
        ("a.usda", b"hello", "is no USD file, or a damaged one"),
        ("a.usdc", b"PXR-USDC" + bytes(200), "is no USD file, or a damaged one"),
        ("a.usdz", b"PK\3\4" * 20, "is no USD file, or a damaged one"),
        ("a.usd", bytes(100), "is no USD file, or a damaged one"),
        ("a.usda", f"#usda 1.0\n({METRES.replace('1', '0')}\n)\n".encode(), "metersPerUnit: 0 is no unit"),
    ],
)
def test_damaged_files_are_one_line(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=rf"{name}: {message}") as raised:
        load_with_report(tmp_path / name)
    assert "\n" not in str(raised.value)


def test_without_the_library_it_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "find_spec", lambda name: None)
    path = write_usda(tmp_path / "a.usda", QUAD_MESH)
    with pytest.raises(
        InputError, match=r'cannot be read without a library; run: pip install "incpt\[usd\]"'
    ):
        load_with_report(path)


def crate(folder: Path) -> Path:
    from pxr import Sdf

    text = write_usda(folder / "a.usda", QUAD_MESH)
    assert Sdf.Layer.FindOrOpen(str(text)).Export(str(folder / "a.usdc"))
    return folder / "a.usdc"


def test_counts_that_lie_take_no_memory(tmp_path: Path) -> None:
    """Of the tokens of a crate file, as its table of contents places them: 100 GB of them."""
    path = crate(tmp_path)
    content = bytearray(path.read_bytes())
    table = int.from_bytes(content[16:24], "little")
    count = int.from_bytes(content[table : table + 8], "little")
    sections = [content[table + 8 + 32 * i : table + 40 + 32 * i] for i in range(count)]
    (tokens,) = (one for one in sections if one.startswith(b"TOKENS\0"))
    place = int.from_bytes(tokens[16:24], "little")
    content[place + 8 : place + 16] = (100 << 30).to_bytes(8, "little")
    path.write_bytes(content)
    with pytest.raises(InputError, match="damaged"):
        load_with_report(path)


def test_what_would_end_the_process_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(probe, "_PROGRAM", "import os; os.abort()")
    with pytest.raises(InputError, match=r"a\.usdc: asks for more than can be in files of its size"):
        load_with_report(crate(tmp_path))
    load_with_report(tmp_path / "a.usda")
    monkeypatch.setattr(probe, "_PROGRAM", "import time; time.sleep(60)")
    monkeypatch.setattr(probe, "_SECONDS", 0.1)
    with pytest.raises(InputError, match=r"takes more than 0\.1 seconds to open"):
        load_with_report(tmp_path / "a.usdc")


@pytest.mark.skipif(sys.platform != "linux", reason="other systems bound no memory")
def test_memory_is_bounded_while_values_are_read() -> None:
    with bounded_memory(0), pytest.raises(MemoryError):
        np.empty(4 << 30, np.uint8)
    assert len(np.empty(4 << 30, np.uint8)) == 4 << 30
