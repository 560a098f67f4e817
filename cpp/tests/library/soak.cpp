// Frames by the thousand on a machine that is busy with other things: every late one is marked, by the call and in a
// stream, and memory, file handles and threads do not grow. Prints what it saw as JSON.
//
//     library_soak RUNTIME MODEL FRAMES
#include <algorithm>
#include <chrono>
#include <deque>
#include <limits>

#include "support.hpp"
#include "use.hpp"

namespace {

constexpr int width = 128;
constexpr int height = 64;
constexpr int warm_up = 200;
// A run has so many parts. What a thread first takes where it first meets another one falls into one of them; a leak into all.
constexpr int parts = 3;
constexpr long most_growth_kib = 64;  // of a part

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point started) {
  return std::chrono::duration<double, std::milli>(Clock::now() - started).count();
}

endo_options settings(const Places& at, double deadline_ms) {
  endo_options options = default_options(at);
  options.threads = 2;
  options.deadline_ms = deadline_ms;
  options.log_level = ENDO_LOG_ERROR;
  return options;
}

// Half more than a frame usually takes.
double usual_deadline(const Places& at, const Pair& pair, Output& out) {
  const Opened estimator(at, settings(at, 0.0));
  std::vector<double> times;
  for (int i = 0; i < warm_up; ++i) {
    const Clock::time_point started = Clock::now();
    CHECK(estimator.predict(pair, out) == ENDO_OK && out.result.late == 0);
    times.push_back(milliseconds_since(started));
  }
  std::nth_element(times.begin(), times.begin() + warm_up / 2, times.end());
  return 1.5 * times[warm_up / 2];
}

// Counts late frames, each held against a clock of its own.
struct Marks {
  double deadline_ms;
  long late = 0;
  long frames = 0;

  void check(const endo_result& result, double elapsed_ms) {
    const double stages_ms = result.rectify_ms + result.session_ms + result.postprocess_ms;
    const double own_ms = result.measures[ENDO_CAUSE_LATE] * deadline_ms;
    CHECK(stages_ms <= own_ms && own_ms <= elapsed_ms);
    CHECK(result.late == (own_ms > deadline_ms ? 1 : 0));
    CHECK(elapsed_ms > deadline_ms || result.late == 0);  // the library's time lies within the caller's
    CHECK(stages_ms <= deadline_ms || result.late == 1);
    CHECK((result.causes >> ENDO_CAUSE_LATE & 1u) == static_cast<uint64_t>(result.late));
    late += result.late;
    ++frames;
  }
};

void predict_frames(const Opened& estimator, const Pair& pair, long count, Marks& marks) {
  Output out(size_t{width} * height);
  for (long i = 0; i < count; ++i) {
    const Clock::time_point started = Clock::now();
    CHECK(estimator.predict(pair, out) == ENDO_OK);
    marks.check(out.result, milliseconds_since(started));
  }
}

// A stream that has two frames in flight all the time.
class Flow {
 public:
  explicit Flow(const Opened& estimator) {
    int32_t lanes = 0;
    CHECK(endo_stream_open(estimator.get(), width, height, &lanes, &stream_) == ENDO_OK && lanes == in_flight);
    for (int i = 0; i < in_flight; ++i) ring_.emplace_back(size_t{width} * height);
  }
  ~Flow() { endo_stream_close(stream_); }
  Flow(const Flow&) = delete;
  Flow& operator=(const Flow&) = delete;

  void frames(const Pair& pair, long count, Marks& marks) {
    const endo_image left = pair.left_image();
    const endo_image right = pair.right_image();
    Clock::time_point started[in_flight];
    for (long i = 0; i < count + in_flight; ++i) {
      const size_t slot = static_cast<size_t>(i % in_flight);
      if (i >= in_flight) {
        endo_result* received = nullptr;
        CHECK(endo_stream_receive(stream_, &received) == ENDO_OK && received == &ring_[slot].result);
        marks.check(*received, milliseconds_since(started[slot]));
      }
      if (i >= count) continue;
      started[slot] = Clock::now();
      CHECK(endo_stream_submit(stream_, &left, &right, &ring_[slot].result) == ENDO_OK);
    }
  }

 private:
  static constexpr int in_flight = 2;

  endo_stream* stream_ = nullptr;
  std::deque<Output> ring_;  // whose maps stay where they are
};

long counted_late(const Opened& estimator) {
  size_t needed = 0;
  CHECK(endo_get_diagnostics(estimator.get(), nullptr, 0, &needed) == ENDO_OK);
  std::string report(needed + 64, '\0');
  CHECK(endo_get_diagnostics(estimator.get(), report.data(), report.size(), nullptr) == ENDO_OK);
  const std::string key = "\"late\":";
  const size_t at = report.find(key);
  CHECK(at != std::string::npos);
  return std::atol(report.c_str() + at + key.size());
}

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  const long frames = argc > 3 ? std::atol(argv[3]) : 3000;
  const Pair pair(width, height, 9);
  Output out(size_t{width} * height);
  Marks marks{usual_deadline(at, pair, out)};
  const Opened estimator(at, settings(at, marks.deadline_ms));
  Flow flow(estimator);
  const auto run = [&](long count) {
    predict_frames(estimator, pair, count, marks);
    flow.frames(pair, count, marks);
  };
  run(warm_up);
  const Use before = use_now();
  Use after = before;
  long least_growth_kib = std::numeric_limits<long>::max();
  for (int part = 0; part < parts; ++part) {
    const long resident_kib = after.resident_kib;
    run(frames / parts);
    after = use_now();
    least_growth_kib = std::min(least_growth_kib, after.resident_kib - resident_kib);
  }
  std::printf("{\"frames\": %ld, \"late\": %ld, \"deadline_ms\": %.3f, \"resident_kib\": [%ld, %ld], \"handles\": [%ld, %ld], "
              "\"threads\": [%ld, %ld]}\n", marks.frames, marks.late, marks.deadline_ms, before.resident_kib,
              after.resident_kib, before.handles, after.handles, before.threads, after.threads);
  CHECK(counted_late(estimator) == marks.late);
  CHECK(after.handles == before.handles && after.threads == before.threads);
  CHECK(least_growth_kib < most_growth_kib);
}
