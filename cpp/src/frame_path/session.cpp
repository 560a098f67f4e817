#include "frame_path/session.hpp"

#include "platform/errors.hpp"

namespace endosdk {
namespace {

// Longest side after padding, px. It is far beyond any frame. Only a model with a very large input multiple exceeds it.
constexpr int64_t longest_padded_side = 1 << 20;

int padded(int length, int multiple) {
  const int64_t result = (int64_t{length} + multiple - 1) / multiple * multiple;
  require(result <= longest_padded_side, "size", Text("must be at most ", longest_padded_side, " px after padding"), result);
  return static_cast<int>(result);
}


}  // namespace

Size padded_size(Size picture, const ModelInfo& model) {
  return {padded(picture.width, model.input_multiple), padded(picture.height, model.input_multiple)};
}

SessionBuffers::SessionBuffers(Size picture, const ModelInfo& model)
    : input_(padded_size(picture, model)),
      grid_{input_.width / model.output_stride, input_.height / model.output_stride} {
  require(grid_.width > 0 && grid_.height > 0, "size", "must give the network at least one output pixel",
          input_);
  pixels_.resize(2 * 3 * count_of(input_));
  maps_.resize(2 * count_of(grid_));
}

}  // namespace endosdk
