// What a frame of the C library costs beyond its frame path: endo_predict against FramePath::predict, turn by turn. Ends
// with an error unless both give the same bytes. Prints medians as JSON.
//
//     library_overhead RUNTIME MODEL WIDTH HEIGHT FRAMES THREADS
#include <algorithm>
#include <chrono>

#include "frame_path/frame_path.hpp"
#include "library/capi_structs.hpp"
#include "library/ort_session.hpp"
#include "support.hpp"

namespace {

using namespace endosdk;

// The frame path without the C interface around it.
std::shared_ptr<FramePath> frame_path(const Places& at, const endo_calibration& rig, int threads) {
  SessionSettings session;
  session.threads = threads;
  FramePathSettings settings;
  settings.threads = threads;
  auto model = std::make_shared<const ModelFile>(read_model(at.model, {}));
  auto path = std::make_shared<FramePath>(
      std::make_shared<OrtStereoSession>(Runtime::open(at.runtime, "", {}), std::move(model), session, Log{}), settings);
  path->set_calibration(Rig(rig));
  return path;
}

FramePair views(const Pair& pair) {
  const endo_image left = pair.left_image();
  const endo_image right = pair.right_image();
  return frame_pair(&left, &right);
}

MapsOut maps(Output& out) {
  MapsOut wanted;
  wanted.disparity = out.disparity.data();
  wanted.confidence = out.confidence.data();
  wanted.depth = out.depth.data();
  wanted.sigma = out.sigma.data();
  wanted.reasons = out.reasons.data();
  return wanted;
}

// To the bit: a map may hold what is no number.
template <typename Value>
bool same(const std::vector<Value>& a, const std::vector<Value>& b) {
  return std::memcmp(a.data(), b.data(), a.size() * sizeof(Value)) == 0;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

template <typename Call>
double time_of(const Call& call) {
  const Clock::time_point start = Clock::now();
  call();
  return milliseconds(start, Clock::now());
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
  const std::shared_ptr<FramePath> path = frame_path(at, rig, threads);
  const Pair pair(width, height, 9);
  Output of_library(pixels, true);
  of_library.result.disparity_u16 = of_library.result.depth_u16 = nullptr;  // the maps of Python
  Output of_path(pixels, true);
  std::vector<double> library_ms;
  std::vector<double> path_ms;
  std::vector<double> ratios;
  for (int i = -3; i < frames; ++i) {
    double with = 0.0;
    double without = 0.0;
    const auto run_library = [&] { with = time_of([&] { CHECK(estimator.predict(pair, of_library) == ENDO_OK); }); };
    const auto run_path = [&] { without = time_of([&] { path->predict(views(pair), maps(of_path)); }); };
    // In turns, so that neither always finds the caches as the other left them.
    if (i % 2 == 0) {
      run_library();
      run_path();
    } else {
      run_path();
      run_library();
    }
    if (i < 0) continue;
    library_ms.push_back(with);
    path_ms.push_back(without);
    ratios.push_back(with / without);
  }
  CHECK(same(of_library.disparity, of_path.disparity) && same(of_library.confidence, of_path.confidence));
  CHECK(same(of_library.depth, of_path.depth) && same(of_library.sigma, of_path.sigma));
  CHECK(same(of_library.reasons, of_path.reasons));
  std::printf("{\"width\": %d, \"height\": %d, \"frames\": %d, \"threads\": %d, \"library_ms\": %.3f, "
              "\"frame_path_ms\": %.3f, \"median_ratio\": %.4f}\n",
              width, height, frames, threads, median(library_ms), median(path_ms), median(ratios));
}
