// A device at work: late frames, logs, diagnostics, cancelling, several threads, and the C++ wrapper.
#include <endosdk/endosdk.hpp>

#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>

#include "frame.hpp"

namespace {

struct Lines {
  std::vector<std::string> seen;
  static void add(void* self, int32_t, const char* line) { static_cast<Lines*>(self)->seen.emplace_back(line); }
};

void late_frames_are_marked_and_logged(const Places& at) {
  Lines lines;
  endo_options options = default_options(at);
  options.deadline_ms = 1e-6;
  options.log = Lines::add;
  options.log_context = &lines;
  const Opened estimator(at, options);
  Output out(pixels);
  CHECK(estimator.predict(Pair(width, height, 9), out) == ENDO_OK && out.result.late == 1);
  CHECK(lines.seen.size() == 1 && lines.seen[0].find("late") != std::string::npos);
}

// Two pictures that share no pixel value leave the same lines, but for times and measures.
void logs_hold_nothing_of_the_pictures(const Places& at) {
  std::vector<std::string> found[2];
  for (int i = 0; i < 2; ++i) {
    Lines lines;
    endo_options options = default_options(at);
    options.deadline_ms = 1e-6;
    options.log = Lines::add;
    options.log_context = &lines;
    options.log_level = ENDO_LOG_INFO;
    const Opened estimator(at, options);
    Pair pair(width, height, 9);
    for (uint8_t& value : pair.left) value = static_cast<uint8_t>(i == 0 ? value / 2 : 255 - value / 2);
    pair.right = pair.left;  // one camera twice: a finding about the pictures, which is logged too
    Output out(pixels);
    CHECK(estimator.predict(pair, out) == ENDO_OK);
    CHECK(lines.seen.size() >= 3);
    for (const std::string& line : lines.seen) {
      CHECK(line.size() < pixels / 4);  // the longest has the options of the runtime
      std::string& words = found[i].emplace_back();
      for (const char one : line) {
        if (one < '0' || one > '9') words += one;
      }
    }
  }
  CHECK(found[0] == found[1]);
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

// Whoever reads the log or a report of a device must see what computed, and with which settings.
void log_and_diagnostics_say_what_computes(const Places& at) {
  Lines lines;
  endo_options options = default_options(at);
  options.log = Lines::add;
  options.log_context = &lines;
  options.log_level = ENDO_LOG_INFO;
  options.min_confidence = 0.5;
  options.max_depth_mm = 90.0;
  options.spinning = 1;
  const Opened estimator(at, options);
  CHECK(lines.seen.size() <= 4);  // ours, and not those of the runtime
  const std::string opened = lines.seen.back();
  for (const char* word : {"endosdk ", "model tiny-for-tests ", "calibration (none)", "ONNX Runtime ", "CPUExecutionProvider"}) {
    CHECK(opened.find(word) != std::string::npos);
  }
  const endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  CHECK(lines.seen.back().find("calibration (sha256 ") != std::string::npos);
  std::vector<char> text(8192);
  CHECK(endo_get_diagnostics(estimator.get(), text.data(), text.size(), nullptr) == ENDO_OK);
  for (const char* field : {"\"min_confidence\":0.5,", "\"min_depth_mm\":0.0,", "\"max_depth_mm\":90.0,", "\"depth_unit_mm\":0.1,",
                            "\"spinning\":true,", "\"model_pinned\":false,", "\"runtime_pinned\":false,", "\"log_level\":3,"}) {
    CHECK(std::strstr(text.data(), field) != nullptr);
  }
}

void a_running_frame_can_be_cancelled(const Places& at) {
  const Opened estimator(at);
  constexpr int w = 1280;
  constexpr int h = 960;
  const Pair pair(w, h, 9);
  Output out(size_t{w} * h);
  std::atomic<bool> finished{false};
  CHECK(endo_cancel(estimator.get()) == ENDO_OK);  // nothing runs: nothing happens
  const Pair small(width, height, 9);
  CHECK(estimator.predict(small, out) == ENDO_OK);
  std::thread canceller([&] {
    while (!finished) {
      endo_cancel(estimator.get());
      std::this_thread::yield();
    }
  });
  const endo_status status = estimator.predict(pair, out);
  finished = true;
  canceller.join();
  expect(status, ENDO_CANCELLED, "cancel");
  CHECK(out.result.quality == ENDO_QUALITY_INVALID && std::isnan(out.disparity[5]));
  // The estimator is as it was: prepared for the frame before, whose pair can still be copied.
  std::vector<uint8_t> left(3 * pixels);
  CHECK(endo_get_rectified(estimator.get(), left.data(), nullptr, left.size()) == ENDO_OK && left == small.left);
  std::vector<char> report(8192);
  CHECK(endo_get_diagnostics(estimator.get(), report.data(), report.size(), nullptr) == ENDO_OK);
  CHECK(std::strstr(report.data(), "\"network_width\":160,") != nullptr);
  CHECK(estimator.predict(pair, out) == ENDO_OK);
}

// A watchdog stops all that is on its way. The second call waits for the first one; a busy machine may let it come too late.
void a_call_that_waits_is_cancelled_too(const Places& at) {
  const Opened estimator(at);
  constexpr int w = 1280;
  constexpr int h = 960;
  const Pair pair(w, h, 9);
  Output first(size_t{w} * h);
  Output second(size_t{w} * h);
  CHECK(estimator.predict(pair, first) == ENDO_OK);
  bool both = false;
  for (int tries = 0; tries < 100 && !both; ++tries) {
    endo_status status[2] = {ENDO_OK, ENDO_OK};
    std::thread running([&] { status[0] = estimator.predict(pair, first); });
    std::thread waiting([&] { status[1] = estimator.predict(pair, second); });
    std::this_thread::sleep_for(std::chrono::milliseconds(2 + tries));
    CHECK(endo_cancel(estimator.get()) == ENDO_OK);
    running.join();
    waiting.join();
    both = status[0] == ENDO_CANCELLED && status[1] == ENDO_CANCELLED;
  }
  CHECK(both);
  CHECK(estimator.predict(pair, second) == ENDO_OK);
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

void the_wrapper_tells_which_frame_of_a_stream_failed(const Places& at) {
  endo::Options options;
  options.runtime_library = at.runtime.c_str();
  const endo::Estimator estimator = endo::Estimator::open(at.model, options);
  const Pair pair(width, height, 9);
  endo::Maps maps(width, height);
  endo::Stream stream(estimator, width, height);
  std::atomic<bool> finished{false};
  std::thread canceller([&] {
    while (!finished) CHECK(endo_cancel(estimator.get()) == ENDO_OK);
  });
  const endo_result* failed = nullptr;
  for (int i = 0; i < 2000 && failed == nullptr; ++i) {
    stream.submit(endo::image(pair.left.data(), width, height), endo::image(pair.right.data(), width, height), maps);
    try {
      CHECK(stream.receive() == &maps.result);
    } catch (const endo::Error& error) {
      CHECK(error.status() == ENDO_CANCELLED);
      failed = error.result();
    }
  }
  finished = true;
  canceller.join();
  CHECK(failed == &maps.result);
}

void the_wrapper_throws_and_frees(const Places& at) {
  endo::Options options;
  options.runtime_library = at.runtime.c_str();
  endo::Estimator opened = endo::Estimator::open(at.model, options);
  endo::Estimator estimator = std::move(opened);
  endo_calibration rig = raw_rig(width, height);
  remove_distortion(rig);
  rig.translation[1] = 0.0;  // now the pair may be one of this rig
  estimator.set_calibration(rig);
  CHECK(estimator.geometry().baseline_mm > 4.0);
  estimator.prepare(width, height);
  const Pair pair(width, height, 9);
  endo::Maps maps(width, height, endo::Maps::metric);
  estimator.predict(endo::image(pair.left.data(), width, height), endo::image(pair.right.data(), width, height), maps);
  CHECK(maps.result.frame == 1 && maps.depth.size() == pixels);
  endo::Stream stream(estimator, width, height);
  stream.submit(endo::image(pair.left.data(), width, height), endo::image(pair.right.data(), width, height), maps);
  stream.end();
  CHECK(stream.lanes() >= 1 && stream.wait(1000.0) && stream.receive() == &maps.result && maps.result.frame == 2 && stream.receive() == nullptr);
  const endo_point point = endo::point_at(rig, maps.result, 80, 48);
  CHECK(std::fabs(point.xyz[2] - static_cast<double>(maps.depth[48 * width + 80])) < 0.1);
  CHECK(endo::path_length(rig, maps.result, {70, 40, 90, 40}).value > 0.0);
  CHECK(endo::area_inside(rig, maps.result, {70, 40, 90, 40, 90, 56}).flat > 0.0);
  CHECK(endo::rectification(rig).q[14] > 0.0);
  const auto message = [](const auto& call) {
    try {
      call();
    } catch (const endo::Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  CHECK(message([&] { endo::path_length(rig, maps.result, {}); }).find("pixels: must be two or more, and at most 10000; got 0") == 0);
  CHECK(message([&] { endo::path_length(rig, maps.result, {1, 2, 3}); }) == "pixels: must be two numbers each; got 3 numbers [INVALID_ARGUMENT]");
  CHECK(endo::raw_to_rectified(rig, true, {}).empty() && endo::to_raw_left(rig, {}).empty());
  const std::vector<double> raw = endo::rectified_to_raw(rig, true, {80, 48});
  CHECK(std::fabs(endo::raw_to_rectified(rig, true, raw)[0] - 80.0) < 1e-3);
  CHECK(std::fabs(endo::to_raw_left(rig, {0, 0, 100})[2] - 100.0) < 1.0);
  std::vector<uint8_t> left(3 * pixels);
  estimator.rectify(endo::image(pair.left.data(), width, height), endo::image(pair.right.data(), width, height), left.data(),
                    nullptr, left.size());
  endo::Stream(estimator, width, height).follow_rig();
  estimator.remove_calibration();
  endo_status status = ENDO_OK;
  try {
    estimator.predict(endo::image(pair.left.data(), width, height), endo::image(pair.right.data(), width, height), maps);
  } catch (const endo::Error& error) {
    status = error.status();
    CHECK(std::strstr(error.what(), "CALIBRATION_REQUIRED") != nullptr);
  }
  CHECK(status == ENDO_CALIBRATION_REQUIRED);
  try {
    endo::path_length(rig, maps.result, {70, 40, 90});
  } catch (const endo::Error& error) {
    status = error.status();
  }
  CHECK(status == ENDO_INVALID_ARGUMENT);
  try {
    endo::read_calibration("no rig");
  } catch (const endo::Error& error) {
    status = error.status();
  }
  CHECK(status == ENDO_CALIBRATION_UNREADABLE);
  estimator.self_test();
  estimator.cancel();
  CHECK(estimator.diagnostics().front() == '{' && estimator.diagnostics().back() == '}');
}

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  late_frames_are_marked_and_logged(at);
  logs_hold_nothing_of_the_pictures(at);
  an_exception_of_the_host_does_not_cross(at);
  diagnostics_fit_or_say_so(at);
  log_and_diagnostics_say_what_computes(at);
  a_running_frame_can_be_cancelled(at);
  a_call_that_waits_is_cancelled_too(at);
  threads_do_not_disturb_each_other(at, false);
  threads_do_not_disturb_each_other(at, true);
  the_wrapper_throws_and_frees(at);
  the_wrapper_tells_which_frame_of_a_stream_failed(at);
}
