// What belongs to one estimator and one frame: its threads, its time, its pictures, and what it says of them.
#include <malloc.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>

#include "frame.hpp"

namespace {

std::string diagnostics(const Opened& estimator) {
  std::vector<char> text(8192);
  CHECK(endo_get_diagnostics(estimator.get(), text.data(), text.size(), nullptr) == ENDO_OK);
  return text.data();
}

bool says(const Opened& estimator, const char* what) { return diagnostics(estimator).find(what) != std::string::npos; }

void opening_another_estimator_changes_none(const Places& at) {
  endo_options options = default_options(at);
  options.threads = 2;
  const Opened estimator(at, options);
  CHECK(says(estimator, "\"threads\":2"));
  endo_options one = default_options(at);
  endo_estimator* handle = nullptr;
  expect(endo_open_memory("garbage", 7, &one, &handle), ENDO_MODEL_UNREADABLE, "model");
  const Opened other(at, one);
  CHECK(says(other, "\"threads\":1") && says(estimator, "\"threads\":2"));
  endo_options usual = default_options(at);
  usual.threads = 0;
  const unsigned cores = std::thread::hardware_concurrency();
  const Opened last(at, usual);
  CHECK(cores == 1 || !says(last, "\"threads\":1,"));
}

// Building the maps of a large raw frame takes longest of all, so it counts and can be cancelled.
void the_first_frame_of_a_size_can_be_cancelled_and_counts_whole(const Places& at) {
  constexpr int w = 1920;
  constexpr int h = 1080;
  endo_options options = default_options(at);
  options.deadline_ms = 1.0;
  const Opened estimator(at, options);
  const endo_calibration rig = raw_rig(w, h);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  const Pair pair(w, h, 9);
  Output out(size_t{w} * h);
  std::atomic<bool> prepared{false};
  std::thread canceller([&] {  // again and again: a busy machine may be late with one call
    while (!prepared) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      endo_cancel(estimator.get());
    }
  });
  const endo_status status = endo_prepare(estimator.get(), w, h);
  prepared = true;
  canceller.join();
  expect(status, ENDO_CANCELLED, "cancel");
  const auto started = std::chrono::steady_clock::now();
  CHECK(estimator.predict(pair, out) == ENDO_OK);
  const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - started;
  const endo_result& r = out.result;
  CHECK(r.late == 1);
  CHECK(r.rectify_ms + r.session_ms + r.postprocess_ms > 0.8 * wall.count());
}

void pictures_are_those_of_the_latest_pair_or_none(const Places& at) {
  const Opened estimator(at);
  const Pair pair(width, height, 9);
  Output out(pixels);
  CHECK(estimator.predict(pair, out) == ENDO_OK);
  std::vector<uint8_t> left(3 * pixels);
  const auto shown = [&] { return endo_get_rectified(estimator.get(), left.data(), nullptr, left.size()); };
  CHECK(shown() == ENDO_OK && left == pair.left);
  // A frame that is refused for what it is leaves all as it was.
  endo_image wrong = pair.left_image();
  wrong.stride = 5;
  const endo_image right = pair.right_image();
  expect(endo_predict(estimator.get(), &wrong, &right, &out.result), ENDO_INVALID_ARGUMENT, "rows must not overlap");
  CHECK(shown() == ENDO_OK && left == pair.left);
  // One that was prepared for has no picture, however the preparation ended.
  CHECK(endo_prepare(estimator.get(), width, height) == ENDO_OK);
  expect(shown(), ENDO_INVALID_ARGUMENT, "no frame yet");
}

void one_camera_connected_twice_is_found_on_a_raw_rig(const Places& at) {
  const Opened estimator(at);
  const endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  Pair pair(width, height, 9);
  pair.right = pair.left;
  Output out(pixels, true);
  CHECK(estimator.predict(pair, out) == ENDO_OK && out.result.quality == ENDO_QUALITY_INVALID);
  CHECK(says(estimator, "\"SAME_VIEW_TWICE\":1"));
}

void a_frame_on_another_thread_allocates_nothing(const Places& at) {
  constexpr int w = 1920;
  constexpr int h = 1080;
  endo_options options = default_options(at);
  options.network_width = 480;
  options.network_height = 270;
  const Opened estimator(at, options);
  CHECK(endo_prepare(estimator.get(), w, h) == ENDO_OK);
  const Pair pair(w, h, 9);
  Output out(size_t{w} * h);
  CHECK(estimator.predict(pair, out) == ENDO_OK);
  const size_t before = mallinfo2().uordblks;
  size_t after = 0;
  std::thread([&] {
    CHECK(estimator.predict(pair, out) == ENDO_OK);
    after = mallinfo2().uordblks;
  }).join();
  CHECK(after < before + 16384);  // what the thread itself and the runtime take; a reduced frame has 388,800 bytes
}

void a_refused_rig_leaves_the_one_before(const Places& at) {
  const Opened estimator(at);
  endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  const Pair pair(width, height, 9);
  Output out(pixels, true);
  CHECK(estimator.predict(pair, out) == ENDO_OK);
  rig.width = 40000;  // a right rig of frames that are too wide for any model
  expect(endo_set_calibration(estimator.get(), &rig), ENDO_INVALID_ARGUMENT, "size");
  CHECK(estimator.predict(pair, out) == ENDO_OK);
  size_t needed = 0;
  CHECK(endo_get_diagnostics(estimator.get(), nullptr, 0, &needed) == ENDO_OK);
}

void preparing_drops_the_pictures_of_the_size_before(const Places& at) {
  const Opened estimator(at);
  Output out(pixels);
  CHECK(estimator.predict(Pair(width, height, 9), out) == ENDO_OK);
  std::vector<uint8_t> left(3 * pixels);
  std::vector<uint8_t> right(3 * pixels);
  const auto latest = [&] { return endo_get_rectified(estimator.get(), left.data(), right.data(), left.size()); };
  CHECK(endo_prepare(estimator.get(), width, height) == ENDO_OK);
  CHECK(endo_prepare(estimator.get(), width / 2, height / 2) == ENDO_OK);
  expect(latest(), ENDO_INVALID_ARGUMENT, "must have answered a frame");
}

void half_turns_are_no_rig_and_infinite_depths_no_answers(const Places& at) {
  const Opened estimator(at);
  for (const int kept : {1, 2}) {  // the axis of the half turn
    endo_calibration rig = raw_rig(width, height);
    for (int i = 0; i < 3; ++i) rig.rotation[4 * i] = i == kept ? 1.0 : -1.0;
    expect(endo_set_calibration(estimator.get(), &rig), ENDO_INVALID_CALIBRATION, "");
  }
  for (const bool far : {true, false}) {
    endo_calibration rig = raw_rig(width, height);
    remove_distortion(rig);
    rig.translation[1] = 0.0;
    if (far) rig.translation[0] = -1e38;
    for (double* k : {rig.left_matrix, rig.right_matrix}) {
      if (!far) k[0] = k[4] = 1e-300;
    }
    if (endo_set_calibration(estimator.get(), &rig) != ENDO_OK) continue;
    Output out(pixels, true);
    CHECK(estimator.predict(Pair(width, height, 9), out) == ENDO_OK);
    for (size_t i = 0; i < pixels; ++i) {
      CHECK((out.reasons[i] == 0) == (std::isfinite(out.depth[i]) && out.depth[i] > 0.0f));
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  opening_another_estimator_changes_none(at);
  the_first_frame_of_a_size_can_be_cancelled_and_counts_whole(at);
  pictures_are_those_of_the_latest_pair_or_none(at);
  one_camera_connected_twice_is_found_on_a_raw_rig(at);
  a_frame_on_another_thread_allocates_nothing(at);
  a_refused_rig_leaves_the_one_before(at);
  preparing_drops_the_pictures_of_the_size_before(at);
  half_turns_are_no_rig_and_infinite_depths_no_answers(at);
}
