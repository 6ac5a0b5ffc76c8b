"""Paths that are traced together: what a tracer is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import layout
from incpt.tables.change_tables import ChangeTables
from incpt.tables.scene_tables import SceneTables


@dataclass(frozen=True, eq=False)
class TouchTest:
    """Asks of each path whether it meets something of `changes`, the difference between the scene that the
    paths are traced in and another one. `touched` has a uint for each path of the path buffer, which gets 1
    or 0; the rest of its buffer holds nothing of use afterwards."""

    changes: ChangeTables
    touched: cl.Buffer


@dataclass(frozen=True, eq=False)
class Batch:
    """Paths to trace, those of `slots` in order or those of a list, and where they leave what they bring.

    tables       the scene that they are traced in.
    params       () layout.PARAMS as `params.path_params` makes them: which paths these are. What follows from
                 the tables is not in them, so that `replace(batch, tables=others)` are the same paths, pixel
                 by pixel and sample by sample, in another scene.
    slots        layout.SLOT on the device: which tile and which samples are in which slot.
    path_count   how many paths these are; tracing takes no others of `slots`.
    path_buffer  planes of params["buffer_stride"] floats, which get what each path brings: those of radiance
                 in layout.SamplePlane, with `aovs` all of them.
    counters     uints on the device, one for each layout.Counter, to which tracing adds.
    aovs         whether auxiliary images are part of it.
    places       uints on the device: which of the paths of `slots` these are. Path number k of the list is
                 number k of the path buffer. None: the first ones.
    touch_test   what else is asked of the paths.
    """

    tables: SceneTables
    params: npt.NDArray[np.void]
    slots: cl.Buffer
    path_count: int
    path_buffer: cl.Buffer
    counters: cl.Buffer
    aovs: bool = False
    places: cl.Buffer | None = None
    touch_test: TouchTest | None = None

    @property
    def features(self) -> tuple[str, ...]:
        """What chooses the variants of the kernels that trace these paths; see `program.FEATURES`."""
        asked = {
            "AOVS": self.aovs,
            "CHANGES": self.touch_test is not None,
            "CLAMP_INDIRECT": self.params["clamp_indirect"] > 0,
        }
        return (*self.tables.variant, *(name for name, is_asked in asked.items() if is_asked))

    @property
    def values(self) -> dict[str, Any]:
        """What kernels are bound to of it, by name. Kernels that have no use for a buffer get any one."""
        test, unused = self.touch_test, self.slots
        return {
            "slots": self.slots,
            "counters": self.counters,
            "places": unused if self.places is None else self.places,
            "change": np.zeros((), layout.CHANGE) if test is None else test.changes.change,
            "changed_objects": unused if test is None else test.changes.objects,
            "touched": unused if test is None else test.touched,
        }
