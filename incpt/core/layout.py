"""Memory layouts that the host and the kernels share, each written down once.

Every struct is a packed numpy dtype of 4-byte scalars; `c_header()` turns all of them into the
OpenCL C header that every kernel includes, with a size assertion per struct, so that the two sides
cannot drift. Vectors and bools are left out on purpose: their layout differs between compilers, and
vector values keep PoCL from running work-items as SIMD lanes.

The state of paths is kept as *planes*: plane `p` of path `i` is `buffer[p * stride + i]`. Neighbouring
work-items then touch neighbouring floats, which GPUs coalesce and PoCL vectorises. A plane has one meaning;
`arena` says which planes of a block of paths share memory.

Words that hold several small numbers are described by `Bits`, which the header turns into a shift and a mask
for each: `FIELD(word, COUNTS_RAY)` reads one in C.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag
from typing import Any, NamedTuple

import numpy as np

BVH_WIDTH = 8
"""Children per node and triangles per pack: one float8 register."""

BVH_MAX_DEPTH = 16
"""Levels of a tree at most: the builder keeps to it, traversal sizes its stack by it."""
BVH_BINS = 32
"""Places along each axis where the builder may split."""

NODE_EMPTY = 0xFFFFFFFF
"""Child reference of an unused place in a node (its box is inverted, so that no ray enters it)."""
NODE_LEAF = 0x80000000
"""Flag of a child reference: the other bits are a pack (bottom level) or an object (top level)."""
NODE_PACK = 0x40000000
"""Flag of a leaf of the top level that is a pack of triangles in world space and no object. Also marks the
place of a hit in such a pack."""
NO_INDEX = 0xFFFFFFFF
"""'None' for every unsigned index: no hit, no triangle, no normals, no medium, no partner."""
NO_PARTNER = 0xFFFFFFFE
"""In place of the number of a partner: the path met something that changed, but gets no partner."""

MOST_CHANGED_BOXES = 8
"""Boxes around what changed between two scenes: rays are tested against all of them, two at a time."""

WORK_GROUP_SIZE = 64
"""Work-items per group of the path kernels; lists of paths are padded to a multiple of it."""

COMPACT_BLOCK = 64
"""Paths that one work-item of `compact` looks at: few atomics, and enough work-items for a GPU."""

MOST_RAYS = 256
"""Rays of a path at most: their numbers are what COUNTS_RAY can hold."""
MOST_RAYS_IN_MEDIA = 250
"""Rays after which no path goes on from a transparent body. Those left are for the opaque surfaces behind."""

MOST_LAYERS = 256
"""Surfaces that cover in part which a ray goes through at most; the next one covers all."""

MIN_ALPHA = 1e-3
"""Least GGX alpha: below it GGX is a mirror to float precision. A dielectric is smooth there, an opaque
surface stays this rough."""

MEDIUM_STACK_SIZE = 4
"""Dielectrics that may enclose a point at the same time (Falcor keeps two)."""
MEDIUM_NONE = 0xFFFF
"""An unused place in the 16-bit medium stack; so at most 65,535 materials."""

LIGHT_TREE_BITS = 3
"""Bits of the trail of a light for each level of the light tree, of which BVH_WIDTH is the base."""

FACE_TRAIL_SIZE = 2
"""Words of a face in the table of trails: its trail, and 1 over its chance by power alone, as a float, 0
where it is no light."""

ALBEDO_TABLE_SIZE = 32
"""Resolution of the specular albedo table in cosine and in roughness (see `albedo.py`)."""
LAYER_SIZE = ALBEDO_TABLE_SIZE + 4
"""Floats of a material in the table of layers (see `albedo.layer_row`)."""
ALBEDO_ROW_SIZE = 3 * ALBEDO_TABLE_SIZE + 2
"""Floats of a roughness in the table of albedos (see `albedo.rows`)."""
STRETCHED_ROUGHNESSES, STRETCHED_STEPS, STRETCHED_COSINES = 16, 8, 16
"""Resolution of the albedo table of stretched reflections: in the roughness across, in how far they are
stretched, and in the root of the cosine."""
STRETCHED_ROW_SIZE = 6 * STRETCHED_COSINES + 2
"""Floats of a roughness and a stretch in that table (see `albedo.stretched_rows`)."""
GLASS_STEPS = 17
"""Resolution of the albedo table of rough glass in the step of the index of refraction, in roughness and in
the root of the cosine (see `albedo.glass_table`); in the middle there is no step."""
CLEARCOAT_F0 = 0.04
"""Reflectance of a clearcoat at normal incidence: that of an index of refraction of 1.5."""
MIN_SHEEN_ALPHA = 0.04
"""Least width of the sheen distribution, of roughness 0.2: what is narrower only glows at the very edge."""
SHEEN_NARROW = (25.3245, 3.32435, 0.16801, -1.27393, -4.85967)
"""Coefficients of the masking of sheen where its distribution is narrow: Estevez and Kulla 2017, table 1."""
SHEEN_WIDE = (21.5473, 3.82987, 0.19823, -1.97760, -4.32054)
"""Those where it is wide."""
LEAST_ALBEDO_LOSS = 1e-3
"""Of light, below which nothing is made of what scatters again: the table of albedos knows no better."""
ENVIRONMENT_MAX_SIZE = 4096
"""Largest width or height of an environment image; the kernels' binary search takes log2 of it steps."""
ENVIRONMENT_SEARCH_STEPS = 12


class RayPlane(IntEnum):
    """Planes of the ray that a path follows next. World space; the direction has unit length."""

    ORIGIN_X = 0
    ORIGIN_Y = 1
    ORIGIN_Z = 2
    DIRECTION_X = 3
    DIRECTION_Y = 4
    DIRECTION_Z = 5


class RawHitPlane(IntEnum):
    """Planes of the nearest hit as traversal finds it, before `setup_surface` turns it into a surface.

    OBJECT is NO_INDEX (as uint) where the ray left the scene; the other planes have no meaning then.
    TRIANGLE is the place of the triangle, see PLACE_PACK. WEIGHT_A to WEIGHT_C belong to its corners and have
    a common factor, which set-up divides out. DISTANCE counts along the ray, in metres.
    """

    DISTANCE = 0
    OBJECT = 1
    TRIANGLE = 2
    WEIGHT_A = 3
    WEIGHT_B = 4
    WEIGHT_C = 5


class SurfacePlane(IntEnum):
    """Planes of the surface that a ray has met, in world space.

    The geometric normal follows the winding of the face; the shading normal lies on its side.
    OFFSET bounds the rounding error of POSITION along the geometric normal: a ray that leaves the surface
    starts that far along it. It is 0 where there is no such error. FACE counts in the mesh. After `intersect`
    OBJECT is NO_INDEX (as uint) and DISTANCE infinity where the ray left the scene; OBJECT too where it ends
    on a light. WEIGHT_B and WEIGHT_C are the barycentric weights of the second and third corner, for what
    meshes have at corners; only scenes with textures have them. TURN is the angle, in turns, from the frame
    that is made of the shading normal alone to the direction along which anisotropic reflections are
    stretched; COAT_X to COAT_Z the normal of the clearcoat, where that is not the shading normal. RISE is how
    far the surface that smooth normals pretend stands above the face, along the geometric normal, where that
    is on the side of the ray, else 0: rays that are scattered below the plane of the face start there.
    """

    GEOMETRIC_X = 0
    GEOMETRIC_Y = 1
    GEOMETRIC_Z = 2
    SHADING_X = 3
    SHADING_Y = 4
    SHADING_Z = 5
    OFFSET = 6
    DISTANCE = 7
    POSITION_X = 8
    POSITION_Y = 9
    POSITION_Z = 10
    OBJECT = 11
    MATERIAL = 12
    FACE = 13
    WEIGHT_B = 14
    WEIGHT_C = 15
    TURN = 16
    COAT_X = 17
    COAT_Y = 18
    COAT_Z = 19
    RISE = 20


class PathPlane(IntEnum):
    """Planes of what a path carries from hit to hit. Uints are stored bit for bit in the floats.

    BSDF_PDF is the solid-angle density with which the current ray was chosen; 0 marks a ray that
    light sampling could not have found (camera ray, smooth dielectric), whose emission counts whole.
    COUNTS holds three numbers, see COUNTS_BOUNCES.
    MEDIUM_0 and MEDIUM_1 hold the stack of enclosing dielectrics, four 16-bit material indices.
    RESULT is the place of the path's sum in the planes of radiance. Only blocks of paths use it, because a
    path of a wavefront stays in its place.
    NORMAL is that of the surface that the current ray comes from, packed (scene/light_tree.cl), NO_INDEX
    where light is chosen from both sides. Only scenes with a light tree have it.
    """

    THROUGHPUT_R = 0
    THROUGHPUT_G = 1
    THROUGHPUT_B = 2
    BSDF_PDF = 3
    PIXEL = 4
    SAMPLE = 5
    COUNTS = 6
    RESULT = 7
    MEDIUM_0 = 8
    MEDIUM_1 = 9
    CLASS = 10
    NORMAL = 11


class ShadowPlane(IntEnum):
    """Planes of the shadow ray of a path and of the radiance that it brings when nothing is in its way.

    `sample_lights` chooses the direction; PDF is its solid-angle density. RADIANCE then is what arrives at
    the surface, and shading scales it by the share that goes on along the path.
    """

    ORIGIN_X = 0
    ORIGIN_Y = 1
    ORIGIN_Z = 2
    DIRECTION_X = 3
    DIRECTION_Y = 4
    DIRECTION_Z = 5
    DISTANCE = 6
    RADIANCE_R = 7
    RADIANCE_G = 8
    RADIANCE_B = 9
    PDF = 10


class LightPlane(IntEnum):
    """Planes of the emissive triangles (world space); their stride is the number of lights.

    Planes also here, because LLVM would fuse loads of neighbouring struct members into short vectors
    before PoCL comes to vectorise over work-items, and those it does not vectorise over.

    PDF_AREA is the density of choosing the triangle and a point on it, per square metre; ALIAS (uint) and
    ALIAS_PROBABILITY are the Walker/Vose table over the triangles; FLAGS are of LightFlag (uint). SLACK
    bounds how far rounding takes a chosen point off the triangle as rays meet it, in metres. The planes from
    TEXTURE on are there where emission has textures: the texture (uint) that the emission is multiplied with,
    and the place in it of the vertex and of the ends of the edges, as VERTEX and EDGE of the triangle.
    """

    VERTEX_X = 0
    VERTEX_Y = 1
    VERTEX_Z = 2
    EDGE_1_X = 3
    EDGE_1_Y = 4
    EDGE_1_Z = 5
    EDGE_2_X = 6
    EDGE_2_Y = 7
    EDGE_2_Z = 8
    EMISSION_R = 9
    EMISSION_G = 10
    EMISSION_B = 11
    PDF_AREA = 12
    ALIAS_PROBABILITY = 13
    ALIAS = 14
    FLAGS = 15
    SLACK = 16
    TEXTURE = 17
    U = 18
    V = 19
    EDGE_1_U = 20
    EDGE_1_V = 21
    EDGE_2_U = 22
    EDGE_2_V = 23


class LightFlag(IntFlag):
    """Properties of a light. CHANGED: it differs between two scenes that choose from the same lights."""

    DOUBLE_SIDED = 1
    CHANGED = 2


LIGHT_HIT = 0x80000000
"""Flag of RawHitPlane.OBJECT where a ray ends on a light, whose number are the other bits."""

SURE_PDF = 1e12
"""The density of a light sample that no ray could find in another way: so high that its weight is 1."""


class ShapedPlane(IntEnum):
    """Planes of the lights that are objects of their own (world space); their stride is their number. Suns
    come first.

    CENTER is where the light stands, X and Y are its axes, of unit length; it shines against the third one,
    X x Y. HALF_X and HALF_Y are half its extent along them, for a ball both its radius. EMISSION is the
    radiance, or for a light without a size its intensity, or irradiance for a sun. CAP is 1 - cos of the
    angular radius of a sun. What is emitted falls off with the cosine of the angle to the axis, to 0 at
    CONE_OUTER; CONE_SCALE is 1 over how much nearer to 1 that cosine is where it begins to. PROBABILITY is
    that of being chosen among all lights; ALIAS (uint) and ALIAS_PROBABILITY are the table over these lights.
    FLAGS are of ShapedFlag (uint). With a light tree, the chance and the table are those of suns alone, and
    TRAIL (uint) leads to each other light, whose PROBABILITY is 1.
    """

    CENTER_X = 0
    CENTER_Y = 1
    CENTER_Z = 2
    X_X = 3
    X_Y = 4
    X_Z = 5
    Y_X = 6
    Y_Y = 7
    Y_Z = 8
    HALF_X = 9
    HALF_Y = 10
    EMISSION_R = 11
    EMISSION_G = 12
    EMISSION_B = 13
    CAP = 14
    CONE_OUTER = 15
    CONE_SCALE = 16
    PROBABILITY = 17
    ALIAS_PROBABILITY = 18
    ALIAS = 19
    FLAGS = 20
    TRAIL = 21


class ShapedFlag(IntFlag):
    """Properties of such a light. BALL, RECTANGLE, DISK or SUN is its shape. POINT: it has no size. HIDDEN:
    camera rays do not meet it. SHADOWLESS: nothing is in the way of its light. CHANGED: as in LightFlag."""

    DOUBLE_SIDED = 1
    CHANGED = 2
    BALL = 4
    RECTANGLE = 8
    DISK = 16
    SUN = 32
    POINT = 64
    HIDDEN = 128
    SHADOWLESS = 256


class LightNodePlane(IntEnum):
    """Planes of the children of a node of the light tree: bounds of where the lights of each are and where
    they shine to.

    CENTER and RADIUS are of a ball around them, metres. POWER is their share of that of
    all, 0 for an unused child. Their normals are within an angle, the spread, around AXIS, which has unit
    length; a light emits more than nothing within another angle of its normal, the falloff. FALLOFF_SCALE is
    1 over 1 - COS_FALLOFF.
    """

    CENTER_X = 0
    CENTER_Y = 1
    CENTER_Z = 2
    RADIUS = 3
    POWER = 4
    AXIS_X = 5
    AXIS_Y = 6
    AXIS_Z = 7
    COS_SPREAD = 8
    SIN_SPREAD = 9
    COS_FALLOFF = 10
    FALLOFF_SCALE = 11


class SamplePlane(IntEnum):
    """Planes of the path buffer: what each path of a step brings, in the order of the passes of a film.

    The planes from ALBEDO_R on are there where the settings ask for auxiliary images. They hold base colour
    and shading normal (world space) of the first surface, and in ALPHA 1 where there is one or a light; all
    are 0 where the camera ray left the scene. Passes that a strategy asks for have their planes behind those
    that are there.
    """

    RADIANCE_R = 0
    RADIANCE_G = 1
    RADIANCE_B = 2
    ALBEDO_R = 3
    ALBEDO_G = 4
    ALBEDO_B = 5
    NORMAL_X = 6
    NORMAL_Y = 7
    NORMAL_Z = 8
    ALPHA = 9


PATCH_WIDTH = 256
"""Width of a patch, the pixels that the kernels of cl/impact/ work on at a time: rows long enough that memory
comes ahead of them, short enough that a patch stays in the nearest cache."""
CELL_SIZE = 8
"""Height of a patch and edge of a cell: statistics of pairs are pooled over the pixels of one, each class of
pixels for itself."""
CLASSES = 2
"""Of pixels: those that show an object which changed itself, and all others, which come first."""
SMOOTHING_SCALES = 4
"""Passes that take a change apart; that of scale k looks 2^k pixels around."""
LOCAL_SCALES = 3
"""Scales whose details are told from noise by the neighbours of a pixel too, and not by cells alone."""
FIELD_MARGIN = 8
"""Pixels around the picture in the planes that are smoothed: the longest distance that passes look around."""
GUIDE_UNIT = 765
"""Weights of neighbours are whole numbers of this part of all; the largest there are is a third."""
SLOPES_PER_OCTAVE = 8
"""Of the table of slopes of the display curve: a power of two, so that bits of a float are a place in it."""
SLOPE_OCTAVES = 20
SLOPE_FIRST_OCTAVE = 112
"""Of the first entry of the table, biased as in a float: 2^-15."""


class PairPlane(IntEnum):
    """Planes of what pairs of paths, in the scene as it is now and in the one before an edit, brought for
    each pixel. All radiances are differences from the kept picture of the old scene.

    Samples fall into two halves, like the squares of a chequerboard that alternates with the sample index;
    squares of 4 x 4 pixels alternate too, so that slots that take every fourth pixel have both halves. A pair
    is a sample of which the radiance in the old scene is known.

    NEW_R_0 and those after it are sums over the samples of a half, in the new scene; OLD_R_0 and those after
    it over its pairs, in the old one. SAMPLES and PAIRS count them. The moments are sums over both halves of
    squares in the new scene (of samples) and in the old one, and of new times old (of pairs), means over the
    channels. TOUCHED counts the samples that met something that changed.
    """

    NEW_R_0 = 0
    NEW_G_0 = 1
    NEW_B_0 = 2
    NEW_R_1 = 3
    NEW_G_1 = 4
    NEW_B_1 = 5
    OLD_R_0 = 6
    OLD_G_0 = 7
    OLD_B_0 = 8
    OLD_R_1 = 9
    OLD_G_1 = 10
    OLD_B_1 = 11
    SAMPLES_0 = 12
    SAMPLES_1 = 13
    PAIRS_0 = 14
    PAIRS_1 = 15
    NEW_MOMENT = 16
    OLD_MOMENT = 17
    JOINT_MOMENT = 18
    TOUCHED = 19


class CellSum(IntEnum):
    """Sums over the pixels of a cell that have one class: NEW_MOMENT of PairPlane, and what `TileSums` has
    too, here without weights. SQUARES_OLD and PRODUCTS are of deviations from the old picture, which the old
    values of PAIRS refine; PAIR_SQUARES_OLD and PAIR_PRODUCTS from the means of pixels, with FREEDOM_PAIRS:
    those of `TileSums`."""

    SAMPLES = 0
    PAIRS = 1
    FREEDOM_NEW = 2
    SQUARES_NEW = 3
    NEW_MOMENT = 4
    SQUARES_OLD = 5
    PRODUCTS = 6
    TOUCHED = 7
    FREEDOM_PAIRS = 8
    PAIR_SQUARES_OLD = 9
    PAIR_PRODUCTS = 10


class CellPlane(IntEnum):
    """What the pixels of a cell that have one class, and of cells around it, say of samples: the variance in
    the new and in the old scene and the covariance of both, means over the channels; the mean square of the
    difference from the kept picture; degrees of freedom of the first, and pairs behind the others; how many
    samples met something that changed, and how many there are."""

    NEW_VARIANCE = 0
    OLD_VARIANCE = 1
    COVARIANCE = 2
    NEW_MOMENT = 3
    FREEDOM_NEW = 4
    PAIRS = 5
    TOUCHED = 6
    SAMPLES = 7


class RulePlane(IntEnum):
    """What follows from CellPlane for a pixel; see cl/impact/cell_statistics.cl. With them, the variance of a
    sample of the change is VARIANCE + PRIOR * (square of the kept picture) - COVERED * (share of the kept
    samples in the refined old picture)."""

    OLD_WEIGHT = 0
    BASE_SHARE = 1
    VARIANCE = 2
    PRIOR = 3
    COVERED = 4


class TileSum(IntEnum):
    """Sums over the pixels of a tile; see `TileSums`."""

    SAMPLES = 0
    PAIRS = 1
    TOUCHED = 2
    KEPT = 3
    FREEDOM_NEW = 4
    FREEDOM_PAIRS = 5
    SQUARES_NEW = 6
    SQUARES_OLD = 7
    PRODUCTS = 8
    SQUARES_KEPT = 9
    DIFFERENCES = 10
    ERROR = 11
    NOISE = 12
    SHOWN_NOISE = 13


class HalfPlane(IntEnum):
    """Planes of the change of the picture as each half of the samples shows it, and of the weights that the
    halves have. They have a margin, see FIELD_MARGIN."""

    CHANGE_R_0 = 0
    CHANGE_G_0 = 1
    CHANGE_B_0 = 2
    CHANGE_R_1 = 3
    CHANGE_G_1 = 4
    CHANGE_B_1 = 5
    WEIGHT_0 = 6
    WEIGHT_1 = 7


class Evidence(IntEnum):
    """What is summed up over a cell and class to tell how much of a detail is no noise: products of the two
    halves, which noise is not part of on average, and the noise of their mean."""

    SIGNAL = 0
    NOISE = 1


class PathClass(IntFlag):
    """What a path waits for: kernels set the bits, `compact` sorts paths into lists by them."""

    LIVE = 1
    SHADOW = 2
    SURFACE = 4
    MEDIUM = 8
    MISS = 16
    CUT_OFF = 32
    """Nothing: the path ended because it had no passages through glass left."""


class Counter(IntEnum):
    """What kernels count of the paths of a step: samples with a float that is not finite; paths that ended
    because `transmission_bounces` was used up, though they still carried something."""

    NONFINITE = 0
    CUT_OFF = 1


class PathList(IntEnum):
    """Lists of paths that the stages of a wavefront go over; each has a length for every ray.

    The live paths; those on opaque surfaces; those whose ray met nothing; those at or in transparent bodies;
    those that ask for a shadow ray.
    """

    LIVE = 0
    SURFACE = 1
    MISS = 2
    MEDIUM = 3
    SHADOW = 4


class SlotFlag(IntFlag):
    """What becomes of the slots of a tile. FIRST, LAST and REPLACE: see `film.py`. SINGLE: paths have no
    partner in the scene before the edit, even where they met something that changed. REPLACE_AOVS: what the
    film has of auxiliary images is of another scene, so that they are replaced where radiance is not."""

    FIRST = 1
    LAST = 2
    REPLACE = 4
    SINGLE = 8
    REPLACE_AOVS = 16


class MaterialFlag(IntFlag):
    """Properties of a material that choose a kernel or a branch. THIN_WALLED: where it is transmissive it
    encloses nothing; CLEAR_WALL: rays go straight through it, see `Material.is_clear_wall`; UNLIT: it shines
    with its base colour. CUTOUT: it covers a share of what is behind
    it, alpha; MASKED: all where alpha is at least the cutoff, and nothing elsewhere."""

    DOUBLE_SIDED = 1
    TRANSMISSIVE = 2
    CUTOUT = 4
    MASKED = 8
    THIN_WALLED = 16
    UNLIT = 32
    CLEAR_WALL = 64


class MaterialTrait(IntEnum):
    """What a material may have beside base, metal, dielectric layer and body; the feature TRAITS has a bit
    for each that some material of the scene has, and kernels leave out the others."""

    SPECULAR_COLOR = 0
    CLEARCOAT = 1
    SHEEN = 2
    ANISOTROPY = 3
    IRIDESCENCE = 4
    DIFFUSE_TRANSMISSION = 5
    THIN_WALLED = 6
    DISPERSION = 7
    UNLIT = 8
    CLEAR_WALL = 9


class TextureSlot(IntEnum):
    """What a material may read from textures, in the order of MATERIAL.textures; the feature TEXTURES has a
    bit for each that some material of the scene has."""

    BASE_COLOR = 0
    METALLIC_ROUGHNESS = 1
    NORMAL = 2
    EMISSION = 3
    TRANSMISSION = 4
    SPECULAR = 5
    SPECULAR_COLOR = 6
    CLEARCOAT = 7
    CLEARCOAT_ROUGHNESS = 8
    CLEARCOAT_NORMAL = 9
    SHEEN_COLOR = 10
    SHEEN_ROUGHNESS = 11
    ANISOTROPY = 12
    IRIDESCENCE = 13
    IRIDESCENCE_THICKNESS = 14
    DIFFUSE_TRANSMISSION = 15
    DIFFUSE_TRANSMISSION_COLOR = 16
    BUMP = 17


class TextureFlag(IntFlag):
    """How the pixels of a texture are stored and read. HALF: as half floats, and not as bytes. SRGB: bytes of
    colours are encoded. GREY: the first channel stands for red, green and blue. ALPHA: the last channel is
    alpha. NEAREST: no interpolation. CLAMP_U, MIRROR_U and those of v: not repeated."""

    HALF = 1
    SRGB = 2
    GREY = 4
    ALPHA = 8
    NEAREST = 16
    CLAMP_U = 32
    MIRROR_U = 64
    CLAMP_V = 128
    MIRROR_V = 256


class Bits(NamedTuple):
    """Some bits of a word: the lowest of them, and how many they are."""

    shift: int
    width: int

    @property
    def mask(self) -> int:
        """The largest number that they hold."""
        return (1 << self.width) - 1


COUNTS_BOUNCES = Bits(0, 8)
"""Of PathPlane.COUNTS: the scattering events of the path so far, passages left out."""
COUNTS_PASSAGES = Bits(8, 8)
"""Of PathPlane.COUNTS: how often the path has passed a smooth dielectric boundary or was reflected inside."""
COUNTS_RAY = Bits(16, 8)
"""Of PathPlane.COUNTS: the number of the ray that the path follows, by which it draws random numbers."""

MEDIUM_LOW = Bits(0, 16)
"""Of PathPlane.MEDIUM_0 and MEDIUM_1: the upper of two entries of the stack."""
MEDIUM_HIGH = Bits(16, 16)
"""Of PathPlane.MEDIUM_0 and MEDIUM_1: the entry below it."""

NORMAL_U = Bits(0, 16)
"""Of PathPlane.NORMAL: the first coordinate of the octahedral map."""
NORMAL_V = Bits(16, 16)
"""Of PathPlane.NORMAL: the second one."""

PLACE_LANE = Bits(0, 3)
"""Of the place of a triangle: its lane in its pack."""
PLACE_PACK = Bits(3, 27)
"""Of the place of a triangle: its pack, counted over all meshes, or over the top level."""
PLACE_ON_TOP = Bits(30, 1)
"""Of the place of a triangle: 1 where its pack belongs to the top level. This is the bit of NODE_PACK."""

TURNS_FIRST = Bits(0, 2)
"""Of QUAD.turns: which corner of the triangle ABC is A."""
TURNS_SECOND = Bits(2, 2)
"""Of QUAD.turns: which corner of the triangle ACD is A."""
TURNS_AXIS_B = Bits(4, 2)
"""Of QUAD.turns, for a side of a parallelepiped: the axis of its local coordinates that leads from A to B."""
TURNS_BACK_B = Bits(6, 1)
"""Of QUAD.turns: 1 where that axis leads from B to A."""
TURNS_AXIS_D = Bits(7, 2)
"""Of QUAD.turns, for a side of a parallelepiped: the axis of its local coordinates that leads from A to D."""
TURNS_BACK_D = Bits(9, 1)
"""Of QUAD.turns: 1 where that axis leads from D to A."""


def _packed(fields: list[Any]) -> np.dtype[np.void]:
    return np.dtype(fields, align=False)


NODE = _packed(
    [
        # One plane of the eight child boxes after the other: index 2 * axis + (1 for the upper bound),
        # so that the sign of the ray direction chooses the near and the far plane by an offset.
        ("bounds", np.float32, (6, BVH_WIDTH)),
        # Another node of the same tree, NODE_LEAF | pack or object, or NODE_EMPTY.
        ("child", np.uint32, (BVH_WIDTH,)),
        # The children from the farthest to the nearest for a ray into each octant (bit i of its number: the
        # direction is negative along axis i), three bits for each, the first in the lowest.
        ("order", np.uint32, (BVH_WIDTH,)),
    ]
)

TRIANGLE_PACK = _packed(
    [
        # vertex[3 * corner + axis][lane], object space.
        ("vertex", np.float32, (9, BVH_WIDTH)),
        # Index of the face in its mesh, NO_INDEX for an unused lane. Vertices are NaN there and
        # where a face has no area: no comparison with them holds, so that no ray meets them.
        ("face", np.uint32, (BVH_WIDTH,)),
        # Index of its object where triangles of several stand together, in world space; else NO_INDEX.
        ("object", np.uint32, (BVH_WIDTH,)),
    ]
)

QUAD = _packed(
    [
        # A parallelogram or a triangle in world space: corners A, B, C, D on the way around, x, y and z of
        # each. A triangle has C in place of D.
        ("vertex", np.float32, (12,)),
        # (C - A) x (B - A): twice the area of ABC is its length.
        ("normal", np.float32, (3,)),
        # Places of the triangles ABC and ACD in the packs of the top level, see PLACE_PACK.
        ("place", np.uint32, (2,)),
        ("object", np.uint32),
        # How the corners of the triangles, and the local axes of a parallelepiped, lie to A, B, C and D: see
        # TURNS_FIRST and those after it.
        ("turns", np.uint32),
    ]
)

PARALLELEPIPED = _packed(
    [
        # A parallelepiped in world space. Its local coordinates are between 0 and 1 inside.
        ("corner", np.float32, (3,)),
        ("opposite", np.float32, (3,)),  # the corner where all local coordinates are 1
        ("local_from_world", np.float32, (9,)),  # 3 x 3, row by row, of the way from that corner
        ("first_side", np.uint32),  # of six quads: where local x is 0, where it is 1, where y is 0 ...
    ]
)

CLUSTER = _packed(
    [
        # Parallelepipeds and quads that stand together. The quads have the parallelograms in front, the
        # triangles from `first_triangle` on.
        ("bounds", np.float32, (6,)),  # least and greatest x, y and z
        ("first_parallelepiped", np.uint32),
        ("parallelepiped_end", np.uint32),
        ("first", np.uint32),
        ("first_triangle", np.uint32),
        ("end", np.uint32),
    ]
)

OBJECT = _packed(
    [
        ("object_from_world", np.float32, (12,)),  # 3 x 4, row by row
        ("world_from_object", np.float32, (12,)),
        ("first_node", np.uint32),  # of its mesh in the buffer of all nodes
        ("first_pack", np.uint32),
        ("first_normal", np.uint32),  # float index of the mesh's corner normals; 0 where it has none
        ("is_smooth", np.uint32),  # 1: it has normals
        ("material", np.uint32),
        ("visible", np.uint32),
        (
            "winding",
            np.float32,
        ),  # -1 where the matrix mirrors, so that faces turn round in world space; else 1
    ]
)

MATERIAL = _packed(
    [
        ("base_color", np.float32, (3,)),
        ("metallic", np.float32),
        ("emission", np.float32, (3,)),
        ("roughness", np.float32),
        ("absorption", np.float32, (3,)),
        ("specular", np.float32),
        ("ior", np.float32),
        ("transmission", np.float32),
        ("light_pdf", np.float32),  # area density with which light sampling finds a point of this emitter
        ("priority", np.uint32),
        ("flags", np.uint32),
        ("alpha", np.float32),
        ("alpha_cutoff", np.float32),
        ("normal_scale", np.float32),  # of the deflections of its normal map
        # The rest of its numbers is read where some material has the trait that they belong to.
        ("specular_color", np.float32, (3,)),
        ("clearcoat", np.float32),
        ("clearcoat_roughness", np.float32),
        ("clearcoat_normal_scale", np.float32),
        ("sheen_color", np.float32, (3,)),
        ("sheen_roughness", np.float32),
        ("anisotropy", np.float32),
        ("anisotropy_rotation", np.float32),  # degrees, from the tangent
        ("iridescence", np.float32),
        ("iridescence_ior", np.float32),
        ("iridescence_thickness", np.float32),  # of the film, nm
        ("iridescence_least_thickness", np.float32),  # where its texture is black, nm
        ("diffuse_transmission", np.float32),
        ("diffuse_transmission_color", np.float32, (3,)),
        ("dispersion", np.float32),
        ("bump_scale", np.float32),  # metres of 1 in its height map
        ("textures", np.uint32, (len(TextureSlot),)),  # rows of TEXTURE; 0 is white
    ]
)

TEXTURE = _packed(
    [
        ("first_word", np.uint32),  # of its pixels in the buffer of all texels
        ("width", np.uint32),
        ("height", np.uint32),
        ("channels", np.uint32),  # of each pixel, 1 to 4
        ("flags", np.uint32),  # TextureFlag
        ("uv_set", np.uint32),
        ("matrix", np.float32, (6,)),  # 2 x 3, row by row: the place in the image of texture coordinates
    ]
)

ATTRIBUTES = _packed(
    [
        # What the mesh of an object has at its corners: the first float of each, and 1 where it is there. For
        # what is not there, what kernels read in its place stands at `first`.
        ("first_uv", np.uint32, (2,)),
        ("has_uv", np.uint32, (2,)),
        ("first_color", np.uint32),
        ("has_color", np.uint32),
        ("first_tangent", np.uint32),
        ("has_tangent", np.uint32),
        # And on its faces, for height maps.
        ("first_gradient", np.uint32),
        ("has_gradient", np.uint32),
    ]
)

LIGHT_NODE = _packed(
    [
        # Of the light tree: planes of eight children, see LightNodePlane.
        ("planes", np.float32, (len(LightNodePlane), BVH_WIDTH)),
        # Another node, or NODE_LEAF | the number of a light: those of ShapedPlane first, then the triangles
        # of LightPlane. NODE_EMPTY: there is no child.
        ("child", np.uint32, (BVH_WIDTH,)),
        ("last", np.uint32),  # the last child that there is
        ("directed", np.uint32),  # 1: some of the children do not shine everywhere
        ("unused", np.uint32, (6,)),  # planes begin where vectors may
    ]
)

SLOT = _packed(
    [
        # The slots that hold repetitions of one tile stand next to each other and form a group; paths of a
        # group go pixel by pixel with the repetitions innermost, because equal pixels make coherent rays.
        ("tile_x", np.uint32),  # first pixel of the tile
        ("tile_y", np.uint32),
        ("pixel_step", np.uint32),  # from a pixel to the next one; above 1 the slot has gaps
        ("first_sample", np.uint32),  # sample index of the first slot of the group
        ("group_first", np.uint32),  # its first slot
        ("group_count", np.uint32),
        ("flags", np.uint32),  # SlotFlag
    ]
)

CAMERA = _packed(
    [
        ("position", np.float32, (3,)),
        ("right", np.float32, (3,)),  # scaled so that pixel (x, y) looks along
        ("up", np.float32, (3,)),  # forward + (2 x / width - 1) right - (2 y / height - 1) up
        ("forward", np.float32, (3,)),
        # The rest is read by the variant LENS alone; see cl/scene/lens.cl.
        ("lens_right", np.float32, (3,)),  # the half axes of the aperture, metres
        ("lens_up", np.float32, (3,)),
        ("inverse_focus", np.float32),  # 1 / distance of the plane that is sharp, 1/m
        ("near", np.float32),  # along the view, metres
        ("orthographic", np.float32),  # 1: rays are parallel and start right and up of the position; else 0
        ("blades", np.uint32),  # corners of the aperture; 0: it is round
        ("blade_turns", np.float32),  # its rotation, as a fraction of a full turn
    ]
)

PARAMS = _packed(
    [
        ("camera", CAMERA),
        ("camera_media", np.uint32, (2,)),  # the media around the camera, as PathPlane.MEDIUM_0 and MEDIUM_1
        ("width", np.uint32),
        ("height", np.uint32),
        ("tile_size", np.uint32),
        ("in_squares", np.uint32),  # 1: pixels of a tile are taken in squares, see cl/path/tile.cl
        ("first_path", np.uint32),  # of this chunk in the path buffer
        ("path_count", np.uint32),  # in this chunk
        ("path_stride", np.uint32),  # of the planes of path state
        ("buffer_stride", np.uint32),  # of the planes of the path buffer
        ("seed", np.uint32),
        ("max_bounces", np.uint32),
        ("transmission_bounces", np.uint32),
        ("roulette_depth", np.uint32),
        ("multiple_scattering", np.float32),  # 1, or 0: light that meets several microfacets is lost
        ("clamp_indirect", np.float32),  # with CLAMP_INDIRECT: see cl/path/clamp.cl
        ("light_count", np.uint32),
        ("environment_probability", np.float32),  # of sampling the environment instead of a triangle
        ("shaped_count", np.uint32),  # lights that are objects of their own
        ("sun_count", np.uint32),  # suns among them, which come first
        ("shaped_probability", np.float32),  # of sampling one of them; with a light tree, of the suns
        ("tree_probability", np.float32),  # of sampling a light of the light tree
        ("light_levels", np.uint32),  # of the light tree
        ("environment_color", np.float32, (3,)),  # radiance; times the image
        ("environment_width", np.uint32),
        ("environment_height", np.uint32),
        ("environment_rotation", np.float32),  # as a fraction of a full turn
        # With SUN, see cl/scene/sun.cl: towards it, turned as the image is, unit length; radiance, times
        # `environment_color`; chord from its middle to its rim on the unit sphere; its share of the samples
        # of the environment.
        ("sun_direction", np.float32, (3,)),
        ("sun_radiance", np.float32, (3,)),
        ("sun_chord", np.float32),
        ("sun_probability", np.float32),
        ("listed", np.uint32),  # 1: paths take their places in the slots from a list
        ("last_ray", np.uint32),  # number of the ray with which all paths end, see stages.py
        (
            "first_sky_ray",
            np.uint32,
        ),  # of a path, to which light comes from far away; MOST_RAYS: there is none
        ("pixel_center", np.uint32),  # 1: camera rays go through pixel centres (first hits)
    ]
)

CHANGE = _packed(
    [
        # What differs between two scenes. Rays are tested against boxes around the objects that are elsewhere
        # or have another shape, as they were and as they are: least and greatest x, y and z of each.
        ("least", np.float32, (MOST_CHANGED_BOXES, 3)),
        ("greatest", np.float32, (MOST_CHANGED_BOXES, 3)),
        ("box_count", np.uint32),  # an even number
        ("reach", np.float32),  # the largest coordinate of the boxes
        ("padding", np.float32),  # of boxes, per metre of `reach` and of the largest coordinate of an origin
        ("has_objects", np.uint32),  # 1: there are objects on which a hit is enough
        ("has_lights", np.uint32),  # 1: lights differ, see LightFlag.CHANGED
    ]
)

STRUCTS: dict[str, np.dtype[np.void]] = {
    "Node": NODE,
    "TrianglePack": TRIANGLE_PACK,
    "Quad": QUAD,
    "Parallelepiped": PARALLELEPIPED,
    "Cluster": CLUSTER,
    "Object": OBJECT,
    "Material": MATERIAL,
    "Texture": TEXTURE,
    "Attributes": ATTRIBUTES,
    "LightNode": LIGHT_NODE,
    "Slot": SLOT,
    "Camera": CAMERA,
    "Params": PARAMS,
    "Change": CHANGE,
}

_C_TYPES = {np.dtype(np.float32): "float", np.dtype(np.int32): "int", np.dtype(np.uint32): "uint"}


def _c_field(name: str, dtype: np.dtype[Any]) -> str:
    base, shape = dtype.subdtype if dtype.subdtype is not None else (dtype, ())
    for struct_name, struct in STRUCTS.items():
        if base == struct:
            c_type = struct_name
            break
    else:
        c_type = _C_TYPES[base]
    return f"    {c_type} {name}{''.join(f'[{n}]' for n in shape)};"


def _c_struct(name: str, dtype: np.dtype[np.void]) -> str:
    assert dtype.names is not None and dtype.fields is not None
    lines = [_c_field(field, dtype.fields[field][0]) for field in dtype.names]
    body = "\n".join(lines)
    # A negative array size stops the build where the device compiler lays the struct out otherwise.
    check = f"typedef char assert_size_of_{name}[sizeof({name}) == {dtype.itemsize} ? 1 : -1];"
    return f"typedef struct {{\n{body}\n}} {name};\n{check}"


def _c_constant(name: str, value: int | float) -> str:
    return f"#define {name} {value}{'u' if isinstance(value, int) else 'f'}"


def _c_enum(enum: type[IntEnum] | type[IntFlag], prefix: str) -> list[str]:
    return [_c_constant(f"{prefix}_{member.name}", int(member)) for member in enum]


def _c_bits(name: str, bits: Bits) -> list[str]:
    return [_c_constant(f"{name}_SHIFT", bits.shift), _c_constant(f"{name}_MASK", bits.mask)]


def c_header() -> str:
    """OpenCL C text of every constant, plane index, bit field and struct in this module."""
    named = sorted((name, value) for name, value in globals().items() if name[0].isalpha() and name.isupper())
    lines = [_c_constant(name, value) for name, value in named if isinstance(value, int | float)]
    for name, value in named:
        if isinstance(value, Bits):
            lines += _c_bits(name, value)
        elif isinstance(value, tuple) and all(isinstance(one, float) for one in value):
            lines += [_c_constant(f"{name}_{i}", one) for i, one in enumerate(value)]
    for enum, prefix in (
        (RayPlane, "RAY"),
        (RawHitPlane, "RAW_HIT"),
        (SurfacePlane, "SURFACE"),
        (PathPlane, "PATH"),
        (ShadowPlane, "SHADOW"),
        (LightPlane, "LIGHT"),
        (LightFlag, "LIGHT"),
        (ShapedPlane, "SHAPED"),
        (ShapedFlag, "SHAPED"),
        (LightNodePlane, "LIGHT_NODE"),
        (SamplePlane, "SAMPLE"),
        (PairPlane, "PAIR"),
        (CellSum, "CELL_SUM"),
        (CellPlane, "CELL"),
        (RulePlane, "RULE"),
        (TileSum, "TILE_SUM"),
        (HalfPlane, "HALF"),
        (Evidence, "EVIDENCE"),
        (PathClass, "CLASS"),
        (Counter, "COUNTER"),
        (SlotFlag, "SLOT"),
        (MaterialFlag, "MATERIAL"),
        (MaterialTrait, "TRAIT"),
        (TextureSlot, "SLOT_OF"),
        (TextureFlag, "TEXTURE"),
    ):
        lines += _c_enum(enum, prefix)
        if issubclass(enum, IntEnum):
            lines.append(_c_constant(f"{prefix}_PLANES", len(enum)))
    lines += [_c_struct(name, dtype) for name, dtype in STRUCTS.items()]
    return "\n".join(lines) + "\n"
