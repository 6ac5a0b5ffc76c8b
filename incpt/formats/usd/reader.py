"""Whole USD files: what they show as meshes, lights, a dome and cameras, and what became of the rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import UsdGeom, UsdLux

from incpt.core.errors import InputError
from incpt.formats import import_report
from incpt.formats.clean import tell_of_faces
from incpt.formats.import_options import current_options
from incpt.formats.import_report import counted
from incpt.formats.names import Names
from incpt.formats.placement import placed_mesh, transform_of
from incpt.formats.reading_progress import each
from incpt.formats.shared_meshes import MOST_PARTS, bounds_of, settled
from incpt.formats.usd import meshes, solids
from incpt.formats.usd.cameras import camera_of
from incpt.formats.usd.lights import Lights, is_light
from incpt.formats.usd.materials import Materials, Surface
from incpt.formats.usd.memory import bounded_memory
from incpt.formats.usd.meshes import Polygons
from incpt.formats.usd.skinning import bent_meshes
from incpt.formats.usd.stage import OpenStage, open_stage, plain_errors
from incpt.formats.usd.textures import Bitmaps
from incpt.formats.usd.walk import Place, Walk
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.mesh_part import MeshFile, MeshPart
from incpt.scene.model import CAMERA_NAME
from incpt.scene.transform import IDENTITY

Matrix = npt.NDArray[np.float64]
_Y_FROM_Z = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def read_usd(path: Path) -> MeshFile:
    """What a .usd, .usda, .usdc or .usdz file shows, in metres and with y up. Raises InputError."""
    with bounded_memory(path.stat().st_size), plain_errors():
        return _read(path)


def _read(path: Path) -> MeshFile:
    opened = open_stage(path, current_options().time or 0.0)
    metres, is_z_up = _metres(opened), UsdGeom.GetStageUpAxis(opened.stage) == UsdGeom.Tokens.z
    ours = np.diag([metres, metres, metres, 1.0]) @ (_Y_FROM_Z if is_z_up else np.eye(4))
    images = Bitmaps(opened)
    walk, lights = Walk(opened), Lights(images, ours, metres, is_z_up)
    parts, places = _Parts(opened, Materials(images), ours), []
    for place in each(list(walk.places())):
        if is_light(place.prim):
            lights.read(place)
        elif place.prim.IsA(UsdGeom.Camera):
            places.append(place)
        else:
            parts.read(place)
    made = parts.made(lights.parts)
    _tell_of_time(walk.moves or parts.moves)
    cameras = _cameras(places, opened, ours, metres, bounds_of(made))
    counts = {
        "object": len(made), "mesh": len({id(part.mesh) for part in made}), "light": len(lights.lights),
        "environment": int(lights.environment is not None), "camera": len(cameras),
    }  # fmt: skip
    import_report.read(", ".join(counted(count, what) for what, count in counts.items() if count))
    # What is lit by a mesh alone has no studio around it.
    environment = lights.environment or (Environment() if lights.parts else None)
    file = MeshFile(made, tuple(lights.lights), cameras, tuple(opened.files), environment)
    return settled(path, file)


def _metres(opened: OpenStage) -> float:
    """Of the stage's unit."""
    if not UsdGeom.StageHasAuthoredMetersPerUnit(opened.stage):
        import_report.changed("the unit: the file says none, and centimetres are that of USD")
    # Asked for as metadata, because the schema's own way refuses the single precision that some files have.
    metres = float(opened.stage.GetMetadata(UsdGeom.Tokens.metersPerUnit))
    if not 1e-9 <= metres <= 1e9:
        raise InputError(f"metersPerUnit: {metres:g} is no unit; write 0.01 for centimetres")
    return metres


def _tell_of_time(moves: bool) -> None:
    if moves and current_options().time is None:
        import_report.left_out("animation: nothing moves without --time (`time` in Python)")


def _cameras(
    places: Sequence[Place], opened: OpenStage, ours: Matrix, metres: float, bounds: Matrix
) -> dict[str, Camera]:
    cameras: dict[str, Camera] = {}
    # Under the name that is left out stands the camera of files that have none.
    names = Names(CAMERA_NAME)
    for place in places:
        camera = camera_of(place, ours, metres, opened.moment, bounds)
        if camera is not None:
            cameras[names.new(str(place.prim.GetName()))] = camera
    return cameras


class _Parts:
    """Makes parts of places: what is stored once is one mesh, however many places show it."""

    def __init__(self, opened: OpenStage, materials: Materials, ours: Matrix) -> None:
        self._moment, self._materials, self._ours = opened.moment, materials, ours
        self._meshes: dict[object, Mesh | None] = {}
        self._solids: dict[Mesh, Mesh] = {}
        self._polygons: tuple[str, Polygons | None] = ("", None)
        self._counts: dict[str, int] = {}
        self._unread: Counter[str] = Counter()
        bent = bent_meshes(opened)
        self._bent = bent.points
        self._labels, self._names = Names(), Names()
        self._found: list[MeshPart] = []
        self._cages = 0
        self.moves = bent.moves

    def read(self, place: Place) -> None:
        """What stands at a place, if it has area. Raises InputError: too many."""
        prim = place.prim
        if prim.IsA(UsdGeom.Mesh):
            self.moves = self.moves or meshes.moves(prim)
            self._read_mesh(place)
        elif solids.is_solid(prim):
            self._read_solid(place)
        elif prim.IsA(UsdGeom.Gprim) or prim.GetTypeName() == "Volume":
            self._unread[str(prim.GetTypeName())] += 1
        if prim.HasAPI(UsdLux.LightAPI):
            import_report.left_out(f"the light of {place.name!r}: a mesh shines by its material alone")
        if len(self._found) > MOST_PARTS:
            raise InputError(f"shows more than {MOST_PARTS:,} meshes; split it")

    def made(self, more: Sequence[MeshPart]) -> tuple[MeshPart, ...]:
        """All parts, and some more. Raises InputError where no face is left."""
        for kind, number in self._unread.items():
            what = f"{counted(number, 'prim')} of the type {kind}"
            import_report.left_out(f"{what}: only meshes and plain shapes are read")
        if self._cages:
            import_report.changed(f"{counted(self._cages, 'mesh')} that USD subdivides: is not, but smooth")
        for part in more:
            self._add(replace(part, name=self._names.new(part.name or "light")))
        tell_of_faces(self._counts)
        if not self._found:
            raise InputError("has no mesh that can stand where the file places it")
        return tuple(self._found)

    def _add(self, part: MeshPart, is_counted: bool = False) -> None:
        if not is_counted:
            self._counts["in all"] = self._counts.get("in all", 0) + len(part.mesh.faces)
        self._found.append(part)

    def _read_solid(self, place: Place) -> None:
        try:
            mesh, inner = solids.solid_of(place.prim, self._moment)
        except InputError as error:
            import_report.left_out(f"{place.name!r}: {error}")
            return
        if mesh not in self._solids:
            label = self._labels.new(str(place.prim.GetTypeName()).lower())
            self._solids[mesh] = replace(mesh, source=MeshSource(geometry=label))
        surface = self._materials.of(place.prim, _is_double_sided(place.prim))
        matrix = self._ours @ place.matrix @ inner
        self._show(place.name, self._solids[mesh], surface, place, matrix, is_counted=False)

    def _read_mesh(self, place: Place) -> None:
        subsets = meshes.subsets_of(place.prim)
        for number in range(-1, len(subsets)):
            # The mesh itself has what is in no subset.
            prim = place.prim if number < 0 else subsets[number]
            surface = self._materials.of(prim, _is_double_sided(place.prim))
            name = place.name if number < 0 else f"{place.name}/{prim.GetName()}"
            key = (place.key, number, surface.wanted)
            if key not in self._meshes:
                self._meshes[key] = self._mesh(place, number, name, surface)
            matrix = self._ours @ place.matrix
            self._show(name, self._meshes[key], surface, place, matrix, is_counted=True)

    def _mesh(self, place: Place, number: int, name: str, surface: Surface) -> Mesh | None:
        if self._polygons[0] != place.key:
            # Those of one mesh at a time are kept, whose pieces come one after the other.
            try:
                self._polygons = place.key, Polygons(place.prim, self._moment, self._bent.get(place.key))
            except InputError as error:
                import_report.left_out(f"{place.name!r}: {error}")
                self._polygons = place.key, None
            self._cages += self._polygons[1] is not None and self._polygons[1].is_cage
        polygons = self._polygons[1]
        mesh = None if polygons is None else polygons.mesh(number, surface.wanted, self._counts)
        return mesh and replace(mesh, source=MeshSource(geometry=self._labels.new(name)))

    def _show(
        self, name: str, mesh: Mesh | None, surface: Surface, place: Place, matrix: Matrix, is_counted: bool
    ) -> None:
        if mesh is None:
            return
        transform = transform_of(matrix)
        if transform is None:
            if not (np.isfinite(matrix).all() and abs(np.linalg.det(matrix[:3, :3])) > 0):
                import_report.left_out(f"{place.name!r}: its placement flattens it")
                return
            mesh, transform = placed_mesh(mesh, matrix[:3], mesh.source), IDENTITY
        name = self._names.new(name)
        part = MeshPart(name, mesh, surface.name, surface.material, transform, place.is_visible)
        self._add(part, is_counted)


def _is_double_sided(prim: Any) -> bool:
    return bool(UsdGeom.Gprim(prim).GetDoubleSidedAttr().Get())
