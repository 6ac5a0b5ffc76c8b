"""Writes a scene as glTF, and tells what that cannot hold."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.core.checks import path_of, require
from incpt.core.errors import InputError
from incpt.core.settings import RenderSettings
from incpt.formats import import_report
from incpt.formats.gltf.lights import EXTENSION as LIGHTS
from incpt.formats.gltf_writer.container import Container
from incpt.formats.gltf_writer.geometry import GeometryWriter
from incpt.formats.gltf_writer.losses import Losses
from incpt.formats.gltf_writer.materials import MaterialWriter
from incpt.formats.names import Names
from incpt.formats.placement import transform_of
from incpt.formats.relink import check_nothing_missing
from incpt.scene.camera import Camera
from incpt.scene.light import Light
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Scene
from incpt.scene.shapes import shape
from incpt.scene.transform import Transform

Array = npt.NDArray[np.float64]

_NEAREST = 1e-3
"""The near plane of cameras that have none, metres: glTF wants one."""
_SHARPEST = 1e-4
"""The least blend of a spot: in glTF its inner cone is smaller than the outer one."""
_CORNERS = 128
"""Of a disk that becomes a surface."""
_SUFFIX = ".glb"


def export(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Writes a scene as a .glb file, atomically: objects with shared meshes, materials, images, cameras and
    lights. InputWarnings tell what glTF has no place for, such as the environment. `load` gives back what
    both know: with a file of the same name objects have their names again.

    Raises InputError: another suffix, or more than 4 GiB; OutputError where the file cannot be written.
    """
    require("scene", scene, Scene, "a Scene")
    check_nothing_missing(scene)
    path = path_of("path", path)
    if path.suffix.lower() != _SUFFIX:
        raise InputError(f"{path}: a scene is exported as {_SUFFIX}; end its name so")
    with import_report.in_file(str(path)):
        _Export(scene, f"{path.stem}/").container.write(path)


class _Export:
    """The tables of a scene. `prefix` is left away from names, because reading the file puts it there."""

    def __init__(self, scene: Scene, prefix: str) -> None:
        self.container = Container()
        self._scene, self._prefix = scene, prefix
        self._losses = Losses()
        self._materials = MaterialWriter(self.container, self._losses)
        self._geometry = GeometryWriter(self.container)
        self._meshes: dict[tuple[Mesh, str], int] = {}
        self._labels = Names()
        self._add_everything()
        self._losses.tell()
        _tell_of_rest(scene)

    def _add_everything(self) -> None:
        scene = self._scene
        nodes = [
            self._node(obj.name, obj.transform, obj.visible, {"mesh": self._mesh(obj.mesh, obj.material)})
            for obj in scene.objects
        ]
        nodes += [self._light(light) for light in scene.lights]
        # The first camera of a file is the one that it is seen through.
        names = dict.fromkeys([scene.camera_name, *scene.cameras])
        nodes += [self._camera(name, scene.cameras[name]) for name in names]
        self.container.add("scenes", {"nodes": nodes})

    def _node(self, name: str, transform: Transform, is_visible: bool, carried: dict[str, Any]) -> int:
        """The number of a node; of one that is sheared, which glTF's nodes are not, a node above it, which
        shears it by scaling what is turned."""
        node: dict[str, Any] = {"name": name.removeprefix(self._prefix) or name, **carried}
        if not is_visible:
            node["extensions"] = {
                **carried.get("extensions", {}),
                **self.container.extension("KHR_node_visibility", {"visible": False}),
            }
        plain = transform
        if transform.matrix is not None:
            found = transform_of(np.vstack([transform.world_from_object, [0, 0, 0, 1]]))
            plain = transform if found is None else found
        if plain.matrix is None:
            turn = affine.rotation_matrix(plain.rotation)
            return self.container.add("nodes", node | _placement(plain.position, turn, plain.scale))
        left, scale, right = np.linalg.svd(plain.world_from_object[:, :3])
        # Both are to turn only, and the scale to mirror.
        mirrors = np.linalg.det(left), np.linalg.det(right)
        left, right, scale = left * mirrors[0], right * mirrors[1], scale * mirrors[0] * mirrors[1]
        below = self.container.add("nodes", node | _placement((0, 0, 0), right, (1, 1, 1)))
        return self.container.add("nodes", {"children": [below]} | _placement(plain.position, left, scale))

    def _mesh(self, mesh: Mesh, material: str) -> int:
        key = mesh, material
        if key not in self._meshes:
            source = mesh.source
            label = source.geometry or source.part or source.shape or Path(source.file or "mesh").stem
            self._meshes[key] = self.container.add("meshes", {
                "name": self._labels.new(label),
                "primitives": [self._primitive(mesh, material, self._scene.materials[material])],
            })  # fmt: skip
        return self._meshes[key]

    def _primitive(self, mesh: Mesh, name: str, material: Material) -> dict[str, Any]:
        number = self._materials.number(name, material)
        return {**self._geometry.primitive(mesh, material), "material": number}

    def _camera(self, name: str, camera: Camera) -> int:
        width, height = self._scene.settings.size
        aspect = width / height
        lens: dict[str, Any] = {"znear": camera.near or _NEAREST}
        if camera.is_orthographic:
            half = camera.ortho_height / 2
            far = _farthest(self._scene, camera)
            lens |= {"xmag": half * aspect, "ymag": half, "zfar": lens["znear"] + far}
        else:
            lens |= {"yfov": math.radians(camera.fov_y_at(aspect)), "aspectRatio": aspect}
        table = {"type": camera.projection, camera.projection: lens, "name": name}
        self._losses.note("camera", name, _lost(camera))
        right, up, forward = camera.image_plane(aspect)
        turn = np.stack([one / np.linalg.norm(one) for one in (right, up, -forward)], axis=1)
        node = {"name": name, "camera": self.container.add("cameras", table)}
        return self.container.add("nodes", node | _placement(camera.position, turn, (1, 1, 1)))

    def _light(self, light: Light) -> int:
        if light.kind in ("rectangle", "disk", "sphere"):
            return self._glowing(light)
        lost = [] if not light.has_size else ["size"]
        lost += [] if light.casts_shadows else ["lack of shadows"]
        self._losses.note("light", light.name, lost)
        strength, value = light.strength
        if strength == "power":
            value /= light.solid_angle
        elif strength == "radiance":
            value *= light.face
        # A colour has no more than 1 there.
        most = max(*light.color, 1.0)
        table: dict[str, Any] = {
            "type": "directional" if light.is_far else light.kind,
            "color": [one / most for one in light.color],
            "intensity": value * most,
        }
        if light.kind == "spot":
            outer = math.radians(light.spot_angle) / 2
            blend = max(light.spot_blend, _SHARPEST)
            table["spot"] = {"innerConeAngle": outer * (1 - blend), "outerConeAngle": outer}
        number = self.container.add_to_extension(LIGHTS, "lights", table)
        carried = {"extensions": self.container.extension(LIGHTS, {"light": number})}
        place = Transform(light.position, light.rotation)
        return self._node(light.name, place, light.visible, carried)

    def _glowing(self, light: Light) -> int:
        """A light with a surface as a surface that glows, as bright as it is."""
        self._losses.note_glowing(light.kind, light.name)
        material = Material(
            base_color=(0.0, 0.0, 0.0), specular=0.0, emission=light.emitted, double_sided=light.double_sided
        )
        primitive = self._primitive(_surface_of(light.kind), light.name, material)
        mesh = self.container.add("meshes", {"name": light.name, "primitives": [primitive]})
        half = light.half_size
        scale = (*half, 1.0) if light.kind != "sphere" else (half[0],) * 3
        place = Transform(light.position, light.rotation, scale)
        return self._node(light.name, place, light.visible, {"mesh": mesh})


@cache
def _surface_of(kind: str) -> Mesh:
    """Of a light with half sizes of 1, which shines along -z."""
    if kind == "sphere":
        ball = shape("sphere")
        return replace(ball, vertices=2 * ball.vertices, uvs=())
    if kind == "rectangle":
        corners = np.array([[-1, -1, 0], [-1, 1, 0], [1, 1, 0], [1, -1, 0]], np.float32)
    else:
        angle = -np.arange(_CORNERS) * 2 * math.pi / _CORNERS
        # As large as the circle.
        radius = math.sqrt(2 * math.pi / (_CORNERS * math.sin(2 * math.pi / _CORNERS)))
        corners = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], 1).astype(np.float32)
    second = np.arange(1, len(corners) - 1)
    return Mesh(corners, np.stack([0 * second, second, second + 1], axis=1))


def _placement(position: Any, turn: Array, scale: Any) -> dict[str, Any]:
    """The keys of a node that say where it stands, those that say anything. `turn` (3, 3) is a rotation."""
    values = {
        "translation": ([float(one) for one in position], [0.0] * 3),
        "rotation": (_quaternion(turn), [0.0, 0.0, 0.0, 1.0]),
        "scale": ([float(one) for one in scale], [1.0] * 3),
    }
    return {key: value for key, (value, default) in values.items() if value != default}


def _quaternion(turn: Array) -> list[float]:
    """x, y, z, w of a rotation (3, 3) (Shepperd, "Quaternion from Rotation Matrix", 1978): from the largest
    of the four, so that nothing cancels."""
    x, y, z = np.diag(turn)
    squares = np.array([1 + x - y - z, 1 - x + y - z, 1 - x - y + z, 1 + x + y + z])
    first = int(squares.argmax())
    (a, b), (c, d), (e, f) = (turn[2, 1], turn[1, 2]), (turn[0, 2], turn[2, 0]), (turn[1, 0], turn[0, 1])
    rows = [
        (squares[0], e + f, c + d, a - b),
        (e + f, squares[1], a + b, c - d),
        (c + d, a + b, squares[2], e - f),
        (a - b, c - d, e - f, squares[3]),
    ]
    quaternion = np.array(rows[first])
    quaternion /= np.linalg.norm(quaternion)
    return [float(one) + 0.0 for one in quaternion]


def _farthest(scene: Scene, camera: Camera) -> float:
    """How far from a camera anything is, and a metre more."""
    corners = [affine.box_corners(one.world_bounds) for one in scene.everything]
    places = np.concatenate([np.zeros((1, 3)), *corners])
    return 1.0 + float(np.linalg.norm(places - np.asarray(camera.position), axis=1).max())


def _lost(camera: Camera) -> list[str]:
    """What of its lens glTF has no place for."""
    lost = ["depth of field"] if camera.has_lens else []
    return [*lost, "shift"] if camera.shift_x or camera.shift_y else lost


def _tell_of_rest(scene: Scene) -> None:
    environment = scene.environment
    if any(environment.radiance):
        import_report.left_out("the environment: glTF has no place for light from far away but suns")
    if scene.settings != RenderSettings():
        import_report.left_out("how the scene is rendered: glTF has no place for it")
