"""Programs: from the files of cl/ to the text that a device's compiler gets.

A program is one file of cl/ with its includes put in, behind the headers of `layout`, `bindings`, `arena` and
`stages`, and the names of its *features*: preprocessor names that choose a variant of it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable

from incpt.core import arena, bindings, layout, stages

# Relaxed arithmetic only where NaN and infinity keep their meaning: -cl-fast-relaxed-math loses rays.
BUILD_OPTIONS = ("-cl-std=CL1.2", "-cl-mad-enable", "-cl-no-signed-zeros")
"""Options of every build."""
EXACT_DIVISION = "-cl-fp32-correctly-rounded-divide-sqrt"
"""The option of builds for devices that can divide exactly, which they need not do without it."""

_LINE = re.compile(r'#line (\d+) "(.*)"$')
_WHOLE_TEXT = re.compile(r"<kernel>:(\d+):")
"""How NVIDIA's compiler, which passes over #line, gives a place in the whole text."""
_INCLUDE = re.compile(r'^#include "([\w/]+)\.cl"$', re.MULTILINE)


FEATURES = {
    "CLANG_CPU": "The compiler is clang for a CPU, whose intrinsics and loop pragmas are at hand.",
    "PORTABLE_LANES": "Instructions of AVX-512 are not written by hand, as on processors without them.",
    "INEXACT_DIVISION": "The device does not round quotients correctly, so that boxes need more slack.",
    "PERTURBED_DIVISION": "Reciprocals of directions are two ulps off, for the tests of that slack.",
    "LENS": "Camera rays start at different points: of a thin lens, an orthographic picture or a near plane.",
    "ENVIRONMENT_IMAGE": "The environment is an image, of which lights are sampled.",
    "SUN": "The image is a sky, in which the sun shines.",
    "TRIANGLE_LIGHTS": "There are emissive triangles, of which lights are sampled.",
    "SHAPED_LIGHTS": "There are lights that are objects of their own.",
    "LIGHT_TREE": "Lights are so many that they are chosen, and met, by a tree.",
    "MEDIA": "There are materials that let light through.",
    "SMOOTH_MEDIA": "No material that lets light through is rough.",
    "CLEAR_MEDIA": "No material that lets light through absorbs any.",
    "MATTE": "Opaque surfaces are Lambertian: no metal, and no layer.",
    "FLAT": "No mesh has normals of its own, and no map bends them.",
    "TOP_LEVEL_ONLY": "Every triangle lies in the packs of the top level, in world space.",
    "BRUTE_FORCE": "The triangles of the top level are so few that blocks test them without a tree.",
    "TEXTURES": "With a number: a bit for each TextureSlot that some material has.",
    "TRAITS": "With a number: a bit for each MaterialTrait that some material has.",
    "CUTOUTS": "Rays may go on behind some materials: they cover a share, or are clear walls.",
    "VERTEX_COLORS": "Some mesh has colours at its corners.",
    "AOVS": "Paths write base colour and normal of the first surface into the path buffer.",
    "CHANGES": "Blocks tell of each path whether it met something that changed between two scenes.",
    "CLAMP_INDIRECT": "What a path adds after its first bounce is held below a limit.",
    "EMISSION_ONLY": "No path goes on after this ray, so that surfaces only emit.",
    "COUNT_VISITS": "Traversal counts the nodes and packs that it tests, for the benchmark of rays.",
    "MIS_ONLY_LIGHT": "Light sampling alone brings light, where it can, for the tests of its weights.",
    "MIS_ONLY_BSDF": "BSDF sampling alone brings light, for the tests of its weights.",
    "CHANNELS": "With a number: how many floats a pass of the film has for each pixel.",
    "SQUARES": "A pass of the film sums up squares.",
    "LAST_SCALE": "What smoothing a change leaves behind is taken as a detail too.",
    "KEEP_SUMS": "The picture of a pass of the film is not divided by the number of samples.",
}
"""Every preprocessor name that chooses a variant of a program, and what it says."""


def program_text(
    file: str,
    features: tuple[str, ...] = (),
    target: str | None = None,
    block_paths: int = arena.BLOCK_SIZES[0],
) -> str:
    """The whole source of the program around cl/`file`.cl, for blocks of `block_paths` paths.

    Each of the features is a name, or a name and its value ("CHANNELS 3").
    The target is part of the text, so that a kernel cached for another processor is not taken. Raises
    KeyError for a feature that is not in FEATURES.
    """
    for name in features:
        if name.split()[0] not in FEATURES:
            raise KeyError(f"no kernel knows the feature {name}")
    defines = "".join(f"#define {name}\n" for name in features)
    headers = (
        layout.c_header() + bindings.c_header() + arena.c_header(block_paths) + stages.c_header(features)
    )
    return f"// target: {target}\n{defines}{headers}\n{source(file)}"


def source(file: str, included: set[str] | None = None) -> str:
    """The text of cl/`file`.cl with its includes put in, each once. `file` is a path below cl/, such as
    "path/generate".

    Done here and not by -I, which a path with a space or a zipped package would defeat.
    """
    included = set() if included is None else included
    included.add(file)
    text = resources.files("incpt.cl").joinpath(f"{file}.cl").read_text("utf-8")

    def include(match: re.Match[str]) -> str:
        name = match.group(1)
        if name in included:
            return ""
        line = text.count("\n", 0, match.end()) + 2
        return f'{source(name, included)}\n#line {line} "{file}.cl"'

    return f'#line 1 "{file}.cl"\n' + _INCLUDE.sub(include, text)


@cache
def files() -> dict[str, str]:
    """Every file of cl/ by its name: "generate" is "path/generate". No two have the same name."""
    found: dict[str, str] = {}
    for file in _below(resources.files("incpt.cl"), ""):
        name = file.rpartition("/")[2]
        assert name not in found, f"cl/{file}.cl and cl/{found[name]}.cl have the same name"
        found[name] = file
    return found


def first_error(log: str, text: str) -> str:
    """The first error that a compiler tells of, with the place in cl/ that it stands at; `text` is what was
    compiled."""
    for line in log.splitlines():
        if "error:" in line:
            return _WHOLE_TEXT.sub(lambda match: _place(text, int(match[1])), line.strip())
    return log.strip().splitlines()[0]


def _place(text: str, number: int) -> str:
    """File and line, with a colon after each, of a line of the whole text."""
    file, first, at = "kernel", 1, 0
    for i, line in enumerate(text.splitlines()[: number - 1], 1):
        if marker := _LINE.match(line):
            file, first, at = marker[2], int(marker[1]), i
    return f"{file}:{first + number - at - 1}:"


def _below(folder: Traversable, prefix: str) -> Iterator[str]:
    for item in sorted(folder.iterdir(), key=lambda item: item.name):
        if item.is_dir():
            yield from _below(item, f"{prefix}{item.name}/")
        elif item.name.endswith(".cl"):
            yield prefix + item.name.removesuffix(".cl")
