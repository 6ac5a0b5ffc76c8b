"""Reads a PLY file: its faces and strips as a mesh, or as one for each of its images."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.core.files import read_bytes
from incpt.formats import bitmaps, import_report
from incpt.formats.clean import tell_of_faces, usable_mesh
from incpt.formats.far_origin import nearer
from incpt.formats.import_report import counted
from incpt.formats.outside import check_inside
from incpt.formats.ply.header import Header, read_header
from incpt.formats.ply.rows import Rows, read_rows
from incpt.formats.polygons import Triangles, triangles_of
from incpt.formats.text_numbers import whole_or_negative
from incpt.formats.vertex_attributes import VertexAttributes, material_of_colors
from incpt.picture.color import linear_from_srgb
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.mesh_part import MeshFile, MeshPart
from incpt.scene.texture import Texture

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

_POSITION, _NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")
_UVS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
_COLORS = (
    ("red", "green", "blue", "alpha"),
    ("diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"),
    ("r", "g", "b", "a"),
)
"""Names under which colours stand; the fourth may be missing."""
_CORNERS = ("vertex_indices", "vertex_index")
_WEDGES, _IMAGE = "texcoord", "texnumber"
"""Of faces: texture coordinates of their corners, and which of the file's images they show."""
_MOST_IMAGES = 256
_LARGEST_COLORS = {"u1": 255, "u2": 65_535}


def read_ply(path: Path) -> MeshFile:
    """The mesh of a PLY file; see `mesh_files.load_file`. (0, 0) of its texture coordinates is the bottom
    left of an image, as MeshLab, Blender and pbrt have it. Colours in whole numbers are sRGB, those in
    floats linear. Raises InputError."""
    content = read_bytes(path)
    header = read_header(content)
    elements = _elements(header, content)
    # Numbers of damaged files may be any.
    with np.errstate(all="ignore"):
        vertices = _Vertices(elements)
        faces = _Faces(elements, vertices)
    _tell_of_unused(elements, vertices, faces)
    counts = {"in all": faces.triangles.too_small, "with fewer than three corners": faces.triangles.too_small}
    images = _Images(path, header, has_uvs=vertices.uvs is not None or faces.uvs is not None)
    parts = list(_parts(images, vertices, faces, counts))
    tell_of_faces(counts)
    import_report.read(f"{counted(counts['in all'], 'triangle')}, {counted(vertices.count, 'point')}")
    source = MeshSource(file=os.path.abspath(path))
    if len(parts) == 1:
        parts = [replace(parts[0], name=None)]
    named = (replace(one, mesh=replace(one.mesh, source=replace(source, part=one.name))) for one in parts)
    return MeshFile(tuple(named), files=tuple(images.files))


def _elements(header: Header, content: bytes) -> dict[str, Rows]:
    """The rows of each element, by its name. Raises InputError."""
    rows, left = read_rows(header, content)
    found: dict[str, Rows] = {}
    for one in rows:
        if one.name in found:
            text = f"{counted(one.count, 'row')} of {one.name!r}: that element stands twice"
            import_report.left_out(text)
        else:
            found[one.name] = one
    if left:
        what = "bytes" if header.order else "numbers"
        import_report.left_out(f"{left:,} {what} behind the last element: the header names none")
    return found


class _Vertices:
    """What stands at vertices: `positions` (V, 3) and, or None, `normals` (V, 3), `uvs` (V, 2) with (0, 0) at
    the top left of an image, and linear `colors` (V, 4). `used`: the properties that these are from."""

    def __init__(self, elements: dict[str, Rows]) -> None:
        rows = elements.get("vertex")
        if rows is None or not all(name in rows for name in _POSITION):
            raise InputError("has no vertices with x, y and z; it is no mesh")
        self.count, self.used = rows.count, [*_POSITION]
        self.positions = nearer(np.stack([rows.numbers(name) for name in _POSITION], axis=1))
        self.normals = None
        if all(name in rows for name in _NORMAL):
            self.normals = np.stack([rows.numbers(name) for name in _NORMAL], axis=1)
            self.used += _NORMAL
        self.uvs = None
        for pair in _UVS:
            if self.uvs is None and all(name in rows for name in pair):
                self.uvs = _upright(np.stack([rows.numbers(name) for name in pair], axis=1))
                self.used += pair
        self.colors, names = _colors(rows)
        self.used += names


class _Faces:
    """The triangles of faces and strips. `colors` (C, 4) are linear colours of faces with their places
    `color_at` (T, 3); `uvs` (N, 2) texture coordinates at corners with theirs in `uv_at` (T, 3); `images`
    (T,) the numbers of images; None where the file has none. `used`: the properties that these are from."""

    def __init__(self, elements: dict[str, Rows], vertices: _Vertices) -> None:
        faces, strips = elements.get("face"), elements.get("tristrips")
        self.used: dict[str, list[str]] = {"face": [], "tristrips": []}
        self.colors: Array | None = None
        self.color_at: Indices | None = None
        self.uvs: Array | None = None
        self.uv_at: Indices | None = None
        self.images: Indices | None = None
        if not any(rows is not None and rows.count for rows in (faces, strips)):
            if not vertices.count:
                raise InputError("has no vertices and no faces")
            raise InputError(
                f"is a cloud of {counted(vertices.count, 'point')} without faces; make a surface of it "
                "first, as MeshLab and CloudCompare do"
            )
        found = []
        if faces is not None and faces.count:
            sizes, corners = self._corners(faces)
            found.append(triangles_of(sizes, vertices.positions, corners))
            self._read_faces(faces, found[0], sizes)
        if strips is not None and strips.count:
            found.append(_strips(*self._corners(strips)))
        self.triangles = found[0] if len(found) == 1 else self._joined(found[0], found[1])

    def _corners(self, rows: Rows) -> tuple[Indices, Indices]:
        for name in _CORNERS:
            if name in rows:
                self.used[rows.name].append(name)
                sizes, corners = rows.lists(name)
                return sizes, whole_or_negative(corners)
        raise InputError(f"has no list {_CORNERS[0]!r} in {rows.name!r}; the file is no mesh")

    def _read_faces(self, faces: Rows, triangles: Triangles, sizes: Indices) -> None:
        colors, names = _colors(faces)
        if colors is not None:
            self.colors, self.color_at = colors, np.repeat(triangles.polygons[:, None], 3, axis=1)
        if _WEDGES in faces and faces.is_list(_WEDGES):
            names.append(_WEDGES)
            self._read_wedges(faces, triangles, sizes)
        if _IMAGE in faces and not faces.is_list(_IMAGE):
            names.append(_IMAGE)
            numbers = whole_or_negative(faces.numbers(_IMAGE))
            self.images = numbers[triangles.polygons]
        self.used["face"] += names

    def _read_wedges(self, faces: Rows, triangles: Triangles, sizes: Indices) -> None:
        lengths, values = faces.lists(_WEDGES)
        fits = lengths == 2 * sizes
        if not fits.all():
            (some,) = np.nonzero(~fits & (lengths > 0))
            if len(some):
                import_report.left_out(
                    f"texture coordinates of {counted(len(some), 'face')}: are not two for each corner"
                )
        uvs = values[np.repeat(fits, lengths)].reshape(-1, 2)
        # Corners of faces without any take what stands behind all of them.
        number_at = np.full(int(sizes.sum()), len(uvs))
        number_at[np.repeat(fits, sizes)] = np.arange(len(uvs))
        self.uvs = _upright(np.concatenate([uvs, np.zeros((1, 2), uvs.dtype)]))
        self.uv_at = number_at[triangles.corners]

    def _joined(self, faces: Triangles, strips: Triangles) -> Triangles:
        """Faces and strips together; what only faces have is white, or 0, on strips."""
        count = len(strips.faces)
        if self.colors is not None and self.color_at is not None:
            self.color_at = _with_rows(self.color_at, count, len(self.colors))
            self.colors = np.concatenate([self.colors, np.ones((1, 4))])
        if self.uvs is not None and self.uv_at is not None:
            self.uv_at = _with_rows(self.uv_at, count, len(self.uvs) - 1)
        if self.images is not None:
            self.images = np.concatenate([self.images, np.full(count, -1)])
        return Triangles(
            np.concatenate([faces.faces, strips.faces]), np.zeros((0, 3), np.int64),
            np.zeros(0, np.int64), faces.too_small,
        )  # fmt: skip


def _with_rows(places: Indices, count: int, value: int) -> Indices:
    return np.concatenate([places, np.full((count, 3), value)])


def _strips(sizes: Indices, corners: Indices) -> Triangles:
    """The triangles of strips with so many corners each, in which -1 ends one too; every second winds the
    other way round."""
    ends = np.zeros(len(corners) + 1, bool)
    ends[np.cumsum(sizes)] = True
    breaks = corners == -1
    begins = np.concatenate([[True], breaks[:-1]]) | ends[:-1] if len(corners) else breaks
    number = np.cumsum(begins)
    first = np.maximum.accumulate(np.where(begins, np.arange(len(corners)), 0))
    place = np.arange(max(len(corners) - 2, 0))
    usable = (number[place] == number[place + 2]) & ~(breaks[place] | breaks[place + 1] | breaks[place + 2])
    place = place[usable]
    is_odd = (place - first[place]) % 2 == 1
    numbers = np.column_stack(
        [place, np.where(is_odd, place + 2, place + 1), np.where(is_odd, place + 1, place + 2)]
    )
    return Triangles(corners[numbers], numbers, np.zeros(len(numbers), np.int64))


def _upright(uvs: npt.NDArray[np.floating]) -> Array:
    """(N, 2) texture coordinates from the bottom left of an image as those from its top left."""
    return uvs.astype(np.float64) * [1, -1] + [0, 1]


def _colors(rows: Rows) -> tuple[Array | None, list[str]]:
    """(rows, 4) linear colours, and the names of the properties that they are from."""
    for names in _COLORS:
        if all(name in rows and not rows.is_list(name) for name in names[:3]):
            used = [name for name in names if name in rows]
            shares = np.ones((rows.count, 4))
            for column, name in enumerate(used):
                shares[:, column] = _shares(rows, name)
            if rows.kind(names[0])[0] in "iu":
                shares[:, :3] = linear_from_srgb(np.clip(shares[:, :3], 0, 1))
            return shares, used
    return None, []


def _shares(rows: Rows, name: str) -> Array:
    """(rows,) parts of colours from 0 to 1."""
    kind = rows.kind(name)
    values = rows.numbers(name).astype(np.float64)
    if kind[0] in "iu":
        return values / _LARGEST_COLORS.get(kind, 255)
    outside = int(((values < 0) | (values > 1)).sum())
    if outside:
        import_report.changed(f"{name!r} of {counted(outside, 'row')} of {rows.name!r}: held within 0 to 1")
    return values


def _tell_of_unused(elements: dict[str, Rows], vertices: _Vertices, faces: _Faces) -> None:
    used = {"vertex": vertices.used, **faces.used}
    for rows in elements.values():
        if rows.name not in used:
            if rows.count:
                import_report.left_out(
                    f"{counted(rows.count, 'row')} of {rows.name!r}: the element is not known"
                )
            continue
        unused = [name for name in rows.names if name not in used[rows.name]]
        if unused and rows.count:
            listed = ", ".join(unused[:8]) + (", …" if len(unused) > 8 else "")
            import_report.left_out(f"properties of {rows.name!r} ({listed}): nothing here is like them")


def _parts(images: _Images, vertices: _Vertices, faces: _Faces, counts: dict[str, int]) -> Iterator[MeshPart]:
    """A part for each image that faces show; one in all where there is one or none."""
    colors, color_at = vertices.colors, None
    if vertices.colors is None:
        colors, color_at = faces.colors, faces.color_at
    elif faces.colors is not None:
        import_report.left_out("colours of faces: those of vertices are used")
    uvs = vertices.uvs if faces.uvs is None else faces.uvs
    last = len(images.textures)
    numbers = None if last < 2 or faces.images is None else faces.images.clip(-1, last)
    shown = faces.triangles.faces
    for number in [0] if numbers is None else np.unique(numbers).tolist():
        chosen = slice(None) if numbers is None else numbers == number
        mesh = usable_mesh(
            vertices.positions, shown[chosen], vertices.normals, counts,
            VertexAttributes(() if uvs is None else (uvs,), colors),
            uv_at=None if faces.uv_at is None else faces.uv_at[chosen],
            color_at=None if color_at is None else color_at[chosen],
        )  # fmt: skip
        if mesh is not None:
            material = images.material(number) or material_of_colors(mesh)
            yield MeshPart(f"image {number}", mesh if numbers is None else _alone(mesh), *material)


def _alone(mesh: Mesh) -> Mesh:
    """The mesh without the vertices that none of its faces uses."""
    used, faces = np.unique(mesh.faces, return_inverse=True)
    return replace(mesh, vertices=mesh.vertices[used], faces=faces.reshape(-1, 3).astype(np.int32))


class _Images:
    """The images that comments name. `textures`: None, which is told, for those that cannot be used; `files`:
    where they are, or would be. Raises InputError where there are too many."""

    def __init__(self, path: Path, header: Header, has_uvs: bool) -> None:
        if len(header.textures) > _MOST_IMAGES:
            raise InputError(f"names {len(header.textures):,} images, more than {_MOST_IMAGES}; split it")
        self._names = header.textures
        self.textures: list[Texture | None] = []
        self.files: list[Path] = []
        for name in header.textures:
            self.textures.append(None)
            try:
                if not has_uvs:
                    raise InputError("the file has no texture coordinates")
                check_inside(path.parent, name)
                self.files.append(path.parent / name)
                self.textures[-1] = Texture(bitmaps.load_bitmap(path.parent / name))
            except InputError as error:
                import_report.left_out(f"image {name}: {error}")

    def material(self, number: int) -> tuple[str, Material] | None:
        """The name and the material of what shows an image, where it is there."""
        texture = self.textures[number] if 0 <= number < len(self.textures) else None
        if texture is None:
            return None
        return self._names[number], Material(base_color=(1.0, 1.0, 1.0), base_color_texture=texture)
