"""Reads a scene of Mitsuba 3: what it shows, how far its light goes, and what became of the rest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from incpt.core.errors import in_place
from incpt.core.settings import RenderSettings
from incpt.formats import import_report
from incpt.formats.import_report import counted
from incpt.formats.mitsuba.document import Document
from incpt.formats.mitsuba.emitters import Emitters
from incpt.formats.mitsuba.materials import Materials
from incpt.formats.mitsuba.node import Node
from incpt.formats.mitsuba.sensors import Film, camera_of, film_of
from incpt.formats.mitsuba.shapes import Shapes
from incpt.formats.mitsuba.textures import Textures
from incpt.formats.names import Names
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import CAMERA_NAME, Object, Scene

Array = npt.NDArray[np.float64]
MOST_BOUNCES = 200
"""Of paths without a `max_depth`: Russian roulette ends nearly all before, but for those that are caught in
clear bodies."""
_PATH_INTEGRATORS = ("path", "volpath", "volpathmis", "prb", "prbvolpath", "prb_basic", "ptracer", "direct")
"""Those whose picture is that of a path tracer."""


def read_mitsuba(path: Path) -> Scene:
    """The scene of a Mitsuba file. Raises InputError, one line that names the line of the file."""
    document = Document(path)
    root = document.root
    textures = Textures(document)
    materials = Materials(document, textures)
    shapes = Shapes(document, materials)
    objects = shapes.objects(root)
    materials.tell_of_back_sides()
    emitters = Emitters(document, textures, tuple(one.name for one in objects))
    emitters.read(root)
    cameras, film = _cameras(root, _bounds(objects))
    active = next(iter(cameras))
    # Mitsuba's microfacets scatter light once.
    settings = replace(_settings(root, film, shapes.materials), multiple_scattering=materials.loses_no_light)
    scene = Scene(
        cameras[active],
        emitters.environment or Environment(),
        shapes.materials,
        objects,
        settings,
        tuple(emitters.lights),
        camera_name=active,
        cameras=cameras,
    )
    _tell_of_unread(document)
    counts = {"object": len(objects), "material": len(shapes.materials), "light": len(emitters.lights)}
    import_report.read(
        ", ".join(counted(count, what) for what, count in counts.items() if count) or "nothing"
    )
    return scene


def _bounds(objects: tuple[Object, ...]) -> Array:
    """(2, 3) of all that stands in the scene; the unit cube where that is nothing."""
    if not objects:
        return np.array([[-1.0] * 3, [1.0] * 3])
    bounds = np.stack([one.world_bounds for one in objects])
    return np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])


def _cameras(root: Node, bounds: Array) -> tuple[dict[str, Camera], Film | None]:
    """The cameras by name, and the film of the first one, through which the scene is seen."""
    cameras: dict[str, Camera] = {}
    first: Film | None = None
    names = Names()
    for node in root.objects_of("sensor"):
        with in_place(node.place):
            film = film_of(node)
            camera = camera_of(node, film, bounds)
            if camera is None:
                continue
            cameras[names.new(node.id or CAMERA_NAME)] = camera
            if first is not None and film.size != first.size:
                import_report.changed(
                    f"{node}: its picture has the size of the first one's unless --size is given"
                )
            first = first or film
    if cameras:
        return cameras, first
    middle, reach = bounds.mean(axis=0), float(np.linalg.norm(bounds[1] - bounds[0]))
    import_report.changed("the scene has no camera that is read: one looks at it from the front")
    where = middle + np.array([0.35, 0.25, 1.0]) * reach * 1.3
    return {CAMERA_NAME: Camera(tuple(where.tolist()), tuple(middle.tolist()))}, None


def _settings(root: Node, film: Film | None, materials: dict[str, Material]) -> RenderSettings:
    """How far paths of the scene go, and how large its picture is."""
    depth, roulette = -1, 5
    waiting = list(root.objects_of("integrator"))
    while waiting:
        node = waiting.pop()
        with in_place(node.place):
            waiting += node.objects_of("integrator")
            if node.kind not in _PATH_INTEGRATORS:
                import_report.left_out(f"{node}: the scene is rendered by path tracing")
                node.ignore(*node.values)
                continue
            depth = 2 if node.kind == "direct" else node.whole("max_depth", -1, -1, 1 << 31)
            roulette = node.whole("rr_depth", 5, 1, 1 << 31)
            if node.flag("hide_emitters", False):
                import_report.left_out(f"hide_emitters of {node}: lights are seen by the camera")
            node.ignore("shading_samples", "emitter_samples", "bsdf_samples", "samples_per_pass")
    if depth in (0, 1):
        import_report.changed(f"max_depth: paths of {depth} are those of 2 here, which have direct light")
    bounces = MOST_BOUNCES if depth < 0 else min(max(depth - 2, 0), MOST_BOUNCES)
    if depth >= 0 and any(material.is_transmissive for material in materials.values()):
        import_report.changed(
            f"max_depth: what goes through smooth glass counts apart, up to {MOST_BOUNCES} times"
        )
    return RenderSettings(
        size=film.size if film is not None else RenderSettings().size,
        max_bounces=bounces,
        transmission_bounces=MOST_BOUNCES,
        roulette_depth=min(roulette, 255),
    )


def _tell_of_unread(document: Document) -> None:
    """Of all properties that nobody has asked for, of objects that are used."""
    used: dict[int, Node] = {}
    # What else stands in the scene is there to be referred to.
    waiting = list(document.root.objects_of("shape", "emitter", "sensor", "integrator"))
    document.root.ignore(*document.root.objects)
    while waiting:
        node = waiting.pop()
        if id(node) not in used:
            used[id(node)] = node
            waiting += [one for name, one in node.objects.items() if name in node.asked]
    for node in document.nodes:
        if (id(node) in used or node is document.root) and (names := node.unread()):
            import_report.left_out(f"{', '.join(sorted(set(names)))[:200]} of {node}: not read")
