// Thousands of frames in one process: memory, file handles and threads must not grow. Prints what it saw as JSON.
//
//     library_steadiness RUNTIME MODEL FRAMES SECONDS
//
// It waits for so many seconds in the end, for whoever listens to what the process does.
#include <chrono>
#include <thread>

#include "support.hpp"
#include "use.hpp"

namespace {

constexpr int width = 96;
constexpr int height = 64;

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  const long frames = argc > 3 ? std::atol(argv[3]) : 2000;
  const std::chrono::seconds wait(argc > 4 ? std::atol(argv[4]) : 0);
  endo_options options = default_options(at);
  options.threads = 2;
  const Opened estimator(at, options);
  const endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  CHECK(endo_prepare(estimator.get(), width, height) == ENDO_OK);
  const Pair pair(width, height, 9);
  Output out(size_t{width} * height, true);
  CHECK(estimator.predict(pair, out) == ENDO_OK);
  const std::vector<float> first = out.disparity;
  for (int i = 0; i < 200; ++i) CHECK(estimator.predict(pair, out) == ENDO_OK);

  const Use before = use_now();
  for (long i = 0; i < frames; ++i) {
    CHECK(estimator.predict(pair, out) == ENDO_OK);
    if (i % 1000 == 999) std::fprintf(stderr, "\r%ld of %ld frames", i + 1, frames);
  }
  const Use after = use_now();
  std::printf("{\"frames\": %ld, \"resident_kib\": [%ld, %ld], \"handles\": [%ld, %ld], \"threads\": [%ld, %ld]}\n", frames,
              before.resident_kib, after.resident_kib, before.handles, after.handles, before.threads, after.threads);
  CHECK(out.disparity == first);
  CHECK(after.handles == before.handles && after.threads == before.threads);
  CHECK(after.resident_kib - before.resident_kib < 1024);
  std::this_thread::sleep_for(wait);
}
