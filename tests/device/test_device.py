"""Choosing a device, building kernels, and what a user reads when either fails."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from importlib import resources
from itertools import groupby

import numpy as np
import pyopencl as cl
import pytest
from support.small_scenes import mixed_scene

from incpt.benchmarks.kit.scenes import cornell, glass, plates
from incpt.core import arena, bindings
from incpt.core.errors import DeviceError, InputError
from incpt.device import pocl, program
from incpt.device.device import DEVICE_VARIABLE, Device, all_devices, choose, device_name
from incpt.render import wavefront
from incpt.render.blocks import traces_in_blocks
from incpt.render.session import Session
from incpt.render.wavefront import Wavefront
from incpt.scene.image import Image
from incpt.scene.material import Material
from incpt.scene.model import Scene
from incpt.tables.scene_tables import SceneTables


def test_choice_by_index_name_and_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(DEVICE_VARIABLE, raising=False)
    first = all_devices()[0]
    assert choose() == choose(0) == choose("0") == choose(device_name(first)[2:9].upper()) == first
    monkeypatch.setenv(DEVICE_VARIABLE, "no such")
    with pytest.raises(InputError, match=rf"{DEVICE_VARIABLE}: no device 'no such'; choose one of 0 = "):
        choose()
    assert choose(0) == first


@pytest.mark.parametrize("choice", ["gpu of dreams", 99, "-1"])
def test_device_that_is_not_there(choice: str | int) -> None:
    with pytest.raises(InputError, match="--device: no device"):
        Device(choice)


def test_no_device_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cl, "get_platforms", list)
    with pytest.raises(DeviceError, match="no OpenCL device was found; install one"):
        choose()


def test_gpus_come_first(monkeypatch: pytest.MonkeyPatch) -> None:
    class Fake:
        def __init__(self, kind: int) -> None:
            self.type = kind

    class Platform:
        def __init__(self, *kinds: int) -> None:
            self.kinds = kinds

        def get_devices(self) -> list[Fake]:
            if not self.kinds:
                raise cl.RuntimeError("DEVICE_NOT_FOUND")
            return [Fake(kind) for kind in self.kinds]

    kinds = cl.device_type
    platforms = [Platform(kinds.CPU), Platform(), Platform(kinds.GPU, kinds.ACCELERATOR)]
    monkeypatch.setattr(cl, "get_platforms", lambda: platforms)
    assert [d.type for d in all_devices()] == [kinds.GPU, kinds.CPU, kinds.ACCELERATOR]


def test_kernel_that_does_not_build_names_file_and_line(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(program, "files", lambda: {"new": "path/new"})
    monkeypatch.setattr(program, "source", lambda file: f'#line 7 "{file}.cl"\n__kernel void k() {{ oops; }}')
    with pytest.raises(DeviceError, match=r"^cl/path/new\.cl does not build on .*: .*new\.cl:7:\d+: .*oops"):
        device.kernel("new")


def test_includes_are_put_in_once_with_their_lines() -> None:
    text = program.source("path/shade")
    assert "#include" not in text
    assert text.count("typedef struct {\n    float x, y, z;\n} Vec3;") == 1
    lines = text.splitlines()
    place = next(i for i, line in enumerate(lines) if line.startswith("__kernel void shade"))
    marker = max(i for i in range(place) if lines[i].startswith("#line"))
    number = int(lines[marker].split()[1])
    original = (resources.files("incpt.cl") / "path/shade.cl").read_text().splitlines()
    assert original[number - 1 + place - marker - 1] == lines[place]


def test_buffers_hold_what_was_written(device: Device) -> None:
    array = np.arange(10, dtype=np.uint32)
    buffer = device.upload(array)
    device.write(buffer, np.array([77], np.uint32), offset=8)
    device.fill(buffer, 5, 4, offset=12)
    assert device.read(buffer, np.empty(3, np.uint32), offset=4).tolist() == [1, 77, 5]
    assert device.upload(np.empty(0, np.float32)).size >= 4


def test_buffer_beyond_the_limit_of_the_device(device: Device) -> None:
    with pytest.raises(DeviceError, match=r"device memory: one buffer of .* use a smaller image or scene"):
        device.empty(1 << 60)


def test_memory_that_runs_out(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise cl.MemoryError("clCreateBuffer failed: MEM_OBJECT_ALLOCATION_FAILURE")

    session = Session(mixed_scene(), device=device)
    session.render(1)
    before = session.image()
    with monkeypatch.context() as patch:
        patch.setattr(cl, "Buffer", fail)
        with pytest.raises(
            DeviceError, match=r"device memory ran out for a buffer of .*; use a smaller image"
        ):
            session.edit(session.scene.with_environment(image=Image(np.ones((4, 8, 3)))))
    # Nothing is lost: the old scene goes on.
    np.testing.assert_array_equal(session.image(), before)
    session.render(2)


@pytest.mark.parametrize("operation", ["write", "read", "fill"])
def test_transfers_that_fail_are_one_line(device: Device, operation: str) -> None:
    buffer = device.upload(np.zeros(1, np.uint32))
    array = np.zeros(100, np.uint32)
    with pytest.raises(DeviceError, match=r"failed: .*INVALID_VALUE"):
        {
            "write": lambda: device.write(buffer, array),
            "read": lambda: device.read(buffer, array),
            "fill": lambda: device.fill(buffer, 0, 400),
        }[operation]()


def test_launch_that_fails_is_one_line(device: Device) -> None:
    kernel = device.kernel("resolve")
    buffer = device.upload(np.zeros(400, np.float32))
    with pytest.raises(DeviceError, match="kernel resolve failed"):
        device.launch(kernel, 10, np.uint32(1), buffer, buffer, work_group=1 << 20)


def test_target_is_the_highest_level_that_the_processor_has() -> None:
    v2 = {"cx16", "popcnt", "sse4_1", "sse4_2", "ssse3"}
    v3 = v2 | {"avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"}
    avx512 = {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}
    assert pocl.target_name(set()) == "x86-64"
    assert pocl.target_name(v2) == "x86-64-v2"
    assert pocl.target_name(v3 | avx512 - {"avx512bw"}) == "x86-64-v3"
    assert pocl.target_name(v3 | avx512) == "x86-64-v4"
    assert pocl.target_name(avx512) == "x86-64"


def test_processors_that_llvm_takes_for_older_ones_get_their_avx512() -> None:
    assert pocl.misnomers("x86-64-v3") == ("generic",)
    assert pocl.misnomers("x86-64-v4") == ("generic", "znver3")


def test_names_of_processors_are_looked_for_without_harm() -> None:
    import ctypes

    text = ctypes.create_string_buffer(b"generic")
    struct = (ctypes.c_void_p * 200)()
    struct[3], struct[7] = 8, ctypes.addressof(text)  # a wild pointer, and the one
    assert pocl._pointers_to("generic", ctypes.addressof(struct)) == [ctypes.addressof(struct) + 56]
    assert pocl._pointers_to("gen", ctypes.addressof(struct)) == []
    assert pocl._pointers_to("generic", 16) == []


def test_two_devices_in_a_process_build_the_same_source(device: Device) -> None:
    assert Device(0).program_text("shade") == device.program_text("shade")


def small(make: Callable[[], Scene]) -> Scene:
    scene = make()
    return replace(scene, settings=replace(scene.settings, size=(53, 37), base_nor=8, roulette_depth=1))


def half_clear_scene() -> Scene:
    """One of whose bodies is opaque for half of the paths that meet it."""
    return mixed_scene().with_material("glass", transmission=0.5)


def frosted_scene() -> Scene:
    """One with a rough transparent body, for which lights are sampled."""
    return mixed_scene().with_material("glass", roughness=0.6)


@pytest.mark.slow
@pytest.mark.parametrize(
    "make",
    [mixed_scene, half_clear_scene, frosted_scene, cornell, glass, plates],
    ids=lambda make: make.__name__,
)
def test_blocks_and_wavefront_agree(make: Callable[[], Scene], device: Device) -> None:
    """The kernel that traces blocks of paths on CPUs, and the wavefront of all other devices."""
    if not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    images = []
    for in_blocks in (False, True):
        session = Session(small(make), device=device)
        session._tracer = session._tracer if in_blocks else Wavefront(device)
        session.render(8)
        images.append(session.image())
    assert np.median(np.abs(images[0] - images[1])) < 1e-5
    assert images[0].mean() == pytest.approx(images[1].mean(), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("make", [mixed_scene, cornell, glass, plates], ids=lambda make: make.__name__)
def test_blocks_are_the_same_without_instructions_of_avx512(
    make: Callable[[], Scene], device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    images = []
    for _ in range(2):
        session = Session(small(make), device=device)
        session.render(8)
        images.append(session.image())
        portable = (*session._tables.variant, "PORTABLE_LANES")
        monkeypatch.setattr(SceneTables, "variant", portable)
    np.testing.assert_allclose(images[0], images[1], rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("make", [mixed_scene, cornell], ids=lambda make: make.__name__)
def test_blocks_of_every_size_make_the_same_picture(make: Callable[[], Scene], device: Device) -> None:
    if not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    images = []
    for paths in arena.BLOCK_SIZES:
        own = Device()
        own.block_paths = paths
        session = Session(small(make), device=own)
        session.render(8)
        images.append(session.image())
    np.testing.assert_allclose(images[0], images[1], rtol=1e-5)


def test_variant_for_matte_scenes_follows_materials(device: Device) -> None:
    box = cornell()
    session = Session(box, size=(8, 8), device=device)
    assert "MATTE" in session._tables.variant
    clear = Material(transmission=1.0)  # opaque never, so that its layer does not count
    session.edit(Scene(box.camera, box.environment, {**box.materials, "clear": clear}, box.objects))
    assert "MATTE" in session._tables.variant
    for change in ({"specular": 0.5}, {"metallic": 1.0}, {"specular": 1.0, "transmission": 0.5}):
        session.edit(box.with_material("white", **change))
        assert "MATTE" not in session._tables.variant


def test_variant_for_clear_media_follows_absorption(device: Device) -> None:
    scene = glass()
    session = Session(scene, size=(40, 24), device=device)
    assert "CLEAR_MEDIA" in session._tables.variant
    session.render(16)
    clear = session.image()
    # Next to nothing is absorbed, but the variant that could do it is taken.
    session.edit(scene.with_material("glass", absorption=(1e-9, 0, 0)))
    assert "CLEAR_MEDIA" not in session._tables.variant
    session.restart()
    session.render(16)
    np.testing.assert_allclose(session.image(), clear, rtol=1e-4, atol=1e-5)
    session.edit(cornell())
    assert "CLEAR_MEDIA" not in session._tables.variant


def test_devices_agree(device: Device) -> None:
    """Every device makes the same picture, within rounding; where there is one only, with itself."""
    session = Session(mixed_scene(base_nor=16), device=device)
    session.render(16)
    for index in range(len(all_devices())):
        other = Session(mixed_scene(base_nor=16), device=index)
        other.render(16)
        difference = np.abs(other.image() - session.image())
        assert np.median(difference) < 1e-4 and abs(other.image().mean() / session.image().mean() - 1) < 0.01


LIGHTS = ("ENVIRONMENT_IMAGE", "TRIANGLE_LIGHTS")
RESTRICTIONS = ("TOP_LEVEL_ONLY", "BRUTE_FORCE", "FLAT", "SMOOTH_MEDIA")
VARIANTS = [
    *(lights + media for lights in ((), LIGHTS[:1], LIGHTS[1:], LIGHTS) for media in ((), ("MEDIA",))),
    ("MEDIA", *RESTRICTIONS),
    (*LIGHTS, "MEDIA", "MATTE", "CLEAR_MEDIA"),
    (*LIGHTS, *RESTRICTIONS[:3], "MATTE"),
    (*LIGHTS, "MEDIA", *RESTRICTIONS),
    (*LIGHTS, *RESTRICTIONS[:3]),
    (*LIGHTS, *RESTRICTIONS[:3], "LENS", "CLAMP_INDIRECT"),
    (*LIGHTS, "SUN", "MEDIA", "CLAMP_INDIRECT"),
    (*LIGHTS, *RESTRICTIONS[1:2]),
    ("TRIANGLE_LIGHTS", "MEDIA", *RESTRICTIONS, "PORTABLE_LANES"),
    ("TRIANGLE_LIGHTS", "PORTABLE_LANES"),
    ("SHAPED_LIGHTS",),
    (*LIGHTS, "SHAPED_LIGHTS", "MEDIA", "CHANGES"),
    (*LIGHTS[:1], "SHAPED_LIGHTS", *RESTRICTIONS[:3], "MATTE", "CHANGES"),
    ("SHAPED_LIGHTS", "MEDIA", *RESTRICTIONS, "PORTABLE_LANES"),
    ("SHAPED_LIGHTS", "LIGHT_TREE"),
    ("TRIANGLE_LIGHTS", "LIGHT_TREE", *RESTRICTIONS[:3], "CHANGES"),
    (*LIGHTS, "SHAPED_LIGHTS", "LIGHT_TREE", "MEDIA", "CHANGES"),
    (*LIGHTS, "SHAPED_LIGHTS", "LIGHT_TREE", *RESTRICTIONS[:3], "MATTE"),
    ("TRIANGLE_LIGHTS", "SHAPED_LIGHTS", "LIGHT_TREE", "MEDIA", "PORTABLE_LANES"),
    ("CHANGES",),
    (*LIGHTS, "MEDIA", "CHANGES"),
    (*LIGHTS, "MEDIA", *RESTRICTIONS, "CHANGES"),
    ("TRIANGLE_LIGHTS", *RESTRICTIONS[:3], "MATTE", "CHANGES", "PORTABLE_LANES"),
]


def warnings_of(device: Device, text: str) -> list[str]:
    """What the compiler warns of, loops among it that it could not vectorise."""
    log = device.build(text, "trace_blocks").get_build_info(device.cl_device, cl.program_build_info.LOG)
    return [line for line in log.splitlines() if "warning" in line]


@pytest.mark.slow
@pytest.mark.parametrize("features", VARIANTS, ids=lambda features: " ".join(features) or "plain")
def test_pocl_runs_shading_in_simd_lanes(device: Device, features: tuple[str, ...]) -> None:
    """Every loop over a block that asks for SIMD lanes gets them; the compiler warns where it cannot, and of
    nothing else."""
    if not device.is_clang_cpu:
        pytest.skip("other compilers warn of code that is made for clang on a CPU")
    assert warnings_of(device, device.program_text("trace_blocks", features)) == []


def test_loops_that_pocl_cannot_vectorise_are_noticed(device: Device) -> None:
    if not device.is_pocl:
        pytest.skip("PoCL's compiler is the one that needs it")
    text = device.program_text("trace_blocks")
    loop = """
__kernel WIDE void roots(__local float *plane, uint count) {
    LANES
    for (int i = 0; i < (int)count; i++)
        plane[i] = sqrt(plane[i]);
}
"""
    assert warnings_of(device, text + loop) != []
    assert warnings_of(device, text + loop.replace("sqrt", "SQRT")) == []


def of_wavefront(variants: Iterable[tuple[str, ...]]) -> set[tuple[str, tuple[str, ...]]]:
    """The files of all stages' kernels, each with those features that a wavefront builds it with."""
    launches = (launch for features in variants for launch in wavefront._launches_of(features))
    return {(bindings.FILES.get(launch.kernel, launch.kernel), launch.features) for launch in launches}


def spread(programs: set[tuple[str, tuple[str, ...]]]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Of each file the variants with the fewest features, with the most, and one between them: all of them
    take half a minute."""
    by_size = sorted(programs, key=lambda one: (one[0], len(one[1]), one[1]))
    for _, group in groupby(by_size, key=lambda one: one[0]):
        variants = list(group)
        yield from dict.fromkeys((variants[0], variants[len(variants) // 2], variants[-1]))


@pytest.mark.slow
def test_kernels_build_without_warnings(device: Device) -> None:
    if not device.is_clang_cpu:
        pytest.skip("other compilers warn of code that is made for clang on a CPU")
    files = {file for file, path in program.files().items() if "__kernel" in program.source(path)}
    # Blocks have a test of their own, and without lights there is nothing to sample.
    plain = {(file, ()) for file in files - {"trace_blocks", "sample_lights", "choose_lights"}}
    variants = [*VARIANTS, *((*features, "CLAMP_INDIRECT") for features in VARIANTS[:2])]
    for file, features in sorted({*plain, ("generate", ("LENS",)), *spread(of_wavefront(variants))}):
        built = cl.Program(device.context, device.program_text(file, features))
        built.build(options=["-Werror"])
        log = built.get_build_info(device.cl_device, cl.program_build_info.LOG)
        assert "warning" not in log, (file, features, log)
