"""glTF: whatever is in a file, it is read or refused in one line."""

from __future__ import annotations

import copy
import random
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.gltf_files import GltfBuilder, embedded, write_document

from incpt.core.errors import InputError, InputWarning
from incpt.formats import registry
from incpt.scene.model import Scene

ODD: list[Any] = [
    None, True, -1, 0, 1, 3, 1 << 31, 1 << 70, 0.5, -1e300, 1e-300, float("nan"), float("inf"), "", "a",
    "VEC3", "../a", [], {}, [0], [[0]], {"a": 0}, [1e30] * 3, [0] * 4, [0] * 16, ["x"] * 3,
]  # fmt: skip


def everything() -> tuple[dict[str, Any], bytes]:
    """A file that has something of each kind that is read."""
    builder = GltfBuilder()
    quad = builder.quad(material=0, targets=[])
    quad["attributes"] |= {
        "NORMAL": builder.accessor(np.float32([[0, 0, 1]] * 4)),
        "TANGENT": builder.accessor(np.float32([[1, 0, 0, 1]] * 4)),
        "TEXCOORD_0": builder.accessor(np.uint16([[0, 1]] * 4), normalized=True),
        "COLOR_0": builder.accessor(np.uint8([[0, 1, 2, 3]] * 4), normalized=True),
        "JOINTS_0": builder.accessor(np.uint8([[0, 1, 0, 0]] * 4)),
        "WEIGHTS_0": builder.accessor(np.float32([[0.5, 0.5, 0, 0]] * 4)),
    }
    quad["targets"] = [{"POSITION": builder.accessor(np.float32([[0, 0, 1]] * 4))}]
    place, value = builder.view(np.uint16([2]).tobytes()), builder.view(np.float32([[1, 1, 1]]).tobytes())
    sparse = {"indices": {"bufferView": place, "componentType": 5123}, "values": {"bufferView": value}}
    builder.accessors[0]["sparse"] = {"count": 1, **sparse}
    instances = {"TRANSLATION": builder.accessor(np.float32([[0, 0, 0], [3, 0, 0]]))}
    times = builder.accessor(np.float32([0, 1]))
    moves = [builder.accessor(np.float32([[0] * width] * 2)) for width in (3, 1)]
    samplers = [{"input": times, "output": values} for values in moves]
    channels = [
        {"sampler": 0, "target": {"node": 1, "path": "translation"}},
        {"sampler": 1, "target": {"node": 0, "path": "weights"}},
    ]
    inverse = builder.accessor(np.float32([np.eye(4).ravel()] * 2))
    document = builder.document(
        [quad],
        scenes=[{"nodes": [0, 2, 3]}, {"nodes": []}],
        nodes=[
            {"mesh": 0, "skin": 0, "weights": [0.5]},
            {"translation": [1, 0, 0], "camera": 0},
            {"matrix": np.eye(4).ravel().tolist(), "children": [1],
             "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"mesh": 0, "rotation": [0, 0, 0, 1], "scale": [1, 2, 1],
             "extensions": {"EXT_mesh_gpu_instancing": {"attributes": instances}}},
        ],
        skins=[{"joints": [1, 2], "inverseBindMatrices": inverse}],
        cameras=[{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
        animations=[{"samplers": samplers, "channels": channels}],
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "alphaCutoff": 0.5,
                    "extensions": {"KHR_materials_volume": {"attenuationDistance": 1},
                                   "KHR_materials_sheen": {"sheenColorFactor": [1, 0, 0]}}}],
        textures=[{"source": 0, "sampler": 0}],
        samplers=[{"wrapS": 33071}],
        images=[{"bufferView": 0, "mimeType": "image/png"}],
        extensions={
            "KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {"outerConeAngle": 1}}]},
            "KHR_materials_variants": {"variants": [{"name": "a"}]},
        },
        extensionsUsed=["KHR_lights_punctual"],
    )  # fmt: skip
    return document, builder.content


DOCUMENT, CONTENT = everything()


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The way to each value within another."""
    found = [path] if path else []
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        found += places(item, (*path, key))
    return found


PLACES = places(DOCUMENT)


def write_mutated(path: Path, choose: random.Random) -> Path:
    """The file with some bytes changed, and some values of its JSON replaced or taken out."""
    content = bytearray(CONTENT)
    for _ in range(choose.choice([0, 0, 4])):
        content[choose.randrange(len(content))] = choose.randrange(256)
    is_text = path.suffix == ".gltf"
    document = copy.deepcopy(embedded(DOCUMENT, bytes(content)) if is_text else DOCUMENT)
    for _ in range(choose.randint(1, 3)):
        *above, key = choose.choice(PLACES)
        owner: Any = document
        try:
            for step in above:
                owner = owner[step]
            what = choose.randrange(4)
            if what == 0:
                del owner[key]
            elif what == 1 and isinstance(owner[key], int):
                owner[key] += choose.choice([-1, 1, 2, 100])
            else:
                owner[key] = copy.deepcopy(choose.choice(ODD))
        except (KeyError, IndexError, TypeError):  # An earlier change took it away.
            continue
    return write_document(path, document, b"" if is_text else bytes(content))


def check_reads_or_explains(path: Path) -> bool:
    """Whether it was read."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", InputWarning)
        try:
            assert isinstance(registry.load(path, time=0.5), Scene)
            assert isinstance(registry.load(path), Scene)
        except InputError as error:
            message = str(error)
            assert message.startswith(str(path)) and len(message.splitlines()) == 1
            return False
    return True


def test_the_file_that_is_mutated_is_read_whole(tmp_path: Path) -> None:
    scene, _ = registry.load_with_report(write_document(tmp_path / "a.glb", DOCUMENT, CONTENT), time=0.5)
    assert len(scene.objects) == 3 and len(scene.lights) == 1 and len(scene.cameras) == 1


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.randoms(use_true_random=False), st.sampled_from(["gltf", "glb"]))
def test_mutated_files_raise_input_errors_or_load(tmp_path: Path, choose: random.Random, suffix: str) -> None:
    check_reads_or_explains(write_mutated(tmp_path / f"a.{suffix}", choose))


def test_numbers_that_signal_are_no_numbers(tmp_path: Path) -> None:
    """A NaN of this kind makes numpy warn when anything is done with it; here all floats are such."""
    content = np.frombuffer(CONTENT[: len(CONTENT) // 4 * 4], np.uint32).copy()
    for accessor in DOCUMENT["accessors"]:
        if accessor["componentType"] == 5126:
            view = DOCUMENT["bufferViews"][accessor["bufferView"]]
            content[view["byteOffset"] // 4 :][: view["byteLength"] // 4] = 0x7F800001
    assert not check_reads_or_explains(write_document(tmp_path / "a.glb", DOCUMENT, content.tobytes()))
