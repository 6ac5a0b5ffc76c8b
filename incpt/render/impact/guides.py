"""Guides: which pixels of a picture belong together, so that what is known of one is used for the other."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from incpt.core import layout
from incpt.device.device import Device
from incpt.render.impact.patches import Patches

_CLASS_BIT, _TARGET_BIT = np.uint32(1 << 31), np.uint32(1 << 30)


class Guides:
    """Of a picture of `width` x `height` pixels on a device: what each pixel shows, and weights with which
    its neighbours count. All pixels belong together at first."""

    def __init__(self, device: Device, width: int, height: int) -> None:
        self.patches = Patches(device, width, height)
        pixels, weights = width * height, 2 * layout.SMOOTHING_SCALES * self.patches.field_size
        self.labels, self._normals = device.empty(4 * pixels), device.empty(12 * pixels)
        self.weights = device.empty(4 * weights)
        # Beyond the edges of the picture nothing counts.
        device.fill(self.weights, 0, 4 * weights)
        self.set(
            np.zeros((height, width), np.uint32),
            np.zeros((height, width, 3)),
            np.zeros((height, width), np.bool_),
        )

    def set(
        self,
        labels: npt.NDArray[np.integer],
        normals: npt.NDArray[np.floating],
        changed: npt.NDArray[np.bool_],
        in_target: npt.NDArray[np.bool_] | None = None,
    ) -> None:
        """What the pixel centres show in the old and in the new scene.

        labels     (H, W) below 2^30: a number for both objects together. Pixels with different ones do not
                   belong together.
        normals    (H, W, 3) of the new scene, world space, unit length; 0 where a pixel shows no surface.
        changed    (H, W) whether the object itself changed, in its place or in its material: such pixels have
                   statistics of their own.
        in_target  (H, W) whether the target shows the same; None: there is no target.
        """
        device = self.patches.device
        words = np.asarray(labels, np.uint32) | changed * _CLASS_BIT
        if in_target is not None:
            words |= in_target * _TARGET_BIT
        self.has_target = in_target is not None and bool(in_target.any())
        device.write(self.labels, words)
        device.write(self._normals, np.moveaxis(np.asarray(normals, np.float32), 2, 0))
        self._weigh(self.patches)

    def idle_launches(self) -> list[Callable[[], None]]:
        """The launches of the kernel, with nothing to do; see `Device.built`."""
        return [partial(self._weigh, self.patches.nothing)]

    def _weigh(self, patches: Patches) -> None:
        values = {"labels": self.labels, "guide_normals": self._normals, "guides": self.weights}
        patches.launch("weigh_guides", "weigh_guides", values)
