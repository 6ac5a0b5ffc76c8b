"""Files that are missing: what stands for them, that saving keeps their names, and how they are found."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh

from incpt.core.errors import InputError
from incpt.formats import bitmaps, images, pack, registry, relink, scene_save
from incpt.formats.gltf_writer.export import export as write_gltf
from incpt.formats.import_report import Fate
from incpt.scene.model import Scene
from incpt.scene.texture import Bitmap

TEXT = """
version = 2
[environment]
image = "sky/even.exr"
[materials.wood]
base_color_texture = { file = "maps/wood.png", wrap = "mirror" }
normal_texture = "maps/bent.png"
[materials.grey]
roughness = 0.5
[[objects]]
name = "pair"
mesh = "models/two.glb"
material = "wood"
[[objects]]
name = "right"
mesh = "models/two.glb"
part = "right"
material = "grey"
position = [1, 2, 3]
"""


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    """A scene whose meshes and images are all there."""
    for name in ("sky", "maps", "models"):
        (tmp_path / "there" / name).mkdir(parents=True)
    images.write_exr(tmp_path / "there" / "sky" / "even.exr", {"RGB": np.full((2, 4, 3), 0.25)})
    for name in ("wood", "bent"):
        pixels = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
        bitmaps.write_bitmap(tmp_path / "there" / "maps" / f"{name}.png", Bitmap(pixels))
    boxes = trimesh.Scene()
    for name, x in (("left", -3), ("right", 3)):
        boxes.add_geometry(
            trimesh.creation.box(), name, transform=trimesh.transformations.translation_matrix([x, 0, 0])
        )
    boxes.export(tmp_path / "there" / "models" / "two.glb")
    path = tmp_path / "there" / "scene.toml"
    path.write_text(TEXT)
    return path


def lost(scene_file: Path, tmp_path: Path) -> tuple[Scene, Path]:
    """The scene opened where nothing is beside it, and the folder where that is now."""
    alone = tmp_path / "alone"
    alone.mkdir()
    shutil.copy(scene_file, alone / "scene.toml")
    return registry.load_with_report(alone / "scene.toml", allow_missing=True)[0], scene_file.parent


def opened(path: Path) -> Scene:
    return registry.load_with_report(path)[0]


def files_of(scene: Scene) -> dict[str, tuple[str, tuple[str, ...]]]:
    return {one.path.name: (one.kind, one.users) for one in relink.missing_files(scene)}


def test_placeholders_stand_for_what_is_missing_where_that_is_asked_for(
    scene_file: Path, tmp_path: Path
) -> None:
    scene, _ = lost(scene_file, tmp_path)
    with pytest.raises(InputError, match=r"\[environment\]: image: .*even.exr: no such file"):
        registry.load(tmp_path / "alone" / "scene.toml")
    assert files_of(scene) == {
        "two.glb": ("mesh", ("pair", "right")),
        "wood.png": ("texture", ("wood",)),
        "bent.png": ("texture", ("wood",)),
        "even.exr": ("environment", ()),
    }
    assert [o.name for o in scene.objects] == ["pair", "right"] and len(scene.objects[0].mesh.faces) == 12
    color, normal = scene.materials["wood"].base_color_texture, scene.materials["wood"].normal_texture
    assert (
        color is not None and color.bitmap.pixels.tolist() == [[[255, 0, 255]]] and color.wrap[0] == "mirror"
    )
    assert normal is not None and normal.bitmap.pixels.tolist() == [[[128, 128, 255]]]
    _, report = registry.load_with_report(tmp_path / "alone" / "scene.toml", allow_missing=True)
    told = [remark.text for remark in report.of(Fate.LEFT_OUT)]
    assert len(told) == 4 and all("no such file" in text and "stands for it" in text for text in told)
    assert registry.load_with_report(scene_file, allow_missing=True) == registry.load_with_report(scene_file)


def test_a_damaged_file_is_missing_too(scene_file: Path) -> None:
    (scene_file.parent / "maps" / "wood.png").write_bytes(b"no image")
    scene, _ = registry.load_with_report(scene_file, allow_missing=True)
    assert files_of(scene) == {"wood.png": ("texture", ("wood",))}


def test_saving_keeps_the_names_of_what_is_missing(scene_file: Path, tmp_path: Path) -> None:
    scene, there = lost(scene_file, tmp_path)
    scene_save.save(scene, tmp_path / "alone" / "again.toml")
    assert sorted(path.name for path in (tmp_path / "alone").iterdir()) == ["again.toml", "scene.toml"]
    shutil.copy(tmp_path / "alone" / "again.toml", there / "again.toml")
    assert opened(there / "again.toml") == opened(scene_file)


@pytest.mark.parametrize("chosen", ["two.glb", "wood.png", "bent.png", "even.exr"])
def test_what_lies_beside_the_chosen_file_is_found_with_it(
    scene_file: Path, tmp_path: Path, chosen: str
) -> None:
    scene, there = lost(scene_file, tmp_path)
    missing = next(one.path for one in relink.missing_files(scene) if one.path.name == chosen)
    found = relink.relinked(scene, missing, there / missing.parent.name / chosen)
    assert relink.missing_files(found) == ()
    whole = opened(scene_file)
    assert [o.name for o in found.objects] == ["pair/left", "pair/right", "right"]
    assert found == whole


def test_files_in_one_folder_are_found_by_their_names(scene_file: Path, tmp_path: Path) -> None:
    scene, there = lost(scene_file, tmp_path)
    heap = tmp_path / "heap"
    heap.mkdir()
    for name in ("maps/wood.png", "maps/bent.png", "sky/even.exr"):
        shutil.copy(there / name, heap)
    (heap / "wood.png").rename(heap / "oak.png")
    found = relink.relinked(scene, tmp_path / "alone" / "maps" / "wood.png", heap / "oak.png")
    assert files_of(found) == {"two.glb": ("mesh", ("pair", "right"))}
    texture = found.materials["wood"].base_color_texture
    assert texture is not None and texture.bitmap.source.file == str(heap / "oak.png")


def test_what_cannot_be_read_stays_missing(scene_file: Path, tmp_path: Path) -> None:
    scene, there = lost(scene_file, tmp_path)
    missing = tmp_path / "alone" / "maps" / "wood.png"
    with pytest.raises(InputError, match="no such file"):
        relink.relinked(scene, missing, there / "maps" / "nothing.png")
    (there / "maps" / "bent.png").write_bytes(b"no image")
    assert list(files_of(relink.relinked(scene, missing, there / "maps" / "wood.png"))) == ["bent.png"]


def test_a_scene_is_not_handed_over_with_placeholders(scene_file: Path, tmp_path: Path) -> None:
    scene, _ = lost(scene_file, tmp_path)
    for write, name in ((pack.pack, "packed.zip"), (write_gltf, "scene.glb")):
        with pytest.raises(InputError, match=r"two.glb and 3 more: cannot be read; find what is missing"):
            write(scene, tmp_path / name)
        assert not (tmp_path / name).exists()
