#include "library/capi_structs.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <utility>

#include "geometry/pose_filter.hpp"
#include "geometry/rig_rules.hpp"
#include "maps/reasons.hpp"
#include "library/struct_io.hpp"
#include "platform/errors.hpp"

namespace endosdk {
namespace {

// Sizes of the structs in the first release; they only grow.
constexpr size_t first_calibration = 392;
constexpr size_t first_geometry = 48;
constexpr size_t first_image = 32;
constexpr size_t first_result = 120;
static_assert(sizeof(endo_calibration) >= first_calibration && sizeof(endo_geometry) >= first_geometry &&
              sizeof(endo_image) == first_image && sizeof(endo_result) >= first_result);

ImageView view_of(const endo_image& image, const char* argument) {
  const bool known = image.format == ENDO_RGB8 || image.format == ENDO_BGR8 || image.format == ENDO_GRAY8;
  require_argument(known, argument, "must have an endo_pixel_format", image.format);
  require_argument(image.data != nullptr, argument, "must have data", "NULL");
  const int channels = image.format == ENDO_GRAY8 ? 1 : 3;
  const int64_t tight = int64_t{image.width} * channels;
  const int64_t stride = image.stride == 0 ? tight : image.stride;
  constexpr int64_t longest = std::numeric_limits<int32_t>::max();
  require_argument(tight <= longest && stride >= -longest && stride <= longest, argument,
                   "a row must take less than 2 GiB", stride);
  return {image.data, image.width, image.height, channels, static_cast<ptrdiff_t>(stride)};
}

ChannelOrder order_of(int32_t format) {
  if (format == ENDO_GRAY8) return ChannelOrder::gray;
  return format == ENDO_BGR8 ? ChannelOrder::bgr : ChannelOrder::rgb;
}

MapsOut maps_of(const endo_result& result) {
  return {result.disparity, result.confidence,    result.depth,    result.sigma,
          result.reasons,   result.disparity_u16, result.depth_u16};
}

// From its first row to its last, whichever comes first.
Memory memory_of(const ImageView& image, const char* name) {
  const auto begin = reinterpret_cast<uintptr_t>(std::min(image.row(0), image.row(image.height - 1)));
  const auto last = reinterpret_cast<uintptr_t>(std::max(image.row(0), image.row(image.height - 1)));
  return {name, begin, last + static_cast<uintptr_t>(image.width) * static_cast<uintptr_t>(image.channels)};
}

}  // namespace

Rig read_rig(const endo_calibration& calibration) {
  const endo_calibration numbers = read_struct(&calibration, first_calibration, "calibration");
  try {
    Rig rig(numbers);
    check_plausible_baseline(numbers);
    return rig;
  } catch (const Error& error) {  // the core found no rectified geometry
    if (error.argument() == "size" || error.status() != ENDO_INVALID_ARGUMENT) throw;
    throw Error(ENDO_INVALID_CALIBRATION, error.argument(), error.rule(), error.value());
  }
}

void write_rig(endo_calibration numbers, endo_calibration& calibration) {
  numbers.struct_size = read_struct(&calibration, first_calibration, "calibration").struct_size;
  write_struct(numbers, numbers.struct_size, &calibration);
}

void write_geometry(const Rig& rig, endo_geometry& geometry) {
  endo_geometry known = read_struct(&geometry, first_geometry, "geometry");
  const RectifiedGeometry& g = rig.geometry();
  const size_t size = known.struct_size;
  known.rectifies = rig.is_rectified() ? 0 : 1;
  known.focal_px = g.focal_px();
  known.baseline_mm = g.baseline_mm();
  known.cx = g.cx();
  known.cy = g.cy();
  known.doffs = g.doffs();
  known.focal_y_px = g.focal_y_px();
  write_struct(known, size, &geometry);
}

FramePair frame_pair(const endo_image* left, const endo_image* right) {
  const endo_image l = read_struct(left, first_image, "left");
  const endo_image r = read_struct(right, first_image, "right");
  FramePair pair = {view_of(l, "left"), view_of(r, "right"), order_of(l.format)};
  check_pair(pair);
  require_argument(l.format == r.format, "right", "must have the format of left", r.format);
  return pair;
}

namespace {

constexpr uint64_t most_pixels = std::numeric_limits<int32_t>::max();

void check_result(const endo_result& known) {
  require_argument(known.capacity <= most_pixels, "result.capacity", "must be less than 2^31 pixels", known.capacity);
  require_argument(known.reserved == 0, "result.reserved", "must be 0", known.reserved);
  require_argument(known.reserved2 == 0, "result.reserved2", "must be 0", known.reserved2);
  check_memory(maps_of(known), known.capacity);
}

}  // namespace

endo_result read_result(const endo_result* result) {
  const endo_result known = read_struct(result, first_result, "result");
  check_result(known);
  return known;
}

void ResultWriter::accept(endo_result* result) {
  known_ = known_fields(result, first_result, "result");
  target_ = result;
  check_newer_fields(result, "result");
}

void ResultWriter::check(const FramePair& pair) {
  pictures_ = {memory_of(pair.left, "left"), memory_of(pair.right, "right")};
  frame_pixels_ = static_cast<uint64_t>(pair.left.width) * static_cast<uint64_t>(pair.left.height);
  check_result(known_);
  in_flight_->check(target_, maps(), known_.capacity);
  for (const Memory& picture : pictures_) check_apart(maps(), known_.capacity, picture);
  require_argument(known_.capacity >= frame_pixels_, "result.capacity", Text("must be at least ", frame_pixels_, " pixels"),
                   known_.capacity);
}

void ResultWriter::join() {
  in_flight_->add(target_, maps(), known_.capacity);
  joined_ = true;
}

MapsOut ResultWriter::maps() const { return maps_of(known_); }

FramePair ResultWriter::stamped(FramePair pair) const {
  pair.stamp_ns = known_.stamp_ns;
  return pair;
}

void ResultWriter::write(const FrameReport& report) {
  known_.quality = static_cast<int32_t>(report.quality);
  known_.frame = report.frame;
  known_.valid_share = report.valid_share;
  known_.rectify_ms = report.rectify_ms;
  known_.session_ms = report.session_ms;
  known_.postprocess_ms = report.postprocess_ms;
  known_.late = report.late ? 1 : 0;
  known_.causes = report.causes.bits();
  std::fill(std::begin(known_.measures), std::end(known_.measures), never);
  for (const CauseFact& fact : cause_facts) known_.measures[static_cast<int>(fact.cause)] = report.causes.measure(fact.cause);
  write_rig(report);
  known_.age_ms = report.age_ms;
  known_.identity = {};
  if (report.identity) write_identity(*report.identity);
  store();
}

void ResultWriter::write_identity(const Identity& identity) {
  endo_identity& shown = known_.identity;
  const auto put = [](auto& text, const std::string& value) { value.copy(text, sizeof text - 1); };
  put(shown.endosdk, identity.endosdk);
  put(shown.model, identity.model);
  put(shown.model_version, identity.model_version);
  put(shown.model_sha256, identity.model_sha256);
  put(shown.calibration_sha256, identity.calibration_sha256);
  put(shown.runtime, identity.runtime);
  put(shown.runtime_sha256, identity.runtime_sha256);
  put(shown.provider, identity.provider);
  put(shown.device, identity.device);
}

void ResultWriter::write_rig(const FrameReport& report) {
  const bool measured = report.pose.measured;
  known_.vertical_disparity_px = measured ? report.pose.vertical_px : never;
  known_.vertical_disparity_se_px = measured ? report.pose.vertical_se_px : never;
  const auto degrees = [](bool known, double radians) { return known ? degrees_per_radian * radians : never; };
  const bool frame = measured && report.calibrated;
  const bool steady = report.steady.measured && report.calibrated;
  for (int i = 0; i < 3; ++i) {
    const auto at = static_cast<size_t>(i);
    known_.rotation_deg[i] = degrees(frame, report.pose.value[at]);
    known_.rotation_se_deg[i] = degrees(frame, report.pose.standard_error(i));
    known_.steady_rotation_deg[i] = degrees(steady, report.steady.value[at]);
    known_.steady_rotation_se_deg[i] = degrees(steady, report.steady.standard_error(i));
    known_.corrected_deg[i] = degrees(true, report.corrected[at]);
  }
  known_.drifted = report.calibrated && has_drifted(report.steady) ? 1 : 0;
}

void ResultWriter::write_failure() {
  if (target_ == nullptr) return;
  if (!joined_ && in_flight_ != nullptr && in_flight_->holds(target_)) return;  // it belongs to the frame in flight
  write_no_answer(writable_maps(), static_cast<size_t>(pixels()));
  write({});
}

// Of a capacity that was refused, as far as the frame goes.
uint64_t ResultWriter::pixels() const { return known_.capacity <= most_pixels ? known_.capacity : frame_pixels_; }

MapsOut ResultWriter::writable_maps() const {
  MapsOut writable = maps();
  if (joined_) return writable;  // all were checked
  drop_refused_maps(writable, pixels());
  for (const Memory& picture : pictures_) drop_maps_in(writable, pixels(), picture);
  if (in_flight_ != nullptr) in_flight_->drop_maps_in_them(writable, pixels());
  return writable;
}

void ResultWriter::store() {
  write_struct(known_, known_.struct_size, target_);
  let_go();
}

void ResultWriter::let_go() {
  if (joined_) in_flight_->remove(target_);
  joined_ = false;
  target_ = nullptr;
}

}  // namespace endosdk
