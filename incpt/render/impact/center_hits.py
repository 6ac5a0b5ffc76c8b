"""What the rays through pixel centres meet first in a scene, and where two scenes show the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.render.film import Float32Array
from incpt.render.impact.anchor import SURROUNDINGS, touched
from incpt.scene.model import Scene

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class CenterHits:
    """The object's place in the scene, or -1 (H, W), and the shading normal in world space and the base
    colour there (H, W, 3)."""

    scene: Scene
    objects: npt.NDArray[np.int32]
    normals: Float32Array
    colors: Float32Array

    def stays(self, now: CenterHits, inside: tuple[slice, slice]) -> Mask:
        """(h, w) where the pixels `inside` show the same thing `now`, and it was not edited in between: not
        moved, nor its shape or its material."""
        numbers = now.scene.object_index
        # The last place is that of -1, of no object.
        common = np.array([numbers.get(obj.name, -2) for obj in self.scene.objects] + [-1], np.int32)
        is_edited = np.zeros(len(now.scene.objects) + 1, np.bool_)
        edited = touched(self.scene, now.scene)
        is_edited[[numbers[name] for name in edited if name in numbers]] = True
        is_edited[-1] = SURROUNDINGS in edited
        then, objects = common[self.objects[inside]], now.objects[inside]
        stays: Mask = (then == objects) & ~is_edited[objects]
        return stays
