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

// What every model must reach on a plane, of the part that both views show, and what it must on pictures that are large enough to
// tell. Shipped models have 99.9 % within half a pixel there, a median error of 0.05 px and a mean confidence of 0.99; the
// smallest network of the tests has 87 % within a pixel, 0.25 px and 0.42.
struct PlaneRule {
  double least_share;  // right to a pixel
  double largest_median_px;
  double least_confidence;  // on average
};
constexpr PlaneRule small_picture_rule = {0.5, 1.0, 0.0};
constexpr PlaneRule large_picture_rule = {0.8, 0.5, 0.3};

// Largest difference of a cell from the golden answer. Among processors, releases of the runtime and providers, cells differ by
// up to 0.08 px and 0.002; with 16-bit floats, by 0.08 px and 0.006.
constexpr double golden_tolerance_px = 0.2;
constexpr double golden_tolerance_confidence = 0.03;

// Limits that accept every answer, whatever its confidence, because the test compares the answers with the truth.
constexpr Limits every_answer = {0.0, 0.0, std::numeric_limits<double>::infinity(), 0.1};

template <typename Rule, typename Seen>
void require_answer(bool holds, const char* what, const Rule& rule, const Seen& seen) {
  require(holds, ENDO_SELF_TEST_FAILED, what, rule, seen);
}

// Of a share, or of a mean confidence.
template <typename Rule>
void require_least(double share, double least, const char* what, const Rule& rule) {
  require_answer(share >= least, what, Text(rule, ", at least ", 100.0 * least, " %"), Text(100.0 * share, " %"));
}

// On smaller pictures, the edges of what both views show are a large part of the plane.
bool is_large(Size size) { return size.width >= golden_picture.width && size.height >= golden_picture.height; }

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

std::shared_ptr<const RectifyStage> stage_of(const KnownPair& pair, const Work& work) {
  return std::make_shared<const RectifyStage>(pair.size(), &pair.rig(), pair.size(), [&] { work.check(); });
}

Answer ask(Slot& slot, const KnownPair& pair, Work& work) {
  Answer answer(count_of(pair.size()));
  slot.rectify(pair.frames(), answer.report);
  slot.infer(work, answer.report);
  slot.answer(answer.maps(), every_answer, &pair.rig(), work, answer.report);
  return answer;
}

// The pixels of a plane with this disparity. The band that the right view does not show is left out.
std::vector<size_t> pixels_of_plane(Size size, double disparity) {
  const int first = std::min(static_cast<int>(2.0 * disparity) + 1, size.width);
  std::vector<size_t> pixels;
  for (int y = 0; y < size.height; ++y) {
    for (int x = first; x < size.width; ++x) {
      pixels.push_back(static_cast<size_t>(y) * static_cast<size_t>(size.width) + static_cast<size_t>(x));
    }
  }
  return pixels;
}

template <typename Holds>
double share_of(const std::vector<size_t>& pixels, const Holds& holds) {
  const auto held = std::count_if(pixels.begin(), pixels.end(), holds);
  return pixels.empty() ? 0.0 : static_cast<double>(held) / static_cast<double>(pixels.size());
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

void check_plane(const Answer& answer, const KnownPair& pair, int shift) {
  const PlaneRule& rule = is_large(pair.size()) ? large_picture_rule : small_picture_rule;
  const double truth = pair.disparity_px(pair.depth_mm(shift));
  const std::vector<size_t> pixels = pixels_of_plane(pair.size(), truth);
  const auto error = [&](double disparity) { return std::fabs(disparity - truth); };
  const auto error_at = [&](size_t i) { return error(static_cast<double>(answer.disparity[i])); };
  const auto has_depth = [&](size_t i) { return error(pair.disparity_px(static_cast<double>(answer.depth[i]))) <= 1.0; };
  require_least(share_of(pixels, [&](size_t i) { return error_at(i) <= 1.0; }), rule.least_share, "self test: disparity",
                "a plane must be right to a pixel");
  require_least(share_of(pixels, [&](size_t i) { return error_at(i) <= rule.largest_median_px; }), 0.5, "self test: disparity",
                Text("a plane must be right to ", rule.largest_median_px, " px"));
  require_least(share_of(pixels, has_depth), rule.least_share, "self test: depth",
                "a plane must have its depth, to a pixel of disparity");
  double confidence = 0.0;
  for (const size_t i : pixels) confidence += static_cast<double>(answer.confidence[i]) / static_cast<double>(pixels.size());
  require_least(confidence, rule.least_confidence, "self test: confidence", "a plane must be certain on average");
  check_agreement(answer, pair);
  check_rows(answer.report.pose);
}

GoldenCells means_of_cells(const std::vector<float>& map) {
  constexpr int width = golden_picture.width;
  constexpr int height = golden_picture.height;
  GoldenCells means{};
  for (int row = 0; row < golden_rows; ++row) {
    for (int column = 0; column < golden_columns; ++column) {
      double sum = 0.0;
      int count = 0;
      for (int y = row * height / golden_rows; y < (row + 1) * height / golden_rows; ++y) {
        for (int x = column * width / golden_columns; x < (column + 1) * width / golden_columns; ++x, ++count) {
          sum += static_cast<double>(map[static_cast<size_t>(y * width + x)]);
        }
      }
      means[static_cast<size_t>(row * golden_columns + column)] = static_cast<float>(sum / count);
    }
  }
  return means;
}

void check_cells(const GoldenCells& found, const GoldenCells& golden, double tolerance, const char* what) {
  for (size_t i = 0; i < golden.size(); ++i) {
    // Written so that a mean that is no number fails.
    const bool near = std::fabs(static_cast<double>(found[i]) - static_cast<double>(golden[i])) <= tolerance;
    require_answer(near, what, Text("must be what this model answered when it was released, ", golden[i], " to ", tolerance,
                                    " in cell ", i % golden_columns, ", ", i / golden_columns), found[i]);
  }
}

}  // namespace

void check_answer_to_plane(std::shared_ptr<Session> session, Size picture, Work& work) {
  const int shift = std::max(1, std::min(16, session->model().max_disparity / 4));
  const KnownPair pair = KnownPair::plane(picture, shift);
  check_rectifier(pair.frames());
  Slot slot(stage_of(pair, work), std::move(session));
  const Answer first = ask(slot, pair, work);
  check_plane(first, pair, shift);
  require_answer(ask(slot, pair, work).same_as(first), "self test: repetition", "the same pair must give the same answer",
                 "another one");
}

CellsOfAnswer cells_of_answer(std::shared_ptr<Session> session, Work& work) {
  constexpr int far_px = 4;
  constexpr int largest_px = 100;  // nearer bands would leave too little of the picture
  const int near_px = std::min(largest_px, session->model().max_candidate_disparity * 4 / 5);
  const KnownPair pair = KnownPair::bands(golden_picture, far_px, near_px);
  Slot slot(stage_of(pair, work), std::move(session));
  const Answer answer = ask(slot, pair, work);
  return {means_of_cells(answer.disparity), means_of_cells(answer.confidence)};
}

void check_golden_answer(std::shared_ptr<Session> session, const GoldenAnswer& golden, Work& work) {
  const CellsOfAnswer found = cells_of_answer(std::move(session), work);
  check_cells(found.disparity, golden.disparity, golden_tolerance_px, "self test: disparity");
  check_cells(found.confidence, golden.confidence, golden_tolerance_confidence, "self test: confidence");
}

}  // namespace endosdk
