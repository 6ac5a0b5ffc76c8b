// Builds 8-wide bounding volume hierarchies level by level, breadth first. A work-item owns one range of
// boxes: it splits the range greedily (the child of largest area first) until it has eight children or
// nothing is left to split, and writes the node. The host sums up the counts, so that nothing is atomic
// and the same mesh always gives the same tree. Very large ranges, of which there are too few to keep a
// device busy, are cut into chunks: work-items measure, bin and move them, and the host chooses the split.
//
// Split: binned surface area heuristic (Wald 2007, "On fast Construction of SAH-based Bounding Volume
// Hierarchies"), where a leaf costs whole packs: 9 triangles cost as much as 16.
//
// A Box holds the lower bounds in s012 and the negated upper bounds in s456: one minimum joins two boxes.
// s3 carries the index of the primitive, bit for bit.

#include "accel/bvh.cl"

typedef float8 Box;

#define JOIN(a, b) ((a) < (b) ? (a) : (b))
#define BOX_EMPTY ((Box)(INFINITY))
// Twice the centre in s012, and its negation in s456: a box around a point.
#define CENTER(box) ((box) - (box).s45670123)

// A set of primitives: [start, start + count), and what surrounds them.
typedef struct {
    uint start;
    uint count;
    Box bounds;
    Box centers;
} Range;

// A plane between two sets of primitives, in bins along `axis`; lower bins go to the left.
typedef struct {
    uint axis;
    uint position;
    float origin;
    float scale;
} Split;

static float lane(const float8 v, uint i) {
    return i == 0 ? v.s0 : i == 1 ? v.s1 : i == 2 ? v.s2 : i == 4 ? v.s4 : i == 5 ? v.s5 : v.s6;
}

// Half the surface of a box.
static float box_area(const Box box) {
    const float x = -box.s4 - box.s0, y = -box.s5 - box.s1, z = -box.s6 - box.s2;
    return x * y + y * z + z * x;
}

static uint bin_of(float center, float origin, float scale) {
    const int bin = (int)((center - origin) * scale);
    return bin < 0 ? 0 : bin > BVH_BINS - 1 ? BVH_BINS - 1 : bin;
}

static Range range_around(__global const Box *boxes, uint start, uint count) {
    Range range = {start, count, BOX_EMPTY, BOX_EMPTY};
    for (uint i = start; i < start + count; i++) {
        const Box box = boxes[i];
        range.bounds = JOIN(range.bounds, box);
        range.centers = JOIN(range.centers, CENTER(box));
    }
    return range;
}

// How many bins a unit of length has along an axis. It is 0 where all centres fall together.
static float bin_scale(const Box centers, uint axis) {
    const float extent = -lane(centers, axis + 4) - lane(centers, axis);
    const float scale = BVH_BINS * 0.999f / extent;
    return extent > 0.0f && scale < 1e30f ? scale : 0.0f;
}

// Joins boxes in bins by their centres: the bins of x, then y, then z.
static void fill_bins(__global const Box *boxes, uint start, uint count, const float *origin,
                      const float *scale, Box *bins, uint *counts) {
    for (uint i = 0; i < 3 * BVH_BINS; i++) {
        bins[i] = BOX_EMPTY;
        counts[i] = 0;
    }
    for (uint i = start; i < start + count; i++) {
        const Box box = boxes[i];
        const Box center = CENTER(box);
        const uint x = bin_of(center.s0, origin[0], scale[0]);
        const uint y = bin_of(center.s1, origin[1], scale[1]) + BVH_BINS;
        const uint z = bin_of(center.s2, origin[2], scale[2]) + 2 * BVH_BINS;
        bins[x] = JOIN(bins[x], box);
        bins[y] = JOIN(bins[y], box);
        bins[z] = JOIN(bins[z], box);
        counts[x]++;
        counts[y]++;
        counts[z]++;
    }
}

// The cheapest split of a range in bins along the three axes. False where no plane separates anything.
static bool choose_split(__global const Box *boxes, const Range range, uint leaf_size, Split *best) {
    Box bins[3 * BVH_BINS];
    uint counts[3 * BVH_BINS];
    float scale[3], origin[3];
    for (uint axis = 0; axis < 3; axis++) {
        scale[axis] = bin_scale(range.centers, axis);
        origin[axis] = lane(range.centers, axis);
    }
    fill_bins(boxes, range.start, range.count, origin, scale, bins, counts);
    float best_cost = INFINITY;
    for (uint axis = 0; axis < 3; axis++) {
        float right_cost[BVH_BINS];
        Box joined = BOX_EMPTY;
        uint count = 0;
        for (uint bin = BVH_BINS - 1; bin > 0; bin--) {
            joined = JOIN(joined, bins[axis * BVH_BINS + bin]);
            count += counts[axis * BVH_BINS + bin];
            right_cost[bin] = count ? box_area(joined) * ((count + leaf_size - 1) / leaf_size) : INFINITY;
        }
        joined = BOX_EMPTY;
        count = 0;
        for (uint bin = 1; bin < BVH_BINS; bin++) {
            joined = JOIN(joined, bins[axis * BVH_BINS + bin - 1]);
            count += counts[axis * BVH_BINS + bin - 1];
            const float cost =
                count ? box_area(joined) * ((count + leaf_size - 1) / leaf_size) + right_cost[bin] : INFINITY;
            if (cost < best_cost) {
                best_cost = cost;
                best->axis = axis;
                best->position = bin;
            }
        }
    }
    best->origin = origin[best->axis];
    best->scale = scale[best->axis];
    return best_cost < INFINITY;
}

// Reorders the range by the split and returns both sides.
static void partition(__global Box *boxes, const Range range, const Split split, Range *left, Range *right) {
    Box left_bounds = BOX_EMPTY, left_centers = BOX_EMPTY, right_bounds = BOX_EMPTY,
        right_centers = BOX_EMPTY;
    uint i = range.start, j = range.start + range.count;
    while (i < j) {
        const Box box = boxes[i];
        const Box center = CENTER(box);
        if (bin_of(lane(center, split.axis), split.origin, split.scale) < split.position) {
            left_bounds = JOIN(left_bounds, box);
            left_centers = JOIN(left_centers, center);
            i++;
        } else {
            right_bounds = JOIN(right_bounds, box);
            right_centers = JOIN(right_centers, center);
            j--;
            boxes[i] = boxes[j];
            boxes[j] = box;
        }
    }
    *left = (Range){range.start, i - range.start, left_bounds, left_centers};
    *right = (Range){i, range.start + range.count - i, right_bounds, right_centers};
}

// Halves the range at the median along its widest axis. That is always possible, also where all centres
// coincide.
static void halve(__global Box *boxes, const Range range, Range *left, Range *right) {
    const Box extent = -range.centers.s45674567 - range.centers;
    const uint axis = extent.s0 >= extent.s1 && extent.s0 >= extent.s2 ? 0 : extent.s1 >= extent.s2 ? 1 : 2;
    const uint middle = range.start + range.count / 2;
    uint first = range.start, last = range.start + range.count - 1;
    while (first < last) { // quickselect (Hoare)
        const float pivot = lane(CENTER(boxes[first + (last - first) / 2]), axis);
        int i = first, j = last;
        while (i <= j) {
            while (lane(CENTER(boxes[i]), axis) < pivot)
                i++;
            while (lane(CENTER(boxes[j]), axis) > pivot)
                j--;
            if (i <= j) {
                const Box swapped = boxes[i];
                boxes[i++] = boxes[j];
                boxes[j--] = swapped;
            }
        }
        if ((int)middle <= j)
            last = j;
        else if ((int)middle >= i)
            first = i;
        else
            break;
    }
    *left = range_around(boxes, range.start, middle - range.start);
    *right = range_around(boxes, middle, range.start + range.count - middle);
}

// The child that is split next: the one of largest area, or, for an `even` tree, the one of most primitives.
// BVH_WIDTH where none can be split.
static uint choose_child(const Range *children, uint child_count, uint leaf_size, bool even) {
    uint chosen = BVH_WIDTH;
    float largest = -1.0f;
    for (uint i = 0; i < child_count; i++) {
        const float size = even ? (float)children[i].count : box_area(children[i].bounds);
        if (children[i].count > leaf_size && size > largest) {
            largest = size;
            chosen = i;
        }
    }
    return chosen;
}

static void write_bounds(__global Node *node, uint child, const Box bounds) {
    node->bounds[0][child] = bounds.s0;
    node->bounds[1][child] = -bounds.s4;
    node->bounds[2][child] = bounds.s1;
    node->bounds[3][child] = -bounds.s5;
    node->bounds[4][child] = bounds.s2;
    node->bounds[5][child] = -bounds.s6;
}

static Box face_box(__global const int *faces, __global const float *vertices, uint face) {
    Box box = BOX_EMPTY;
    for (uint corner = 0; corner < 3; corner++) {
        __global const float *v = vertices + 3 * (size_t)faces[3 * (size_t)face + corner];
        const Box point = (Box)(v[0], v[1], v[2], 0.0f, -v[0], -v[1], -v[2], 0.0f);
        box = JOIN(box, point);
    }
    return box;
}

// Copies a face into a lane of a pack. The vertices of a face without area become NaN, like those of unused
// lanes: every comparison with them is false, so that no ray meets them and a hit always has a normal.
static void write_face(__global TrianglePack *pack, uint lane_index, __global const int *faces,
                       __global const float *vertices, uint face) {
    Vec3 vertex[3];
    for (uint corner = 0; corner < 3; corner++) {
        __global const float *v = vertices + 3 * (size_t)faces[3 * (size_t)face + corner];
        vertex[corner] = vec3(v[0], v[1], v[2]);
    }
    const bool flat = !(bvh_largest(bvh_normal(vertex[0], vertex[1], vertex[2])) > BVH_LEAST_NORMAL);
    for (uint corner = 0; corner < 3; corner++) {
        pack->vertex[3 * corner][lane_index] = flat ? NAN : vertex[corner].x;
        pack->vertex[3 * corner + 1][lane_index] = flat ? NAN : vertex[corner].y;
        pack->vertex[3 * corner + 2][lane_index] = flat ? NAN : vertex[corner].z;
    }
    pack->face[lane_index] = face;
    pack->object[lane_index] = NO_INDEX;
}

static void clear_lane(__global TrianglePack *pack, uint lane_index) {
    for (uint i = 0; i < 9; i++)
        pack->vertex[i][lane_index] = NAN;
    pack->face[lane_index] = NO_INDEX;
    pack->object[lane_index] = NO_INDEX;
}

// Boxes around all faces of a mesh.
__kernel void bound_faces(ITEMS_PARAMETERS, MESH_PARAMETERS, BOXES_PARAMETERS) {
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    Box box = face_box(faces, vertices, i);
    box.s3 = as_float(i);
    boxes[i] = box;
}

// What surrounds the boxes, and the centres, of each chunk.
__kernel void measure_chunks(ITEMS_PARAMETERS, BOXES_PARAMETERS, CHUNKS_PARAMETERS, MEASURES_PARAMETERS) {
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    const Range range = range_around(boxes, chunks[2 * i], chunks[2 * i + 1]);
    measures[2 * i] = range.bounds;
    measures[2 * i + 1] = range.centers;
}

// Joins the boxes of each chunk in bins by their centres.
__kernel void bin_chunks(ITEMS_PARAMETERS, BOXES_PARAMETERS, CHUNKS_PARAMETERS, BINS_PARAMETERS) {
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    const float origin[3] = {origin_x, origin_y, origin_z}, scale[3] = {scale_x, scale_y, scale_z};
    Box own_bins[3 * BVH_BINS];
    uint own_counts[3 * BVH_BINS];
    fill_bins(boxes, chunks[2 * i], chunks[2 * i + 1], origin, scale, own_bins, own_counts);
    for (uint bin = 0; bin < 3 * BVH_BINS; bin++) {
        bins[3 * BVH_BINS * i + bin] = own_bins[bin];
        bin_counts[3 * BVH_BINS * i + bin] = own_counts[bin];
    }
}

// Moves the boxes of chunk i to `moved`: those of lower bins to sides[2 * i] and on, the others to
// sides[2 * i + 1] and on.
__kernel void scatter_chunks(ITEMS_PARAMETERS, BOXES_PARAMETERS, CHUNKS_PARAMETERS, SIDES_PARAMETERS,
                             MOVED_PARAMETERS) {
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    uint left = sides[2 * i], right = sides[2 * i + 1];
    for (uint k = chunks[2 * i]; k < chunks[2 * i] + chunks[2 * i + 1]; k++) {
        const Box box = boxes[k];
        if (bin_of(lane(CENTER(box), axis), origin, scale) < position)
            moved[left++] = box;
        else
            moved[right++] = box;
    }
}

// Copies the boxes of each chunk back from `moved`.
__kernel void copy_chunks(ITEMS_PARAMETERS, BOXES_PARAMETERS, CHUNKS_PARAMETERS, MOVED_PARAMETERS) {
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    for (uint k = chunks[2 * i]; k < chunks[2 * i] + chunks[2 * i + 1]; k++)
        boxes[k] = moved[k];
}

// Splits range i of a level into the children of node i. `children` gets start and count of each (count 0:
// none), `child_counts` the number of inner children and of leaves. A range above `capacity` would not
// fit the levels that are left unless it is split evenly; one above `largest` is left to the host.
__kernel void split_ranges(ITEMS_PARAMETERS, BOXES_PARAMETERS, LEVEL_PARAMETERS, SPLITTING_PARAMETERS) {
    const uint i = get_global_id(0);
    if (i >= count || ranges[2 * i + 1] > largest)
        return;
    Range parts[BVH_WIDTH];
    uint part_count = 1;
    parts[0] = range_around(boxes, ranges[2 * i], ranges[2 * i + 1]);
    const bool even = parts[0].count > capacity;
    while (part_count < BVH_WIDTH) {
        const uint chosen = choose_child(parts, part_count, leaf_size, even);
        if (chosen == BVH_WIDTH)
            break;
        const Range range = parts[chosen];
        Split split;
        if (!even && choose_split(boxes, range, leaf_size, &split))
            partition(boxes, range, split, &parts[chosen], &parts[part_count]);
        else
            halve(boxes, range, &parts[chosen], &parts[part_count]);
        part_count++;
    }
    uint leaf_count = 0;
    for (uint child = 0; child < BVH_WIDTH; child++) {
        const bool used = child < part_count && parts[child].count > 0;
        leaf_count += used && parts[child].count <= leaf_size;
        write_bounds(level_nodes + i, child, used ? parts[child].bounds : BOX_EMPTY);
        children[2 * (BVH_WIDTH * i + child)] = used ? parts[child].start : 0;
        children[2 * (BVH_WIDTH * i + child) + 1] = used ? parts[child].count : 0;
    }
    child_counts[2 * i] = part_count - leaf_count;
    child_counts[2 * i + 1] = leaf_count;
}

// Sorts the children of a node for rays into each octant, by the centres of their boxes. A ray into the
// opposite octant takes them backwards.
static void write_order(__global Node *node) {
    for (uint octant = 0; octant < 4; octant++) {
        float depth[BVH_WIDTH];
        for (uint child = 0; child < BVH_WIDTH; child++) {
            depth[child] = 0.0f;
            for (uint axis = 0; axis < 3; axis++) {
                // The bounds are scaled, so that no sum leaves the range of a float.
                const float sum =
                    0.125f * node->bounds[2 * axis][child] + 0.125f * node->bounds[2 * axis + 1][child];
                depth[child] += octant >> axis & 1 ? -sum : sum;
            }
            if (node->child[child] == NODE_EMPTY)
                depth[child] = INFINITY;
        }
        uint order = 0, backwards = 0;
        for (uint child = 0; child < BVH_WIDTH; child++) {
            uint farther = 0;
            for (uint other = 0; other < BVH_WIDTH; other++)
                farther += depth[other] > depth[child] || (depth[other] == depth[child] && other < child);
            order |= child << (3 * farther);
            backwards |= child << (3 * (BVH_WIDTH - 1 - farther));
        }
        node->order[octant] = order;
        node->order[7 - octant] = backwards;
    }
}

// Refers node i to its children: inner ones become ranges of the next level, leaves packs or objects.
// `before` holds, for each node, the number of inner children and of leaves of the nodes before it.
__kernel void link_children(ITEMS_PARAMETERS, MESH_PARAMETERS, BOXES_PARAMETERS, LEVEL_PARAMETERS,
                            LINKING_PARAMETERS, LEAVES_PARAMETERS) {
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    uint inner = before[2 * i], leaf = before[2 * i + 1];
    for (uint child = 0; child < BVH_WIDTH; child++) {
        const uint start = children[2 * (BVH_WIDTH * i + child)];
        const uint size = children[2 * (BVH_WIDTH * i + child) + 1];
        uint reference = NODE_EMPTY;
        if (size > leaf_size) {
            reference = next_node + inner;
            next_ranges[2 * inner] = start;
            next_ranges[2 * inner + 1] = size;
            inner++;
        } else if (size > 0 && leaf_size == 1) {
            reference = NODE_LEAF | as_uint(boxes[start].s3);
        } else if (size > 0) {
            reference = NODE_LEAF | (next_pack + leaf);
            for (uint k = 0; k < BVH_WIDTH; k++)
                if (k < size)
                    write_face(leaf_packs + leaf, k, faces, vertices, as_uint(boxes[start + k].s3));
                else
                    clear_lane(leaf_packs + leaf, k);
            leaf++;
        }
        level_nodes[i].child[child] = reference;
    }
    write_order(level_nodes + i);
}

// Gives the faces in the leaves of a tree the vertices of another mesh.
__kernel void refit_packs(ITEMS_PARAMETERS, MESH_PARAMETERS, LEAVES_PARAMETERS) {
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    for (uint k = 0; k < BVH_WIDTH; k++)
        if (leaf_packs[i].face[k] != NO_INDEX)
            write_face(leaf_packs + i, k, faces, vertices, leaf_packs[i].face[k]);
}

// Fits the boxes of nodes [first_node, first_node + count), whose inner children are done already.
__kernel void refit_nodes(ITEMS_PARAMETERS, MESH_PARAMETERS, LEAVES_PARAMETERS, REFITTING_PARAMETERS) {
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    __global Node *node = tree_nodes + first_node + i;
    for (uint child = 0; child < BVH_WIDTH; child++) {
        const uint reference = node->child[child];
        Box box = BOX_EMPTY;
        if (reference == NODE_EMPTY)
            continue;
        for (uint k = 0; k < BVH_WIDTH; k++) {
            if (reference & NODE_LEAF) {
                const uint face = leaf_packs[reference & ~NODE_LEAF].face[k];
                if (face != NO_INDEX)
                    box = JOIN(box, face_box(faces, vertices, face));
            } else {
                __global const float *b = &tree_nodes[reference].bounds[0][k];
                box = JOIN(box, (Box)(b[0], b[16], b[32], 0.0f, -b[8], -b[24], -b[40], 0.0f));
            }
        }
        write_bounds(node, child, box);
    }
    write_order(node);
}
