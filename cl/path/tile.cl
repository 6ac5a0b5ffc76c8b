#include "base/scalar.cl"

// The order in which the pixels of a tile are taken. Where rays go through trees, and the edge of the tile is
// a multiple of 4, they are taken in squares of 4 x 4, because sixteen neighbours then share their way
// through a tree. The squares follow each other row by row, and so do the pixels of a tile without squares.

typedef struct {
    uint x, y; // counted from the corner of the tile
} TilePixel;

// a / b, exactly: the quotient of two 32-bit integers is farther from the next whole number than a double
// rounds. There are no SIMD instructions that divide integers.
INLINE uint quotient(uint a, uint b) {
#ifdef CLANG_CPU
    return (uint)((double)a / (double)b);
#else
    return a / b;
#endif
}

// Binary logarithm of the edge of a square.
INLINE uint tile_square_bits(const Params *params) {
    return params->in_squares && params->tile_size % 4u == 0u ? 2u : 0u;
}

// The pixel at a place in that order.
INLINE TilePixel tile_pixel(const Params *params, uint place) {
    const uint bits = tile_square_bits(params), mask = (1u << bits) - 1u;
    const uint squares = params->tile_size >> bits; // in a row
    const uint square = place >> (2u * bits);
    const uint row = quotient(square, squares);
    const TilePixel pixel = {((square - row * squares) << bits) + (place & mask),
                             (row << bits) + ((place >> bits) & mask)};
    return pixel;
}

// The place of a pixel in that order.
INLINE uint tile_place(const Params *params, TilePixel pixel) {
    const uint bits = tile_square_bits(params), mask = (1u << bits) - 1u;
    const uint square = (pixel.y >> bits) * (params->tile_size >> bits) + (pixel.x >> bits);
    return (((square << bits) + (pixel.y & mask)) << bits) + (pixel.x & mask);
}
