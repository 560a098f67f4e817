#include "frame_path/self_test.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "frame_path/known_pair.hpp"
#include "frame_path/slot.hpp"
#include "platform/errors.hpp"

namespace endosdk {
namespace {

// Least share that must be right, of the part of the plane that both views show.
constexpr double least_share = 0.5;

// Limits that accept every answer, whatever its confidence, because the test compares the answers with the truth.
constexpr Limits every_answer = {0.0, 0.0, std::numeric_limits<double>::infinity(), 0.1};

template <typename Rule, typename Seen>
void require_answer(bool holds, const char* what, const Rule& rule, const Seen& seen) {
  require(holds, ENDO_SELF_TEST_FAILED, what, rule, seen);
}

void require_share(double share, const char* what, const char* rule) {
  require_answer(share >= least_share, what, rule, Text(100.0 * share, " %"));
}

// The map of a rectified rig moves no pixel, so rectification must give the same bytes as repacking.
void check_rectifier(const FramePair& pair) {
  const Size size = pair.size();
  const size_t bytes = rgb_bytes(size);
  std::vector<uint8_t> packed(2 * bytes);
  std::vector<uint8_t> rectified(2 * bytes);
  const auto view = [&](std::vector<uint8_t>& planes, size_t first) { return PlanarView{planes.data() + first, size.width, size.height}; };
  pack(pair.left, pair.right, view(packed, 0), view(packed, bytes), pair.order);
  const Rig rig = Rig::identity(size);
  RectifyScratch scratch;
  rig.rectifier(rig.geometry(), Border::fading)
      .rectify(pair.left, pair.right, view(rectified, 0), view(rectified, bytes), pair.order, scratch);
  require_answer(packed == rectified, "self test: rectify", "must leave a rectified picture as it is", "other bytes");
}

// The report and the maps of one frame.
struct Answer {
  FrameReport report;
  std::vector<float> disparity, confidence, depth, sigma;
  std::vector<uint8_t> reasons;
  std::vector<uint16_t> disparity_u16, depth_u16;

  explicit Answer(size_t pixels)
      : disparity(pixels), confidence(pixels), depth(pixels), sigma(pixels), reasons(pixels), disparity_u16(pixels), depth_u16(pixels) {}

  MapsOut maps() {
    return {disparity.data(), confidence.data(), depth.data(), sigma.data(), reasons.data(), disparity_u16.data(), depth_u16.data()};
  }

  // Compares the bytes, because pixels without depth hold NaN.
  bool same_as(const Answer& other) const {
    const auto same = [](const auto& a, const auto& b) { return std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0; };
    return same(disparity, other.disparity) && same(confidence, other.confidence) && same(depth, other.depth) &&
           same(sigma, other.sigma) && same(reasons, other.reasons) && same(disparity_u16, other.disparity_u16) &&
           same(depth_u16, other.depth_u16);
  }
};

Answer ask(Slot& slot, const KnownPair& pair, Work& work) {
  Answer answer(count_of(pair.size()));
  slot.rectify(pair.frames(), answer.report);
  slot.infer(work, answer.report);
  slot.answer(answer.maps(), every_answer, &pair.rig(), work, answer.report);
  return answer;
}

// Share of pixels for which `holds` is true. The band of the plane that the right view does not show is left out.
template <typename Holds>
double share_of_plane(const KnownPair& pair, const Holds& holds) {
  const Size size = pair.size();
  const int first = std::min(static_cast<int>(2.0 * pair.disparity_px(pair.depth_mm())) + 1, size.width);
  int held = 0;
  for (int y = 0; y < size.height; ++y) {
    for (int x = first; x < size.width; ++x) {
      held += holds(static_cast<size_t>(y) * static_cast<size_t>(size.width) + static_cast<size_t>(x)) ? 1 : 0;
    }
  }
  const int count = (size.width - first) * size.height;
  return count > 0 ? static_cast<double>(held) / count : 0.0;
}

// A map in steps holds the same number as its float map, to half a step; 0 where that has none or one that 16 bits cannot hold.
void check_steps(uint16_t steps, float value, double per_unit, bool valid, const char* what) {
  const double wanted = static_cast<double>(value) * per_unit;
  const bool fits = valid && wanted > -0.5 && wanted < std::numeric_limits<uint16_t>::max() + 0.5;
  const bool right = fits ? std::fabs(steps - wanted) <= 0.51 : steps == 0;
  require_answer(right, what, "must hold the steps of its map of floats", Text(steps, " steps at ", value));
}

// Each pixel must have either a reason, or the depth that follows from its disparity and an expected error.
void check_agreement(const Answer& answer, const KnownPair& pair) {
  constexpr double rounding_px = 1e-3;
  int count = 0;
  for (size_t i = 0; i < answer.reasons.size(); ++i) {
    const bool valid = answer.reasons[i] == 0;
    require_answer(std::isfinite(answer.depth[i]) == valid, "self test: reasons", "must be set exactly where there is no depth",
                   Text(int{answer.reasons[i]}, " at a depth of ", answer.depth[i]));
    require_answer(answer.confidence[i] >= 0.0f && answer.confidence[i] <= 1.0f, "self test: confidence", "must lie within 0..1",
                   answer.confidence[i]);
    check_steps(answer.disparity_u16[i], answer.disparity[i], static_cast<double>(disparity_steps), valid, "self test: disparity_u16");
    check_steps(answer.depth_u16[i], answer.depth[i], 1.0 / every_answer.depth_unit_mm, valid, "self test: depth_u16");
    if (!valid) continue;
    ++count;
    const double off = pair.disparity_px(static_cast<double>(answer.depth[i])) - static_cast<double>(answer.disparity[i]);
    require_answer(std::fabs(off) <= rounding_px, "self test: depth",
                   "must be that of the disparity", Text(answer.depth[i], " mm at ", answer.disparity[i], " px"));
    require_answer(std::isfinite(answer.sigma[i]) && answer.sigma[i] > 0.0f, "self test: sigma",
                   "must be a positive number where there is a depth", answer.sigma[i]);
  }
  const double share = count / static_cast<double>(answer.reasons.size());
  require_answer(answer.report.valid_share == share, "self test: valid share", Text("must be that of the reasons, ", share),
                 answer.report.valid_share);
}

// The rows are checked separately, because networks find the plane even if the rows are some pixels off.
void check_rows(const PoseError& found) {
  require_answer(!found.measured || found.vertical_px <= 1.0, "self test: rectify", "rows must match to a pixel", found.vertical_px);
}

void check_plane(const Answer& answer, const KnownPair& pair) {
  const double truth = pair.disparity_px(pair.depth_mm());
  const auto is_right = [&](double disparity) { return std::fabs(disparity - truth) <= 1.0; };
  require_share(share_of_plane(pair, [&](size_t i) { return is_right(static_cast<double>(answer.disparity[i])); }), "self test: disparity",
                "at least half of a plane must be right to a pixel");
  require_share(share_of_plane(pair, [&](size_t i) { return is_right(pair.disparity_px(static_cast<double>(answer.depth[i]))); }), "self test: depth",
                "at least half of a plane must have its depth, to a pixel of disparity");
  check_agreement(answer, pair);
  check_rows(answer.report.pose);
}

}  // namespace

void run_self_test(std::shared_ptr<Session> session, Size picture, Work& work) {
  const int shift = std::max(1, std::min(16, session->model().max_disparity / 4));
  const KnownPair pair(picture, shift);
  check_rectifier(pair.frames());
  auto stage = std::make_shared<const RectifyStage>(picture, &pair.rig(), picture, [&] { work.check(); });
  Slot slot(std::move(stage), std::move(session));
  const Answer first = ask(slot, pair, work);
  check_plane(first, pair);
  require_answer(ask(slot, pair, work).same_as(first), "self test: repetition", "the same pair must give the same answer",
                 "another one");
}

}  // namespace endosdk
