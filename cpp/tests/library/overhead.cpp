// What a frame costs beyond its parts: the library's call against the runtime and the kernels called directly, turn by
// turn. Prints medians as JSON.
//
//     library_overhead RUNTIME MODEL WIDTH HEIGHT FRAMES THREADS
#include <algorithm>
#include <chrono>
#include <limits>

#include "frame_path/network_size.hpp"
#include "maps/postprocess.hpp"
#include "geometry/rig.hpp"
#include "frame_path/frame_path.hpp"
#include "library/ort_session.hpp"
#include "support.hpp"
#include "platform/threads.hpp"

namespace {

using namespace endosdk;
using Clock = std::chrono::steady_clock;

// The frame path, written out without the library around it.
class Bare {
 public:
  Bare(const Places& at, const endo_calibration& numbers, Size frame, int threads)
      : rig_(numbers),
        session_(Runtime::open(at.runtime, "", {}), std::make_shared<const ModelFile>(read_model(at.model, {})),
                 {"cpu", {}, threads, true}, {}),
        picture_(network_size_of(frame, session_.model().inference_width)),
        rectifier_(rig_.rectifier(rig_.geometry().scaled(picture_), Border::fading)),
        full_(rig_.rectifier(rig_.geometry(), Border::fading)),
        buffers_(picture_, session_.model()),
        run_(session_.bind(buffers_)) {}

  void predict(const Pair& pair, Output& out) {
    const ImageView left = {pair.left.data(), pair.width, pair.height, 3, ptrdiff_t{3} * pair.width};
    const ImageView right = {pair.right.data(), pair.width, pair.height, 3, ptrdiff_t{3} * pair.width};
    rectifier_.rectify(left, right, buffers_.left(), buffers_.right(), ChannelOrder::rgb, scratch_);
    (*run_)();
    const int stride = session_.model().output_stride;
    const RectifiedGeometry& g = rig_.geometry();
    const MutableFloatView disparity = buffers_.disparity();
    const MutableFloatView confidence = buffers_.confidence();
    PostprocessInput in;
    in.size = {pair.width, pair.height};
    in.disparity = {disparity.data, disparity.width, disparity.height};
    in.confidence = {confidence.data, confidence.width, confidence.height};
    in.view_scale = {static_cast<double>(picture_.height) / pair.height, static_cast<double>(picture_.width) / pair.width};
    in.scale = {in.view_scale.y / stride, in.view_scale.x / stride};
    in.gain = static_cast<float>(static_cast<double>(pair.width) / picture_.width);
    in.min_confidence = 0.3f;
    in.max_candidate_disparity = session_.model().max_candidate_disparity;
    in.left = buffers_.left();
    in.right = buffers_.right();
    in.valid_left = full_.valid_left().data();
    in.valid_right = full_.valid_right().data();
    in.geometry = {g.focal_px(), g.baseline_mm(), g.doffs(), 0.0, std::numeric_limits<double>::infinity()};
    MapsOut maps;
    maps.disparity = out.disparity.data();
    maps.confidence = out.confidence.data();
    maps.depth = out.depth.data();
    maps.sigma = out.sigma.data();
    maps.reasons = out.reasons.data();
    postprocess(in, maps);
  }

 private:
  Rig rig_;
  OrtStereoSession session_;
  Size picture_;  // as the network sees the frame
  Rectifier rectifier_;
  RectifyScratch scratch_;
  Rectifier full_;  // for the masks, which have the frame's size
  SessionBuffers buffers_;
  std::unique_ptr<Session::Run> run_;
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

template <typename Call>
double milliseconds(const Call& call) {
  const Clock::time_point start = Clock::now();
  call();
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  CHECK(argc == 7);
  const int width = std::atoi(argv[3]);
  const int height = std::atoi(argv[4]);
  const int frames = std::atoi(argv[5]);
  const int threads = std::atoi(argv[6]);
  const size_t pixels = static_cast<size_t>(width) * static_cast<size_t>(height);
  endo_options options = default_options(at);
  options.threads = threads;
  const Opened estimator(at, options);
  const endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  Bare bare(at, rig, {width, height}, threads);
  set_thread_count(threads);  // of the parts' kernels; the estimator's are its own
  const Pair pair(width, height, 9);
  Output ours(pixels, true);
  ours.result.disparity_u16 = ours.result.depth_u16 = nullptr;  // more than the parts do
  Output parts(pixels, true);
  std::vector<double> library_ms;
  std::vector<double> parts_ms;
  std::vector<double> ratios;
  for (int i = -3; i < frames; ++i) {
    double with = 0.0;
    double without = 0.0;
    const auto run_library = [&] { with = milliseconds([&] { CHECK(estimator.predict(pair, ours) == ENDO_OK); }); };
    const auto run_parts = [&] { without = milliseconds([&] { bare.predict(pair, parts); }); };
    // In turns, so that neither always finds the caches as the other left them.
    if (i % 2 == 0) {
      run_library();
      run_parts();
    } else {
      run_parts();
      run_library();
    }
    if (i < 0) continue;
    library_ms.push_back(with);
    parts_ms.push_back(without);
    ratios.push_back(with / without);
  }
  CHECK(ours.disparity == parts.disparity && ours.reasons == parts.reasons);
  std::printf("{\"width\": %d, \"height\": %d, \"frames\": %d, \"threads\": %d, \"library_ms\": %.3f, \"parts_ms\": %.3f, "
              "\"median_ratio\": %.4f}\n",
              width, height, frames, threads, median(library_ms), median(parts_ms), median(ratios));
}
