"""OpenEXR files of every kind, and other images, as environments."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import OpenImageIO
import PIL.Image
import pytest
from hypothesis import given
from hypothesis import strategies as st

from incpt.core.errors import InputError
from incpt.formats import bitmaps, images, import_report, insert
from incpt.formats.import_report import Fate
from incpt.picture.color import REC_709, linear_from_srgb, rec709_from_rgb, xyz_from_rgb
from incpt.scene.model import Scene

REC_2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
ACES = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)


def written(path: Path, channels: dict[str, Any], **header: Any) -> Path:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    OpenEXR.File(header, channels).write(str(path))
    return path


def flat(*color: float, size: tuple[int, int] = (8, 16)) -> np.ndarray:
    return np.broadcast_to(np.float32(color), (*size, len(color))).copy()


def told(path: Path, fate: Fate = Fate.CHANGED) -> list[str]:
    with import_report.gathered() as found:
        images.load_image(path)
    return [remark.text for remark in found.report.of(fate)]


def test_primaries_become_those_of_rec_709(tmp_path: Path) -> None:
    path = written(tmp_path / "a.exr", {"RGB": flat(0.6625, 0.1616, 0.06997)}, chromaticities=REC_2020)
    (text,) = told(path)
    assert text == "colours: converted to the primaries and the white of Rec. 709"
    np.testing.assert_allclose(images.load_image(path).pixels[3, 3], (1, 0.1, 0.05), atol=1e-3)
    same = written(tmp_path / "b.exr", {"RGB": flat(0.5, 0.2, 0.1)}, chromaticities=REC_709)
    assert told(same) == []
    np.testing.assert_array_equal(images.load_image(same).pixels, flat(0.5, 0.2, 0.1))


def test_an_image_that_is_in_use_tells_again(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    PIL.Image.new("RGB", (4, 2), (9, 9, 9)).save(path)
    with import_report.gathered() as first:
        image = images.load_image(path)
    with import_report.gathered() as second:
        assert images.load_image(path) is image
    assert first.report == second.report and len(first.report.of(Fate.CHANGED)) == 1


def test_colours_that_rec_709_has_not_are_clipped_and_told(tmp_path: Path) -> None:
    pixels = flat(0.2, 0.2, 0.2)
    pixels[:2] = (0, 1, 0)
    path = written(tmp_path / "a.exr", {"RGB": pixels}, chromaticities=REC_2020)
    (text,) = told(path)
    assert text.endswith("; 25 % of the pixels are beyond them, and clipped")
    assert images.load_image(path).pixels.min() == 0


def test_the_matrix_is_that_of_the_standards() -> None:
    np.testing.assert_allclose(
        xyz_from_rgb(REC_709), [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]],
        atol=2e-4,
    )  # fmt: skip
    np.testing.assert_allclose(rec709_from_rgb(REC_709), np.eye(3), atol=1e-12)
    # ITU-R BT.2407, and the matrix of ACES's reference implementation (ACES 2065-1 to Rec. 709, Bradford).
    np.testing.assert_allclose(
        rec709_from_rgb(REC_2020),
        [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]], atol=2e-4,
    )  # fmt: skip
    np.testing.assert_allclose(
        rec709_from_rgb(ACES),
        [[2.5217, -1.1341, -0.3876], [-0.2765, 1.3727, -0.0962], [-0.0154, -0.1530, 1.1684]], atol=1e-3,
    )  # fmt: skip


@given(st.lists(st.floats(0.05, 0.6), min_size=8, max_size=8))
def test_white_stays_white_whatever_the_primaries(chromaticities: list[float]) -> None:
    matrix = rec709_from_rgb(chromaticities)
    if np.isfinite(matrix).all() and np.abs(matrix).max() < 1e4:
        np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=1e-6)


def test_chromaticities_of_no_light_are_told(tmp_path: Path) -> None:
    path = written(tmp_path / "a.exr", {"RGB": flat(0.5, 0.2, 0.1)}, chromaticities=(0.3,) * 8)
    assert told(path, Fate.LEFT_OUT)[0].startswith("chromaticities: no light has them")
    np.testing.assert_array_equal(images.load_image(path).pixels, flat(0.5, 0.2, 0.1))


def test_damaged_attributes_are_one_line(tmp_path: Path) -> None:
    """One of an unknown type, and one whose type is no text."""
    path = written(tmp_path / "a.exr", {"RGB": flat(0.5, 0.2, 0.1)}, chromaticities=REC_2020)
    content = path.read_bytes()
    path.write_bytes(content.replace(b"chromaticities\0c", b"chromaticities\0x", 1))
    with pytest.raises(InputError, match=r"a\.exr: chromaticities: are no numbers; the file is damaged"):
        images.load_image(path)
    path.write_bytes(content.replace(b"channels\0c", b"channels\0\xff", 1))
    with pytest.raises(InputError, match=r"a\.exr: is damaged \(it holds bytes that are no text\)"):
        bitmaps.load_bitmap(path)


def test_luminance_and_chroma(tmp_path: Path) -> None:
    """A file of RGBA's YC mode, of a picture that varies slowly."""
    y, x = np.mgrid[:16, :32] / 32
    rgb = np.stack([0.3 + 0.3 * x, 0.5 + 0.2 * y, 0.4 - 0.2 * x], axis=-1)
    weights = xyz_from_rgb(REC_709)[1]
    luminance = rgb @ weights
    chroma = {name: ((rgb[..., i] - luminance) / luminance)[::2, ::2] for name, i in (("RY", 0), ("BY", 2))}
    path = tmp_path / "a.exr"
    path.write_bytes(with_chroma(luminance, chroma["RY"], chroma["BY"]))
    np.testing.assert_allclose(images.load_image(path).pixels, rgb, atol=0.01)


def with_chroma(y: np.ndarray, ry: np.ndarray, by: np.ndarray) -> bytes:
    """An uncompressed file whose chroma is there for every second pixel ("OpenEXR File Layout"), which the
    library reads and does not write."""
    height, width = y.shape

    def attribute(name: str, kind: str, value: bytes) -> bytes:
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value

    channels = b"".join(
        name.encode() + b"\0" + struct.pack("<iB3xii", 2, 0, step, step)
        for name, step in (("BY", 2), ("RY", 2), ("Y", 1))
    )
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    header = struct.pack("<ii", 20000630, 2) + b"".join(
        (
            attribute("channels", "chlist", channels + b"\0"),
            attribute("compression", "compression", b"\0"),
            attribute("dataWindow", "box2i", window),
            attribute("displayWindow", "box2i", window),
            attribute("lineOrder", "lineOrder", b"\0"),
            attribute("pixelAspectRatio", "float", struct.pack("<f", 1)),
            attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
            attribute("screenWindowWidth", "float", struct.pack("<f", 1)),
            b"\0",
        )
    )
    lines = []
    for row in range(height):
        planes = [by[row // 2], ry[row // 2]] if row % 2 == 0 else []
        content = b"".join(np.float32(plane).tobytes() for plane in (*planes, y[row]))
        lines.append(struct.pack("<ii", row, len(content)) + content)
    first = len(header) + 8 * height
    places = first + np.cumsum([0, *map(len, lines[:-1])])
    return header + places.astype("<u8").tobytes() + b"".join(lines)


def test_a_part_of_the_frame_stands_where_it_belongs(tmp_path: Path) -> None:
    window = {"dataWindow": ((4, 2), (11, 5)), "displayWindow": ((0, 0), (15, 7))}
    path = written(tmp_path / "a.exr", {"RGB": flat(1, 2, 3, size=(4, 8))}, **window)
    pixels = images.load_image(path).pixels
    assert pixels.shape == (8, 16, 3) and not pixels[:2].any() and not pixels[:, 12:].any()
    np.testing.assert_array_equal(pixels[2:6, 4:12], flat(1, 2, 3, size=(4, 8)))
    assert told(path) == [
        "the image: has pixels in a part of its frame only, or beyond it; the rest is black"
    ]
    beyond = {"dataWindow": ((-2, -1), (17, 8)), "displayWindow": ((0, 0), (15, 7))}
    path = written(tmp_path / "b.exr", {"RGB": flat(1, 2, 3, size=(10, 20))}, **beyond)
    np.testing.assert_array_equal(images.load_image(path).pixels, flat(1, 2, 3))


def test_the_first_part_with_colours_is_taken(tmp_path: Path) -> None:
    depth = OpenEXR.Part({"name": "depth"}, {"Z": np.ones((8, 16), np.float32)})
    beauty = OpenEXR.Part({"name": "beauty"}, {"RGB": flat(3, 2, 1)})
    path = tmp_path / "a.exr"
    OpenEXR.File([depth, beauty]).write(str(path))
    np.testing.assert_array_equal(images.load_image(path).pixels, flat(3, 2, 1))


def test_what_has_no_single_colour_is_refused(tmp_path: Path) -> None:
    deep = np.empty((4, 4), object)
    for place in np.ndindex(4, 4):
        deep[place] = np.array([1.0, 2.0], np.float32)
    path = tmp_path / "deep.exr"
    header = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    OpenEXR.File(header, dict.fromkeys("RGB", deep)).write(str(path))
    with pytest.raises(InputError, match=r"deep\.exr: is a deep image, .*flatten it$"):
        images.load_image(path)
    path = written(tmp_path / "cube.exr", {"RGB": flat(1, 1, 1, size=(48, 8))}, envmap=OpenEXR.ENVMAP_CUBE)
    with pytest.raises(InputError, match=r"cube\.exr: is a cube map; save it as latitude and longitude$"):
        images.load_image(path)


def test_other_images_are_environments_too(tmp_path: Path) -> None:
    bright = flat(40, 2, 0.5)
    spec = OpenImageIO.ImageSpec(16, 8, 3, OpenImageIO.FLOAT)
    file = OpenImageIO.ImageOutput.create(str(tmp_path / "a.hdr"))
    file.open(str(tmp_path / "a.hdr"), spec)
    file.write_image(bright)
    file.close()
    np.testing.assert_allclose(images.load_image(tmp_path / "a.hdr").pixels, bright, rtol=0.02)
    PIL.Image.fromarray(np.uint8(flat(255, 128, 0))).save(tmp_path / "a.png")
    assert told(tmp_path / "a.png") == ["the environment is an image for displays: it has no bright lights"]
    expected = linear_from_srgb([1, 128 / 255, 0])
    np.testing.assert_allclose(images.load_image(tmp_path / "a.png").pixels[2, 2], expected, atol=1e-5)
    PIL.Image.fromarray(np.full((8, 16), 255, np.uint8)).save(tmp_path / "grey.jpg")
    np.testing.assert_allclose(images.load_image(tmp_path / "grey.jpg").pixels, 1)
    # What is dropped on the window is meant as environment where it has light in it.
    scene, _ = insert.drop_file(Scene(), tmp_path / "a.hdr")
    assert scene.environment.image is not None
    with pytest.raises(InputError, match="drop an image on the row of a texture"):
        insert.drop_file(Scene(), tmp_path / "a.png")
