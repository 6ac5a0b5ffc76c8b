"""Emitters that stand in the scene itself: lights without a size, and light from far away."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from incpt.core.affine import Vector
from incpt.core.errors import InputError, in_place
from incpt.formats import images, import_report
from incpt.formats.appearance.colored import linear_pixels
from incpt.formats.lat_long import turned_environment
from incpt.formats.mitsuba.document import Document
from incpt.formats.mitsuba.node import Node
from incpt.formats.mitsuba.textures import Textures
from incpt.formats.names import Names
from incpt.picture.spectra import LUMINANCE_INTEGRAL
from incpt.scene.environment import Environment
from incpt.scene.light import Light
from incpt.scene.sky import Sky

Array = npt.NDArray[np.float64]
_SAME = 1e-6
_SOLAR_DUST = 3.0
"""The turbidity that our skies have without more dust."""


class Emitters:
    """Reads the emitters of a scene: `lights` that have a place or a direction, and the environment."""

    def __init__(self, document: Document, textures: Textures, taken: tuple[str, ...]) -> None:
        self._document, self._textures, self._names = document, textures, Names(*taken)
        self.lights: list[Light] = []
        self.environment: Environment | None = None

    def read(self, root: Node) -> None:
        """Raises InputError."""
        for node in root.objects_of("emitter"):
            if node.kind == "area":  # It stands there for shapes that refer to it.
                continue
            with in_place(node.place):
                node.ignore("sampling_weight")
                read = _KINDS.get(node.kind)
                if read is None:
                    node.ignore(*node.values, *node.objects)
                    import_report.left_out(f"{node}: emitters of that type are not read")
                else:
                    read(self, node)

    def _color(self, node: Node, name: str) -> Vector:
        found = self._textures.emission(node, name)
        if found.texture is None:
            return found.rgb
        import_report.changed(f"{name} of {node}: the mean of its image")
        mean = linear_pixels(found.texture.bitmap)[..., :3].mean(axis=(0, 1)) * found.rgb
        r, g, b = mean.tolist()
        return r, g, b

    def _name(self, node: Node) -> str:
        return self._names.new(node.id or node.kind)

    def point(self, node: Node) -> None:
        position = _position(node)
        # Intensity is power over the whole sphere of directions.
        light = Light(
            self._name(node), "point", position, color=self._color(node, "intensity"), power=4 * math.pi,
            radius=0.0,
        )  # fmt: skip
        self.lights.append(light)

    def spot(self, node: Node) -> None:
        matrix = node.matrix("to_world")
        cutoff = node.number("cutoff_angle", 20.0, 1e-3, 90.0)
        beam = min(node.number("beam_width", cutoff * 0.75, 0.0, 90.0), cutoff)
        if node.has("texture"):
            node.ignore("texture")
            import_report.left_out(f"texture of {node}: a spot has no picture here")
        if beam < cutoff:
            import_report.changed(
                f"{node}: its light falls off smoothly at the edge of the cone, not linearly"
            )
        light = Light(
            self._name(node), "spot", matrix=_facing_back(matrix), color=self._color(node, "intensity"),
            radius=0.0, spot_angle=2 * cutoff, spot_blend=1 - beam / cutoff, power=1.0,
        )  # fmt: skip
        self.lights.append(replace(light, power=light.solid_angle))

    def directional(self, node: Node) -> None:
        if node.has("direction"):
            direction = node.vector("direction", (0.0, 0.0, 1.0))
        else:
            direction = node.matrix("to_world")[:3, 2]
        length = float(np.linalg.norm(direction))
        if not length > 0:
            raise InputError("direction: has no length; write one such as 0, -1, 0")
        light = _sun(self._name(node), direction / length, self._color(node, "irradiance"))
        self.lights.append(light)

    def constant(self, node: Node) -> None:
        node.ignore("to_world")
        self._surround(node, Environment(self._color(node, "radiance")))

    def envmap(self, node: Node) -> None:
        scale = node.number("scale", 1.0, 0.0)
        turn = node.matrix("to_world")[:3, :3]
        node.ignore("mis_compensation")
        try:
            image = images.load_image(self._document.file(node.text("filename")))
        except InputError as error:
            import_report.left_out(f"{node}: {error}")
            return
        self._surround(
            node, turned_environment(str(node), Environment((1.0, 1.0, 1.0), image, intensity=scale), turn)
        )

    def sunsky(self, node: Node) -> None:
        """A clear sky of another model, with its sun where it is told. Ours is in W / (m² sr) for red, green
        and blue; theirs is as bright as light of one W / (m² sr nm) is 1."""
        turn = node.matrix("to_world")[:3, :3]
        if not node.has("sun_direction"):
            node.ignore(*node.values)
            import_report.left_out(f"{node}: is not placed by sun_direction; write one")
            return
        # The sun's direction is told in the world, and the zenith is z before the transform.
        sun, up = node.vector("sun_direction", (0.0, 0.0, 1.0)), turn @ np.array([0.0, 0.0, 1.0])
        if not (np.linalg.norm(sun) > 0 and np.linalg.norm(up) > 0):
            raise InputError("sun_direction: has no length; write one such as 0, 0, 1")
        sun, up = sun / np.linalg.norm(sun), up / np.linalg.norm(up)
        import_report.changed(f"{node}: is a sky that scatters once, of another model")
        turbidity = node.number("turbidity", 3.0, 1.0, 10.0)
        scale = node.number("sky_scale", 1.0, 0.0) / LUMINANCE_INTEGRAL
        sky = Sky(
            sun_elevation=math.degrees(math.asin(float(np.clip(sun @ up, -1, 1)))),
            dust=(turbidity - 1) / (_SOLAR_DUST - 1),
            ground=0.0,
            sun_disc=False,
        )
        node.ignore(*node.values)
        # The sun of our skies stands over +z of the image.
        ahead = sun - (sun @ up) * up
        ahead = ahead / np.linalg.norm(ahead) if np.linalg.norm(ahead) > _SAME else _across(up)
        frame = np.column_stack([np.cross(up, ahead), up, ahead])
        self._surround(
            node, turned_environment(str(node), Environment((1.0, 1.0, 1.0), sky=sky, intensity=scale), frame)
        )
        irradiance = np.array(replace(sky, sun_disc=True).sun_irradiance)
        irradiance *= node.number("sun_scale", 1.0, 0.0) / LUMINANCE_INTEGRAL
        if irradiance.max() > 0:
            self.lights.append(_sun(self._name(node), -sun, tuple(irradiance.tolist()), sky.sun_size))

    def _surround(self, node: Node, environment: Environment) -> None:
        if self.environment is not None:
            import_report.left_out(f"{node}: a scene has one environment, and this is another")
            return
        self.environment = environment


_KINDS: dict[str, Callable[[Emitters, Node], None]] = {
    "point": Emitters.point,
    "spot": Emitters.spot,
    "directional": Emitters.directional,
    "constant": Emitters.constant,
    "envmap": Emitters.envmap,
    "sunsky": Emitters.sunsky,
}


def _position(node: Node) -> Vector:
    if node.has("position") and node.has("to_world"):
        raise InputError("position: stands beside to_world; leave one of them out")
    place = (
        node.vector("position", (0.0, 0.0, 0.0)) if node.has("position") else node.matrix("to_world")[:3, 3]
    )
    x, y, z = place.tolist()
    return x, y, z


def _facing_back(matrix: Array) -> Array:
    """(3, 4) of a light, which shines along -z here and along +z there."""
    return np.column_stack([-matrix[:3, 0], matrix[:3, 1], -matrix[:3, 2], matrix[:3, 3]])


def _across(direction: Array) -> Array:
    """A unit vector at right angles."""
    other = np.cross(direction, [1.0, 0.0, 0.0] if abs(direction[0]) < 0.9 else [0.0, 1.0, 0.0])
    return np.asarray(other / np.linalg.norm(other))


def _sun(name: str, direction: Array, irradiance: Vector, angle: float = 0.0) -> Light:
    """Far light that comes along a direction."""
    across = _across(direction)
    axes = np.column_stack([across, np.cross(-direction, across), -direction, np.zeros(3)])
    return Light(name, "sun", matrix=axes, color=irradiance, irradiance=1.0, angle=angle)
