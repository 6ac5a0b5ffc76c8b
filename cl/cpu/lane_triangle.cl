#include "accel/bvh.cl"
#include "cpu/lanes.cl"

// Sixteen rays in the lanes against one triangle after the other. The test is that of bvh.cl. Its axes depend
// on the largest component of the direction, so that rays which are tested together must have the same one.

// A corner in coordinates in which every ray starts in the origin and goes along z.
typedef struct {
    float16 x, y, z;
} LaneCorner;

// The corner with these coordinates. All components are along the axes of the test.
INLINE LaneCorner lane_corner(float x, float y, float z, const float16 *origin, const float16 *shear) {
    LaneCorner seen;
    seen.z = z - origin[2];
    seen.x = (x - origin[0]) - shear[0] * seen.z;
    seen.y = (y - origin[1]) - shear[1] * seen.z;
    return seen;
}

// Twice the signed area between the rays and an edge; see bvh_edge.
INLINE float16 lane_edge(const LaneCorner *from, const LaneCorner *to) {
#pragma OPENCL FP_CONTRACT OFF
    return to->x * from->y - to->y * from->x;
}

// The distances at which the rays meet the plane of three corners. `weight` has the area of the edge across
// from each corner; their sum is 0 where a ray goes along the plane. `shear` is that of the rays along z.
INLINE float16 lane_distance(const LaneCorner *corner, const float16 *weight, float16 shear) {
    const float16 depth =
        (weight[0] * corner[0].z + weight[1] * corner[1].z + weight[2] * corner[2].z) * shear;
    return depth / (weight[0] + weight[1] + weight[2]);
}

// Takes over a hit in the lanes that have met it.
INLINE void lane_keep(int16 met, float16 distance, const float16 *weight, float16 *limit, float16 *kept) {
    *limit = met ? distance : *limit;
#pragma unroll
    for (uint i = 0; i < 3; i++)
        kept[i] = met ? weight[i] : kept[i];
}
