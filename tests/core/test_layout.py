"""Host and kernels agree on every struct, offset and constant."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import pyopencl as cl
import pytest

from incpt.core import layout
from incpt.device.device import Device


@pytest.mark.parametrize("name", sorted(layout.STRUCTS))
def test_offsets_of_every_field(device: Device, name: str) -> None:
    struct = layout.STRUCTS[name]
    assert struct.names is not None and struct.fields is not None
    lines = "\n".join(
        f"offsets[{i}] = (uint)((size_t)&((__private {name} *)0)->{field});"
        for i, field in enumerate(struct.names)
    )
    count = len(struct.names)
    body = f"{lines}\noffsets[{count}] = sizeof({name});"
    text = f"{layout.c_header()}\n__kernel void probe(__global uint *offsets) {{\n{body}\n}}"
    program = cl.Program(device.context, text).build()
    offsets = device.empty(4 * (count + 1))
    device.launch(cl.Kernel(program, "probe"), 1, offsets, work_group=1)
    expected = [struct.fields[field][1] for field in struct.names] + [struct.itemsize]
    assert device.read(offsets, np.empty(count + 1, np.uint32)).tolist() == expected


def test_size_that_differs_stops_the_build(device: Device) -> None:
    text = layout.c_header().replace("uint alias;", "").replace("float ior;", "float ior, more;")
    with pytest.raises(cl.Error, match="assert_size_of_Material"):
        cl.Program(device.context, text + "\n__kernel void k() {}").build()


def test_only_scalars_of_four_bytes() -> None:
    for struct in layout.STRUCTS.values():
        assert struct.fields is not None
        for field in struct.fields.values():
            base = field[0].base
            assert base in layout._C_TYPES or base in layout.STRUCTS.values()


def test_constants_and_planes_are_in_the_header() -> None:
    header = layout.c_header()
    assert "#define NODE_LEAF 2147483648u" in header
    assert "#define SURFACE_MATERIAL 12u" in header and "#define PATH_PLANES 12u" in header
    assert "#define COUNTS_RAY_SHIFT 16u" in header and "#define COUNTS_RAY_MASK 255u" in header
    assert "#define CLASS_MEDIUM 8u" in header and "#define MIN_ALPHA 0.001f" in header


@pytest.mark.parametrize(
    "enum",
    [
        layout.RayPlane,
        layout.RawHitPlane,
        layout.SurfacePlane,
        layout.PathPlane,
        layout.SamplePlane,
        layout.ShadowPlane,
        layout.LightPlane,
        layout.PathList,
        layout.Counter,
        layout.PairPlane,
        layout.CellSum,
        layout.CellPlane,
        layout.TileSum,
        layout.HalfPlane,
        layout.RulePlane,
        layout.Evidence,
    ],
)
def test_planes_are_numbered_without_gaps(enum: type[IntEnum]) -> None:
    assert [int(plane) for plane in enum] == list(range(len(enum)))


def test_numbers_that_share_a_word_do_not_overlap() -> None:
    fields = {name: bits for name, bits in vars(layout).items() if isinstance(bits, layout.Bits)}
    for word in {name.split("_")[0] for name in fields}:
        masks = [bits.mask << bits.shift for name, bits in fields.items() if name.startswith(f"{word}_")]
        assert sum(masks) < 1 << 32
        assert sum(masks) == int(np.bitwise_or.reduce(np.array(masks, np.uint64)))
    assert 1 << layout.PLACE_ON_TOP.shift == layout.NODE_PACK
    assert layout.PLACE_LANE.mask == layout.BVH_WIDTH - 1
    assert layout.COUNTS_RAY.mask + 1 == layout.MOST_RAYS
    assert layout.MOST_RAYS_IN_MEDIA < layout.MOST_RAYS
    assert layout.MEDIUM_LOW.mask == layout.MEDIUM_HIGH.mask == layout.MEDIUM_NONE
