"""The top level of a scene on the device, and what its small meshes are tested against by brute force."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.accel import clusters, top_level
from incpt.accel.quads import Quads
from incpt.core import layout
from incpt.device.device import Device
from incpt.scene.mesh import Mesh
from incpt.tables.object_table import ObjectTable


@dataclass(frozen=True, eq=False)
class TopLevelTables:
    """The buffers, by name, and what they hold.

    all_in_world_space  whether the triangles of all objects are part of the top level
    is_brute_force      whether blocks of paths test those triangles by brute force
    cluster_count       of the tables for that
    """

    buffers: Mapping[str, cl.Buffer]
    all_in_world_space: bool
    is_brute_force: bool
    cluster_count: int


def top_level_tables(device: Device, table: ObjectTable, quads_of: Callable[[Mesh], Quads]) -> TopLevelTables:
    """Those of these objects. Raises DeviceError where the device's memory runs out."""
    others = table.others
    bounds = table.bounds[others]
    meshes = [
        top_level.PlacedMesh(i, table.objects[i].mesh, vertices)
        for i, vertices in table.world_vertices.items()
    ]
    triangles = top_level.join_triangles(device, meshes) if meshes else None
    tree = None if triangles is None else triangles.tree
    found = None if triangles is None else clusters.arrange(triangles, quads_of)
    nodes = device.upload(top_level.build_top_with_triangles(device, bounds, others, tree))
    # Beside brute force, blocks of paths take the tree for the other objects alone.
    other_nodes = (
        nodes
        if found is None
        else device.upload(top_level.build_top_with_triangles(device, bounds, others, None))
    )
    brute_force = clusters.empty_tables() if found is None else found
    packs = np.zeros(0, layout.TRIANGLE_PACK) if tree is None else tree.packs
    buffers = {
        "top_nodes": nodes,
        "block_nodes": other_nodes,
        "top_packs": _upload(device, packs),
        "quads": _upload(device, brute_force.quads),
        "parallelepipeds": _upload(device, brute_force.parallelepipeds),
        "clusters": device.upload(brute_force.clusters),
    }
    return TopLevelTables(buffers, len(others) == 0, found is not None, len(brute_force.clusters))


def _upload(device: Device, rows: npt.NDArray[Any]) -> cl.Buffer:
    # Kernels may read the first row before they know that there is none.
    return device.upload(rows if len(rows) else np.zeros(1, rows.dtype))
