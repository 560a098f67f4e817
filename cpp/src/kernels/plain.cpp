// Kernels without vector instructions. They are the reference that the other sets must match bit for bit.
#include "kernels/kernels.hpp"
#include "kernels/sample.hpp"
#include "kernels/sets.hpp"

namespace endosdk::plain {

void remap_rgb(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* c0, uint8_t* c1, uint8_t* c2) {
  for (int i = 0; i < span.count; ++i) {
    const ptrdiff_t x = span.corner[i] & 0xffff;
    const ptrdiff_t y = span.corner[i] >> 16;
    const int fx = span.fraction[i] & 0xff;
    const int fy = span.fraction[i] >> 8;
    const uint8_t* upper = source + y * stride + 3 * x;
    const uint8_t* lower = upper + stride;
    c0[i] = sample(upper[0], upper[3], lower[0], lower[3], fx, fy);
    c1[i] = sample(upper[1], upper[4], lower[1], lower[4], fx, fy);
    c2[i] = sample(upper[2], upper[5], lower[2], lower[5], fx, fy);
  }
}

void remap_gray(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* out) {
  for (int i = 0; i < span.count; ++i) {
    const ptrdiff_t x = span.corner[i] & 0xffff;
    const ptrdiff_t y = span.corner[i] >> 16;
    const uint8_t* upper = source + y * stride + x;
    const uint8_t* lower = upper + stride;
    out[i] = sample(upper[0], upper[1], lower[0], lower[1], span.fraction[i] & 0xff, span.fraction[i] >> 8);
  }
}

void split_rgb(const uint8_t* source, int count, uint8_t* c0, uint8_t* c1, uint8_t* c2) {
  for (int i = 0; i < count; ++i) {
    c0[i] = source[3 * i];
    c1[i] = source[3 * i + 1];
    c2[i] = source[3 * i + 2];
  }
}

void stretch_row(const float* value, const float* step, const int32_t* index, const float* weight, int count,
                 float* out) {
  for (int x = 0; x < count; ++x) out[x] = value[index[x]] + weight[x] * step[index[x]];
}

}  // namespace endosdk::plain
