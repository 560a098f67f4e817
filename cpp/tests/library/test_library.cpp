// The library as its callers see it, through the C interface alone.
#include <endosdk/endosdk.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <thread>

#include "support.hpp"

namespace {

constexpr int width = 160;
constexpr int height = 96;
constexpr size_t pixels = size_t{width} * height;

void expect(endo_status seen, endo_status wanted, const char* word) {
  if (seen != wanted || std::strstr(endo_last_error(), word) == nullptr) {
    std::fprintf(stderr, "wanted %s and \"%s\", got %s: %s\n", endo_status_name(wanted), word, endo_status_name(seen),
                 endo_last_error());
    std::exit(1);
  }
}

float middle(const std::vector<float>& map) { return map[pixels / 2 + width / 2]; }

void finds_the_disparity_of_a_plane(const Places& at) {
  const Opened estimator(at);
  Output out(pixels);
  CHECK(endo_prepare(estimator.get(), width, height) == ENDO_OK);
  CHECK(estimator.predict(Pair(width, height, 9), out) == ENDO_OK);
  CHECK(std::fabs(middle(out.disparity) - 9.0f) < 0.5f);
  CHECK(out.result.frame == 1 && out.result.quality == ENDO_QUALITY_OK && out.result.valid_share > 0.5);
  CHECK(out.result.session_ms > 0.0 && out.result.late == 0);
  for (size_t i = 0; i < pixels; ++i) {
    const long wanted = out.reasons[i] != 0 ? 0 : std::lround(256.0 * static_cast<double>(out.disparity[i]));
    CHECK(std::labs(out.disparity_u16[i] - wanted) <= 1);
  }
}

void a_rig_gives_depth(const Places& at) {
  const Opened estimator(at);
  Output out(pixels, true);
  const Pair pair(width, height, 9);
  expect(estimator.predict(pair, out), ENDO_CALIBRATION_REQUIRED, "endo_set_calibration");
  endo_geometry geometry{};
  geometry.struct_size = sizeof geometry;
  expect(endo_get_geometry(estimator.get(), &geometry), ENDO_CALIBRATION_REQUIRED, "calibration");

  const endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  CHECK(endo_get_geometry(estimator.get(), &geometry) == ENDO_OK);
  CHECK(geometry.rectifies == 1 && geometry.focal_px > 0.0 && std::fabs(geometry.baseline_mm - 4.6) < 0.01);
  CHECK(estimator.predict(pair, out) == ENDO_OK);
  for (size_t i = 0; i < pixels; ++i) {
    CHECK(std::isnan(out.depth[i]) == (out.reasons[i] != 0) && std::isnan(out.sigma[i]) == (out.reasons[i] != 0));
    if (out.reasons[i] != 0) continue;
    const double depth = geometry.focal_px * geometry.baseline_mm / (static_cast<double>(out.disparity[i]) + geometry.doffs);
    CHECK(std::fabs(static_cast<double>(out.depth[i]) - depth) <= 1e-5 * depth);
    CHECK(std::fabs(std::min(depth, 6553.5) - 0.1 * out.depth_u16[i]) <= 0.06);
  }
  expect(estimator.predict(Pair(width, height + 8, 9), out), ENDO_INVALID_ARGUMENT, "capacity");
  Output larger(pixels + 8 * width, true);
  expect(estimator.predict(Pair(width, height + 8, 9), larger), ENDO_CALIBRATION_SIZE_MISMATCH, "160x104");
  CHECK(endo_set_calibration(estimator.get(), nullptr) == ENDO_OK);
  expect(estimator.predict(pair, out), ENDO_CALIBRATION_REQUIRED, "depth");
}

void bad_calibrations_are_refused_and_change_nothing(const Places& at) {
  const Opened estimator(at);
  const endo_calibration good = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &good) == ENDO_OK);
  const auto refused = [&](auto change, endo_status status, const char* word) {
    endo_calibration bad = good;
    change(bad);
    expect(endo_set_calibration(estimator.get(), &bad), status, word);
  };
  using Rig = endo_calibration;
  refused([](Rig& r) { r.translation[0] = 4.6; }, ENDO_INVALID_CALIBRATION, "negative x");
  refused([](Rig& r) { r.translation[0] = 0; r.translation[1] = 0; }, ENDO_INVALID_CALIBRATION, "zero");
  refused([](Rig& r) { r.translation[1] = 9; }, ENDO_INVALID_CALIBRATION, "vertical");
  refused([](Rig& r) { r.translation[2] = 9; }, ENDO_INVALID_CALIBRATION, "in front");
  refused([](Rig& r) { r.left_matrix[0] = 0; }, ENDO_INVALID_CALIBRATION, "left_matrix");
  refused([](Rig& r) { r.right_matrix[1] = 1; }, ENDO_INVALID_CALIBRATION, "skew");
  refused([](Rig& r) { r.left_distortion[2] = std::nan(""); }, ENDO_INVALID_CALIBRATION, "left_distortion");
  refused([](Rig& r) { r.right_distortion_count = 9; }, ENDO_INVALID_CALIBRATION, "coefficients");
  refused([](Rig& r) { r.camera_model = ENDO_FISHEYE; }, ENDO_INVALID_CALIBRATION, "fisheye");
  refused([](Rig& r) { r.camera_model = 7; }, ENDO_INVALID_CALIBRATION, "camera_model");
  refused([](Rig& r) { r.rotation[0] = 1.1; }, ENDO_INVALID_CALIBRATION, "orthonormal");
  refused([](Rig& r) { r.rotation[0] = -1; }, ENDO_INVALID_CALIBRATION, "mirrors");
  refused([](Rig& r) { r.width = 0; }, ENDO_INVALID_ARGUMENT, "size");
  refused([](Rig& r) { r.struct_size = 8; }, ENDO_INVALID_ARGUMENT, "struct_size");
  Output out(pixels, true);
  CHECK(estimator.predict(Pair(width, height, 9), out) == ENDO_OK);
}

void bad_frames_are_refused_and_read_as_no_answer(const Places& at) {
  const Opened estimator(at);
  const Pair pair(width, height, 9);
  Output out(pixels);
  const auto refused = [&](auto change, const char* word) {
    endo_image left = pair.left_image();
    endo_image right = pair.right_image();
    endo_result result = out.result;
    change(left, right, result);
    CHECK(estimator.predict(pair, out) == ENDO_OK);  // something to be stale
    expect(endo_predict(estimator.get(), &left, &right, &result), ENDO_INVALID_ARGUMENT, word);
  };
  refused([](endo_image& l, endo_image&, endo_result&) { l.data = nullptr; }, "left");
  refused([](endo_image& l, endo_image&, endo_result&) { l.format = 9; }, "endo_pixel_format");
  refused([](endo_image& l, endo_image&, endo_result&) { l.width = -1; }, "left");
  refused([](endo_image& l, endo_image&, endo_result&) { l.stride = 3; }, "left");
  refused([](endo_image& l, endo_image&, endo_result&) { l.stride = std::numeric_limits<int64_t>::min(); }, "2 GiB");
  refused([](endo_image& l, endo_image&, endo_result&) { l.struct_size = 3; }, "struct_size");
  refused([](endo_image& l, endo_image&, endo_result&) { l.width = l.height = 100000; }, "right");
  refused([](endo_image&, endo_image& r, endo_result&) { r.height -= 1; }, "size of left");
  refused([](endo_image&, endo_image& r, endo_result&) { r.format = ENDO_BGR8; }, "format of left");
  refused([](endo_image&, endo_image&, endo_result& o) { o.capacity = 100; }, "capacity");
  CHECK(out.confidence[50] == 0.0f && out.confidence[pixels - 1] > 0.0f);  // no further than the capacity given
  refused([](endo_image&, endo_image&, endo_result& o) { o.capacity = ~uint64_t{0}; }, "capacity");
  refused([](endo_image&, endo_image&, endo_result& o) { o.struct_size = 0; }, "struct_size");

  const endo_image left = pair.left_image();
  CHECK(estimator.predict(pair, out) == ENDO_OK);
  expect(endo_predict(estimator.get(), &left, nullptr, &out.result), ENDO_INVALID_ARGUMENT, "right");
  CHECK(out.result.quality == ENDO_QUALITY_INVALID && out.result.frame == 0 && out.result.valid_share == 0.0);
  CHECK(std::all_of(out.disparity.begin(), out.disparity.end(), [](float d) { return std::isnan(d); }));
  CHECK(std::all_of(out.confidence.begin(), out.confidence.end(), [](float c) { return c == 0.0f; }));
  CHECK(std::all_of(out.reasons.begin(), out.reasons.end(), [](int r) { return r == ENDO_REASON_LOW_CONFIDENCE; }));
  CHECK(std::all_of(out.disparity_u16.begin(), out.disparity_u16.end(), [](int d) { return d == 0; }));
  expect(endo_predict(estimator.get(), &left, &left, nullptr), ENDO_INVALID_ARGUMENT, "result");
  expect(endo_predict(nullptr, &left, &left, &out.result), ENDO_INVALID_ARGUMENT, "estimator");
  expect(endo_prepare(estimator.get(), 0, 5), ENDO_INVALID_ARGUMENT, "size");
  expect(endo_prepare(estimator.get(), 100000, 100000), ENDO_INVALID_ARGUMENT, "size");
  CHECK(estimator.predict(pair, out) == ENDO_OK && std::fabs(middle(out.disparity) - 9.0f) < 0.5f);
}

void every_layout_of_a_frame_gives_the_same(const Places& at) {
  const Opened estimator(at);
  const Pair pair(width, height, 9);
  Output plain(pixels);
  CHECK(estimator.predict(pair, plain) == ENDO_OK);
  constexpr int pitch = 3 * width + 17;
  std::vector<uint8_t> left(size_t{pitch} * height);
  std::vector<uint8_t> right(left.size());
  for (int y = 0; y < height; ++y) {  // bottom-up, padded rows, blue first
    for (int x = 0; x < 3 * width; ++x) {
      const size_t from = static_cast<size_t>(3 * width * y + x / 3 * 3 + 2 - x % 3);
      const size_t to = static_cast<size_t>(pitch * (height - 1 - y) + x);
      left[to] = pair.left[from];
      right[to] = pair.right[from];
    }
  }
  const size_t top = size_t{pitch} * (height - 1);
  const endo_image l = {sizeof l, ENDO_BGR8, left.data() + top, width, height, -pitch};
  const endo_image r = {sizeof r, ENDO_BGR8, right.data() + top, width, height, -pitch};
  Output turned(pixels);
  CHECK(endo_predict(estimator.get(), &l, &r, &turned.result) == ENDO_OK);
  CHECK(turned.disparity == plain.disparity && turned.confidence == plain.confidence && turned.reasons == plain.reasons);

  const endo_image gray = {sizeof gray, ENDO_GRAY8, pair.left.data(), width, height, 0};
  CHECK(endo_predict(estimator.get(), &gray, &gray, &turned.result) == ENDO_OK);
  CHECK(std::fabs(middle(turned.disparity)) < 0.5f);
}

void the_rectified_pair_can_be_seen(const Places& at) {
  const Opened estimator(at);
  const Pair pair(width, height, 9);
  std::vector<uint8_t> left(3 * pixels);
  expect(endo_get_rectified(estimator.get(), left.data(), nullptr, left.size()), ENDO_INVALID_ARGUMENT, "endo_predict");
  Output out(pixels);
  CHECK(estimator.predict(pair, out) == ENDO_OK);
  expect(endo_get_rectified(estimator.get(), left.data(), nullptr, 5), ENDO_INVALID_ARGUMENT, "capacity");
  CHECK(endo_get_rectified(estimator.get(), left.data(), nullptr, left.size()) == ENDO_OK);
  CHECK(left == pair.left);
}

// What opening can go wrong with, and that nothing is left behind.
void bad_openings_are_refused(const Places& at) {
  const auto refused = [&](auto change, endo_status status, const char* word) {
    endo_options options = default_options(at);
    change(options);
    endo_estimator* handle = reinterpret_cast<endo_estimator*>(&options);
    expect(endo_open_file(at.model.c_str(), &options, &handle), status, word);
    CHECK(handle == nullptr);
  };
  using O = endo_options;
  refused([](O& o) { o.runtime_library = "/no/such/libonnxruntime.so"; }, ENDO_RUNTIME_MISSING, "/no/such/");
  refused([](O& o) { o.runtime_library = "libm.so.6"; }, ENDO_RUNTIME_MISSING, "another library");
  refused([](O& o) { o.provider = "cuda"; }, ENDO_PROVIDER_UNAVAILABLE, "cuda");
  refused([](O& o) { o.provider = ""; }, ENDO_PROVIDER_UNAVAILABLE, "provider");
  static const std::string zeros(64, '0');
  refused([](O& o) { o.model_sha256 = "abc"; }, ENDO_INVALID_ARGUMENT, "hexadecimal");
  refused([](O& o) { o.model_sha256 = zeros.c_str(); }, ENDO_MODEL_HASH_MISMATCH, "SHA-256");
  refused([](O& o) { o.threads = -1; }, ENDO_INVALID_ARGUMENT, "threads");
  refused([](O& o) { o.spinning = 2; }, ENDO_INVALID_ARGUMENT, "spinning");
  refused([](O& o) { o.log_level = 0; }, ENDO_INVALID_ARGUMENT, "log_level");
  refused([](O& o) { o.network_width = 64; }, ENDO_INVALID_ARGUMENT, "network_width");
  refused([](O& o) { o.min_confidence = 1.5; }, ENDO_INVALID_ARGUMENT, "min_confidence");
  refused([](O& o) { o.min_confidence = std::nan(""); }, ENDO_INVALID_ARGUMENT, "min_confidence");
  refused([](O& o) { o.min_depth_mm = -1; }, ENDO_INVALID_ARGUMENT, "min_depth_mm");
  refused([](O& o) { o.max_depth_mm = 0; }, ENDO_INVALID_ARGUMENT, "max_depth_mm");
  refused([](O& o) { o.depth_unit_mm = 0; }, ENDO_INVALID_ARGUMENT, "depth_unit_mm");
  refused([](O& o) { o.deadline_ms = -1; }, ENDO_INVALID_ARGUMENT, "deadline_ms");
  refused([](O& o) { o.struct_size = 5; }, ENDO_INVALID_ARGUMENT, "struct_size");
  refused([](O& o) { o.struct_size = ~0u; }, ENDO_INVALID_ARGUMENT, "struct_size");

  const endo_options options = default_options(at);
  endo_estimator* handle = nullptr;
  expect(endo_open_file("/no/such/model.onnx", &options, &handle), ENDO_MODEL_NOT_FOUND, "/no/such/model.onnx");
  expect(endo_open_file("/", &options, &handle), ENDO_MODEL_NOT_FOUND, "path");
  expect(endo_open_file(nullptr, &options, &handle), ENDO_INVALID_ARGUMENT, "path");
  expect(endo_open_memory(nullptr, 5, &options, &handle), ENDO_INVALID_ARGUMENT, "data");
  expect(endo_open_memory("onnx", 4, &options, &handle), ENDO_MODEL_UNREADABLE, "model");
  expect(endo_open_file(at.model.c_str(), &options, nullptr), ENDO_INVALID_ARGUMENT, "estimator");
  endo_close(nullptr);
}

// A caller compiled against a later header whose structs have grown.
void structs_may_be_longer_than_this_library_knows(const Places& at) {
  struct Later {
    endo_options known;
    uint64_t added;
  } later{default_options(at), 0};
  later.known.struct_size = sizeof later;
  endo_estimator* handle = nullptr;
  CHECK(endo_open_file(at.model.c_str(), &later.known, &handle) == ENDO_OK);
  endo_close(handle);
  later.added = 1;
  expect(endo_open_file(at.model.c_str(), &later.known, &handle), ENDO_INVALID_ARGUMENT, "newer");
  CHECK(endo_options_init(&later.known, sizeof later) == ENDO_OK);
  CHECK(later.known.struct_size == sizeof later && later.added == 0);
}

// Replaces one piece of text in the model's bytes by another of the same length.
std::string patched(const Places& at, const std::string& from, const std::string& to) {
  std::string bytes = read_file(at.model);
  const size_t place = bytes.find(from);
  CHECK(place != std::string::npos && from.size() == to.size());
  return bytes.replace(place, from.size(), to);
}

void models_must_say_what_they_are(const Places& at) {
  const endo_options options = default_options(at);
  endo_estimator* handle = nullptr;
  for (const char* key : {"format_version", "name", "version", "input_multiple", "output_stride", "max_disparity",
                          "channel_order", "license", "training", "intended_use"}) {
    const std::string whole = "endosdk." + std::string(key);
    std::string other = whole;
    other.back() = '#';
    const std::string marker = {'\x0a', static_cast<char>(whole.size())};  // protobuf: field 1, this long
    const std::string model = patched(at, marker + whole, marker + other);
    expect(endo_open_memory(model.data(), model.size(), &options, &handle), ENDO_MODEL_METADATA, whole.c_str());
  }
  const std::string zero = patched(at, "endosdk.output_stride\x12\x01" "4", "endosdk.output_stride\x12\x01" "0");
  expect(endo_open_memory(zero.data(), zero.size(), &options, &handle), ENDO_MODEL_METADATA, "positive");
}

void a_model_that_lies_about_its_stride_fails_cleanly(const Places& at) {
  const std::string model = patched(at, "endosdk.output_stride\x12\x01" "4", "endosdk.output_stride\x12\x01" "2");
  const endo_options options = default_options(at);
  endo_estimator* handle = nullptr;
  CHECK(endo_open_memory(model.data(), model.size(), &options, &handle) == ENDO_OK);
  const Pair pair(width, height, 9);
  const endo_image left = pair.left_image();
  Output out(pixels);
  expect(endo_predict(handle, &left, &left, &out.result), ENDO_INFERENCE_FAILED, "session");
  CHECK(out.result.quality == ENDO_QUALITY_INVALID && std::isnan(out.disparity[7]));
  expect(endo_self_test(handle), ENDO_INFERENCE_FAILED, "session");
  endo_close(handle);
}

void self_test_passes_and_leaves_no_trace(const Places& at) {
  const Opened estimator(at);
  CHECK(endo_self_test(estimator.get()) == ENDO_OK);
  const Pair pair(width, height, 9);
  Output before(pixels);
  Output after(pixels);
  CHECK(estimator.predict(pair, before) == ENDO_OK);
  CHECK(endo_self_test(estimator.get()) == ENDO_OK);
  CHECK(estimator.predict(pair, after) == ENDO_OK);
  CHECK(before.disparity == after.disparity && after.result.frame == 2);
}

void late_frames_are_marked_and_logged(const Places& at) {
  struct Lines {
    std::vector<std::string> seen;
    static void add(void* self, int32_t, const char* line) { static_cast<Lines*>(self)->seen.emplace_back(line); }
  } lines;
  endo_options options = default_options(at);
  options.deadline_ms = 1e-6;
  options.log = Lines::add;
  options.log_context = &lines;
  const Opened estimator(at, options);
  Output out(pixels);
  CHECK(estimator.predict(Pair(width, height, 9), out) == ENDO_OK && out.result.late == 1);
  CHECK(lines.seen.size() == 1 && lines.seen[0].find("late") != std::string::npos);
}

void an_exception_of_the_host_does_not_cross(const Places& at) {
  endo_options options = default_options(at);
  options.log = [](void*, int32_t, const char*) { throw 5; };
  options.log_level = ENDO_LOG_INFO;
  endo_estimator* handle = nullptr;
  expect(endo_open_file(at.model.c_str(), &options, &handle), ENDO_INTERNAL, "unknown");
}

void diagnostics_fit_or_say_so(const Places& at) {
  const Opened estimator(at);
  size_t needed = 0;
  CHECK(endo_get_diagnostics(estimator.get(), nullptr, 0, &needed) == ENDO_OK && needed > 100);
  std::vector<char> text(needed);
  expect(endo_get_diagnostics(estimator.get(), text.data(), 10, nullptr), ENDO_INVALID_ARGUMENT, "size");
  CHECK(text[0] == '\0');
  CHECK(endo_get_diagnostics(estimator.get(), text.data(), text.size(), nullptr) == ENDO_OK);
  CHECK(std::strlen(text.data()) + 1 == needed && std::strstr(text.data(), "\"onnxruntime_telemetry\":\"off\"") != nullptr);
  CHECK(std::string(endo_status_name(99)) == "UNKNOWN");
}

void a_running_frame_can_be_cancelled(const Places& at) {
  const Opened estimator(at);
  constexpr int w = 1280;
  constexpr int h = 960;
  const Pair pair(w, h, 9);
  Output out(size_t{w} * h);
  std::atomic<bool> finished{false};
  CHECK(endo_cancel(estimator.get()) == ENDO_OK);  // nothing runs: nothing happens
  std::thread canceller([&] {
    while (!finished) {
      endo_cancel(estimator.get());
      std::this_thread::yield();
    }
  });
  const endo_status status = estimator.predict(pair, out);
  finished = true;
  canceller.join();
  expect(status, ENDO_CANCELLED, "endo_cancel");
  CHECK(out.result.quality == ENDO_QUALITY_INVALID && std::isnan(out.disparity[5]));
  CHECK(estimator.predict(pair, out) == ENDO_OK);
}

// Frames of several threads, on an estimator each or on a shared one, must not differ from those of one thread.
void threads_do_not_disturb_each_other(const Places& at, bool shared) {
  constexpr int frames = 30;
  endo_options options = default_options(at);
  options.threads = 2;
  const Opened first(at, options);
  const Opened second(at, options);
  const endo_calibration rig = raw_rig(width, height);
  for (const Opened* one : {&first, &second}) CHECK(endo_set_calibration(one->get(), &rig) == ENDO_OK);
  const Pair pairs[2] = {{width, height, 5}, {width, height, 9}};
  Output wanted[2] = {Output(pixels, true), Output(pixels, true)};
  for (int i = 0; i < 2; ++i) CHECK(first.predict(pairs[i], wanted[i]) == ENDO_OK);
  std::vector<std::thread> threads;
  for (int i = 0; i < 2; ++i) {
    threads.emplace_back([&, i] {
      const Opened& estimator = shared || i == 0 ? first : second;
      Output out(pixels, true);
      for (int frame = 0; frame < frames; ++frame) {
        CHECK(estimator.predict(pairs[i], out) == ENDO_OK);
        CHECK(out.disparity == wanted[i].disparity && out.reasons == wanted[i].reasons);
        CHECK(std::memcmp(out.depth.data(), wanted[i].depth.data(), pixels * sizeof(float)) == 0);
        if (frame == frames / 2) CHECK(endo_self_test(estimator.get()) == ENDO_OK);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
}

void the_wrapper_throws_and_frees(const Places& at) {
  endo::Options options;
  options.runtime_library = at.runtime.c_str();
  endo::Estimator opened = endo::Estimator::open(at.model, options);
  endo::Estimator estimator = std::move(opened);
  estimator.set_calibration(raw_rig(width, height));
  CHECK(estimator.geometry().baseline_mm > 4.0);
  estimator.prepare(width, height);
  const Pair pair(width, height, 9);
  endo::Maps maps(width, height, endo::Maps::metric);
  estimator.predict(endo::image(pair.left.data(), width, height), endo::image(pair.right.data(), width, height), maps);
  CHECK(maps.result.frame == 1 && maps.depth.size() == pixels);
  estimator.remove_calibration();
  endo_status status = ENDO_OK;
  try {
    estimator.predict(endo::image(pair.left.data(), width, height), endo::image(pair.right.data(), width, height), maps);
  } catch (const endo::Error& error) {
    status = error.status();
    CHECK(std::strstr(error.what(), "CALIBRATION_REQUIRED") != nullptr);
  }
  CHECK(status == ENDO_CALIBRATION_REQUIRED);
  estimator.self_test();
  estimator.cancel();
  CHECK(estimator.diagnostics().front() == '{' && estimator.diagnostics().back() == '}');
}

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  finds_the_disparity_of_a_plane(at);
  a_rig_gives_depth(at);
  bad_calibrations_are_refused_and_change_nothing(at);
  bad_frames_are_refused_and_read_as_no_answer(at);
  every_layout_of_a_frame_gives_the_same(at);
  the_rectified_pair_can_be_seen(at);
  bad_openings_are_refused(at);
  structs_may_be_longer_than_this_library_knows(at);
  models_must_say_what_they_are(at);
  a_model_that_lies_about_its_stride_fails_cleanly(at);
  self_test_passes_and_leaves_no_trace(at);
  late_frames_are_marked_and_logged(at);
  an_exception_of_the_host_does_not_cross(at);
  diagnostics_fit_or_say_so(at);
  a_running_frame_can_be_cancelled(at);
  threads_do_not_disturb_each_other(at, false);
  threads_do_not_disturb_each_other(at, true);
  the_wrapper_throws_and_frees(at);
}
