"""The arguments of kernels, each written down once, in named groups.

A group stands for the parameters of a kernel, the members of a C struct and what the host binds, all in the
same order. The header has three things for the group GEOMETRY, say: `GEOMETRY_PARAMETERS` for the parameter
list of a kernel, `GEOMETRY_ARGUMENTS` for their names, and the struct `Geometry`, so that a kernel reads

    __kernel void intersect(LAUNCH_PARAMETERS, LIST_PARAMETERS, GEOMETRY_PARAMETERS, ...) {
        const Geometry geometry = {GEOMETRY_ARGUMENTS};

`KERNELS` names the groups of every kernel; `arguments` looks up what they are bound to by name. A test
compares both with what the compiler says of each kernel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np


class SceneBuffers(Protocol):
    """What kernels need of a scene on a device."""

    @property
    def cluster_count(self) -> int:
        """How many clusters brute force goes over."""

    def buffer(self, name: str) -> Any:
        """The buffer that is bound to the argument of that name."""


@dataclass(frozen=True)
class Argument:
    """One argument: its name in C and Python, its type in C, and what it holds."""

    name: str
    c_type: str
    holds: str

    @property
    def declaration(self) -> str:
        """As a parameter or a member in C."""
        return f"{self.c_type}{self.name}" if self.c_type.endswith("*") else f"{self.c_type} {self.name}"


@dataclass(frozen=True)
class Group:
    """Arguments that go together, in order. `struct`: the C struct that takes them; None: there is none."""

    name: str
    struct: str | None
    arguments: tuple[Argument, ...]


def _table(name: str, c_type: str, holds: str) -> Argument:
    return Argument(name, f"__global const {c_type} *", holds)


def _planes(name: str, holds: str) -> Argument:
    return Argument(name, "__global float *", holds)


def _count(name: str, holds: str) -> Argument:
    return Argument(name, "uint", holds)


def _number(name: str, holds: str) -> Argument:
    return Argument(name, "float", holds)


_SCALARS = {"uint": np.uint32, "float": np.float32}
"""What Python's numbers become for a parameter of that type."""


LAUNCH = Group("LAUNCH", None, (Argument("params", "Params", "the settings of this launch"),))

SLOTS = Group("SLOTS", None, (_table("slots", "Slot", "which tile and which samples are in which slot"),))

PLACES = Group(
    "PLACES",
    None,
    (_table("places", "uint", "with params.listed: which of the paths of all slots these are"),),
)

LIST = Group(
    "LIST",
    None,
    (
        Argument("lengths", "__global uint *", "lengths of all lists"),
        _count("length_place", "where that of `list` stands; work-items beyond it have nothing to do"),
        _table("list", "uint", "places of the paths that the kernel works on"),
    ),
)

GEOMETRY = Group(
    "GEOMETRY",
    "Geometry",
    (
        _table("top_nodes", "Node", "the tree over objects and over the packs of small meshes"),
        _table("top_packs", "TrianglePack", "triangles of small meshes, in world space"),
        _table("nodes", "Node", "the trees of the other meshes, one after the other"),
        _table("packs", "TrianglePack", "their triangles, in object space"),
        _table("objects", "Object", "placement and mesh of every object"),
        _table("normals", "float", "normals at the corners of faces, mesh by mesh"),
    ),
)

SHADING = Group(
    "SHADING",
    "Shading",
    (
        _table("materials", "Material", "every material"),
        _table("layers", "float", "of every material the albedo table of its layer, see shading/material.cl"),
        _table("albedos", "float", "the albedo table of all roughnesses, see albedo.rows"),
        _table("stretched", "float", "that of stretched reflections, see albedo.stretched_rows"),
        _table("glass", "float", "that of rough glass, see albedo.glass_table"),
        _table("textures", "Texture", "every texture of a material; the first is white"),
        _table("texels", "uint", "the pixels of all bitmaps, see base/texture.cl"),
        _table("byte_values", "float", "what a byte of a pixel stands for, and what one in sRGB does"),
        _table("attributes", "Attributes", "of every object, where its mesh has what follows"),
        _table("uvs", "float", "texture coordinates at the corners of faces, mesh by mesh"),
        _table("colors", "float", "colours at the corners of faces, mesh by mesh"),
        _table("tangents", "float", "tangents and their sides at the corners of faces, mesh by mesh"),
        _table("gradients", "float", "of faces, how texture coordinates grow along them, mesh by mesh"),
        _table(
            "first_share", "uint", "of every object, where the shares of its faces begin; 0: there are none"
        ),
        _table("emitter_shares", "float", "of faces in the density of their material; 1 in front"),
    ),
)

EMITTERS = Group(
    "EMITTERS",
    "Emitters",
    (
        _table("lights", "float", "LightPlane of params.light_count emissive triangles"),
        _table("shaped_lights", "float", "ShapedPlane of params.shaped_count lights"),
        _table("environment_image", "float", "red, green and blue, row by row from +y"),
        _table("marginal", "float", "cumulative distribution of its rows, height + 1"),
        _table("conditional", "float", "of the pixels of each row, width + 1 each"),
        _table("texel_pdf", "float", "density over the unit square of the image, per texel"),
        _table("light_nodes", "LightNode", "the light tree"),
        _table("light_boxes", "Node", "the same nodes, with boxes around those lights that rays may meet"),
        _table("first_trail", "uint", "of every object, its first face in the next table, or NO_INDEX"),
        _table("face_trails", "uint", "the ways of emissive triangles in the light tree: FACE_TRAIL_SIZE"),
    ),
)

BRUTE_FORCE = Group(
    "BRUTE_FORCE",
    "BruteForce",
    (
        _table("quads", "Quad", "parallelograms and triangles, in world space"),
        _table("parallelepipeds", "Parallelepiped", "in world space"),
        _table("clusters", "Cluster", "what of them stands together"),
        _count("cluster_count", "at most 32; rays meet the last without asking for its box"),
    ),
)

PATH_STATE = Group(
    "PATH_STATE",
    None,
    (
        _planes("rays", "RayPlane"),
        _planes("paths", "PathPlane"),
        _planes("surfaces", "SurfacePlane"),
        _planes("shadows", "ShadowPlane"),
        _planes("radiance", "SamplePlane, of which radiance is what each path has gathered so far"),
    ),
)

COMPACTION = Group(
    "COMPACTION",
    None,
    (
        _count("takes_all", "1: all paths of the chunk are looked at, and not those of `list`"),
        _count("class_0", "the PathClass that paths of the first new list have"),
        Argument("list_0", "__global uint *", "the first new list"),
        _count("length_0", "where its length stands, which grows"),
        _count("class_1", "as class_0, of the second list"),
        Argument("list_1", "__global uint *", "the second new list"),
        _count("length_1", "where its length stands"),
        _count("class_2", "as class_0, of the third list"),
        Argument("list_2", "__global uint *", "the third new list"),
        _count("length_2", "where its length stands"),
    ),
)

BLOCK_MEMORY = Group(
    "BLOCK_MEMORY", None, (Argument("memory", "__local float *", "the arena of a block, see arena.py"),)
)

RADIANCE = Group(
    "RADIANCE",
    None,
    (Argument("path_buffer", "__global float *", "what each path of the step brings: SamplePlane"),),
)

CHANGES = Group(
    "CHANGES",
    "Changes",
    (
        Argument("change", "Change", "what differs between two scenes"),
        _table("changed_objects", "uint", "of each object 1 where a hit on it is enough"),
        Argument("touched", "__global uint *", "of each path 1 where it met something that changed"),
    ),
)

FIRST_HITS = Group(
    "FIRST_HITS",
    None,
    (
        _count("pixels", "of the picture: the stride of `first_surface`"),
        Argument("first_surface", "__global float *", "seven planes, see film/first_hits.cl"),
        Argument("object_ids", "__global uint *", "the object that each pixel shows, NO_INDEX for none"),
    ),
)

PARTNERS = Group(
    "PARTNERS",
    None,
    (
        Argument("partner_counts", "__global uint *", "of each work-item; or the sum of those before it"),
        Argument("partner_place", "__global uint *", "of each path, see impact/partners.cl"),
        Argument("partners", "__global uint *", "the places of the paths that have a partner"),
    ),
)

TRACED = Group(
    "TRACED",
    None,
    (
        _count("group_total", "how many groups of slots there are"),
        _table("groups", "uint", "the first slot of each group"),
        _table("samples", "float", "the path buffer: a plane for each channel of each pass"),
    ),
)

COUNTERS = Group("COUNTERS", None, (Argument("counters", "__global uint *", "Counter"),))

REDUCTION = Group(
    "REDUCTION",
    None,
    (
        _count("first_plane", "where the pass begins in the path buffer"),
        _count("replace_flags", "the flags of slots (layout.SlotFlag) that replace what the film has"),
        _planes("pending", "sums of tiles under way: CHANNELS planes and the number of samples"),
        _planes("film", "sums of finished tiles, as `pending`"),
    ),
)

RESOLUTION = Group(
    "RESOLUTION",
    None,
    (
        _count("pixel_total", "of the picture"),
        _table("sums", "float", "what `reduce` leaves in `film`"),
        _planes("image", "interleaved: the channels of the pass, and 1 where there is a sample"),
    ),
)

PICTURE = Group(
    "PICTURE", None, (_count("width", "of the picture, pixels"), _count("height", "of the picture, pixels"))
)

PAIRS = Group(
    "PAIRS",
    None,
    (
        _planes("anchor_sums", "the kept picture of the old scene: three sums, and the number of samples"),
        _planes("pairs", "PairPlane"),
    ),
)

OLD_VALUES = Group(
    "OLD_VALUES",
    None,
    (
        _table("partner_of_path", "uint", "the place of a path's partner, NO_INDEX or NO_PARTNER"),
        _table("partner_radiance", "float", "what partners bring: three planes"),
        _count("partner_stride", "of these planes"),
    ),
)

LABELS = Group(
    "LABELS", None, (_table("labels", "uint", "what a pixel shows, and its class: impact/guides.cl"),)
)

NORMALS = Group(
    "NORMALS", None, (_table("guide_normals", "float", "three planes: the normal at a pixel's centre, or 0"),)
)

GUIDES = Group(
    "GUIDES",
    None,
    (Argument("guides", "__global uint *", "of each scale two planes, see impact/guides.cl"),),
)

TILE_COLUMNS = Group(
    "TILE_COLUMNS",
    None,
    (
        _count("row_count", "pixels of a column"),
        _planes("columns", "sums over columns, in as many planes as there are sums"),
    ),
)

COLUMN_SUMS = Group(
    "COLUMN_SUMS",
    None,
    (
        _count("row_total", "rows of columns in all planes together"),
        _count("column_total", "columns of a row"),
        _count("column_count", "columns of a square"),
        _table("column_sums", "float", "what is in `columns`"),
        _planes("square_sums", "sums over squares, plane by plane and row by row"),
    ),
)

CELL_SUMS = Group("CELL_SUMS", None, (_planes("cell_sums", "CellSum for each class"),))

CELLS = Group("CELLS", None, (_planes("cells", "CellPlane for each class"),))

RULES = Group("RULES", None, (_planes("rules", "RulePlane, of each for each class"),))

COLUMN_RULES = Group("COLUMN_RULES", None, (_table("column_rules", "float", "`rules`, interpolated"),))

SPREADING = Group(
    "SPREADING",
    None,
    (
        _count("plane_total", "planes that are interpolated"),
        _table("cell_values", "float", "with a float for each cell"),
        _planes("column_values", "with a float for each column of pixels of each row of cells"),
    ),
)

SPANS = Group(
    "SPANS",
    None,
    (
        Argument(
            "spans",
            "__global uint *",
            "columns of each patch near which anything changes: from, to; and those of the picture before",
        ),
    ),
)

SLOPES = Group("SLOPES", None, (_table("slopes", "float", "squared slope of the display curve"),))

SCALE = Group("SCALE", None, (_count("scale_index", "smoothing looks 2^scale_index pixels around"),))

HALVES = Group("HALVES", None, (_planes("halves", "HalfPlane"),))

SMOOTH_HALVES = Group("SMOOTH_HALVES", None, (_planes("smooth_halves", "HalfPlane of the next scale"),))

DETAILS = Group("DETAILS", None, (_planes("details", "three planes for each scale and for the rest"),))

EVIDENCE = Group("EVIDENCE", None, (_planes("evidence", "Evidence for each of LOCAL_SCALES, with a margin"),))

CELL_EVIDENCE = Group(
    "CELL_EVIDENCE",
    None,
    (_planes("cell_evidence", "sums of Evidence for each detail, each for each class"),),
)

POOLED_EVIDENCE = Group(
    "POOLED_EVIDENCE", None, (_planes("pooled_evidence", "means over cells and those around"),)
)

COLUMN_EVIDENCE = Group(
    "COLUMN_EVIDENCE", None, (_table("column_evidence", "float", "`pooled_evidence`, interpolated"),)
)

BASE = Group("BASE", None, (_planes("base_light", "three planes: the picture without its change"),))

SHOWN_IMAGE = Group(
    "SHOWN_IMAGE",
    None,
    (_planes("shown_image", "interleaved: the shown radiance, and 1 where there is any"),),
)

TARGET = Group(
    "TARGET",
    None,
    (_table("target_image", "float", "interleaved: the picture that was shown before, where labels say so"),),
)

HAS_TARGET = Group("HAS_TARGET", None, (_count("has_target", "1 where any label says so, or else 0"),))

SHOWN_SHARES = Group(
    "SHOWN_SHARES", None, (_planes("shown_shares", "how much of the noise of its change a pixel shows"),)
)

# Of the builder of trees, cl/accel/build_bvh.cl, where Box is declared.

ITEMS = Group(
    "ITEMS", None, (_count("count", "of what the kernel goes over; work-items beyond have nothing to do"),)
)

MESH = Group(
    "MESH",
    None,
    (
        _table("faces", "int", "three vertices of each face"),
        _table("vertices", "float", "x, y and z of each"),
    ),
)

BOXES = Group(
    "BOXES", None, (Argument("boxes", "__global Box *", "around each face or object, with its number"),)
)

CHUNKS = Group("CHUNKS", None, (_table("chunks", "uint", "first box and number of boxes of each chunk"),))

MEASURES = Group(
    "MEASURES", None, (Argument("measures", "__global Box *", "around the boxes and the centres of a chunk"),)
)

BINS = Group(
    "BINS",
    None,
    (
        *(_number(f"origin_{axis}", f"where bins along {axis} begin") for axis in "xyz"),
        *(_number(f"scale_{axis}", "how many of these bins a unit of length has") for axis in "xyz"),
        Argument("bins", "__global Box *", "around the boxes in each bin: those of x, y and z of each chunk"),
        Argument("bin_counts", "__global uint *", "how many boxes these are"),
    ),
)

SIDES = Group(
    "SIDES",
    None,
    (
        _count("axis", "along which bins lie"),
        _count("position", "the first bin of the upper side"),
        _number("origin", "where bins begin"),
        _number("scale", "how many bins a unit of length has"),
        _table("sides", "uint", "where the boxes of each chunk go: of the lower side, of the upper one"),
    ),
)

MOVED = Group("MOVED", None, (Argument("moved", "__global Box *", "boxes in their new places"),))

LEVEL = Group(
    "LEVEL",
    None,
    (
        _count("leaf_size", "the most boxes of a leaf"),
        Argument("level_nodes", "__global Node *", "the nodes of the level"),
        Argument("children", "__global uint *", "first box and number of boxes of their children"),
    ),
)

SPLITTING = Group(
    "SPLITTING",
    None,
    (
        _count(
            "capacity", "ranges with more boxes are split evenly, so that the levels that are left suffice"
        ),
        _count("largest", "ranges with more boxes are left to the host"),
        _table("ranges", "uint", "first box and number of boxes of each node"),
        Argument("child_counts", "__global uint *", "inner children and leaves of each node"),
    ),
)

LINKING = Group(
    "LINKING",
    None,
    (
        _count("next_node", "where the next level begins in the tree"),
        _count("next_pack", "where the packs of this level begin in it"),
        _table("before", "uint", "inner children and leaves of the nodes before each node"),
        Argument("next_ranges", "__global uint *", "`ranges` of the next level"),
    ),
)

LEAVES = Group(
    "LEAVES", None, (Argument("leaf_packs", "__global TrianglePack *", "of a tree, or of one level"),)
)

REFITTING = Group(
    "REFITTING",
    None,
    (
        _count("first_node", "of those that are fitted"),
        Argument("tree_nodes", "__global Node *", "all nodes of the tree"),
    ),
)

GROUPS = (
    LAUNCH, SLOTS, PLACES, LIST, GEOMETRY, SHADING, EMITTERS, BRUTE_FORCE, PATH_STATE, COMPACTION,
    BLOCK_MEMORY, RADIANCE, CHANGES, PARTNERS, FIRST_HITS, TRACED, COUNTERS, REDUCTION, RESOLUTION, PICTURE,
    PAIRS, OLD_VALUES, LABELS, NORMALS, GUIDES, TILE_COLUMNS, COLUMN_SUMS, CELL_SUMS, CELLS, RULES,
    COLUMN_RULES, SPREADING, SPANS, SLOPES, SCALE, HALVES, SMOOTH_HALVES, DETAILS, EVIDENCE, CELL_EVIDENCE,
    POOLED_EVIDENCE, COLUMN_EVIDENCE, BASE, TARGET, HAS_TARGET, SHOWN_IMAGE, SHOWN_SHARES,
    ITEMS, MESH, BOXES, CHUNKS, MEASURES, BINS, SIDES, MOVED, LEVEL, SPLITTING, LINKING, LEAVES, REFITTING,
)  # fmt: skip
"""Every group."""

BLOCK = (GEOMETRY, SHADING, EMITTERS, BRUTE_FORCE, BLOCK_MEMORY)
"""What kernels over blocks of paths need of a scene, and the memory of a block: BLOCK_PARAMETERS in C."""

KERNELS: dict[str, tuple[Group, ...]] = {
    "generate": (LAUNCH, SLOTS, PLACES, PATH_STATE),
    "compact": (LAUNCH, LIST, PATH_STATE, COMPACTION),
    "intersect": (LAUNCH, LIST, GEOMETRY, SHADING, EMITTERS, PATH_STATE),
    "choose_lights": (LAUNCH, LIST, SHADING, EMITTERS, PATH_STATE),
    "sample_lights": (LAUNCH, LIST, SHADING, EMITTERS, PATH_STATE),
    "shade": (LAUNCH, LIST, SHADING, PATH_STATE),
    "shade_medium": (LAUNCH, LIST, SHADING, PATH_STATE, COUNTERS),
    "shade_miss": (LAUNCH, LIST, SHADING, EMITTERS, PATH_STATE),
    "trace_shadow": (LAUNCH, LIST, GEOMETRY, SHADING, EMITTERS, PATH_STATE),
    "write_aovs": (LAUNCH, LIST, SHADING, PATH_STATE),
    "touch_rays": (LAUNCH, LIST, PATH_STATE, CHANGES),
    "touch_lights": (LAUNCH, LIST, SHADING, EMITTERS, PATH_STATE, CHANGES),
    "touch_shadow_rays": (LAUNCH, LIST, PATH_STATE, CHANGES),
    "trace_blocks": (LAUNCH, SLOTS, PLACES, *BLOCK, RADIANCE, CHANGES, COUNTERS),
    "count_partners": (LAUNCH, SLOTS, PARTNERS),
    "list_partners": (LAUNCH, SLOTS, PARTNERS),
    "first_hits": (LAUNCH, SHADING, PATH_STATE, FIRST_HITS),
    "reduce": (LAUNCH, SLOTS, TRACED, COUNTERS, REDUCTION),
    "resolve": (RESOLUTION,),
    "reduce_pairs": (LAUNCH, SLOTS, TRACED, COUNTERS, PAIRS, OLD_VALUES),
    "weigh_guides": (PICTURE, LABELS, NORMALS, GUIDES),
    "measure_cells": (PICTURE, PAIRS, LABELS, CELL_SUMS),
    "pool_cells": (PICTURE, CELL_SUMS, CELLS, RULES),
    "spread_cells": (PICTURE, SPREADING),
    "find_spans": (PICTURE, CELLS, HAS_TARGET, SPANS),
    "tile_columns": (
        *(PICTURE, PAIRS, LABELS, CELLS, RULES, SLOPES, SHOWN_IMAGE, SHOWN_SHARES, TILE_COLUMNS),
    ),
    "sum_columns": (COLUMN_SUMS,),
    "split_change": (
        *(PICTURE, PAIRS, LABELS, CELLS, SPANS, COLUMN_RULES),
        *(HALVES, SMOOTH_HALVES, EVIDENCE, TARGET, BASE, SHOWN_IMAGE),
    ),
    "smooth_change": (
        *(PICTURE, LABELS, GUIDES, SPANS, SCALE, HALVES, SMOOTH_HALVES, DETAILS, EVIDENCE, CELL_EVIDENCE),
    ),
    "pool_evidence": (PICTURE, CELL_EVIDENCE, POOLED_EVIDENCE),
    "show_change": (
        *(PICTURE, PAIRS, LABELS, GUIDES, SPANS, BASE, DETAILS, EVIDENCE, COLUMN_EVIDENCE),
        *(SHOWN_IMAGE, SHOWN_SHARES),
    ),
    "fold_change": (PICTURE, PAIRS, LABELS, CELLS, SHOWN_IMAGE, SHOWN_SHARES),
    "bound_faces": (ITEMS, MESH, BOXES),
    "measure_chunks": (ITEMS, BOXES, CHUNKS, MEASURES),
    "bin_chunks": (ITEMS, BOXES, CHUNKS, BINS),
    "scatter_chunks": (ITEMS, BOXES, CHUNKS, SIDES, MOVED),
    "copy_chunks": (ITEMS, BOXES, CHUNKS, MOVED),
    "split_ranges": (ITEMS, BOXES, LEVEL, SPLITTING),
    "link_children": (ITEMS, MESH, BOXES, LEVEL, LINKING, LEAVES),
    "refit_packs": (ITEMS, MESH, LEAVES),
    "refit_nodes": (ITEMS, MESH, LEAVES, REFITTING),
}
"""The groups that each kernel takes, in order."""

FILES = {
    "touch_rays": "changes",
    "touch_shadow_rays": "changes",
    "count_partners": "partners",
    "list_partners": "partners",
    "measure_cells": "cell_statistics",
    "pool_cells": "cell_statistics",
    "spread_cells": "cell_statistics",
    "find_spans": "cell_statistics",
    "split_change": "shrinkage",
    "smooth_change": "shrinkage",
    "pool_evidence": "shrinkage",
    "show_change": "shrinkage",
    "bound_faces": "build_bvh",
    "measure_chunks": "build_bvh",
    "bin_chunks": "build_bvh",
    "scatter_chunks": "build_bvh",
    "copy_chunks": "build_bvh",
    "split_ranges": "build_bvh",
    "link_children": "build_bvh",
    "refit_packs": "build_bvh",
    "refit_nodes": "build_bvh",
}
"""The files of cl/ that hold several kernels, by these; other kernels stand in a file of their name."""

_OF_SCENE = {
    argument.name for group in (GEOMETRY, SHADING, EMITTERS, BRUTE_FORCE) for argument in group.arguments
}


def parameters(groups: tuple[Group, ...]) -> list[Argument]:
    """All arguments of these groups, in order."""
    return [argument for group in groups for argument in group.arguments]


def arguments(
    groups: tuple[Group, ...], values: Mapping[str, Any], scene: SceneBuffers | None = None
) -> list[Any]:
    """What a kernel with these groups is launched with: by name from `values`, else from the scene.

    Numbers become what the kernel takes. Raises KeyError where nothing has the name.
    """
    return [_bound(argument, values, scene) for argument in parameters(groups)]


def _bound(argument: Argument, values: Mapping[str, Any], scene: SceneBuffers | None) -> Any:
    if argument.name in values:
        value = values[argument.name]
    elif scene is not None and argument.name in _OF_SCENE:
        value = scene.cluster_count if argument.name == "cluster_count" else scene.buffer(argument.name)
    else:
        raise KeyError(f"nothing is bound to the kernel argument {argument.name!r}: {argument.holds}")
    scalar = _SCALARS.get(argument.c_type)
    return value if scalar is None else scalar(value)


def c_header(groups: tuple[Group, ...] = GROUPS) -> str:
    """OpenCL C text of these groups, and of BLOCK_PARAMETERS."""
    block = _c_macro("BLOCK_PARAMETERS", ", ".join(f"{group.name}_PARAMETERS" for group in BLOCK))
    return "".join(map(_c_group, groups)) + (block if set(BLOCK) <= set(groups) else "")


def _c_group(group: Group) -> str:
    lines = [
        _c_macro(f"{group.name}_PARAMETERS", ", ".join(_c_parameter(a) for a in group.arguments)),
        _c_macro(f"{group.name}_ARGUMENTS", ", ".join(argument.name for argument in group.arguments)),
    ]
    if group.struct is not None:
        members = "".join(f"    {a.declaration}; // {a.holds}\n" for a in group.arguments)
        lines.append(f"typedef struct {{\n{members}}} {group.struct};\n")
    return "".join(lines)


def _c_parameter(argument: Argument) -> str:
    return argument.declaration if argument.c_type.endswith("*") else f"const {argument.declaration}"


def _c_macro(name: str, text: str) -> str:
    return f"#define {name} {text}\n"
