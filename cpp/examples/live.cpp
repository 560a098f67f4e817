// live: depth of a running camera, whose raw frames come through a pipe.
//
//     some-grabber | live model.onnx WIDTH HEIGHT [BUDGET_MS]
//
// Each frame is the left and then the right picture, WIDTH x HEIGHT x 3 bytes RGB, rectified. One thread reads and keeps
// only the latest frame; the main thread computes. A frame that came while another was computed and was replaced before
// its turn counts as skipped: the depth shown is always that of the newest frame, never of a growing queue. At the end of
// the stream a histogram of the latency, from the frame's last byte to its map, is printed. A camera that stalls is told of
// every second. MODEL_SHA256 in the environment pins the model. ffmpeg or GStreamer feed it:
//
//     ffmpeg -re -stream_loop -1 -i pairs-above-each-other.mp4 -f rawvideo -pix_fmt rgb24 - | live fast.onnx 960 720 22
#include <endosdk/endosdk.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;

struct Frame {
  std::vector<uint8_t> pixels;  // left, then right
  Clock::time_point arrived;
};

// A box for one frame: putting in replaces what was not taken out in time.
class Latest {
 public:
  explicit Latest(size_t bytes) : waiting_{std::vector<uint8_t>(bytes), {}} {}

  // Swaps, so that no pixel is copied and nothing is allocated.
  void put(Frame& frame) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      std::swap(waiting_, frame);
      skipped_ += fresh_ ? 1 : 0;
      fresh_ = true;
    }
    changed_.notify_one();
  }

  void close() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      closed_ = true;
    }
    changed_.notify_one();
  }

  // False at the end of the stream. Says so when no frame comes: a display must then show no depth.
  bool take(Frame& frame) {
    std::unique_lock<std::mutex> lock(mutex_);
    for (int waited_s = 1; !changed_.wait_for(lock, std::chrono::seconds(1), [&] { return fresh_ || closed_; }); ++waited_s) {
      std::fprintf(stderr, "live: no frame for %d s\n", waited_s);
    }
    if (!fresh_) return false;
    std::swap(waiting_, frame);
    fresh_ = false;
    return true;
  }

  long skipped() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return skipped_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  Frame waiting_;
  bool fresh_ = false;
  bool closed_ = false;
  long skipped_ = 0;
};

void read_frames(Latest& latest, size_t bytes) {
  Frame frame{std::vector<uint8_t>(bytes), {}};
  while (std::fread(frame.pixels.data(), 1, bytes, stdin) == bytes) {
    frame.arrived = Clock::now();
    latest.put(frame);
  }
  latest.close();
}

void print_histogram(const std::vector<double>& latencies) {
  if (latencies.empty()) return;
  std::vector<double> sorted = latencies;
  std::sort(sorted.begin(), sorted.end());
  const auto quantile = [&](double share) { return sorted[static_cast<size_t>(share * double(sorted.size() - 1))]; };
  std::printf("latency ms: p50 %.1f, p95 %.1f, p99 %.1f, max %.1f\n", quantile(0.5), quantile(0.95), quantile(0.99),
              sorted.back());
  constexpr int rows = 12;
  const double step = std::max(sorted.back() / rows, 0.1);
  std::array<int, rows> counts{};
  for (const double ms : sorted) ++counts[static_cast<size_t>(std::min(ms / step, rows - 1.0))];
  const int most = *std::max_element(counts.begin(), counts.end());
  for (size_t row = 0; row < rows; ++row) {
    const int bar = counts[row] * 50 / most;
    std::printf("%7.1f %6d %.*s\n", step * double(row), counts[row], bar, "##################################################");
  }
}

void run(const char* model, int width, int height, double budget_ms) {
  endo::Options options;
  options.deadline_ms = budget_ms;
  options.model_sha256 = std::getenv("MODEL_SHA256");  // null: any model
  endo::Estimator estimator = endo::Estimator::open(model, options);
  estimator.prepare(width, height);
  estimator.self_test();

  const size_t view = static_cast<size_t>(width) * static_cast<size_t>(height) * 3;
  Latest latest(2 * view);
  std::thread reader(read_frames, std::ref(latest), 2 * view);
  Frame frame{std::vector<uint8_t>(2 * view), {}};
  endo::Maps maps(width, height);
  std::vector<double> latencies;
  long late = 0;
  long invalid = 0;
  try {
    while (latest.take(frame)) {
      const uint8_t* pixels = frame.pixels.data();
      estimator.predict(endo::image(pixels, width, height), endo::image(pixels + view, width, height), maps);
      latencies.push_back(std::chrono::duration<double, std::milli>(Clock::now() - frame.arrived).count());
      late += maps.result.late;
      invalid += maps.result.quality == ENDO_QUALITY_INVALID;  // not to be used: its maps say so, too
    }
  } catch (const endo::Error& error) {
    std::fprintf(stderr, "live: %s\n", error.what());
    std::_Exit(EXIT_FAILURE);  // at once: the reader may wait for a frame that never comes
  }
  reader.join();
  std::printf("%zu frames computed, %ld of them invalid, %ld skipped, %ld late\n", latencies.size(), invalid,
              latest.skipped(), late);
  print_histogram(latencies);
}

double number(const std::string& text) {
  size_t end = 0;
  const double value = std::stod(text, &end);
  if (end != text.size()) throw std::invalid_argument("no number: " + text);
  return value;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4 && argc != 5) {
    std::fprintf(stderr, "usage: live MODEL WIDTH HEIGHT [BUDGET_MS]\n");
    return EXIT_FAILURE;
  }
  try {
    const int width = static_cast<int>(number(argv[2]));
    const int height = static_cast<int>(number(argv[3]));
    if (width < 1 || height < 1) throw std::invalid_argument("WIDTH and HEIGHT must be positive");
    run(argv[1], width, height, argc == 5 ? number(argv[4]) : 1e3 / 45.0);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "live: %s\n", error.what());
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
