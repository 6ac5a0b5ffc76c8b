"""MTL files: the materials of OBJ files.

The format is of 1995, and its numbers are of shading models that are no longer used. They are taken for what
programs that write it today mean by them (Blender's "io/wavefront_obj" writes and reads these files):

- `Ns` is a roughness of 1 - sqrt(Ns / 1000), where `Pr` does not say another;
- `Ks` of 0.5 is a dielectric with an index of refraction of 1.5, which has more with `Ni`;
- `map_Kd` takes the place of `Kd`, which many files leave black beside it;
- `illum` 3 and 5 without a diffuse colour are mirrors, 6 and 7 is glass, 4 and 9 a window.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from incpt.core.errors import InputError, in_place
from incpt.core.files import read_bytes
from incpt.formats import bitmaps, import_report
from incpt.formats.obj.lines import decoded, plain_text
from incpt.formats.outside import check_inside
from incpt.scene.checks import LARGEST
from incpt.scene.material import HIGHEST_BUMP, LARGEST_SLOPE, Material
from incpt.scene.texture import Bitmap, Texture

LARGEST_EXPONENT = 1000.0
"""Of `Ns`, which is a mirror."""
_NUMBERS = ("ns", "ni", "d", "tr", "illum", "pr", "pm", "ps", "pc", "pcr", "aniso", "anisor")
_RANGES = {
    "ns": (0.0, LARGEST_EXPONENT), "ni": (1.0, 100.0), "d": (0.0, 1.0), "tr": (0.0, 1.0), "pr": (0.0, 1.0),
    "pm": (0.0, 1.0), "ps": (0.0, 1.0), "pc": (0.0, 1.0), "pcr": (0.0, 1.0), "aniso": (0.0, 1.0),
    "kd": (0.0, 1.0), "ks": (0.0, LARGEST), "ke": (0.0, LARGEST), "tf": (0.0, 1.0),
}  # fmt: skip
_COLORS = ("kd", "ks", "ke", "tf")
_SILENT = ("ka", "map_ka", "sharpness")
"""What says how light is to be imagined that is computed here."""
_TEXTURES = {
    "map_kd": "Kd", "map_ks": "Ks", "map_ke": "Ke", "map_d": "d", "map_pr": "Pr", "map_pm": "Pm",
    "map_bump": "bump", "bump": "bump", "map_normal": "norm", "norm": "norm", "map_kn": "norm",
}  # fmt: skip
"""Images that are read, and what is called so below."""
_REFLECTION = "reflections are of what is there"
_UNUSED = {
    "map_ns": "roughness has a map of its own, map_Pr",
    "map_tr": "map_d is the one that is read",
    "disp": "surfaces are not displaced",
    "refl": _REFLECTION,
    "map_refl": _REFLECTION,
}
"""What is left out, and why, where there is more to say than that nothing here is like it."""
_ARGUMENTS = {
    "-blendu": 1, "-blendv": 1, "-bm": 1, "-boost": 1, "-cc": 1, "-clamp": 1, "-colorspace": 1, "-imfchan": 1,
    "-mm": 2, "-texres": 1, "-type": 1,
}  # fmt: skip
"""Options of images with so many words behind them; -o, -s and -t have up to three numbers."""
_NORMAL_MAP_BLUE = 0.7
"""Mean blue from which an image called a bump map is taken for a normal map."""


@dataclass
class _Entry:
    """The values of a `newmtl`, by keywords in small letters."""

    numbers: dict[str, float] = field(default_factory=dict)
    colors: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    images: dict[str, tuple[str, dict[str, Any]]] = field(default_factory=dict)


@dataclass
class MaterialLibrary:
    """The materials of MTL files by name, and all files that they were read from. `images` keeps each image
    once; None: it cannot be read."""

    materials: dict[str, Material] = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)
    images: dict[Path, Bitmap | None] = field(default_factory=dict)

    def read(self, path: Path) -> None:
        """Take in the materials of a file, of which the first of a name counts. What is left out is told.
        Raises InputError where the file cannot be read."""
        self.files.append(path)
        entries, unknown = _entries(decoded(read_bytes(path)), path.name)
        for keyword in sorted(unknown):
            reason = _UNUSED.get(keyword) or "nothing here is like it"
            import_report.left_out(f"{keyword} in {path.name}: {reason}")
        for name, entry in entries.items():
            if name not in self.materials:
                with in_place(f"material {name!r}"):
                    self.materials[name] = self._material(entry, path.parent)

    def _material(self, entry: _Entry, folder: Path) -> Material:
        textures = {key: self._texture(folder, *image) for key, image in entry.images.items()}
        found = {key: texture for key, texture in textures.items() if texture is not None}
        bump = found.pop("bump", None)
        strengths = {key: options.get("bm", 1.0) for key, (_, options) in entry.images.items()}
        if bump is not None and "norm" not in found and _is_normal_map(bump.bitmap):
            found["norm"], strengths["norm"], bump = bump, strengths["bump"], None
        material = Material(**{**_plain(entry, found), **_bodies(entry), **_mapped(found)})
        if "norm" in found:
            slope = max(-LARGEST_SLOPE, min(strengths["norm"], LARGEST_SLOPE))
            material = replace(material, normal_texture=found["norm"], normal_scale=slope)
        if bump is not None:
            height = max(-HIGHEST_BUMP, min(material.bump_scale * strengths["bump"], HIGHEST_BUMP))
            material = replace(material, bump_texture=bump, bump_scale=height)
            import_report.changed(f"a bump map: from black to white it is taken for {height:g} m high")
        return material

    def _texture(self, folder: Path, name: str, options: dict[str, Any]) -> Texture | None:
        """The texture of an image beside the file; None, which is told, where there is none to be read."""
        try:
            bitmap = self._bitmap(folder, name)
        except InputError as error:
            import_report.left_out(f"image {name}: {error}")
            return None
        if bitmap is None:
            return None
        (u, v), (over, up) = options.get("s", (1.0, 1.0)), options.get("o", (0.0, 0.0))
        wrap = "clamp" if options.get("clamp") else "repeat"
        # Their (0, 0) is the bottom left corner of the image, and ours the top left one.
        return Texture(bitmap, wrap=(wrap, wrap), offset=(over, 1 - up - v), scale=(u, v))

    def _bitmap(self, folder: Path, name: str) -> Bitmap | None:
        path = folder / name
        if not path.is_file():
            # Many files name the folders of the machine that they come from.
            path = folder / Path(name).name
        if path not in self.images:
            self.images[path] = None
            check_inside(folder, str(path.relative_to(folder) if path.is_relative_to(folder) else path))
            self.files.append(path)
            self.images[path] = bitmaps.load_bitmap(path)
        return self.images[path]


def _entries(content: bytes, file: str) -> tuple[dict[str, _Entry], set[str]]:
    """The materials of a file, and the keywords that are not read. Lines that say nothing are told."""
    entries: dict[str, _Entry] = {}
    unknown: set[str] = set()
    name, entry = "", _Entry()
    for line in plain_text(content).split(b"\n"):
        words = line.decode("utf-8", "replace").split(None, 1)
        if not words:
            continue
        keyword, rest = words[0].lower(), words[1].strip() if len(words) > 1 else ""
        if keyword == "newmtl":
            name, entry = rest, _Entry()
            entries.setdefault(name, entry)
            continue
        try:
            if not _take(entry, keyword, rest):
                unknown.add(keyword)
            else:
                _limit(entry, keyword, f"{words[0]} of material {name!r} in {file}")
        except InputError as error:
            import_report.left_out(f"{words[0]} of material {name!r} in {file}: {error}")
    return entries, unknown


def _limit(entry: _Entry, keyword: str, what: str) -> None:
    """Brings a number or a colour into its range, and tells of it."""
    if keyword not in _RANGES:
        return
    low, high = _RANGES[keyword]
    values = entry.colors.get(keyword) or (entry.numbers[keyword],)
    outside = next((value for value in values if not low <= value <= high), None)
    if outside is None:
        return
    import_report.changed(f"{what}: {outside:g} does not lie from {low:g} to {high:g}")
    if keyword in entry.colors:
        red, green, blue = (min(max(value, low), high) for value in values)
        entry.colors[keyword] = red, green, blue


def _take(entry: _Entry, keyword: str, rest: str) -> bool:
    """Put the value of a keyword into a material; returns whether anything reads it. Raises InputError."""
    if keyword in _NUMBERS:
        entry.numbers[keyword] = _number(rest.split()[-1] if rest else "")
    elif keyword in _COLORS and not rest.startswith(("spectral", "xyz")):
        entry.colors[keyword] = _color(rest)
    elif keyword in _TEXTURES:
        name, options = _image(rest)
        if not name:
            raise InputError("names no image")
        entry.images[_TEXTURES[keyword]] = name, options
    else:
        return keyword in _SILENT
    return True


def _number(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        raise InputError(f"{word[:20]!r} is not a number") from None
    return min(max(value, -LARGEST), LARGEST) if value == value else 0.0


def _color(rest: str) -> tuple[float, float, float]:
    numbers = [_number(word) for word in rest.split()[:3]]
    if not numbers:
        raise InputError("a colour has no numbers")
    red, green, blue = (*numbers, *numbers[:1] * 2)[:3] if len(numbers) < 3 else numbers
    return red, green, blue


def _image(rest: str) -> tuple[str, dict[str, Any]]:
    """The name of an image, which may have spaces, and its options: -o and -s as pairs, -bm, -clamp."""
    words, name = rest.split(), []
    options: dict[str, Any] = {}
    while words:
        word = words.pop(0)
        option = word.lower()
        if option in ("-o", "-s", "-t"):
            numbers: list[float] = []
            while words and len(numbers) < 3 and _is_number(words[0]):
                numbers.append(_number(words.pop(0)))
            filler = [1.0, 1.0] if option == "-s" else [0.0, 0.0]
            options[option[1:]] = tuple([*numbers, *filler[len(numbers) :]][:2])
        elif option in _ARGUMENTS:
            values, words = words[: _ARGUMENTS[option]], words[_ARGUMENTS[option] :]
            if option == "-bm" and values and _is_number(values[0]):
                options["bm"] = _number(values[0])
            elif option == "-clamp":
                options["clamp"] = values[:1] == ["on"]
        else:
            name.append(word)
    return " ".join(name).strip('"').replace("\\", "/"), options


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _plain(entry: _Entry, textures: Mapping[str, Texture]) -> dict[str, Any]:
    """Colours and shares of an opaque surface."""
    numbers, colors = entry.numbers, entry.colors
    specular = colors.get("ks", (0.0, 0.0, 0.0))
    brightest = max(specular)
    exponent = min(max(numbers.get("ns", 0.0), 0.0), LARGEST_EXPONENT)
    values: dict[str, Any] = {
        "base_color": colors.get("kd", (0.8, 0.8, 0.8)),
        "emission": colors.get("ke", (1.0, 1.0, 1.0) if "Ke" in textures else (0.0, 0.0, 0.0)),
        "roughness": _share(numbers.get("pr", 1 - (exponent / LARGEST_EXPONENT) ** 0.5)),
        "metallic": _share(numbers.get("pm", 0.0)),
        "specular": min(2 * brightest, 1.0),
        "ior": min(max(numbers.get("ni", 1.5), 1.0), 100.0) if numbers.get("ni", 1.5) > 1 else 1.5,
        "clearcoat": _share(numbers.get("pc", 0.0)),
        "clearcoat_roughness": _share(numbers.get("pcr", 0.0)),
        "sheen_color": (_share(numbers.get("ps", 0.0)),) * 3,
        "anisotropy": _share(numbers.get("aniso", 0.0)),
        "anisotropy_rotation": 360 * numbers.get("anisor", 0.0),
    }
    if brightest > 0:
        values["specular_color"] = tuple(c / brightest for c in specular)
    if "Ks" in textures and brightest == 0:
        values["specular"] = 1.0
    if "pm" in numbers or "pr" in numbers:
        # These files say nothing by Ks, or what follows from the rest.
        values["specular"], values["specular_color"] = 1.0, (1.0, 1.0, 1.0)
    is_mirror = int(numbers.get("illum", 2)) in (3, 5) and not any(values["base_color"]) and brightest > 0
    if is_mirror and "Kd" not in textures:
        values |= {
            "metallic": 1.0,
            "base_color": tuple(min(c, 1.0) for c in specular),
            "specular_color": (1.0,) * 3,
        }
    return values


def _bodies(entry: _Entry) -> dict[str, Any]:
    """Alpha and transmission."""
    numbers = entry.numbers
    opacity = _share(numbers.get("d", 1 - numbers.get("tr", 0.0)))
    model = int(numbers.get("illum", 2))
    if model in (4, 6, 7, 9):
        tint = entry.colors.get("tf", (1.0, 1.0, 1.0))
        tint = tint if any(tint) else (1.0, 1.0, 1.0)
        return {
            "transmission": 1 - opacity if opacity < 1 else 1.0,
            "base_color": tint,
            "thin_walled": model in (4, 9),
            "specular": 1.0,
        }
    return {"alpha": opacity, "alpha_mode": "blend" if opacity < 1 else "opaque"}


def _mapped(textures: Mapping[str, Texture]) -> dict[str, Any]:
    """What follows from images."""
    values: dict[str, Any] = {}
    color, coverage = textures.get("Kd"), textures.get("d")
    if color is not None:
        values |= {"base_color": (1.0, 1.0, 1.0), "base_color_texture": color}
    if coverage is not None:
        values |= {"base_color_texture": _with_alpha(color, coverage), "alpha_mode": "blend"}
    if "Ks" in textures:
        values["specular_color_texture"] = textures["Ks"]
        values["specular_color"] = (1.0, 1.0, 1.0)
    if "Ke" in textures:
        values["emission_texture"] = textures["Ke"]
    rough, metal = textures.get("Pr"), textures.get("Pm")
    if rough is not None or metal is not None:
        values["metallic_roughness_texture"] = _packed(rough, metal)
        values |= ({"roughness": 1.0} if rough is not None else {}) | (
            {"metallic": 1.0} if metal is not None else {}
        )
    return values


def _with_alpha(color: Texture | None, coverage: Texture) -> Texture:
    """The colours of one image with the alpha of another: of its fourth channel, or as bright as it is."""
    mask = coverage.bitmap
    alpha = mask.pixels[..., -1] if mask.has_alpha else mask.pixels[..., : min(mask.channels, 3)].mean(axis=2)
    if color is None:
        color = replace(coverage, bitmap=Bitmap(np.full((1, 1, 3), 255, np.uint8)))
    if color.bitmap is mask and mask.has_alpha:
        return color
    size = max(color.bitmap.height, mask.height), max(color.bitmap.width, mask.width)
    pixels = _resized(_eight_bits(color.bitmap, 3), size)
    covered = _resized(_eight_bits(Bitmap(alpha[..., None].astype(mask.pixels.dtype)), 1), size)
    return replace(color, bitmap=Bitmap(np.concatenate([pixels, covered], axis=2)))


def _packed(rough: Texture | None, metal: Texture | None) -> Texture:
    """Roughness in green and metal in blue, as glTF has them."""
    one = rough if rough is not None else metal
    assert one is not None, "there is one of them"
    bitmaps_of = [None if texture is None else texture.bitmap for texture in (rough, metal)]
    size = (max(b.height for b in bitmaps_of if b), max(b.width for b in bitmaps_of if b))
    planes = [np.full((*size, 1), 255, np.uint8) if bitmap is None else _resized(_eight_bits(bitmap, 1), size)
              for bitmap in (None, *bitmaps_of)]  # fmt: skip
    return replace(one, bitmap=Bitmap(np.concatenate(planes, axis=2)))


def _eight_bits(bitmap: Bitmap, channels: int) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """(H, W, channels) grey or colours of an image as bytes."""
    pixels = bitmap.pixels[..., : 3 if bitmap.channels >= 3 else 1].astype(np.float64)
    largest = {"uint8": 1, "uint16": 257}.get(bitmap.pixels.dtype.name, 1 / 255)
    values = pixels / largest
    values = (
        values.mean(axis=2, keepdims=True)
        if channels == 1
        else np.broadcast_to(values, (*values.shape[:2], 3))
    )
    return np.asarray(np.clip(np.rint(values), 0, 255), np.uint8)


def _resized(pixels: np.ndarray[Any, np.dtype[np.uint8]], size: tuple[int, int]) -> np.ndarray[Any, Any]:
    """With the nearest pixels."""
    rows = np.arange(size[0]) * pixels.shape[0] // size[0]
    columns = np.arange(size[1]) * pixels.shape[1] // size[1]
    return np.asarray(pixels[rows[:, None], columns[None, :]])


def _is_normal_map(bitmap: Bitmap) -> bool:
    """Whether an image is one of normals: blue, where it is flat."""
    if bitmap.channels < 3:
        return False
    red, green, blue = _eight_bits(bitmap, 3).reshape(-1, 3).mean(axis=0) / 255
    return bool(blue > _NORMAL_MAP_BLUE and max(red, green) < blue - 0.1)


def _share(value: float) -> float:
    return min(max(value, 0.0), 1.0)
