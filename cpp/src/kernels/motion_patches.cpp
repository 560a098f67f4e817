// Patches whose motion is followed. The file is compiled once per instruction set. Sums have a fixed order, so that every set
// rounds alike.
#include <string.h>

#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

typedef float Row __attribute__((vector_size(motion_patch * sizeof(float))));

void read(const float* from, Row& row) { memcpy(&row, from, sizeof(row)); }

float sum_of(const Row& row) {
  float sum = 0.0f;
  for (int x = 0; x < motion_patch; ++x) sum += row[x];
  return sum;
}

}  // namespace

void blend_patch(const float* map, ptrdiff_t stride, float along, float down, float* out) {
  Row rows[motion_patch + 1];
  for (int y = 0; y <= motion_patch; ++y) {
    Row here, next;
    read(map + y * stride, here);
    read(map + y * stride + 1, next);
    rows[y] = here * (1.0f - along) + next * along;
  }
  Row sums = {};
  for (int y = 0; y < motion_patch; ++y) {
    rows[y] = rows[y] * (1.0f - down) + rows[y + 1] * down;
    sums += rows[y];
  }
  const float mean = sum_of(sums) / (motion_patch * motion_patch);
  for (int y = 0; y < motion_patch; ++y) {
    rows[y] -= mean;
    memcpy(out + y * motion_patch, &rows[y], sizeof(Row));
  }
}

void motion_sums(const float* patch, const float* other, const float* along_x, const float* along_y, float* sums) {
  Row with_x = {}, with_y = {};
  for (int i = 0; i < motion_patch * motion_patch; i += motion_patch) {
    Row value, less, x, y;
    read(patch + i, value);
    read(other + i, less);
    read(along_x + i, x);
    read(along_y + i, y);
    value -= less;
    with_x += x * value;
    with_y += y * value;
  }
  sums[0] = sum_of(with_x);
  sums[1] = sum_of(with_y);
}

}  // namespace endosdk::ENDOSDK_ISA
