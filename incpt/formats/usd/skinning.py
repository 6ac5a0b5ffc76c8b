"""Meshes bent by skeletons and blend shapes, as USD's own library computes them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Usd, UsdGeom, UsdSkel, Vt

from incpt.formats import import_report
from incpt.formats.import_report import counted
from incpt.formats.usd.stage import OpenStage

Points = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Bent:
    """The points (V, 3) of meshes that skeletons bend, in the space of each mesh, by the path of its prim;
    and whether any of these skeletons moves."""

    points: dict[str, Points]
    moves: bool


def bent_meshes(opened: OpenStage) -> Bent:
    """What skeletons do to meshes. What bends the meshes of instances is left out, and told."""
    roots = [prim for prim in Usd.PrimRange.Stage(opened.stage) if prim.IsA(UsdSkel.Root)]
    cache, spaces = UsdSkel.Cache(), UsdGeom.XformCache(opened.moment)
    found: dict[str, Points] = {}
    failed, moves = 0, False
    for prim in roots:
        root = UsdSkel.Root(prim)
        cache.Populate(root, Usd.PrimDefaultPredicate)
        for binding in cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate):
            moves = moves or _moves(cache.GetSkelQuery(binding.GetSkeleton()).GetAnimQuery())
            for target, points in _targets(binding, cache, opened.moment):
                if points is None:
                    failed += 1
                    continue
                from_skeleton = _from_skeleton(binding, target, spaces)
                found[str(target.GetPath())] = points @ from_skeleton[:3, :3] + from_skeleton[3, :3]
    if failed:
        import_report.left_out(f"the skeletons of {counted(failed, 'mesh')}: do not fit, it is as at rest")
    _tell_of_instances(opened.stage)
    return Bent(found, moves)


def _moves(animation: Any) -> bool:
    """Whether an animation has different values at different times."""
    if not animation:
        return False
    joints, shapes = (
        animation.JointTransformsMightBeTimeVarying,
        animation.BlendShapeWeightsMightBeTimeVarying,
    )
    return bool(joints() or shapes())


def _targets(binding: Any, cache: Any, moment: Any) -> Iterator[tuple[Any, Points | None]]:
    """The meshes of a skeleton, with their points in its space; None where what bends them does not fit."""
    skeleton = cache.GetSkelQuery(binding.GetSkeleton())
    matrices = skeleton.ComputeSkinningTransforms(moment)
    for query in binding.GetSkinningTargets():
        prim = query.GetPrim()
        points = UsdGeom.PointBased(prim).GetPointsAttr().Get(moment)
        if not prim.IsA(UsdGeom.Mesh) or not points:
            continue
        is_shaped = not query.HasBlendShapes() or _shape(query, skeleton, points, moment)
        # Changes the points.
        is_bent = query.ComputeSkinnedPoints(matrices, points, moment) if matrices else False
        yield prim, np.array(points, np.float64) if is_shaped and is_bent else None


def _shape(query: Any, skeleton: Any, points: Any, moment: Any) -> bool:
    """Adds to points what blend shapes do, as much as the animation says."""
    animation = skeleton.GetAnimQuery()
    weights = animation.ComputeBlendShapeWeights(moment) if animation else None
    mapper = query.GetBlendShapeMapper()
    if not weights or not mapper:
        return True
    own = mapper.Remap(weights)
    shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(query.GetPrim()))
    computed = shapes.ComputeSubShapeWeights(Vt.FloatArray(own))
    return bool(
        shapes.ComputeDeformedPoints(
            *computed, shapes.ComputeBlendShapePointIndices(), shapes.ComputeSubShapePointOffsets(), points
        )
    )


def _from_skeleton(binding: Any, prim: Any, spaces: Any) -> npt.NDArray[np.float64]:
    """(4, 4) what takes rows of points from the space of a skeleton to that of a mesh."""
    to_world = np.array(spaces.GetLocalToWorldTransform(binding.GetSkeleton().GetPrim()))
    own = np.array(spaces.GetLocalToWorldTransform(prim))
    return np.asarray(to_world @ np.linalg.pinv(own))


def _tell_of_instances(stage: Any) -> None:
    everything = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
    shared = [
        prim for prim in Usd.PrimRange.Stage(stage, everything)
        if prim.IsInstanceProxy() and prim.IsA(UsdSkel.Root)
    ]  # fmt: skip
    if shared:
        import_report.left_out(f"the skeletons below {shared[0].GetPath()}: those of instances bend nothing")
