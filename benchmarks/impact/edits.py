"""The edits of the benchmark of the strategy impact, in one table, found by name.

The first fifteen are those by which the method was chosen; its constants were tuned on `rotate`, `cbox`,
`nglass`, `cwall` and `nwhite`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import resources
from pathlib import Path

import numpy as np

from incpt.formats import registry
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.texture import Bitmap, Texture


@dataclass(frozen=True)
class Stage:
    """A scene that is edited: its file in scenes/, the size of its picture in pixels, and the most samples
    per pixel of its converged pictures, which take long where the scene is large."""

    file: str
    size: tuple[int, int]
    most_spp: int = 1 << 16

    @property
    def scene(self) -> Scene:
        """As the file has it."""
        return _loaded(self.file)

    def scaled_size(self, scale: float) -> tuple[int, int]:
        """Its size times a factor."""
        width, height = (max(1, round(scale * pixels)) for pixels in self.size)
        return width, height


@cache
def _loaded(file: str) -> Scene:
    return registry.load(Path(str(resources.files("incpt.scenes"))) / file)


STAGES = {
    "editing": Stage("editing.toml", (256, 144)),
    "nested": Stage("nested_dielectrics.toml", (192, 112)),
    "cornell": Stage("cornell.toml", (144, 144)),
    "city": Stage("city.toml", (192, 112), most_spp=1024),
}


@dataclass(frozen=True)
class SceneEdit:
    """An edit of a stage: `words` say what it does, `change` does it. Where the scene of the file will not
    do, `prepared` makes the one before the edit. An edit that is not `local` leaves nothing of the picture as
    it was. Where there is a `first` edit, that has been made before, and FIRST_STEPS steps were taken."""

    stage: str
    words: str
    change: Callable[[Scene], Scene]
    prepared: Callable[[Scene], Scene] | None = None
    local: bool = True
    first: Callable[[Scene], Scene] | None = None

    @cached_property
    def before(self) -> Scene:
        """The scene that is edited."""
        scene = STAGES[self.stage].scene
        return scene if self.prepared is None else self.prepared(scene)

    @cached_property
    def between(self) -> Scene | None:
        """The scene after the first edit, if there is one."""
        return None if self.first is None else self.first(self.before)

    @cached_property
    def after(self) -> Scene:
        """The edited scene."""
        return self.change(self.before if self.between is None else self.between)


def _moved(name: str, **placement: tuple[float, float, float]) -> Callable[[Scene], Scene]:
    return lambda scene: scene.with_object(name, **placement)


def _recoloured(name: str, **values: object) -> Callable[[Scene], Scene]:
    return lambda scene: scene.with_material(name, **values)


def _shown(visible: bool, *names: str) -> Callable[[Scene], Scene]:
    def change(scene: Scene) -> Scene:
        for name in names:
            scene = scene.with_object(name, visible=visible)
        return scene

    return change


def _bent(scene: Scene) -> Scene:
    """The bunny leans to its side, the more the higher."""
    mesh = scene.object("bunny").mesh
    vertices = np.array(mesh.vertices)
    height = vertices[:, 1] - vertices[:, 1].min()
    vertices[:, 0] += 0.35 * height**2 / max(float(height.max()), 1e-9)
    return scene.with_object("bunny", mesh=Mesh(vertices, mesh.faces, mesh.normals))


def _with_another_cube(scene: Scene) -> Scene:
    cube = Object(
        "another cube", shape("cube"), "plaster", (0.42, 0.12, 1.5), (0.0, 15.0, 0.0), (0.24, 0.24, 0.24)
    )
    return scene.with_added(cube)


def _two_moved(scene: Scene) -> Scene:
    scene = scene.with_object("red cube", position=(-0.45, 0.17, 1.25))
    return scene.with_object("gold ball", position=(1.6, 0.4, -0.4))


def _boarded(scene: Scene) -> Scene:
    """The red cube wears a texture of light and dark boards."""
    across = np.arange(64)
    shades = np.where(across % 16 < 2, 60, 150 + 30 * (across // 16 % 2)).astype(np.uint8)
    boards = np.stack([shades, shades * 0.7, shades * 0.4, np.full(64, 255)], axis=-1)
    image = Bitmap(np.broadcast_to(boards.astype(np.uint8), (64, 64, 4)).copy())
    return scene.with_material("red", base_color=(1.0, 1.0, 1.0), base_color_texture=Texture(image))


def _liquids(scene: Scene) -> Scene:
    for priority, absorption in (("lower", (30, 8, 12)), ("equal", (6, 24, 10)), ("higher", (18, 18, 4))):
        scene = scene.with_material(f"liquid of {priority} priority", absorption=absorption)
    return scene


FIRST_STEPS = 30
"""Steps between a first edit and the one that is measured."""
DRAG, DRAG_STAGE, DRAG_STEPS = "drag", "cornell", 20
"""The drag's name among the edits, where it happens, and its edits."""


def drag_step(scene: Scene, number: int) -> Scene:
    """The Cornell box after so many of the DRAG_STEPS edits of a drag of its short block: to the side,
    towards the eye and turned, by equal parts."""
    part = number / DRAG_STEPS
    position = (0.0925 - 0.11 * part, 0.0825, -0.169 + 0.08 * part)
    return scene.with_object("short block", position=position, rotation=(0.0, -17.0 + 40.0 * part, 0.0))


EDITS = {
    "shrink": SceneEdit(
        "editing",
        "shrink grey cube",
        _moved("small grey cube", position=(-1.6, 0.1, 0.85), scale=(0.2, 0.2, 0.2)),
    ),
    "rotate": SceneEdit(
        "editing",
        "rotate red cube",
        _moved("red cube", position=(-0.22, 0.265, 1.05), rotation=(0, 32, 30)),
    ),
    "bigmove": SceneEdit(
        "editing", "move glass cube", _moved("large translucent cube", position=(0.42, 0.601, -0.65))
    ),
    "recolour": SceneEdit("editing", "recolour red", _recoloured("red", base_color=(0.04, 0.35, 0.30))),
    "goldmove": SceneEdit("editing", "move gold ball", _moved("gold ball", position=(1.55, 0.4, 0.15))),
    "roughen": SceneEdit(
        "editing", "polish gold", _recoloured("gold", roughness=0.15, base_color=(0.95, 0.64, 0.54))
    ),
    "panel": SceneEdit("editing", "move light panel", _moved("light panel", position=(-2.0, 3.6, 1.6))),
    "glow": SceneEdit("editing", "red cube glows", _recoloured("red", emission=(3.0, 0.3, 0.2))),
    "floor": SceneEdit(
        "editing",
        "floor: metal to diffuse",
        _recoloured("floor", metallic=0.0, roughness=0.8, base_color=(0.35, 0.3, 0.25)),
        local=False,
    ),
    "cbox": SceneEdit(
        "cornell",
        "cornell: move block",
        _moved("short block", position=(0.12, 0.0825, -0.13), rotation=(0, 10, 0)),
    ),
    "cwall": SceneEdit(
        "cornell", "cornell: red wall blue", _recoloured("red", base_color=(0.10, 0.12, 0.55))
    ),
    "clight": SceneEdit("cornell", "cornell: move light", _moved("light", position=(0.08, 0.5487, -0.2795))),
    "nwhite": SceneEdit(
        "nested", "nested: move white block", _moved("white block 3", position=(-2.0, 0.62, 0.12))
    ),
    "nglass": SceneEdit(
        "nested",
        "nested: move glass block",
        _moved("large glass block 3", position=(0.15, 0.55, 0.1), rotation=(0, 20, 0)),
    ),
    "city": SceneEdit("city", "city: raise building", _moved("block A3 stepped", scale=(1, 1.4, 1))),
    "deform": SceneEdit("editing", "bend bunny", _bent),
    "hide": SceneEdit(
        "city", "city: hide building", _shown(False, "block K5 office", "block K5 office glass 1")
    ),
    "show": SceneEdit(
        "editing", "show pillar", _shown(True, "plaster pillar"), prepared=_shown(False, "plaster pillar")
    ),
    "delete": SceneEdit(
        "cornell", "cornell: delete tall block", lambda scene: scene.without_object("tall block")
    ),
    "add": SceneEdit("editing", "add cube", _with_another_cube),
    "two": SceneEdit("editing", "move red cube and gold ball", _two_moved),
    "toglass": SceneEdit(
        "editing",
        "blue cylinder to glass",
        _recoloured(
            "blue", base_color=(1, 1, 1), roughness=0.0, transmission=1.0, absorption=(2.5, 1.5, 0.4)
        ),
    ),
    "reassign": SceneEdit(
        "cornell",
        "cornell: tall block red",
        lambda scene: scene.with_object("tall block", material="red"),
    ),
    "swap": SceneEdit(
        "editing", "gold ball to cube", lambda scene: scene.with_object("gold ball", mesh=shape("cube"))
    ),
    "liquids": SceneEdit("nested", "nested: recolour three liquids", _liquids),
    "texture": SceneEdit("editing", "boards on red cube", _boarded),
    "brighten": SceneEdit(
        "editing", "brighter environment", lambda scene: scene.with_environment(intensity=0.6), local=False
    ),
    "turn": SceneEdit(
        "editing", "turn environment", lambda scene: scene.with_environment(rotation_y=215.0), local=False
    ),
    "again": SceneEdit(
        "cornell",
        "cornell: move block again",
        lambda scene: drag_step(scene, DRAG_STEPS),
        first=lambda scene: drag_step(scene, 12),
    ),
    "movecolour": SceneEdit(
        "editing",
        "recolour red cube after a move",
        _recoloured("red", base_color=(0.04, 0.35, 0.30)),
        first=_moved("red cube", position=(-0.45, 0.17, 1.25)),
    ),
    "another": SceneEdit(
        "editing",
        "move gold ball after red cube",
        _moved("gold ball", position=(1.55, 0.4, 0.15)),
        first=_moved("red cube", position=(-0.45, 0.17, 1.25)),
    ),
}
"""By name; in the order of the tables."""
