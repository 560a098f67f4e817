// endosdk for C++17: the C interface with objects that free themselves and errors that are thrown. Header only, so no C++
// type crosses the library's boundary and any compiler's standard library will do.
//
//     endo::Options options;
//     options.deadline_ms = 22.0;
//     endo::Estimator estimator = endo::Estimator::open("wang2020.onnx", options);
//     estimator.set_calibration(rig);                     // an endo_calibration filled by you
//     estimator.prepare(960, 720);
//     endo::Maps maps(960, 720, endo::Maps::metric);
//     estimator.predict(endo::image(left_pixels, 960, 720), endo::image(right_pixels, 960, 720), maps);
//     if (maps.result.quality == ENDO_QUALITY_OK) use(maps.depth);
#ifndef ENDOSDK_HPP
#define ENDOSDK_HPP

#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "endosdk.h"

namespace endo {

// A failed call: what() names the argument, the rule and the value seen. result() is that of a frame of a stream that was
// received and had failed, null for every other call: its maps are free again.
class Error : public std::runtime_error {
 public:
  Error(endo_status status, const char* message, endo_result* result = nullptr)
      : std::runtime_error(message), status_(status), result_(result) {}

  endo_status status() const noexcept { return status_; }
  endo_result* result() const noexcept { return result_; }

 private:
  endo_status status_;
  endo_result* result_;
};

inline void check(endo_status status, endo_result* result = nullptr) {
  if (status != ENDO_OK) throw Error(status, endo_last_error(), result);
}

// The options with their defaults. Strings and bytes are only pointed at and must live until `open` returns, the contexts
// of the log and of the threads until the estimator is gone.
struct Options : endo_options {
  Options() : endo_options() { check(endo_options_init(this, sizeof(endo_options))); }
};

// A rig to fill in: struct_size is set, the cameras are pinhole and all numbers zero.
inline endo_calibration calibration() {
  endo_calibration rig = {};
  rig.struct_size = sizeof rig;
  return rig;
}

// From the text of a rig file of endosdk.
inline endo_calibration read_calibration(const std::string& text) {
  endo_calibration rig = calibration();
  check(endo_read_calibration(text.data(), text.size(), &rig));
  return rig;
}

// A view of pixels that stay yours; stride in bytes, 0 for rows without gaps.
inline endo_image image(const uint8_t* data, int width, int height, endo_pixel_format format = ENDO_RGB8,
                        int64_t stride = 0) {
  return {sizeof(endo_image), format, data, width, height, stride};
}

// Memory for the maps of one frame size, made once and written by every predict.
class Maps {
 public:
  enum Kind { disparity_only, metric };  // metric adds depth and sigma, which need a calibration

  Maps(int width, int height, Kind kind = disparity_only)
      : disparity(pixels(width, height)), confidence(disparity.size()), reasons(disparity.size()) {
    if (kind == metric) {
      depth.resize(disparity.size());
      sigma.resize(disparity.size());
    }
  }

  std::vector<float> disparity;
  std::vector<float> confidence;
  std::vector<uint8_t> reasons;
  std::vector<float> depth;
  std::vector<float> sigma;
  // The result, pointing to these maps.
  endo_result& tied() {
    result.struct_size = sizeof result;
    result.capacity = disparity.size();
    result.disparity = disparity.data();
    result.confidence = confidence.data();
    result.reasons = reasons.data();
    result.depth = depth.empty() ? nullptr : depth.data();
    result.sigma = sigma.empty() ? nullptr : sigma.data();
    return result;
  }

  endo_result result = {};  // quality, share of answers, times, late; its pointers are set by predict

 private:
  static size_t pixels(int width, int height) {
    return width > 0 && height > 0 ? static_cast<size_t>(width) * static_cast<size_t>(height) : 0;
  }
};

// One loaded model with its memory; it can be moved, not copied.
class Estimator {
 public:
  static Estimator open(const std::string& path, const Options& options = Options()) {
    endo_estimator* handle = nullptr;
    check(endo_open_file(path.c_str(), &options, &handle));
    return Estimator(handle);
  }

  static Estimator open(const void* data, size_t size, const Options& options = Options()) {
    endo_estimator* handle = nullptr;
    check(endo_open_memory(data, size, &options, &handle));
    return Estimator(handle);
  }

  void set_calibration(const endo_calibration& rig) { check(endo_set_calibration(get(), &rig)); }

  void remove_calibration() { check(endo_set_calibration(get(), nullptr)); }

  endo_geometry geometry() const {
    endo_geometry found = {};
    found.struct_size = sizeof found;
    check(endo_get_geometry(get(), &found));
    return found;
  }

  void prepare(int width, int height) { check(endo_prepare(get(), width, height)); }

  // Writes the maps that the result points to.
  void predict(const endo_image& left, const endo_image& right, endo_result& result) {
    check(endo_predict(get(), &left, &right, &result));
  }

  void predict(const endo_image& left, const endo_image& right, Maps& maps) { predict(left, right, maps.tied()); }

  // The pair that the maps lie over, at its own size. Either output may be null.
  void rectify(const endo_image& left, const endo_image& right, uint8_t* rectified_left, uint8_t* rectified_right,
               size_t capacity) {
    check(endo_rectify(get(), &left, &right, rectified_left, rectified_right, capacity));
  }

  // Copies of the latest pair as the network saw it.
  void rectified(uint8_t* left, uint8_t* right, size_t capacity) const {
    check(endo_get_rectified(get(), left, right, capacity));
  }

  // From any thread: the predict that is running throws an Error with ENDO_CANCELLED.
  void cancel() { check(endo_cancel(get())); }

  void self_test() { check(endo_self_test(get())); }

  // JSON.
  std::string diagnostics() const {
    size_t needed = 0;
    check(endo_get_diagnostics(get(), nullptr, 0, &needed));
    for (;;) {
      std::string text(needed, '\0');
      const endo_status status = endo_get_diagnostics(get(), &text[0], text.size(), &needed);
      if (needed > text.size()) continue;  // a frame has ended between the two calls, and the text has grown
      check(status);
      text.resize(needed - 1);
      return text;
    }
  }

  endo_estimator* get() const noexcept { return handle_.get(); }

 private:
  struct Close {
    void operator()(endo_estimator* handle) const noexcept { endo_close(handle); }
  };

  explicit Estimator(endo_estimator* handle) : handle_(handle) {}

  std::unique_ptr<endo_estimator, Close> handle_;
};

// Frames of one size, several in flight: one thread submits, another receives.
class Stream {
 public:
  Stream(const Estimator& estimator, int width, int height) {
    endo_stream* opened = nullptr;
    check(endo_stream_open(estimator.get(), width, height, &lanes_, &opened));
    handle_.reset(opened);
  }

  // Frames that may be submitted before one must be received.
  int lanes() const noexcept { return lanes_; }

  // Steady in time; to be chosen before the first frame.
  void set_temporal(bool on) { check(endo_stream_set_temporal(handle_.get(), on ? 1 : 0)); }

  // Corrects the rectification slowly where the rig has moved.
  void follow_rig() { check(endo_stream_follow_rig(handle_.get())); }

  // The maps must live, untouched, until they are received.
  void submit(const endo_image& left, const endo_image& right, Maps& maps) {
    check(endo_stream_submit(handle_.get(), &left, &right, &maps.tied()));
  }

  // The result of the oldest frame, that of its maps; null when the stream has ended and nothing is left. The Error of a frame
  // that failed carries its result, and the stream goes on.
  endo_result* receive() {
    endo_result* result = nullptr;
    const endo_status status = endo_stream_receive(handle_.get(), &result);
    check(status, result);
    return result;
  }

  // Whether receive() would return at once. Waits for that, but `longest_ms` at most.
  bool wait(double longest_ms) {
    int32_t ready = 0;
    check(endo_stream_wait(handle_.get(), longest_ms, &ready));
    return ready == 1;
  }

  void end() { check(endo_stream_end(handle_.get())); }

 private:
  struct Close {
    void operator()(endo_stream* handle) const noexcept { endo_stream_close(handle); }
  };

  int32_t lanes_ = 0;
  std::unique_ptr<endo_stream, Close> handle_;
};

// ---- Measuring. Pixels are x and y, one after the other. ----

// How many there are, of so many numbers each.
inline size_t whole(const std::vector<double>& numbers, size_t each) {
  if (numbers.size() % each != 0) {
    const std::string rule = each == 2 ? "pixels: must be two numbers each" : "points: must be three numbers each";
    const std::string seen = rule + "; got " + std::to_string(numbers.size()) + " numbers [INVALID_ARGUMENT]";
    throw Error(ENDO_INVALID_ARGUMENT, seen.c_str());
  }
  return numbers.size() / each;
}

inline endo_point point_at(const endo_calibration& rig, const endo_result& result, double x, double y) {
  endo_point point = {};
  point.struct_size = sizeof point;
  check(endo_point_at(&rig, &result, x, y, &point));
  return point;
}

inline endo_measured path_length(const endo_calibration& rig, const endo_result& result, const std::vector<double>& pixels) {
  endo_measured length = {};
  length.struct_size = sizeof length;
  check(endo_path_length(&rig, &result, pixels.data(), whole(pixels, 2), &length));
  return length;
}

inline endo_area area_inside(const endo_calibration& rig, const endo_result& result, const std::vector<double>& pixels) {
  endo_area area = {};
  area.struct_size = sizeof area;
  check(endo_area_inside(&rig, &result, pixels.data(), whole(pixels, 2), &area));
  return area;
}

inline endo_rectification rectification(const endo_calibration& rig, double alpha = 0.0) {
  endo_rectification found = {};
  found.struct_size = sizeof found;
  check(endo_get_rectification(&rig, alpha, &found));
  return found;
}

inline std::vector<double> raw_to_rectified(const endo_calibration& rig, bool right, std::vector<double> pixels, double alpha = 0.0) {
  check(endo_raw_to_rectified(&rig, alpha, right ? 1 : 0, pixels.data(), whole(pixels, 2), pixels.data()));
  return pixels;
}

inline std::vector<double> rectified_to_raw(const endo_calibration& rig, bool right, std::vector<double> pixels, double alpha = 0.0) {
  check(endo_rectified_to_raw(&rig, alpha, right ? 1 : 0, pixels.data(), whole(pixels, 2), pixels.data()));
  return pixels;
}

// Points, x y z each.
inline std::vector<double> to_raw_left(const endo_calibration& rig, std::vector<double> points) {
  check(endo_to_raw_left(&rig, points.data(), whole(points, 3), points.data()));
  return points;
}

}  // namespace endo

#endif
