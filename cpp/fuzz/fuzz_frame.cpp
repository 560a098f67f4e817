// Any description of a frame: what it says is in memory is there, and the library must read and write no byte more.
#include "target.hpp"

namespace {

struct Input {
  endo_image left;
  endo_image right;
  uint64_t capacity;
  uint32_t result_size;
  uint8_t maps;  // one bit per map
  uint8_t with_rig;
};

// Memory for exactly the rows that an image describes; null when it describes too much for a test.
std::vector<uint8_t> memory_of(const endo_image& image) {
  const int64_t channels = image.format == ENDO_GRAY8 ? 1 : 3;
  const int64_t tight = int64_t{image.width} * channels;
  if (image.width < 1 || image.height < 1 || int64_t{image.width} * image.height > 128 * 128) return {};
  if (image.stride > 1024 || image.stride < -1024) return {};
  const int64_t stride = image.stride == 0 ? tight : image.stride < 0 ? -image.stride : image.stride;
  return std::vector<uint8_t>(static_cast<size_t>(stride * (image.height - 1) + tight), 90);
}

endo_image at_memory(endo_image image, std::vector<uint8_t>& memory) {
  image.data = nullptr;
  if (memory.empty()) return image;
  const int64_t up = image.stride < 0 ? -image.stride * (image.height - 1) : 0;
  image.data = memory.data() + up;
  return image;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static endo_estimator* const estimator = open_tiny_model();
  Input input = {};
  if (size > sizeof input) return -1;
  std::memcpy(&input, data, size);
  // struct_size may only name memory that the struct has.
  if (input.left.struct_size > sizeof input.left || input.right.struct_size > sizeof input.right) return -1;
  if (input.result_size > sizeof(endo_result) || input.capacity > 128 * 128) return -1;

  std::vector<uint8_t> left_memory = memory_of(input.left);
  std::vector<uint8_t> right_memory = memory_of(input.right);
  const endo_image left = at_memory(input.left, left_memory);
  const endo_image right = at_memory(input.right, right_memory);
  const endo_calibration rig = small_rig(input.left.width, input.left.height);
  endo_set_calibration(estimator, (input.with_rig & 1) != 0 ? &rig : nullptr);
  Frame frame(static_cast<int>(input.capacity), 1);
  endo_result result = frame.result(input.maps);
  result.struct_size = input.result_size;
  const endo_status status = endo_predict(estimator, &left, &right, &result);
  must(status != ENDO_INTERNAL && status != ENDO_OUT_OF_MEMORY);
  must(status != ENDO_OK || result.quality <= ENDO_QUALITY_INVALID);
  return 0;
}
