"""Pictures on disk: layers, tone mapping, and what becomes of damaged or unwritable files."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import OpenEXR
import PIL.Image
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from incpt.core.errors import InputError, OutputError
from incpt.formats import images
from incpt.picture import tone_mapping

RAMP = np.linspace(0, 2, 6 * 4 * 3, dtype=np.float32).reshape(6, 4, 3)


def write_channels(path: Path, **channels: np.ndarray) -> Path:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {name.replace("_", "."): c for name, c in channels.items()}).write(str(path))
    return path


def test_layers_come_back_as_written(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    ids = np.arange(24, dtype=np.uint32).reshape(6, 4)
    images.write_exr(
        path, {"RGB": RAMP, "normal.XYZ": -RAMP, "depth.Z": RAMP[..., 0].astype(np.float64), "object_id": ids}
    )
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    assert set(channels) == {"R", "G", "B", "normal.X", "normal.Y", "normal.Z", "depth.Z", "object_id"}
    assert (channels["G"].pixels == RAMP[..., 1]).all() and channels["G"].pixels.dtype == np.float32
    assert (channels["normal.Z"].pixels == -RAMP[..., 2]).all()
    assert (channels["object_id"].pixels == ids).all() and channels["object_id"].pixels.dtype == np.uint32
    image = images.load_image(path)
    assert (image.pixels == RAMP).all()
    assert image.source == str(path)
    assert images.load_image(path) is image


@pytest.mark.parametrize(
    "layers",
    [
        {},
        {"RGB": RAMP, "depth.Z": RAMP[:3, :, 0]},
        {"RG": RAMP},
        {"RRR": RAMP},
        {"": RAMP[..., 0]},
        {"R": RAMP[0, 0]},
        {"RGB": RAMP[:0]},
    ],
)
def test_layers_that_do_not_fit(tmp_path: Path, layers: dict[str, np.ndarray]) -> None:
    with pytest.raises(InputError, match="layer"):
        images.write_exr(tmp_path / "a.exr", layers)
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.uint32])
def test_every_channel_type(tmp_path: Path, dtype: type) -> None:
    plane = np.arange(6, dtype=dtype).reshape(2, 3)
    image = images.load_image(write_channels(tmp_path / "a.exr", R=plane, G=plane * 2, B=plane * 3))
    assert image.pixels.dtype == np.float32
    np.testing.assert_array_equal(image.pixels[1, 2], [5, 10, 15])


def test_other_channel_names(tmp_path: Path) -> None:
    plane = np.arange(6, dtype=np.float32).reshape(2, 3)
    grey = images.load_image(write_channels(tmp_path / "y.exr", Y=plane))
    assert (grey.pixels == plane[..., None]).all()
    layer = images.load_image(
        write_channels(tmp_path / "l.exr", sky_R=plane, sky_G=plane, sky_B=plane + 1, sky_A=plane)
    )
    assert (layer.pixels[..., 2] == plane + 1).all()
    with pytest.raises(InputError, match="has no channels R, G, B or Y of full size, but A, Z"):
        images.load_image(write_channels(tmp_path / "z.exr", Z=plane, A=plane))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.0])
def test_radiance_that_cannot_be(tmp_path: Path, bad: float) -> None:
    pixels = RAMP.copy()
    pixels[2, 2, 1] = bad
    images.write_exr(tmp_path / "a.exr", {"RGB": pixels})
    with pytest.raises(InputError, match=r"a\.exr: image: holds negative, infinite or undefined radiance"):
        images.load_image(tmp_path / "a.exr")


def test_ringing_of_lossy_compression_is_cleared(tmp_path: Path) -> None:
    pixels = RAMP.copy()
    pixels[0, 0, 0] = -0.005
    images.write_exr(tmp_path / "a.exr", {"RGB": pixels})
    assert images.load_image(tmp_path / "a.exr").pixels[0, 0, 0] == 0


def test_the_shipped_environments_load() -> None:
    for name in ("city", "studio", "courtyard", "interior"):
        image = images.load_image(Path(__file__).parents[2] / "scenes" / f"{name}.exr")
        assert image.pixels.shape == (512, 1024, 3)
        assert 0.1 < image.pixels.mean() < 2


def test_absurd_sizes_are_refused_before_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    images.write_exr(path, {"RGB": np.ones((1, 5000, 3))})
    with pytest.raises(InputError, match="is 5000 x 1 pixels"):
        images.load_image(path)
    content = path.read_bytes()
    start = content.index(b"dataWindow\0box2i\0") + 17 + 4
    huge = np.array([0, 0, 2**31 - 2, 2**31 - 2], "<i4").tobytes()
    path.write_bytes(content[:start] + huge + content[start + 16 :])
    with pytest.raises(InputError):
        images.load_image(path)


def test_files_that_are_no_image(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    with pytest.raises(InputError, match="no such file"):
        images.load_image(path)
    for content in (b"garbage" * 100, b"\x76\x2f\x31\x01", b"\x89PNG\r\n\x1a\n" + bytes(50)):
        path.write_bytes(content)
        with pytest.raises(InputError, match="is no OpenEXR image"):
            images.load_image(path)


@pytest.mark.slow
def test_a_damaged_image_prints_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    images.write_exr(path, {"RGB": np.random.default_rng(0).random((200, 200, 3))})
    path.write_bytes(path.read_bytes()[:100_000])
    program = f"""
        from incpt.core import errors
        from incpt.formats import images
        print("before", flush=True)
        try:
            images.load_image({str(path)!r})
        except errors.InputError as error:
            print(error)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    assert done.stdout.splitlines() == [
        "before", f"{path}: is no OpenEXR image, or a damaged one; save it again as OpenEXR"
    ]  # fmt: skip


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    places=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=8),
    cut=st.floats(0, 1),
)
def test_damaged_images_raise_input_errors_or_load(
    tmp_path: Path, places: list[tuple[float, int]], cut: float
) -> None:
    path = tmp_path / "a.exr"
    images.write_exr(path, {"RGB": RAMP})
    content = bytearray(path.read_bytes())
    for place, value in places:
        content[int(place * (len(content) - 1))] = value
    path.write_bytes(content[: len(content) if cut > 0.5 else int(2 * cut * len(content))])
    message = str(path)
    try:
        assert images.load_image(path).pixels.shape[2] == 3
    except InputError as error:
        message = str(error)
    assert message.startswith(str(path)) and len(message.splitlines()) == 1


def test_greys_stay_grey_and_in_order() -> None:
    grey = np.repeat(np.logspace(-5, 4, 2000)[:, None], 3, axis=1)
    for curve in tone_mapping.CURVES:
        mapped = tone_mapping.tone_map(grey, curve=curve).astype(int)
        assert (mapped == mapped[:, :1]).all()
        assert (np.diff(mapped[:, 0]) >= 0).all()
        assert mapped[0, 0] == 0 and mapped[-1, 0] == 255


def test_mid_grey_stays_mid_grey() -> None:
    mid = np.full((1, 1, 3), 0.18)
    assert tone_mapping.tone_map(mid, curve="srgb")[0, 0, 0] == 118
    assert abs(int(tone_mapping.tone_map(mid)[0, 0, 0]) - 118) < 12
    np.testing.assert_array_equal(tone_mapping.tone_map(mid, exposure=1), tone_mapping.tone_map(mid * 2))


def test_the_filmic_curve_is_that_of_its_author() -> None:
    """f(x) = ((x (0.15 x + 0.05) + 0.004) / (x (0.15 x + 0.5) + 0.06) - 1/15) of 2 L over f(11.2), worked
    out for L = 0.18: 0.093062 / 0.725129 = 0.128338, which sRGB encodes as 0.393471, 100.3 of 255."""
    mapped = tone_mapping.tone_map(np.outer([0.18, 1.0, 5.0, 5.6, 1e6], [1, 1, 1]), curve="filmic")
    assert mapped[:, 0].tolist() == [100, 186, 252, 255, 255]


def test_a_bright_colour_runs_into_white() -> None:
    red = np.array([1.0, 0.02, 0.02])
    mapped = tone_mapping.tone_map(np.stack([red, red * 1000])).astype(int)
    assert mapped[0, 0] - mapped[0, 1] > 100
    assert mapped[1, 0] - mapped[1, 1] < 40


def test_pixels_that_are_no_radiance_are_seen() -> None:
    mapped = tone_mapping.tone_map([[np.nan, 0, 0], [np.inf] * 3, [-np.inf, -1, -5]])
    assert mapped.tolist() == [[255, 0, 255], [255, 255, 255], [0, 0, 0]]
    with pytest.raises(InputError, match="curve: 'reinhard' is not known"):
        tone_mapping.tone_map([[0, 0, 0]], curve="reinhard")
    with pytest.raises(InputError, match="shape"):
        tone_mapping.tone_map([[0, 0]])


def test_png_holds_the_mapped_picture(tmp_path: Path) -> None:
    images.write_png(tmp_path / "a.png", RAMP, exposure=-1, curve="srgb")
    with PIL.Image.open(tmp_path / "a.png") as picture:
        assert (np.asarray(picture) == tone_mapping.tone_map(RAMP, -1, "srgb")).all()
    with pytest.raises(InputError, match="shape"):
        images.write_png(tmp_path / "b.png", RAMP[0])


@pytest.mark.parametrize("name", ["a.tga", "a.png.bak", "a"])
def test_names_of_other_formats_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"path: .* does not end in \.png, the format that is written"):
        images.write_png(tmp_path / name, RAMP)
    with pytest.raises(InputError, match=r"path: .* does not end in \.exr, the format that is written"):
        images.write_exr(tmp_path / name, {"RGB": RAMP})
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize("name", ["a.exr", "a.png"])
def test_a_folder_that_is_not_there(tmp_path: Path, name: str) -> None:
    def write(path: Path) -> None:
        images.write_png(path, RAMP) if name.endswith("png") else images.write_exr(path, {"RGB": RAMP})

    with pytest.raises(OutputError, match="no such file or directory"):
        write(tmp_path / "none" / name)
    (tmp_path / name).mkdir()
    with pytest.raises(OutputError, match="is a folder"):
        write(tmp_path / name)
    assert os.listdir(tmp_path) == [name]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit on the size of files")
@pytest.mark.parametrize("name", ["a.exr", "a.png"])
def test_a_full_disk_keeps_the_old_file(tmp_path: Path, name: str) -> None:
    """A limit on the size of files makes writes fail half-way, as a full disk does."""
    path = tmp_path / name
    path.write_text("old")
    program = f"""
        import resource, signal
        import numpy as np
        from incpt.core import errors
        from incpt.formats import images
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
        noise = np.random.default_rng(0).random((200, 200, 3))
        try:
            if {name!r}.endswith("png"):
                images.write_png({str(path)!r}, noise)
            else:
                images.write_exr({str(path)!r}, {{"RGB": noise}})
        except errors.OutputError as error:
            print(error)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    assert done.stdout.startswith(f"{path}: cannot be written (") and len(done.stdout.splitlines()) == 1
    assert path.read_text() == "old" and os.listdir(tmp_path) == [name]
