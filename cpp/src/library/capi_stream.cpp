// The functions of endosdk.h for streams.
#include <endosdk/endosdk.h>

#include <chrono>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>

#include "library/capi_structs.hpp"
#include "library/guarded.hpp"
#include "library/handles.hpp"

using endosdk::Call;
using endosdk::FramePath;
using endosdk::guarded;
using endosdk::require_pointer;
using endosdk::Stream;
using endosdk::with;

namespace {

// Results of a stream at a time: one for each writer, and one that is being submitted while it waits for room.
size_t places_of(size_t writers) { return writers + 1; }

}  // namespace

extern "C" {

endo_status endo_stream_open(endo_estimator* estimator, int32_t width, int32_t height, int32_t* frames_in_flight,
                             endo_stream** stream) {
  return guarded([&] {
    require_pointer(stream, "stream");
    *stream = nullptr;
    with(estimator, [&](FramePath& path) {
      std::unique_ptr<Stream> opened = path.stream({width, height});
      const size_t slots = static_cast<size_t>(opened->lanes()) + 1;
      if (frames_in_flight != nullptr) *frames_in_flight = opened->lanes();
      estimator->in_flight->make_room(places_of(slots));
      *stream = new endo_stream{std::move(opened), std::vector<endosdk::ResultWriter>(slots), std::vector<endo_result*>(slots),
                                estimator->in_flight};
    });
  });
}

endo_status endo_stream_set_temporal(endo_stream* stream, int32_t temporal) {
  return guarded([&] {
    const Call call(stream, "stream");
    endosdk::require(temporal == 0 || temporal == 1, "temporal", "must be 0 or 1", temporal);
    stream->stream->set_temporal(temporal == 1);
  });
}

endo_status endo_stream_submit(endo_stream* stream, const endo_image* left, const endo_image* right,
                               endo_result* result) {
  const endosdk::Clock::time_point asked = endosdk::Clock::now();
  endosdk::ResultWriter writer;
  const endo_status status = guarded([&] {
    writer.accept(result);
    const Call call(stream, "stream");
    writer.beside(stream->in_flight);
    const endosdk::FramePair pair = writer.stamped(endosdk::frame_pair(left, right));
    writer.check(pair);
    writer.join();
    const std::lock_guard lock(stream->submitting);
    endosdk::require(stream->stream->wait_for_room(), "stream", "must not have ended", "an ended one");
    const size_t slot = static_cast<size_t>(stream->submitted % stream->writers.size());
    stream->writers[slot] = writer;
    stream->results[slot] = result;
    stream->stream->submit(pair, writer.maps(), &stream->writers[slot], asked);
    ++stream->submitted;
  });
  if (status != ENDO_OK) writer.write_failure();
  return status;
}

endo_status endo_stream_receive(endo_stream* stream, endo_result** result) {
  return guarded([&] {
    require_pointer(result, "result");
    *result = nullptr;
    const Call call(stream, "stream");
    const std::lock_guard lock(stream->receiving);
    const std::optional<Stream::Answer> answer = stream->stream->receive();
    if (!answer) return;
    auto* writer = static_cast<endosdk::ResultWriter*>(answer->tag);
    *result = stream->results[static_cast<size_t>(writer - stream->writers.data())];
    ++stream->received;
    if (answer->error) {
      writer->write_failure();
      std::rethrow_exception(answer->error);
    }
    writer->write(answer->report);
  });
}

endo_status endo_stream_wait(endo_stream* stream, double longest_ms, int32_t* ready) {
  return guarded([&] {
    require_pointer(ready, "ready");
    *ready = 0;
    const Call call(stream, "stream");
    constexpr double most_ms = 60000.0;
    endosdk::require(longest_ms >= 0.0 && longest_ms <= most_ms, "longest_ms", endosdk::Text("must be within 0..", most_ms), longest_ms);
    const std::chrono::duration<double, std::milli> longest(longest_ms);
    *ready = stream->stream->wait_for_answer(std::chrono::duration_cast<std::chrono::microseconds>(longest)) ? 1 : 0;
  });
}

endo_status endo_stream_follow_rig(endo_stream* stream) {
  return guarded([&] {
    const Call call(stream, "stream");
    stream->stream->follow_rig();
  });
}

endo_status endo_stream_end(endo_stream* stream) {
  return guarded([&] {
    const Call call(stream, "stream");
    stream->stream->end();
  });
}

void endo_stream_close(endo_stream* stream) {
  if (stream == nullptr || !stream->process.is_this()) return;
  stream->stream->close();
  stream->callers.wait_for_none();
  for (uint64_t i = stream->received; i < stream->submitted; ++i) {
    stream->writers[static_cast<size_t>(i % stream->writers.size())].let_go();
  }
  stream->in_flight->give_back(places_of(stream->writers.size()));
  delete stream;
}

}  // extern "C"
