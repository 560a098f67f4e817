// Models: what they must say of themselves, and the self test that runs one.
#include <cmath>

#include "frame.hpp"

namespace {

void replace(std::string& bytes, const std::string& from, const std::string& to) {
  const size_t place = bytes.find(from);
  CHECK(place != std::string::npos && from.size() == to.size());
  bytes.replace(place, from.size(), to);
}

// Replaces one piece of text in the model's bytes by another of the same length, and breaks the seal, which would tell
// of it first.
std::string patched(const Places& at, const std::string& from, const std::string& to) {
  std::string bytes = read_file(at.model);
  replace(bytes, from, to);
  replace(bytes, "endosdk.content_sha256", "endosdk.content_sha25#");
  return bytes;
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

// What a model says of itself cannot write a line of its own into a device's log.
void a_model_cannot_break_a_line_of_the_log(const Places& at) {
  const std::string bytes = read_file(at.model);
  const std::string key = "endosdk.version\x12";
  const size_t place = bytes.find(key) + key.size();
  const auto length = static_cast<size_t>(bytes[place]);
  const std::string model = patched(at, bytes.substr(place - key.size(), key.size() + 1 + length),
                                    key + bytes[place] + std::string(length, '\n'));
  std::vector<std::string> lines;
  endo_options options = default_options(at);
  options.log_level = ENDO_LOG_INFO;
  options.log = [](void* context, int32_t, const char* line) { static_cast<std::vector<std::string>*>(context)->emplace_back(line); };
  options.log_context = &lines;
  endo_estimator* handle = nullptr;
  CHECK(endo_open_memory(model.data(), model.size(), &options, &handle) == ENDO_OK);
  CHECK(!lines.empty());
  for (const std::string& line : lines) CHECK(line.find('\n') == std::string::npos);
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

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  models_must_say_what_they_are(at);
  a_model_that_lies_about_its_stride_fails_cleanly(at);
  a_model_cannot_break_a_line_of_the_log(at);
  self_test_passes_and_leaves_no_trace(at);
}
