// Frames a second by endo_predict, one after the other, and by a stream, turn by turn. Prints them as JSON.
//
//     library_stream_rate RUNTIME MODEL WIDTH HEIGHT FRAMES THREADS
#include <algorithm>
#include <chrono>
#include <thread>

#include "support.hpp"

namespace {

using Clock = std::chrono::steady_clock;

constexpr int rounds = 5;

template <typename Call>
double frames_per_second(int frames, const Call& call) {
  const Clock::time_point start = Clock::now();
  call();
  return frames / std::chrono::duration<double>(Clock::now() - start).count();
}

void run_stream(const Opened& estimator, const Pair& pair, std::vector<Output>& ring, int frames) {
  endo_stream* stream = nullptr;
  CHECK(endo_stream_open(estimator.get(), pair.width, pair.height, nullptr, &stream) == ENDO_OK);
  std::thread source([&] {
    const endo_image left = pair.left_image();
    const endo_image right = pair.right_image();
    for (int i = 0; i < frames; ++i) {
      CHECK(endo_stream_submit(stream, &left, &right, &ring[static_cast<size_t>(i) % ring.size()].result) == ENDO_OK);
    }
    CHECK(endo_stream_end(stream) == ENDO_OK);
  });
  endo_result* result = nullptr;
  int received = 0;
  while (endo_stream_receive(stream, &result) == ENDO_OK && result != nullptr) ++received;
  source.join();
  endo_stream_close(stream);
  CHECK(received == frames);
}

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  CHECK(argc == 7);
  const Pair pair(std::atoi(argv[3]), std::atoi(argv[4]), 9);
  const int frames = std::atoi(argv[5]);
  endo_options options = default_options(at);
  options.threads = std::atoi(argv[6]);
  const Opened estimator(at, options);
  const endo_calibration rig = raw_rig(pair.width, pair.height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  CHECK(endo_prepare(estimator.get(), pair.width, pair.height) == ENDO_OK);
  std::vector<Output> ring;
  for (int i = 0; i < options.threads + 2; ++i) {
    ring.emplace_back(static_cast<size_t>(pair.width) * static_cast<size_t>(pair.height), true);
  }
  run_stream(estimator, pair, ring, options.threads + 1);
  double predict = 0.0;
  double stream = 0.0;
  for (int i = 0; i < rounds; ++i) {  // the best round of each: others are disturbed by what else runs
    predict = std::max(predict, frames_per_second(frames, [&] {
                         for (int n = 0; n < frames; ++n) CHECK(estimator.predict(pair, ring[0]) == ENDO_OK);
                       }));
    stream = std::max(stream, frames_per_second(frames, [&] { run_stream(estimator, pair, ring, frames); }));
  }
  std::printf("{\"width\": %d, \"height\": %d, \"threads\": %d, \"predict_fps\": %.2f, \"stream_fps\": %.2f}\n", pair.width,
              pair.height, options.threads, predict, stream);
}
