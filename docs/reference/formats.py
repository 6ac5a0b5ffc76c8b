"""Which files can be read."""

from __future__ import annotations

from collections.abc import Callable

from incpt.formats import bitmaps, registry
from incpt.formats.registry import FileKind
from reference.markdown import code, table

_READERS = {
    "gltf.reader": "glTF 2.0, by a reader of our own",
    "mitsuba.reader": "scenes of Mitsuba 3, by a reader of our own",
    "pbrt.reader": "scenes of pbrt-v4, by a reader of our own",
    "obj.reader": "OBJ with MTL, by a reader of our own",
    "ply.reader": "by a reader of our own",
    "stl": "by a reader of our own",
    "off": "by a reader of our own",
    "threemf.reader": "by a reader of our own",
    "trimesh_adapter": "by trimesh",
    "usd.reader": "Universal Scene Description, by its own library",
    "mesh_store": "meshes that incpt itself writes beside a scene file",
    "images": "environments and, in scene files, textures",
    "scene_toml": "[scene files](scene-file.md)",
}


def readable() -> str:
    """Every suffix, what such files are, and what has to be installed for them."""
    rows = []
    for kind in FileKind:
        for row in (row for row in registry.FORMATS if row.kind is kind):
            needs = code(row.package) if row.package else "–"
            rows.append((code(row.suffix), kind.value, _READERS[row.reader[0]], needs))
    return table(("suffix", "holds", "read as", "needs as well"), rows)


def textures() -> str:
    """The suffixes that are offered as textures."""
    return ", ".join(map(code, bitmaps.SUFFIXES))


PIECES: dict[str, Callable[[], str]] = {"formats": readable, "texture formats": textures}
