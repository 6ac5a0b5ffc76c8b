"""Reads a scene of pbrt-v4: what it shows, how far its light goes, and what became of the rest.

Its world is left-handed unless the camera mirrors it, as files of other programs do by `Scale -1 1 1`. Ours
is right-handed: where it has to be, z is negated for the whole scene, so that the picture is the same.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError, in_place
from incpt.core.settings import RenderSettings
from incpt.formats import import_report
from incpt.formats.import_report import counted
from incpt.formats.pbrt.cameras import camera_of
from incpt.formats.pbrt.document import Document
from incpt.formats.pbrt.lights import Lights
from incpt.formats.pbrt.materials import Materials
from incpt.formats.pbrt.shapes import Shapes
from incpt.formats.pbrt.textures import Textures
from incpt.scene.environment import Environment
from incpt.scene.model import Object, Scene

Array = npt.NDArray[np.float64]
_TRANSMISSION_BOUNCES = 200
_MIRRORED = np.diag([1.0, 1.0, -1.0, 1.0])
_PATH_INTEGRATORS = ("path", "volpath", "simplepath", "simplevolpath", "bdpt", "mlt", "sppm", "lightpath")
_UNUSED = ("Sampler", "PixelFilter", "Accelerator")
"""What says how a picture is made, and not which."""


def read_pbrt(path: Path) -> Scene:
    """The scene of a pbrt file. Raises InputError, one line that names the line of the file."""
    document = Document(path)
    if document.camera is None:
        raise InputError("has no Camera before WorldBegin; open the file that includes it")
    world = _handed(document.camera.state.matrix)
    textures = Textures(document)
    materials = Materials(document, textures)
    shapes = Shapes(document, materials, world)
    objects = shapes.objects()
    lights = Lights(document, textures, world, tuple(one.name for one in objects))
    lights.read()
    camera, size = camera_of(document, world, _bounds(objects))
    settings = _settings(document, size)
    scene = Scene(
        camera,
        lights.environment or Environment(),
        shapes.materials,
        objects,
        settings,
        tuple(lights.lights),
    )
    _tell_of_unread(document)
    counts = {"object": len(objects), "material": len(shapes.materials), "light": len(lights.lights)}
    import_report.read(
        ", ".join(counted(count, what) for what, count in counts.items() if count) or "nothing"
    )
    return scene


def _handed(camera_from_world: Array) -> Array:
    """(4, 4) what makes the world right-handed. Raises InputError."""
    determinant = float(np.linalg.det(camera_from_world[:3, :3]))
    if determinant == 0:
        raise InputError("the transform of the camera flattens space")
    if determinant < 0:
        return np.eye(4)
    import_report.changed("the world, which is left-handed: z is negated, so that the picture is the same")
    return _MIRRORED


def _bounds(objects: tuple[Object, ...]) -> Array:
    """(2, 3) of all that stands in the scene; a cube where that is nothing."""
    if not objects:
        return np.array([[-1.0] * 3, [1.0] * 3])
    bounds = np.stack([one.world_bounds for one in objects])
    return np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])


def _settings(document: Document, size: tuple[int, int]) -> RenderSettings:
    """How the scene asks to be rendered. pbrt's microfacets scatter light once."""
    depth = 5
    integrator = document.options.get("Integrator")
    if integrator is not None:
        with in_place(integrator.place):
            if integrator.kind not in _PATH_INTEGRATORS:
                integrator.ignore(*integrator.parameters)
                import_report.left_out(f"{integrator}: the scene is rendered by path tracing")
            else:
                depth = integrator.whole("maxdepth", 5, 0, 1 << 30)
                integrator.ignore("lightsampler", "samplelights", "samplebsdf", "regularize")
    sampler = document.options.get("Sampler")
    if sampler is not None:
        count = sampler.whole("pixelsamples", 16, 1, 1 << 30)
        import_report.changed(f"{sampler}: {count} samples a pixel are asked for by --spp {count}")
    for directive in _UNUSED:
        statement = document.options.get(directive)
        if statement is not None:
            statement.ignore(*statement.parameters)
    return RenderSettings(
        size=size,
        # Of paths with one scattering event there is direct light.
        max_bounces=min(max(depth - 1, 0), 200),
        transmission_bounces=_TRANSMISSION_BOUNCES,
        multiple_scattering=False,
    )


def _tell_of_unread(document: Document) -> None:
    """Of all parameters that nobody has asked for, of statements that were read."""
    for statement in document.statements:
        if statement.asked and (names := statement.unread()):
            import_report.left_out(f"{', '.join(sorted(names))[:200]} of {statement}: not read")
