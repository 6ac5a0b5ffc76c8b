"""Which prims of a stage are shown, and where: by transforms, visibility, purpose and instances of any
kind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Usd, UsdGeom

from incpt.core.errors import InputError
from incpt.formats import import_report
from incpt.formats.import_report import counted
from incpt.formats.shared_meshes import MOST_PARTS
from incpt.formats.usd.stage import OpenStage

Matrix = npt.NDArray[np.float64]
_SHOWN_PURPOSES = ("default", "render")
_MOST_PRIMS = 10 * MOST_PARTS
_DEEPEST = 64
"""Point instancers within point instancers."""


@dataclass(frozen=True, eq=False)
class Place:
    """A prim where it is shown: its name among all that are, its placement (4, 4) in the space of the stage,
    and whether it and all above it are visible. `key` is the same for all places of what is stored once."""

    prim: Any
    name: str
    matrix: Matrix
    is_visible: bool
    key: str


@dataclass(frozen=True, eq=False)
class _Step:
    """A prim to look at, with what it has from above: its matrix, its visibility, and its purpose."""

    prim: Any
    prefix: str
    above: Matrix
    is_visible: bool
    purpose: str
    depth: int = 0


class Walk:
    """Goes through the prims of a stage. `moves` tells afterwards whether any place changes over time."""

    def __init__(self, opened: OpenStage) -> None:
        self._stage, self._moment = opened.stage, opened.moment
        self._cache = UsdGeom.XformCache(self._moment)
        self._hidden: Counter[str] = Counter()
        self._predicate = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
        self.moves = False

    def places(self) -> Iterator[Place]:
        """Of everything that is shown, each before what stands below it. What is not for pictures is told.
        Raises InputError: too many."""
        first = _Step(self._stage.GetPseudoRoot(), "", np.eye(4), True, "default")
        for count, place in enumerate(self._below(first)):
            if count >= _MOST_PRIMS:
                raise InputError(f"shows more than {_MOST_PRIMS:,} prims; use fewer instances")
            yield place
        for purpose, number in (+self._hidden).items():
            import_report.left_out(f"{counted(number, 'prim')} of purpose {purpose!r}: not for pictures")

    def _below(self, first: _Step) -> Iterator[Place]:
        left = [first]
        while left:
            step = left.pop()
            prim = step.prim
            matrix, is_visible, purpose = step.above, step.is_visible, step.purpose
            if prim.IsA(UsdGeom.Imageable):
                if prim.IsA(UsdGeom.Xformable):
                    matrix = self._world(prim, step.above)
                    self.moves = self.moves or UsdGeom.Xformable(prim).TransformMightBeTimeVarying()
                imageable = UsdGeom.Imageable(prim)
                is_visible = is_visible and imageable.GetVisibilityAttr().Get(self._moment) != "invisible"
                said = imageable.GetPurposeAttr()
                purpose = said.Get() if said.HasAuthoredValue() else purpose
            if purpose not in _SHOWN_PURPOSES:
                self._hidden[purpose] += int(prim.IsA(UsdGeom.Gprim))
            elif not prim.IsPseudoRoot():
                path = str(prim.GetPath())
                name = f"{step.prefix}{path[1:] if not step.prefix else prim.GetName()}"
                key = str(prim.GetPrimInPrototype().GetPath()) if prim.IsInstanceProxy() else path
                yield Place(prim, name, matrix, is_visible, key)
                if prim.IsA(UsdGeom.PointInstancer):
                    below = _Step(prim, name, matrix, is_visible, purpose, step.depth)
                    yield from self._instances(UsdGeom.PointInstancer(prim), below)
                    continue
            children = prim.GetFilteredChildren(self._predicate)
            prefix = f"{step.prefix}{prim.GetName()}/" if step.prefix else ""
            left += [
                _Step(child, prefix, matrix, is_visible, purpose, step.depth) for child in reversed(children)
            ]

    def _world(self, prim: Any, above: Matrix) -> Matrix:
        local, resets = self._cache.GetLocalTransformation(prim)
        matrix = np.array(local).T
        return matrix if resets else above @ matrix

    def _instances(self, instancer: Any, step: _Step) -> Iterator[Place]:
        """What a point instancer shows: its prototypes, wherever they stand, at each of its points."""
        moment = self._moment
        if step.depth >= _DEEPEST:
            raise InputError(f"{step.prefix}: more than {_DEEPEST} point instancers stand within each other")
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        numbers = np.asarray(instancer.GetProtoIndicesAttr().Get(moment) or [], np.int64)
        # The transform of the prototype itself is put in below, where prims have it.
        transforms = instancer.ComputeInstanceTransformsAtTime(
            moment, moment, UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        )
        mask = np.asarray(instancer.ComputeMaskAtTime(moment) or np.ones(len(numbers)), bool)
        self.moves = self.moves or instancer.GetPositionsAttr().ValueMightBeTimeVarying()
        fits = len(transforms) == len(numbers) == len(mask)
        if not fits or (len(numbers) and not 0 <= numbers.min() <= numbers.max() < len(targets)):
            import_report.left_out(f"{step.prefix}: its arrays do not fit together; the file is damaged")
            return
        prototypes = [self._stage.GetPrimAtPath(target) for target in targets]
        missing = sum(not prim for prim in prototypes)
        if missing:
            import_report.left_out(f"{counted(missing, 'prototype')} of {step.prefix}: not in the file")
        for place in np.flatnonzero(mask):
            prim = prototypes[numbers[place]]
            if prim:
                above = step.above @ np.array(transforms[int(place)]).T
                prefix = f"{step.prefix}/{place}/"
                yield from self._below(
                    _Step(prim, prefix, above, step.is_visible, step.purpose, step.depth + 1)
                )
