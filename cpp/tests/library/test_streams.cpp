// Frames in flight, and calls that meet: order, equality with single frames, cancel, close, and reports beside work.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <thread>
#include <utility>

#include "frame.hpp"

namespace {

struct OpenedStream {
  endo_stream* handle = nullptr;
  int32_t lanes = 0;

  explicit OpenedStream(const Opened& estimator) {
    CHECK(endo_stream_open(estimator.get(), width, height, &lanes, &handle) == ENDO_OK);
  }
  ~OpenedStream() { endo_stream_close(handle); }
  OpenedStream(const OpenedStream&) = delete;
  OpenedStream& operator=(const OpenedStream&) = delete;

  endo_status submit(const Pair& pair, endo_result& result) const {
    const endo_image left = pair.left_image();
    const endo_image right = pair.right_image();
    return endo_stream_submit(handle, &left, &right, &result);
  }
};

endo_options with_threads(const Places& at, int threads) {
  endo_options options = default_options(at);
  options.threads = threads;
  return options;
}

std::vector<Pair> some_pairs(int count) {
  std::vector<Pair> pairs;
  for (int i = 0; i < count; ++i) {
    Pair& pair = pairs.emplace_back(width, height, 3 + i);
    pair.left[0] = static_cast<uint8_t>(i);  // a view that never changes would be a frozen one
  }
  return pairs;
}

std::string report_of(const Opened& estimator) {
  size_t needed = 0;
  CHECK(endo_get_diagnostics(estimator.get(), nullptr, 0, &needed) == ENDO_OK);
  std::string report(needed, '\0');
  CHECK(endo_get_diagnostics(estimator.get(), report.data(), report.size(), nullptr) == ENDO_OK);
  return report;
}

void a_stream_gives_what_predict_gives_in_order(const Places& at, int threads) {
  constexpr int count = 12;
  const Opened estimator(at, with_threads(at, threads));
  const endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  const std::vector<Pair> pairs = some_pairs(count);
  std::vector<Output> wanted;
  std::vector<Output> found;
  wanted.reserve(count);
  found.reserve(count);
  for (const Pair& pair : pairs) {
    CHECK(estimator.predict(pair, wanted.emplace_back(pixels, true)) == ENDO_OK);
    found.emplace_back(pixels, true);
  }
  const OpenedStream stream(estimator);
  CHECK(stream.lanes == threads);
  std::thread source([&] {
    Pair reused(width, height, 1);
    for (size_t i = 0; i < count; ++i) {
      reused.left = pairs[i].left;  // a frame may be overwritten once it was submitted
      reused.right = pairs[i].right;
      CHECK(stream.submit(reused, found[i].result) == ENDO_OK);
    }
    CHECK(endo_stream_end(stream.handle) == ENDO_OK);
  });
  endo_result* result = nullptr;
  for (size_t i = 0; i < count; ++i) {
    CHECK(endo_stream_receive(stream.handle, &result) == ENDO_OK && result == &found[i].result);
    CHECK(result->frame == count + 1 + i && result->quality == wanted[i].result.quality);
    CHECK(found[i].disparity == wanted[i].disparity && found[i].reasons == wanted[i].reasons);
    CHECK(std::memcmp(found[i].depth.data(), wanted[i].depth.data(), pixels * sizeof(float)) == 0);
    CHECK(result->rectify_ms > 0.0 && result->valid_share == wanted[i].result.valid_share);
  }
  CHECK(endo_stream_receive(stream.handle, &result) == ENDO_OK && result == nullptr);
  source.join();
  Output more(pixels, true);
  expect(stream.submit(pairs[0], more.result), ENDO_INVALID_ARGUMENT, "ended");
  CHECK(more.result.quality == ENDO_QUALITY_INVALID && std::isnan(more.depth[3]) && more.result.frame == 0);
  CHECK(estimator.predict(pairs[0], more) == ENDO_OK && more.disparity == wanted[0].disparity);
  CHECK(more.result.frame == 2 * count + 1);  // the one that was refused has no number
  CHECK(report_of(estimator).find("\"frames\":25,\"failed\":0,") != std::string::npos);
}

void one_thread_can_do_both_ends(const Places& at) {
  const Opened estimator(at, with_threads(at, 2));
  const OpenedStream stream(estimator);
  const Pair pair(width, height, 9);
  std::vector<Output> out;
  out.reserve(2);
  for (int i = 0; i < stream.lanes; ++i) CHECK(stream.submit(pair, out.emplace_back(pixels).result) == ENDO_OK);
  for (int i = 0; i < stream.lanes; ++i) {
    endo_result* result = nullptr;
    CHECK(endo_stream_receive(stream.handle, &result) == ENDO_OK && result == &out[static_cast<size_t>(i)].result);
    CHECK(std::fabs(middle(out[static_cast<size_t>(i)].disparity) - 9.0f) < 0.5f);
  }
}

void bad_frames_are_refused_and_the_stream_goes_on(const Places& at) {
  const Opened estimator(at);
  const OpenedStream stream(estimator);
  const Pair pair(width, height, 9);
  Output out(2 * pixels);
  expect(stream.submit(Pair(width, height + 8, 9), out.result), ENDO_INVALID_ARGUMENT, "left: must have the size of the stream, 160x96");
  CHECK(out.result.quality == ENDO_QUALITY_INVALID && std::isnan(out.disparity[0]));
  Output metric(pixels, true);
  expect(stream.submit(pair, metric.result), ENDO_CALIBRATION_REQUIRED, "endo_set_calibration");
  CHECK(stream.submit(pair, out.result) == ENDO_OK);
  endo_result* result = nullptr;
  CHECK(endo_stream_receive(stream.handle, &result) == ENDO_OK && result == &out.result && result->frame == 1);
  expect(endo_stream_receive(stream.handle, nullptr), ENDO_INVALID_ARGUMENT, "result");
  expect(endo_stream_receive(nullptr, &result), ENDO_INVALID_ARGUMENT, "stream");
  endo_stream_close(nullptr);
}

void a_receiver_can_wait_for_a_while(const Places& at) {
  using std::chrono::steady_clock;
  const Opened estimator(at);
  const OpenedStream stream(estimator);
  int32_t ready = 7;
  const auto started = steady_clock::now();
  CHECK(endo_stream_wait(stream.handle, 30.0, &ready) == ENDO_OK && ready == 0);
  CHECK(steady_clock::now() - started >= std::chrono::milliseconds(30));
  const Pair pair(width, height, 9);
  Output out(pixels);
  CHECK(stream.submit(pair, out.result) == ENDO_OK);
  CHECK(endo_stream_wait(stream.handle, 60000.0, &ready) == ENDO_OK && ready == 1);
  CHECK(endo_stream_wait(stream.handle, 0.0, &ready) == ENDO_OK && ready == 1);  // nothing was taken
  endo_result* result = nullptr;
  CHECK(endo_stream_receive(stream.handle, &result) == ENDO_OK && result == &out.result);
  CHECK(endo_stream_wait(stream.handle, 0.0, &ready) == ENDO_OK && ready == 0);
  for (const double longest_ms : {-1.0, 60001.0, std::numeric_limits<double>::quiet_NaN()}) {
    expect(endo_stream_wait(stream.handle, longest_ms, &ready), ENDO_INVALID_ARGUMENT, "longest_ms: must be within 0..60000");
  }
  expect(endo_stream_wait(stream.handle, 0.0, nullptr), ENDO_INVALID_ARGUMENT, "ready");
  expect(endo_stream_wait(nullptr, 0.0, &ready), ENDO_INVALID_ARGUMENT, "stream");
  // The end is an answer too: receiving then returns at once, with nothing.
  std::thread ends([&] { CHECK(endo_stream_end(stream.handle) == ENDO_OK); });
  CHECK(endo_stream_wait(stream.handle, 60000.0, &ready) == ENDO_OK && ready == 1);
  ends.join();
  CHECK(endo_stream_receive(stream.handle, &result) == ENDO_OK && result == nullptr);
}

void memory_of_a_frame_in_flight_is_not_taken_again(const Places& at) {
  const Opened estimator(at, with_threads(at, 3));
  const OpenedStream stream(estimator);
  const Pair pair(width, height, 9);
  Output first(pixels);
  Output second(pixels);
  CHECK(stream.submit(pair, first.result) == ENDO_OK);
  expect(stream.submit(pair, first.result), ENDO_INVALID_ARGUMENT, "result: must not be in flight");
  expect(stream.submit(Pair(width, height + 8, 9), first.result), ENDO_INVALID_ARGUMENT, "result: must not be in flight");
  float* const own = std::exchange(second.result.confidence, first.disparity.data());
  expect(stream.submit(pair, second.result), ENDO_INVALID_ARGUMENT, "confidence: must not lie in the memory of a frame in flight");
  CHECK(second.result.quality == ENDO_QUALITY_INVALID && std::isnan(second.disparity[7]));
  second.result.confidence = own;
  CHECK(stream.submit(pair, second.result) == ENDO_OK);
  endo_result* result = nullptr;
  for (const Output* wanted : {&first, &second}) {
    CHECK(endo_stream_receive(stream.handle, &result) == ENDO_OK && result == &wanted->result);
    CHECK(std::fabs(middle(wanted->disparity) - 9.0f) < 0.5f);
  }
  // What was received, and what was refused, may be submitted again.
  CHECK(stream.submit(pair, first.result) == ENDO_OK);
  expect(stream.submit(Pair(width, height + 8, 9), second.result), ENDO_INVALID_ARGUMENT, "result.capacity");
  CHECK(stream.submit(pair, second.result) == ENDO_OK);
  for (int i = 0; i < 2; ++i) CHECK(endo_stream_receive(stream.handle, &result) == ENDO_OK && result != nullptr);
}

void memory_in_flight_is_not_taken_by_other_calls_of_the_estimator(const Places& at) {
  const Opened estimator(at, with_threads(at, 3));
  const Pair pair(width, height, 9);
  Output first(pixels);
  Output second(pixels);
  endo_result* result = nullptr;
  {
    const OpenedStream stream(estimator);
    const OpenedStream other(estimator);
    CHECK(stream.submit(pair, first.result) == ENDO_OK);
    expect(estimator.predict(pair, first), ENDO_INVALID_ARGUMENT, "result: must not be in flight");
    expect(other.submit(pair, first.result), ENDO_INVALID_ARGUMENT, "result: must not be in flight");
    float* const own = std::exchange(second.result.disparity, first.disparity.data());
    second.confidence[7] = 1.0f;
    expect(estimator.predict(pair, second), ENDO_INVALID_ARGUMENT, "disparity: must not lie in the memory of a frame in flight");
    CHECK(second.result.quality == ENDO_QUALITY_INVALID && second.confidence[7] == 0.0f);
    expect(other.submit(pair, second.result), ENDO_INVALID_ARGUMENT, "disparity: must not lie in the memory of a frame in flight");
    second.result.disparity = own;
    CHECK(estimator.predict(pair, second) == ENDO_OK);
    CHECK(endo_stream_receive(stream.handle, &result) == ENDO_OK && result == &first.result);
    CHECK(std::fabs(middle(first.disparity) - 9.0f) < 0.5f);
    CHECK(stream.submit(pair, first.result) == ENDO_OK);  // and not received
  }
  CHECK(estimator.predict(pair, first) == ENDO_OK);
}

void frames_in_flight_can_be_cancelled(const Places& at) {
  const Opened estimator(at);
  const OpenedStream stream(estimator);
  const Pair pair(width, height, 9);
  Output out(pixels);
  std::atomic<bool> finished{false};
  std::thread canceller([&] {
    while (!finished) CHECK(endo_cancel(estimator.get()) == ENDO_OK);
  });
  bool cancelled = false;
  for (int i = 0; i < 2000 && !cancelled; ++i) {
    CHECK(stream.submit(pair, out.result) == ENDO_OK);
    endo_result* result = nullptr;
    const endo_status status = endo_stream_receive(stream.handle, &result);
    CHECK(result == &out.result && (status == ENDO_OK || status == ENDO_CANCELLED));
    cancelled = status == ENDO_CANCELLED;
    if (cancelled) CHECK(std::isnan(out.disparity[5]) && out.result.frame == 0);
  }
  finished = true;
  canceller.join();
  CHECK(cancelled);
  CHECK(stream.submit(pair, out.result) == ENDO_OK);
  endo_result* result = nullptr;
  CHECK(endo_stream_receive(stream.handle, &result) == ENDO_OK && std::isfinite(out.disparity[5]));
}

void closing_waits_for_the_frame_that_runs(const Places& at) {
  for (int i = 0; i < 10; ++i) {
    endo_estimator* handle = nullptr;
    const endo_options options = default_options(at);
    CHECK(endo_open_file(at.model.c_str(), &options, &handle) == ENDO_OK);
    const Pair pair(1280, 960, 9);
    Output out(1280 * 960);
    const endo_image left = pair.left_image();
    const endo_image right = pair.right_image();
    endo_status status = ENDO_INTERNAL;
    std::thread caller([&] { status = endo_predict(handle, &left, &right, &out.result); });
    std::vector<char> report(8192);
    do {  // until the call has chosen the network's size; its frame takes far longer
      CHECK(endo_get_diagnostics(handle, report.data(), report.size(), nullptr) == ENDO_OK);
    } while (std::strstr(report.data(), "network_width") == nullptr);
    endo_close(handle);
    caller.join();
    CHECK(status == ENDO_OK && out.result.frame == 1);
  }
}

void closing_an_estimator_ends_its_streams(const Places& at) {
  endo_estimator* handle = nullptr;
  endo_options options = default_options(at);
  options.threads = 1;
  options.deadline_ms = 1e-6;  // each frame logs that it was late
  std::atomic<int> lines{0};
  options.log = [](void* context, int32_t, const char*) { ++*static_cast<std::atomic<int>*>(context); };
  options.log_context = &lines;
  CHECK(endo_open_file(at.model.c_str(), &options, &handle) == ENDO_OK);
  endo_stream* stream = nullptr;
  CHECK(endo_stream_open(handle, width, height, nullptr, &stream) == ENDO_OK);
  const Pair pair(width, height, 9);
  const endo_image left = pair.left_image();
  const endo_image right = pair.right_image();
  Output first(pixels);
  Output second(pixels);
  CHECK(endo_stream_submit(stream, &left, &right, &first.result) == ENDO_OK);
  endo_status status = ENDO_OK;
  std::thread waits([&] { status = endo_stream_submit(stream, &left, &right, &second.result); });  // for room
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  endo_close(handle);
  const int before = lines.exchange(-1000);  // what the log function needs may now be gone
  waits.join();
  CHECK(status == ENDO_INVALID_ARGUMENT && before == 0);
  expect(endo_stream_submit(stream, &left, &right, &second.result), ENDO_INVALID_ARGUMENT, "estimator: must be open");
  endo_result* received = nullptr;
  CHECK(endo_stream_receive(stream, &received) == ENDO_OK && received == &first.result && first.result.frame == 1);
  CHECK(first.result.late == 1 && lines == -1000);
  CHECK(endo_stream_receive(stream, &received) == ENDO_OK && received == nullptr);
  endo_stream_close(stream);
}

void reports_do_not_wait_for_frames(const Places& at) {
  const Opened estimator(at);
  const Pair pair(1280, 960, 9);
  std::atomic<bool> finished{false};
  std::thread worker([&] {
    Output out(1280 * 960);
    while (!finished) CHECK(estimator.predict(pair, out) == ENDO_OK);
  });
  std::vector<char> text(8192);
  const auto started = std::chrono::steady_clock::now();
  for (int i = 0; i < 20; ++i) CHECK(endo_get_diagnostics(estimator.get(), text.data(), text.size(), nullptr) == ENDO_OK);
  CHECK(std::chrono::steady_clock::now() - started < std::chrono::seconds(2));
  // Others that wait for their turn get it, however tight the loop of the first.
  for (int i = 0; i < 3; ++i) CHECK(endo_set_calibration(estimator.get(), nullptr) == ENDO_OK);
  finished = true;
  worker.join();
}

void late_counts_the_wait_for_others(const Places& at) {
  const Pair pair(1280, 960, 9);
  const auto stages_ms = [](const endo_result& r) { return r.rectify_ms + r.session_ms + r.postprocess_ms; };
  // The fastest of several: one that others disturbed would give a deadline that no wait exceeds.
  double one_ms = std::numeric_limits<double>::infinity();
  {
    const Opened estimator(at);
    Output out(1280 * 960);
    for (int i = 0; i < 8; ++i) {
      CHECK(estimator.predict(pair, out) == ENDO_OK);
      one_ms = std::min(one_ms, stages_ms(out.result));
    }
  }
  endo_options options = default_options(at);
  options.deadline_ms = 2.5 * one_ms;
  const Opened estimator(at, options);
  CHECK(endo_prepare(estimator.get(), 1280, 960) == ENDO_OK);
  // The last of four waits for three. Other programs may disturb a round, not twenty.
  std::atomic<bool> late_by_waiting_alone{false};
  for (int round = 0; round < 20 && !late_by_waiting_alone; ++round) {
    std::vector<std::thread> callers;
    for (int i = 0; i < 4; ++i) {
      callers.emplace_back([&] {
        Output out(1280 * 960);
        CHECK(estimator.predict(pair, out) == ENDO_OK);
        if (out.result.late == 1 && stages_ms(out.result) < options.deadline_ms) late_by_waiting_alone = true;
      });
    }
    for (std::thread& caller : callers) caller.join();
  }
  CHECK(late_by_waiting_alone);
}

void late_counts_the_wait_for_room(const Places& at) {
  endo_options options = default_options(at);
  options.deadline_ms = 200.0;
  const Opened estimator(at, options);
  const OpenedStream stream(estimator);
  const Pair pair(width, height, 9);
  Output first(pixels);
  Output second(pixels);
  CHECK(stream.submit(pair, first.result) == ENDO_OK);
  std::atomic<bool> submitting{false};
  std::thread slow_consumer([&] {
    while (!submitting) std::this_thread::yield();
    std::this_thread::sleep_for(std::chrono::milliseconds(600));
    endo_result* result = nullptr;
    for (const Output* wanted : {&first, &second}) {
      CHECK(endo_stream_receive(stream.handle, &result) == ENDO_OK && result == &wanted->result);
    }
  });
  submitting = true;
  CHECK(stream.submit(pair, second.result) == ENDO_OK);
  slow_consumer.join();
  CHECK(second.result.late == 1 && (second.result.causes & 1u << ENDO_CAUSE_LATE) != 0);
}

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  for (const int threads : {1, 2, 3}) a_stream_gives_what_predict_gives_in_order(at, threads);
  one_thread_can_do_both_ends(at);
  bad_frames_are_refused_and_the_stream_goes_on(at);
  a_receiver_can_wait_for_a_while(at);
  memory_of_a_frame_in_flight_is_not_taken_again(at);
  memory_in_flight_is_not_taken_by_other_calls_of_the_estimator(at);
  frames_in_flight_can_be_cancelled(at);
  closing_waits_for_the_frame_that_runs(at);
  closing_an_estimator_ends_its_streams(at);
  reports_do_not_wait_for_frames(at);
  late_counts_the_wait_for_others(at);
  late_counts_the_wait_for_room(at);
}
