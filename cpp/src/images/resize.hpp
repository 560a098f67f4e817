// Bilinear resizing with half-pixel centres and clamped edges, equal to torch's interpolate(align_corners=False).
#pragma once

#include <cstdint>
#include <vector>

namespace endosdk {

struct FloatView {
  const float* data = nullptr;
  int width = 0;
  int height = 0;
};

struct MutableFloatView {
  float* data = nullptr;
  int width = 0;
  int height = 0;

  float* row(int y) const { return data + static_cast<int64_t>(y) * width; }
};

// How output pixels map to the source: position = (out + 0.5) * scale - 0.5 with scale = source size / full output size.
// The output may be the top left part of the full one.
struct Scale {
  double y = 1.0;
  double x = 1.0;
};

void check_grid(const FloatView& source, const char* name);
void check_scale(Scale scale, float gain);

// Resizes grids row by row. It keeps its tables between frames: nothing is allocated as long as sizes and the number of threads
// do not grow.
class RowResizer {
 public:
  void prepare(int source_width, int source_height, int out_width, Scale scale);

  // Number of workers of a parallel loop that may call row() at the same time.
  int workers() const { return workers_; }

  // Writes output row y, multiplied by `gain`. `worker` names the calling thread of a parallel loop.
  void row(const FloatView& source, int y, float gain, int worker, float* out);

 private:
  std::vector<int32_t> index_;
  std::vector<float> weight_;
  std::vector<float> scratch_;  // per worker: one blended source row, and the steps between its values
  float scale_y_ = 1.0f;
  int source_width_ = 0;
  int source_height_ = 0;
  int out_width_ = 0;
  int workers_ = 0;
  int stride_ = 0;  // values per scratch row
};

// out = gain * resized source
void resize_bilinear(const FloatView& source, const MutableFloatView& out, Scale scale, float gain);

}  // namespace endosdk
