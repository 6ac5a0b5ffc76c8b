#include "base/features.cl"
#include "base/scalar.cl"

// Images on surfaces. All pixels of a device lie in one buffer of words, in the form that files have: bytes,
// or half floats where there is more to them than bytes hold (tables/textures.py). This is straight-line
// code of scalars, so that PoCL runs it in SIMD lanes.

typedef struct {
    Vec3 color;
    float alpha;
} Texel;

// Texture coordinates at a point of a surface, of both sets.
typedef struct {
    float u0, v0, u1, v1;
} Uvs;

// The value of a half float in the lower bits of a word: with the exponent of a float it is 2^112 times
// smaller.
INLINE float half_value(uint bits) {
    return as_float((bits & 0x8000u) << 16 | (bits & 0x7fffu) << 13) * 0x1p112f;
}

INLINE float channel_value(const Shading *shading, uint flags, uint bits) {
    uint place = (bits & 0xffu) | (flags & TEXTURE_SRGB ? 256u : 0u);
    float byte = shading->byte_values[place];
    return flags & TEXTURE_HALF ? half_value(bits) : byte;
}

// One pixel. It has 8 bytes at most, and begins at a byte of the first of two words.
INLINE Texel texel_at(const Shading *shading, __global const Texture *texture, uint column, uint row) {
    uint flags = texture->flags;
    uint is_half = flags & TEXTURE_HALF, is_grey = flags & TEXTURE_GREY;
    uint byte = (row * texture->width + column) * (texture->channels << is_half);
    __global const uint *words = shading->texels + texture->first_word + (byte >> 2);
    uint shift = (byte & 3u) * 8u;
    uint low = words[0] >> shift | (words[1] << 1) << (31u - shift), high = words[1] >> shift;
    uint first = is_half ? low & 0xffffu : low & 0xffu;
    uint second = is_half ? low >> 16 : low >> 8 & 0xffu;
    uint third = is_half ? high & 0xffffu : low >> 16 & 0xffu;
    uint fourth = is_half ? high >> 16 : low >> 24;
    uint last = is_grey ? second : fourth;
    Texel texel;
    texel.color.x = channel_value(shading, flags, first);
    texel.color.y = channel_value(shading, flags, is_grey ? first : second);
    texel.color.z = channel_value(shading, flags, is_grey ? first : third);
    float alpha = channel_value(shading, flags & ~TEXTURE_SRGB, last);
    texel.alpha = flags & TEXTURE_ALPHA ? alpha : 1.0f;
    return texel;
}

// Where a coordinate of the image lies, in images from the start of one: in [0, 1], or in [0, 2] where every
// other image is a mirror image.
INLINE float wrapped(float x, uint clamps, uint mirrors) {
    float repeated = x - FLOOR(x), mirrored = x - 2.0f * FLOOR(0.5f * x);
    return clamps ? CLAMP(x, 0.0f, 1.0f) : (mirrors ? mirrored : repeated);
}

// The row or column that is meant by one of those, or by a neighbour just beside them.
INLINE uint wrapped_index(int i, int size, uint clamps, uint mirrors) {
    int repeated = i < 0 ? i + size : (i >= size ? i - size : i);
    int mirrored = i < 0 ? 0 : (i >= size ? 2 * size - 1 - i : i);
    int index = clamps ? i : (mirrors ? mirrored : repeated);
    return (uint)CLAMP(index, 0, size - 1);
}

INLINE Texel texel_between(Texel a, Texel b, float t) {
    Texel texel;
    texel.color = add(a.color, scale(t, subtract(b.color, a.color)));
    texel.alpha = LERP(a.alpha, b.alpha, t);
    return texel;
}

// Where a point of a surface lies in the image of a texture, in images.
typedef struct {
    float x, y;
} ImagePlace;

INLINE ImagePlace place_in_image(__global const Texture *texture, const Uvs *uvs) {
    __global const float *m = texture->matrix;
    float u = texture->uv_set ? uvs->u1 : uvs->u0, v = texture->uv_set ? uvs->v1 : uvs->v0;
    ImagePlace place;
    place.x = m[0] * u + m[1] * v + m[2];
    place.y = m[3] * u + m[4] * v + m[5];
    return place;
}

INLINE Texel sample_image(const Shading *shading, __global const Texture *texture, ImagePlace place) {
    uint flags = texture->flags;
    uint clamps_u = flags & TEXTURE_CLAMP_U, mirrors_u = flags & TEXTURE_MIRROR_U;
    uint clamps_v = flags & TEXTURE_CLAMP_V, mirrors_v = flags & TEXTURE_MIRROR_V;
    float half_pixel = flags & TEXTURE_NEAREST ? 0.0f : 0.5f;
    int width = (int)texture->width, height = (int)texture->height;
    float x = wrapped(place.x, clamps_u, mirrors_u) * (float)width - half_pixel;
    float y = wrapped(place.y, clamps_v, mirrors_v) * (float)height - half_pixel;
    float left = FLOOR(x), top = FLOOR(y);
    float tx = flags & TEXTURE_NEAREST ? 0.0f : x - left, ty = flags & TEXTURE_NEAREST ? 0.0f : y - top;
    uint x0 = wrapped_index((int)left, width, clamps_u, mirrors_u);
    uint x1 = wrapped_index((int)left + 1, width, clamps_u, mirrors_u);
    uint y0 = wrapped_index((int)top, height, clamps_v, mirrors_v);
    uint y1 = wrapped_index((int)top + 1, height, clamps_v, mirrors_v);
    Texel upper = texel_between(texel_at(shading, texture, x0, y0), texel_at(shading, texture, x1, y0), tx);
    Texel lower = texel_between(texel_at(shading, texture, x0, y1), texel_at(shading, texture, x1, y1), tx);
    return texel_between(upper, lower, ty);
}

// A texture at a point of a surface; texture 0 is white.
INLINE Texel sample_texture(const Shading *shading, uint number, const Uvs *uvs) {
    __global const Texture *texture = shading->textures + number;
    return sample_image(shading, texture, place_in_image(texture, uvs));
}

typedef struct {
    float u, v;
} TextureSlope;

// How red grows in a texture along u and along v: the differences over a pixel, which are continuous where
// the slopes of what is interpolated are not.
INLINE TextureSlope texture_slope(const Shading *shading, uint number, const Uvs *uvs) {
    __global const Texture *texture = shading->textures + number;
    __global const float *m = texture->matrix;
    float width = (float)texture->width, height = (float)texture->height;
    ImagePlace left = place_in_image(texture, uvs), right = left, above = left, below = left;
    left.x -= 0.5f / width;
    right.x += 0.5f / width;
    above.y -= 0.5f / height;
    below.y += 0.5f / height;
    float along_x = width * (sample_image(shading, texture, right).color.x -
                             sample_image(shading, texture, left).color.x);
    float along_y = height * (sample_image(shading, texture, below).color.x -
                              sample_image(shading, texture, above).color.x);
    TextureSlope slope;
    slope.u = along_x * m[0] + along_y * m[3];
    slope.v = along_x * m[1] + along_y * m[4];
    return slope;
}

// The colour of a texture that may be above 1, as that of emission, but not below 0: images of floats may
// hold anything.
INLINE Vec3 bright_texel(const Shading *shading, uint number, const Uvs *uvs) {
    Vec3 color = sample_texture(shading, number, uvs).color;
    return vec3(MAX(color.x, 0.0f), MAX(color.y, 0.0f), MAX(color.z, 0.0f));
}
