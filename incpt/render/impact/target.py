"""The target: the picture that was shown before an edit, where it is not the kept one.

Objects that are edited again keep their anchor (see anchor.py), whose picture may be that of several edits
ago: shown first, it would bring back shadows and reflections that are gone. So the picture of the edited
scene starts from the last one that was known well, wherever both show the same, and what is shrunk is the
change from that: the target of the shrinkage, as statistics calls it. Sums of samples know nothing of it, so
that nothing piles up over many edits.
"""

from __future__ import annotations

from dataclasses import dataclass

from incpt.render.film import Float32Array
from incpt.render.first_hits import Window
from incpt.render.impact import exploration
from incpt.render.impact.anchor import SURROUNDINGS, affected, touched
from incpt.render.impact.center_hits import CenterHits, Mask
from incpt.render.impact.first_sight import rows_columns, widened
from incpt.render.tiles import TileGrid
from incpt.scene.model import Scene

KNOWN = 0.5
"""The most that is left of the error of an edit (`Session.error_left`) where its picture becomes a target:
while an object is dragged on and on, that from before the drag stays."""
_RIM = 1
"""So many pixels around what was edited show a bit of it, since pixels are areas."""


@dataclass(frozen=True, eq=False)
class Target:
    """A picture (H, W, 4), as `Film.image` has it, and what is seen in its scene."""

    hits: CenterHits
    image: Float32Array

    def windows(self, scene: Scene, grid: TileGrid) -> list[Window]:
        """Where `scene` shows other objects, or the same ones edited."""
        return exploration.windows(grid, scene.camera, affected(self.hits.scene, scene))

    def shows(self, now: CenterHits, grid: TileGrid) -> Mask:
        """(H, W) where it has what is seen `now`: the same thing, which was not edited in between."""
        camera, reach = now.scene.camera, _RIM
        if camera.has_lens:
            reach += exploration.most_blur(grid, camera, affected(self.hits.scene, now.scene))
        found = self.image[..., 3] > 0
        windows = self.windows(now.scene, grid)
        if SURROUNDINGS in touched(self.hits.scene, now.scene):  # They may be seen anywhere.
            windows = [(0, 0, grid.width, grid.height)]
        for window in windows:
            inside = rows_columns(_grown(window, reach, grid))
            found[inside] &= ~widened(~self.hits.stays(now, inside), reach)
        return found


def _grown(window: Window, pixels: int, grid: TileGrid) -> Window:
    left, top, right, bottom = window
    return (
        max(left - pixels, 0),
        max(top - pixels, 0),
        min(right + pixels, grid.width),
        min(bottom + pixels, grid.height),
    )
