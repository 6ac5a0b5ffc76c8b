"""Reads an OBJ file: an object for each object or group of it and each material."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.core.files import read_bytes
from incpt.formats import import_report
from incpt.formats.clean import tell_of_faces, usable_mesh
from incpt.formats.far_origin import nearer
from incpt.formats.import_options import current_options
from incpt.formats.import_report import counted
from incpt.formats.names import Names
from incpt.formats.obj.lines import IMPOSSIBLE, NOWHERE, ObjText, State, decoded, read_text
from incpt.formats.obj.mtl import MaterialLibrary
from incpt.formats.outside import check_inside
from incpt.formats.polygons import triangulated
from incpt.formats.smooth_normals import smooth_normals
from incpt.formats.vertex_attributes import VertexAttributes, material_of_colors
from incpt.picture.color import linear_from_srgb
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.mesh_part import MeshFile, MeshPart

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


def read_obj(path: Path) -> MeshFile:
    """The parts of an OBJ file with the materials of its MTL files; see `mesh_files.load_file`. Raises
    InputError."""
    text = read_text(decoded(read_bytes(path)))
    text = replace(text, vertices=nearer(text.vertices))
    triangles = _Triangles(text)
    normals = _smoothed(text, triangles)
    counts = {"in all": triangles.too_small, "with fewer than three corners": triangles.too_small}
    keys = list(dict.fromkeys(_part_of(run.state) for run in text.runs))
    place = {key: number for number, key in enumerate(keys)}
    part_of_run = np.array([place[_part_of(run.state)] for run in text.runs], np.int64)
    meshes = _Meshes(text, triangles, normals, counts).of(part_of_run[triangles.run], len(keys))
    tell_of_faces(counts)
    library = _materials(path, text) if current_options().materials else MaterialLibrary()
    _tell_of_rest(text)
    found = [(name, key[1], mesh) for name, key, mesh in zip(_names(keys), keys, meshes, strict=True) if mesh]
    used = {material for _, material, _ in found} & library.materials.keys()
    counts = {"object": len(found), "material": len(used)}
    import_report.read(", ".join(counted(n, what) for what, n in counts.items() if n))
    source = MeshSource(file=os.path.abspath(path))
    return MeshFile(
        tuple(
            MeshPart(
                name if len(found) > 1 else None,
                replace(mesh, source=replace(source, part=name) if len(found) > 1 else source),
                *_material(library, material, mesh),
            )
            for name, material, mesh in found
        ),
        files=tuple(library.files),
    )


def _material(
    library: MaterialLibrary, name: str, mesh: Mesh
) -> tuple[str, Material] | tuple[str | None, None]:
    """The name and the material of faces under a name of one."""
    material = library.materials.get(name)
    if material is not None:
        return name, material
    return (name, None) if name else material_of_colors(mesh)


def _part_of(state: State) -> tuple[str, str]:
    """By what faces are parted: the name of an object, or of groups where there is none, and the material."""
    return state.object or state.group, state.material


def _names(keys: Sequence[tuple[str, str]]) -> list[str]:
    """Names of parts, no two alike: with the material where an object has several."""
    uses = Counter(name for name, _ in keys)
    names = Names()
    return [
        names.new(
            f"{name}/{material}" if name and material and uses[name] > 1 else name or material or "part"
        )
        for name, material in keys
    ]


class _Triangles:
    """All faces of a file as triangles. `run` (T,): the number of the run that each comes from; `positions`,
    `uvs`, `normals` (T, 3): the places of its corners in the text's arrays, NOWHERE where it has none."""

    def __init__(self, text: ObjText) -> None:
        sizes = np.concatenate([np.zeros(0, np.int64), *(run.sizes for run in text.runs)])
        corners = np.concatenate([np.zeros((0, 3), np.int32), *(run.corners for run in text.runs)])
        # Impossible positions count from the end, where there is none.
        there = np.concatenate([text.vertices, np.full((2, 3), np.nan)])
        numbers = triangulated(sizes, there, corners[:, 0])
        polygon = np.repeat(np.arange(len(sizes)), np.maximum(sizes - 2, 0))
        # A polygon with an impossible corner goes as a whole.
        owner = np.repeat(np.arange(len(sizes)), sizes)
        is_bad = np.zeros(len(sizes), bool)
        is_bad[owner[corners[:, 0] < 0]] = True
        self.positions = corners[numbers, 0]
        self.positions[is_bad[polygon]] = IMPOSSIBLE
        self.uvs, self.normals = corners[numbers, 1], corners[numbers, 2]
        run_of = np.repeat(np.arange(len(text.runs)), [len(run.sizes) for run in text.runs])
        self.run = run_of[polygon]
        self.too_small = int((sizes < 3).sum())


def _smoothed(text: ObjText, triangles: _Triangles) -> Array:
    """(N, 3) the normals of the file, and behind them those of smoothing groups, which triangles get that
    have none of their own."""
    group = np.array([run.state.smoothing for run in text.runs], np.int64)[triangles.run]
    usable = (triangles.positions >= 0).all(axis=1)
    (chosen,) = np.nonzero((group > 0) & (triangles.normals == NOWHERE).any(axis=1) & usable)
    if not len(chosen):
        return text.normals
    faces = triangles.positions[chosen]
    keys, place = np.unique(
        faces.astype(np.int64) * (group.max() + 1) + group[chosen][:, None], return_inverse=True
    )
    sums = smooth_normals(text.vertices[faces], place.reshape(-1, 3), len(keys))
    own = triangles.normals[chosen]
    triangles.normals[chosen] = np.where(own == NOWHERE, len(text.normals) + place.reshape(-1, 3), own)
    return np.concatenate([text.normals, sums])


class _Meshes:
    """Makes the meshes of parts, each of what it uses alone: a file may have thousands of parts."""

    def __init__(self, text: ObjText, triangles: _Triangles, normals: Array, counts: dict[str, int]) -> None:
        self._text, self._triangles, self._normals, self._counts = text, triangles, normals, counts
        largest = max(len(text.vertices), len(text.uvs), len(normals))
        # What is not there is counted from the end.
        self._place = np.zeros(largest - IMPOSSIBLE, np.int64)

    def of(self, part_of: Indices, count: int) -> list[Mesh | None]:
        """The mesh of each of so many parts, None where no face is left; `part_of` (T,): that of each
        triangle."""
        order = np.argsort(part_of, kind="stable")
        ends = np.cumsum(np.bincount(part_of, minlength=count))
        return [self._mesh(chosen) for chosen in np.split(order, ends[:-1])]

    def _mesh(self, chosen: Indices) -> Mesh | None:
        """That of the triangles with these numbers."""
        text, triangles = self._text, self._triangles
        used, faces = self._renumbered(triangles.positions[chosen])
        used_uvs, uv_at = self._renumbered(triangles.uvs[chosen])
        used_normals, normal_at = self._renumbered(triangles.normals[chosen])
        colors = None
        if text.colors is not None:
            linear = linear_from_srgb(np.clip(text.colors[used], 0, 1))
            colors = np.concatenate([linear, np.ones((len(linear), 1))], axis=1)
        # Corners without the one or the other take what stands behind all of them.
        uvs = np.concatenate([text.uvs[used_uvs] * [1, -1] + [0, 1], [[0, 0]]])
        normals = np.concatenate([self._normals[used_normals], np.full((1, 3), np.nan)])
        return usable_mesh(
            text.vertices[used],
            faces,
            normals if len(used_normals) else None,
            self._counts,
            VertexAttributes((uvs,) if len(used_uvs) else (), colors),
            normal_at=np.where(normal_at < 0, len(used_normals), normal_at) if len(used_normals) else None,
            uv_at=np.where(uv_at < 0, len(used_uvs), uv_at) if len(used_uvs) else None,
        )

    def _renumbered(self, places: Indices) -> tuple[Indices, Indices]:
        """The places (n,) of an array that are used, in their order, and `places` counted among them. Those
        that are not there, below 0, stay as they are."""
        there = places[places >= 0]
        numbers = np.arange(len(there))
        self._place[there] = numbers
        used = np.sort(there[self._place[there] == numbers])
        self._place[used] = numbers[: len(used)]
        return used, np.where(places < 0, places, self._place[places])


def _materials(path: Path, text: ObjText) -> MaterialLibrary:
    """The materials of the files that `mtllib` names. One that cannot be read is told."""
    library = MaterialLibrary()
    wanted = {run.state.material for run in text.runs} - {""}
    for name in dict.fromkeys(text.libraries):
        for one in _files(path.parent, name):
            try:
                check_inside(path.parent, one)
                library.read(path.parent / one)
            except InputError as error:
                import_report.left_out(f"materials of {one}: {error}")
    missing = sorted(wanted - library.materials.keys())
    if missing and library.files:
        others = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        import_report.left_out(f"material {missing[0]!r}{others}: is in none of the files of materials")
    elif missing and not text.libraries:
        import_report.left_out(f"{len(missing)} materials: the file names no file of materials")
    return library


def _files(folder: Path, line: str) -> list[str]:
    """The names in a line of `mtllib`: one with spaces, or several, whose own spaces have a backslash. Where
    none of them is there, the line is one name."""
    if (folder / line).is_file():
        return [line]
    names = [_plain_name(name) for name in re.split(r"(?<!\\)\s+", line)]
    return names if any((folder / name).is_file() for name in names) else [_plain_name(line)]


def _plain_name(name: str) -> str:
    return name.replace("\\ ", " ").replace("\\", "/")


def _tell_of_rest(text: ObjText) -> None:
    if text.unreadable:
        others = f" and {len(text.unreadable) - 1:,} more" if len(text.unreadable) > 1 else ""
        import_report.left_out(f"faces at a corner {text.unreadable[0]!r}{others}: it is no index")
    for name, count in text.out_of_range.items():
        import_report.left_out(f"{name} of {counted(count, 'corner')}: are not in the file")
    undirected = int((~(np.abs(text.normals).max(axis=1, initial=0) > 0)).sum())
    if undirected:
        import_report.changed(
            f"{counted(undirected, 'normal')}: without direction, for which faces have their own"
        )
    undefined = int((~np.isfinite(text.uvs).all(axis=1)).sum())
    if undefined:
        import_report.changed(
            f"{counted(undefined, 'pair')} of texture coordinates: no numbers, which count as 0"
        )
    for count, what in ((text.lines, "line"), (text.points, "point")):
        if count:
            import_report.left_out(f"{counted(count, what)} without area")
    if text.curves:
        import_report.left_out("curves and surfaces: only polygons are read; export them as polygons")
    for keyword, count in text.unknown.items():
        import_report.left_out(f"{counted(count, 'line')} with {keyword!r}: the keyword is not known")
