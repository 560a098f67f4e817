// What is refused: openings, rigs and frames that cannot be right. A refused call changes nothing.
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "frame.hpp"

namespace {

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
  refused([](O& o) { o.model_sha256 = ""; }, ENDO_INVALID_ARGUMENT, "model_sha256");
  // A pin of the file that another machine of the fleet opens, whatever this one does.
  refused([](O& o) { o.float32_model_sha256 = "abc"; }, ENDO_INVALID_ARGUMENT, "float32_model_sha256: must be 64 hexadecimal");
  refused([](O& o) { o.model_sha256 = zeros.c_str(), o.float32_model = "other.onnx"; }, ENDO_INVALID_ARGUMENT,
          "float32_model_sha256: must be given where model_sha256 and float32_model are, and no public_key");
  refused([](O& o) { o.runtime_sha256 = "0x12"; }, ENDO_INVALID_ARGUMENT, "runtime_sha256: must be 64 hexadecimal");
  refused([](O& o) { o.runtime_library = ""; }, ENDO_INVALID_ARGUMENT, "runtime_library");
  // Where Python names a setting otherwise, the text says how C does.
  refused([](O& o) { o.threads = -1; }, ENDO_INVALID_ARGUMENT, "threads: must be a whole number, 1 to 256; in C also 0");
  refused([](O& o) { o.spinning = 2; }, ENDO_INVALID_ARGUMENT, "spinning");
  refused([](O& o) { o.log_level = 0; }, ENDO_INVALID_ARGUMENT, "log_level");
  refused([](O& o) { o.network_width = 64; }, ENDO_INVALID_ARGUMENT, "network_width and network_height");
  refused([](O& o) { o.min_confidence = 1.5; }, ENDO_INVALID_ARGUMENT, "min_confidence");
  refused([](O& o) { o.min_confidence = std::nan(""); }, ENDO_INVALID_ARGUMENT, "min_confidence");
  refused([](O& o) { o.min_depth_mm = -1; }, ENDO_INVALID_ARGUMENT, "min_depth_mm and max_depth_mm");
  refused([](O& o) { o.max_depth_mm = 0; }, ENDO_INVALID_ARGUMENT, "min_depth_mm and max_depth_mm");
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

bool is_mapped(const char* library) { return read_file("/proc/self/maps").find(library) != std::string::npos; }

// A host without signatures needs no libcrypto.
void libcrypto_is_opened_for_a_signature_alone(const Places& at) {
  endo_options options = default_options(at);
  endo_estimator* handle = nullptr;
  CHECK(endo_open_file(at.model.c_str(), &options, &handle) == ENDO_OK);
  endo_close(handle);
  CHECK(!is_mapped("libcrypto"));
  const std::vector<uint8_t> nonsense(64, 0xff);
  options.public_key = options.signature = nonsense.data();
  options.public_key_size = 32;
  options.signature_size = 64;
  const endo_status status = endo_open_file(at.model.c_str(), &options, &handle);
  expect(status, is_mapped("libcrypto") ? ENDO_MODEL_HASH_MISMATCH : ENDO_DEPENDENCY_MISSING, "");
  CHECK(handle == nullptr);
}

// Nobody writes to this pipe, so whoever waits for it waits forever.
void a_pipe_is_no_model_and_no_library(const Places& at) {
  const std::string pipe = "./pipe-" + std::to_string(getpid());
  CHECK(mkfifo(pipe.c_str(), 0600) == 0);
  alarm(20);
  endo_options options = default_options(at);
  endo_estimator* handle = nullptr;
  expect(endo_open_file(pipe.c_str(), &options, &handle), ENDO_MODEL_NOT_FOUND, "regular file");
  options.runtime_library = pipe.c_str();
  expect(endo_open_file(at.model.c_str(), &options, &handle), ENDO_RUNTIME_MISSING, "no regular file");
  alarm(0);
  CHECK(unlink(pipe.c_str()) == 0);
}

// Nothing of it is read, nor is there memory for it. The file has a hole in place of its bytes.
void a_file_too_large_for_a_model_is_refused(const Places& at) {
  const std::string name = "large-" + std::to_string(getpid());
  std::ofstream(name).close();
  CHECK(truncate(name.c_str(), (off_t{256} << 20) + 1) == 0);
  const endo_options options = default_options(at);
  endo_estimator* handle = nullptr;
  expect(endo_open_file(name.c_str(), &options, &handle), ENDO_MODEL_NOT_FOUND, "268435457 bytes, more than 268435456");
  CHECK(unlink(name.c_str()) == 0);
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
  refused([](Rig& r) { r.left_distortion_count = 0; }, ENDO_INVALID_CALIBRATION, "left_distortion: must be 0 past the 0 coeff");
  refused([](Rig& r) { r.right_distortion[7] = 1e-9; }, ENDO_INVALID_CALIBRATION, "right_distortion: must be 0 past the 5 coeff");
  refused([](Rig& r) { r.camera_model = ENDO_FISHEYE; }, ENDO_INVALID_CALIBRATION, "fisheye");
  refused([](Rig& r) { r.camera_model = 7; }, ENDO_INVALID_CALIBRATION, "camera_model");
  refused([](Rig& r) { r.rotation[0] = 1.1; }, ENDO_INVALID_CALIBRATION, "orthonormal");
  refused([](Rig& r) { r.rotation[0] = -1; }, ENDO_INVALID_CALIBRATION, "mirrors");
  refused([](Rig& r) { r.left_field_of_view[2] = 0.4; }, ENDO_INVALID_CALIBRATION, "left_field_of_view");
  refused([](Rig& r) { r.right_field_of_view[0] = std::nan(""); }, ENDO_INVALID_CALIBRATION, "right_field_of_view");
  for (const double metres : {1e-3, 1e3}) {
    refused([&](Rig& r) { for (double& part : r.translation) part *= metres; }, ENDO_INVALID_CALIBRATION, "must be in mm");
  }
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
    result.quality = ENDO_QUALITY_OK;
    expect(endo_predict(estimator.get(), &left, &right, &result), ENDO_INVALID_ARGUMENT, word);
    CHECK(result.struct_size == 0 || (result.quality == ENDO_QUALITY_INVALID && result.frame == 0));
  };
  refused([](endo_image& l, endo_image&, endo_result&) { l.data = nullptr; }, "left");
  refused([](endo_image& l, endo_image&, endo_result&) { l.format = 9; }, "endo_pixel_format");
  refused([](endo_image& l, endo_image&, endo_result&) { l.width = -1; }, "left");
  refused([](endo_image& l, endo_image&, endo_result&) { l.stride = 3; }, "left");
  refused([](endo_image& l, endo_image&, endo_result&) { l.stride = std::numeric_limits<int64_t>::min(); }, "2 GiB");
  refused([](endo_image& l, endo_image&, endo_result&) { l.struct_size = 3; }, "struct_size");
  refused([](endo_image& l, endo_image&, endo_result&) { l.width = l.height = 100000; }, "left");
  refused([](endo_image&, endo_image& r, endo_result&) { r.height -= 1; }, "size of left");
  refused([](endo_image&, endo_image& r, endo_result&) { r.format = ENDO_BGR8; }, "format of left");
  refused([](endo_image&, endo_image&, endo_result& o) { o.capacity = 100; }, "capacity");
  CHECK(out.confidence[50] == 0.0f && out.confidence[pixels - 1] > 0.0f);  // no further than the capacity given
  refused([](endo_image&, endo_image&, endo_result& o) { o.capacity = ~uint64_t{0}; }, "capacity");
  refused([](endo_image&, endo_image&, endo_result& o) { o.struct_size = 0; }, "struct_size");
  refused([](endo_image&, endo_image&, endo_result& o) { o.reserved = 1; }, "result.reserved");
  const auto by = [](float* map, ptrdiff_t bytes) { return reinterpret_cast<float*>(reinterpret_cast<char*>(map) + bytes); };
  // Both maps have room for what a failure writes: they lie within the disparity's memory.
  refused([&](endo_image&, endo_image&, endo_result& o) { o.confidence = by(o.disparity, 2); o.capacity = pixels; }, "aligned");
  refused([&](endo_image&, endo_image&, endo_result& o) { o.confidence = o.disparity; }, "must not lie in the memory of");
  refused([&](endo_image&, endo_image&, endo_result& o) { o.reasons = reinterpret_cast<uint8_t*>(o.disparity) + 8; },
          "must not lie in the memory of");

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

// Whatever was wrong, the depth of the frame before must not stay in maps that were in order themselves.
void maps_that_were_in_order_read_as_no_answer(const Places& at) {
  const Opened estimator(at);
  const endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  const Pair pair(width, height, 9);
  const endo_image left = pair.left_image();
  const endo_image right = pair.right_image();
  Output out(pixels, true);
  struct Later {
    endo_result known;
    uint64_t added;
  };
  const auto refused = [&](auto change, bool confidence_is_written, const char* word) {
    CHECK(estimator.predict(pair, out) == ENDO_OK);
    const std::vector<float> before = out.confidence;
    Later later = {out.result, 0};
    later.known.quality = ENDO_QUALITY_OK;
    change(later);
    expect(endo_predict(estimator.get(), &left, &right, &later.known), ENDO_INVALID_ARGUMENT, word);
    CHECK(later.known.quality == ENDO_QUALITY_INVALID && later.known.frame == 0 && later.known.valid_share == 0.0);
    CHECK(std::all_of(out.depth.begin(), out.depth.end(), [](float z) { return std::isnan(z); }));
    CHECK(std::all_of(out.reasons.begin(), out.reasons.end(), [](int r) { return r == ENDO_REASON_LOW_CONFIDENCE; }));
    CHECK(std::all_of(out.depth_u16.begin(), out.depth_u16.end(), [](int z) { return z == 0; }));
    CHECK(confidence_is_written ? out.confidence == std::vector<float>(pixels) : out.confidence == before);
  };
  refused([](Later& o) { o.known.reserved = 1; }, true, "result.reserved");
  refused([](Later& o) { o.known.reserved2 = 1; }, true, "result.reserved2");
  refused([](Later& o) { o.known.capacity = uint64_t{1} << 31; }, true, "less than 2^31");
  refused([](Later& o) { o.known.capacity = ~uint64_t{0}; }, true, "less than 2^31");
  refused([](Later& o) { o.known.struct_size = sizeof o; o.added = 1; }, true, "newer");
  std::vector<float> shared(pixels + 1);
  refused([&](Later& o) { o.known.confidence = reinterpret_cast<float*>(reinterpret_cast<char*>(shared.data()) + 2); }, false,
          "confidence: must be aligned");
  refused([&](Later& o) { o.known.confidence = o.known.sigma = shared.data(); }, false, "must not lie in the memory of");
  CHECK(shared == std::vector<float>(pixels + 1));
}

// What a failure writes would lie in the picture, too.
void maps_over_a_picture_are_refused_and_not_written_to(const Places& at) {
  const Opened estimator(at);
  const Pair pair(width, height, 9);
  std::vector<float> shared(pixels);  // has room for a picture
  auto* const bytes = reinterpret_cast<uint8_t*>(shared.data());
  std::copy(pair.left.begin(), pair.left.end(), bytes);
  Output out(pixels);
  out.result.confidence = shared.data();
  const auto refused = [&](const endo_image& left, const endo_image& right, const char* word) {
    out.result.quality = 77;
    expect(endo_predict(estimator.get(), &left, &right, &out.result), ENDO_INVALID_ARGUMENT, word);
    CHECK(out.result.quality == ENDO_QUALITY_INVALID && std::equal(pair.left.begin(), pair.left.end(), bytes));
  };
  endo_image over = pair.left_image();
  over.data = bytes;
  refused(over, pair.right_image(), "confidence: must not lie in the memory of left");
  refused(pair.left_image(), over, "confidence: must not lie in the memory of right");
  over.data = bytes + (height - 1) * width * 3;  // from the bottom up
  over.stride = -width * 3;
  refused(over, pair.right_image(), "got 46080 bytes that both have");
  over.data = bytes;
  over.stride = 0;
  out.result.confidence = nullptr;
  CHECK(endo_predict(estimator.get(), &over, &over, &out.result) == ENDO_OK);  // one picture for both views is allowed
}

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  libcrypto_is_opened_for_a_signature_alone(at);
  bad_openings_are_refused(at);
  a_pipe_is_no_model_and_no_library(at);
  a_file_too_large_for_a_model_is_refused(at);
  structs_may_be_longer_than_this_library_knows(at);
  bad_calibrations_are_refused_and_change_nothing(at);
  bad_frames_are_refused_and_read_as_no_answer(at);
  maps_that_were_in_order_read_as_no_answer(at);
  maps_over_a_picture_are_refused_and_not_written_to(at);
}
