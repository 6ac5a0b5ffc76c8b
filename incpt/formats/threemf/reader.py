"""Reads a 3MF file: the objects that it builds, where they stand, with their colours and images."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.formats import bitmaps, import_report
from incpt.formats.clean import tell_of_faces, usable_mesh
from incpt.formats.import_report import counted
from incpt.formats.names import Names
from incpt.formats.orientation import ROTATIONS
from incpt.formats.placement import transform_of
from incpt.formats.reading_progress import each
from incpt.formats.threemf.model import GREY, NOTHING, Key, Model, Placed, Solid, read_part
from incpt.formats.threemf.package import Package
from incpt.formats.vertex_attributes import NO_ATTRIBUTES, VertexAttributes, material_of_colors
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.mesh_part import MeshFile, MeshPart
from incpt.scene.texture import Bitmap, Texture
from incpt.scene.transform import Transform

Indices = npt.NDArray[np.int64]
Row = tuple[float, ...]

MOST_OBJECTS = 100_000
"""Objects at places that a file may build: each may be made of others many times over."""
MOST_MODELS = 1000
MOST_IMAGES = 256
"""Of an object."""
_SUFFIXES = (".png", ".jpg", ".jpeg")


def read_3mf(path: Path) -> MeshFile:
    """What a 3MF file builds, in metres with y up; see `mesh_files.load_file`. Raises InputError."""
    with Package(path) as package:
        model = _model(package)
        parts = _Parts(model, package, os.path.abspath(path)).all()
    meshes = len({id(part.mesh) for part in parts})
    import_report.read(f"{counted(len(parts), 'object')}, {counted(meshes, 'mesh')}")
    return MeshFile(parts)


def _model(package: Package) -> Model:
    """All model parts, the root first. Raises InputError."""
    model = Model()
    model.parts.append(package.model())
    read = 0
    while read < len(model.parts):
        if read == MOST_MODELS:
            raise InputError(f"has more than {MOST_MODELS:,} models; split it")
        read_part(model, model.parts[read], package.pieces(model.parts[read]))
        read += 1
    return model


@dataclass(frozen=True, eq=False)
class _Piece:
    """The triangles of an object that show one image, or none."""

    mesh: Mesh
    material_name: str | None
    material: Material | None


class _Parts:
    """Makes parts of what is built: each object is one mesh for each image, wherever it stands."""

    def __init__(self, model: Model, package: Package, file: str) -> None:
        self._model, self._package, self._file = model, package, file
        self._counts: dict[str, int] = {}
        self._pieces: dict[Key, list[_Piece]] = {}
        self._textures: dict[Key, Texture | None] = {}
        self._names, self._labels = Names(), Names()
        self._material_names: dict[tuple[str, Material], str] = {}
        self._names_of_materials = Names()

    def all(self) -> tuple[MeshPart, ...]:
        """The parts. Raises InputError where there is no face."""
        unit = self._model.unit
        turn = Transform(rotation=ROTATIONS["z"], scale=(unit, unit, unit)).world_from_object
        upright = np.vstack([turn, [0, 0, 0, 1]])
        parts: list[MeshPart] = []
        # All are counted before the first is made, which takes longer.
        for one in each(list(self._built())):
            parts += self._part(one, upright)
            _check_count(len(parts))
        tell_of_faces(self._counts)
        if not parts:
            raise InputError("has no usable face (nothing that it builds can be placed)")
        return (replace(parts[0], name=None),) if len(parts) == 1 else tuple(parts)

    def _built(self) -> Iterator[Placed]:
        """Every mesh that is built, with components taken apart. Raises InputError."""
        left = [*reversed(self._model.build)]
        shown = 0
        while left:
            one = left.pop()
            shown += 1
            _check_count(shown)
            solid = self._model.solids.get(one.key)
            if solid is None:
                import_report.left_out(f"object {one.key[1]} of {one.key[0]}: is not in the file")
                continue
            if solid.triangles:
                yield one
            with np.errstate(all="ignore"):
                left += [Placed(c.key, one.matrix @ c.matrix) for c in reversed(solid.components)]

    def _part(self, placed: Placed, upright: npt.NDArray[np.float64]) -> list[MeshPart]:
        solid = self._model.solids[placed.key]
        if placed.key not in self._pieces:
            self._pieces[placed.key] = list(self._made(placed.key[0], solid))
        with np.errstate(all="ignore"):
            transform = transform_of(upright @ placed.matrix)
        if transform is None:
            import_report.left_out(f"object {solid.name!r}: its placement flattens it")
            return []
        return [
            MeshPart(self._names.new(solid.name), piece.mesh, piece.material_name, piece.material, transform)
            for piece in self._pieces[placed.key]
        ]

    def _made(self, part: str, solid: Solid) -> Iterator[_Piece]:
        """An object in its own space: a piece for each image, and one for what shows none."""
        vertices = np.array(solid.vertices, np.float64).reshape(-1, 3)
        rows = np.array(solid.triangles, np.int64).reshape(-1, 7)
        groups = np.where(rows[:, 3] == NOTHING, solid.group, rows[:, 3])
        # A triangle without properties of its own has those of its object.
        numbers = np.where(rows[:, 4:5] == NOTHING, solid.property, rows[:, 4:])
        used = np.unique(groups)
        images = {g: self._model.image_groups.get((part, g)) for g in used.tolist()}
        shown = list(dict.fromkeys(None if one is None else one.image for one in images.values()))
        if len(shown) > MOST_IMAGES:
            raise InputError(f"object {solid.name!r} has more than {MOST_IMAGES} images; split it")
        image_of = np.array([shown.index(None if one is None else one.image) for one in images.values()])
        image_at = image_of[np.searchsorted(used, groups)]
        for place, image in enumerate(shown):
            is_here = image_at == place
            look = self._look(part, groups[is_here], numbers[is_here], image)
            mesh = usable_mesh(
                vertices, rows[is_here, :3], None, self._counts, look.attributes,
                uv_at=look.uv_at, color_at=look.color_at,
            )  # fmt: skip
            if mesh is not None:
                label = self._labels.new(solid.name)
                mesh = replace(mesh, source=MeshSource(file=self._file, geometry=label))
                if look.material is None:
                    yield _Piece(mesh, *material_of_colors(mesh))
                else:
                    yield _Piece(mesh, self._named(look.name, look.material), look.material)

    def _named(self, wanted: str, material: Material) -> str:
        """A name that no other material of the file has."""
        key = wanted, material
        if key not in self._material_names:
            self._material_names[key] = self._names_of_materials.new(wanted)
        return self._material_names[key]

    def _look(self, part: str, groups: Indices, numbers: Indices, image: Key | None) -> _Look:
        """What triangles (T,) look like that show one image, or none: by the groups of their properties, and
        the numbers (T, 3) in them of their corners."""
        if image is not None:
            texture = self._texture(image)
            uvs = {g: self._model.image_groups[part, g].uvs for g in np.unique(groups).tolist()}
            values, at = _at_corners(groups, numbers, uvs, (0.0, 0.0))
            attributes = VertexAttributes((values * [1, -1] + [0, 1],))
            if texture is None:
                return _Look(attributes, uv_at=at)
            material = Material(base_color=(1.0, 1.0, 1.0), base_color_texture=texture)
            return _Look(attributes, uv_at=at, name=self._model.images[image].part, material=material)
        colors = {g: self._model.colors.get((part, g)) for g in np.unique(groups).tolist()}
        self._tell_of_unknown(part, [group for group, one in colors.items() if one is None])
        found = {group: one for group, one in colors.items() if one is not None}
        if not found:
            return _Look()
        values, at = _at_corners(groups, numbers, {g: one.colors for g, one in found.items()}, GREY)
        if len(found) > 1 or (at != at.flat[0]).any():
            return _Look(VertexAttributes(colors=values), color_at=at)
        group = next(iter(found.values()))
        red, green, blue, alpha = values[at.flat[0]].tolist()
        names = dict(enumerate(group.names, 1))
        mode = "opaque" if alpha == 1 else "blend"
        material = Material(base_color=(red, green, blue), roughness=0.6, alpha=alpha, alpha_mode=mode)
        return _Look(name=names.get(int(at.flat[0])) or "color", material=material)

    def _tell_of_unknown(self, part: str, groups: list[int]) -> None:
        for group in groups:
            if group != NOTHING:
                import_report.left_out(f"properties {group} of {part}: are no colours, materials or images")

    def _texture(self, key: Key) -> Texture | None:
        """An image; None, which is told, where it cannot be read."""
        if key not in self._textures:
            self._textures[key] = None
            use = self._model.images.get(key)
            try:
                if use is None:
                    raise InputError("is not in the file")
                suffix = os.path.splitext(use.part)[1].lower()
                if suffix not in _SUFFIXES:
                    raise InputError("is neither PNG nor JPEG")
                bitmap = Bitmap(bitmaps.pixels_of(self._package.content(use.part), suffix))
                self._textures[key] = Texture(bitmap, wrap=use.wrap, filter=use.filter)
            except InputError as error:
                import_report.left_out(f"image {key[1]} of {key[0]}: {error}")
        return self._textures[key]


@dataclass(frozen=True, eq=False)
class _Look:
    """What triangles (T,) look like: attributes with the places (T, 3) of corners in them, and a material
    or None, with its name."""

    attributes: VertexAttributes = NO_ATTRIBUTES
    uv_at: Indices | None = None
    color_at: Indices | None = None
    name: str = ""
    material: Material | None = None


def _check_count(objects: int) -> None:
    if objects > MOST_OBJECTS:
        raise InputError(f"builds more than {MOST_OBJECTS:,} objects, or one of itself; split it")


def _at_corners(
    groups: Indices, numbers: Indices, values: Mapping[int, Sequence[tuple[float, ...]]], default: Row
) -> tuple[npt.NDArray[np.float64], Indices]:
    """All values of groups behind the default, and the places (T, 3) in them of the corners of triangles with
    these groups (T,) and numbers (T, 3) in them; those that are not there have the default."""
    used = np.unique(groups)
    lengths = np.array([len(values.get(group, ())) for group in used.tolist()], np.int64)
    firsts = 1 + np.cumsum(lengths) - lengths
    place = np.searchsorted(used, groups)
    is_there = (numbers >= 0) & (numbers < lengths[place][:, None])
    rows = [default, *(row for group in used.tolist() for row in values.get(group, ()))]
    return np.array(rows, np.float64), np.where(is_there, firsts[place][:, None] + numbers, 0)
