#include "frame_path/rectify_stage.hpp"

#include <algorithm>
#include <cmath>

#include "platform/errors.hpp"

namespace endosdk {
namespace {

// Principal points closer together than this, px, put the end of the range so far away that no endoscope sees it.
constexpr double harmless_doffs = 0.5;

// Right views moved to the left, and of a camera that turned.
RectifiedGeometry moved(RectifiedGeometry geometry, double shift, const PoseVector& turned) {
  geometry.views.right_projection[2] -= shift;
  geometry.views.right_rotation = multiply(turn_of(turned), geometry.views.right_rotation);
  return geometry;
}

PoseVector negative(PoseVector value) {
  for (double& term : value) term = -term;
  return value;
}

}  // namespace

double RectifyStage::right_shift_of(const Rig* rig) {
  if (rig == nullptr || !rig->is_rectified() || rig->geometry().doffs() <= harmless_doffs) return 0.0;
  return rig->geometry().doffs();
}

RectifyStage::RectifyStage(Size frame, const Rig* rig, std::optional<Size> network,
                           const std::function<void()>& checkpoint, const PoseVector& corrected)
    : frame_(frame), picture_(network.value_or(frame)), corrected_(corrected), right_shift_(network ? right_shift_of(rig) : 0.0),
      moves_(rig != nullptr && (!rig->is_rectified() || right_shift_ > 0.0 || corrected != PoseVector{})) {
  require(frame.width > 0 && frame.height > 0, ENDO_INVALID_ARGUMENT, "size", "must be at least 1x1", frame);
  require(rig == nullptr || rig->size() == frame, ENDO_CALIBRATION_SIZE_MISMATCH, "calibration",
          Text("must be for frames of ", frame), rig != nullptr ? rig->size() : Size());
  if (rig != nullptr) {
    for (const bool right : {false, true}) place_field(*rig, right);
  }
  if (network) place_blocks(rig);
  const bool resized = picture_ != frame_;
  if (!moves_ && !resized) return;
  const Rig source = moves_ ? *rig : Rig::identity(frame);
  const RectifiedGeometry geometry = moved(source.geometry(), right_shift_, negative(corrected_));
  const Border border = moves_ ? Border::fading : Border::whole;
  rectifier_.emplace(source.rectifier(geometry.scaled(picture_), border));
  checkpoint();
  if (!moves_) return;
  for (const bool right : {false, true}) {
    const size_t side = right ? 1 : 0;
    if (resized) own_masks_[side] = valid_pixels(source.view(right, geometry), frame, geometry.size);
    masks_[side] = resized ? own_masks_[side].data() : (right ? rectifier_->valid_right() : rectifier_->valid_left()).data();
    checkpoint();
  }
}

std::vector<Point> RectifyStage::places_of_cells(const Rig* rig, bool right) const {
  const Size cells = MatchedViews::cells_of(picture_);
  const double cell = 2.0 * MatchedViews::unit_of(picture_);
  const Rig source = rig != nullptr ? *rig : Rig::identity(frame_);
  const SourceMap map(source.view(right, moved(source.geometry(), right_shift_, negative(corrected_)).scaled(picture_)));
  std::vector<Point> places;
  places.reserve(count_of(cells));
  for (int y = 0; y < cells.height; ++y) {
    for (int x = 0; x < cells.width; ++x) {
      const SourceMap::Source found = map.at((x + 0.5) * cell - 0.5, (y + 0.5) * cell - 0.5);
      places.push_back(found.unfolded ? found.pixel : nowhere);
    }
  }
  return places;
}

// The cells of the picture whose middle the optics of the view fill.
void RectifyStage::place_field(const Rig& rig, bool right) {
  const double* const field = rig.field_of_view(right);
  if (field == nullptr) return;
  std::vector<uint8_t> inside;
  for (const Point& raw : places_of_cells(&rig, right)) {
    inside.push_back(std::hypot((raw.x - field[0]) / field[2], (raw.y - field[1]) / field[3]) <= 1.0 ? 1 : 0);
  }
  fields_[right ? 1 : 0].emplace().take(inside, MatchedViews::cells_of(picture_));
}

void RectifyStage::place_blocks(const Rig* rig) {
  const Size blocks = EqualBlocks::blocks_of(frame_);
  const int side = EqualBlocks::side_of(frame_);
  const auto block_of = [&](const Point& raw) {
    const bool seen = raw.x >= -0.5 && raw.y >= -0.5 && raw.x < frame_.width - 0.5 && raw.y < frame_.height - 0.5;
    if (!seen || count_of(blocks) == 0) return -1;
    const int x = std::min(static_cast<int>(raw.x + 0.5) / side, blocks.width - 1);
    const int y = std::min(static_cast<int>(raw.y + 0.5) / side, blocks.height - 1);
    return y * blocks.width + x;
  };
  for (const bool right : {false, true}) {
    for (const Point& raw : places_of_cells(rig, right)) blocks_.of[right ? 1 : 0].push_back(block_of(raw));
  }
}

void RectifyStage::operator()(const ImageView& left, const ImageView& right, const PlanarView& out_left,
                              const PlanarView& out_right, ChannelOrder order, RectifyScratch& scratch) const {
  if (rectifier_) {
    rectifier_->rectify(left, right, out_left, out_right, order, scratch);
  } else {
    pack(left, right, out_left, out_right, order);
  }
}

RowsOfPairs::RowsOfPairs(std::shared_ptr<const RectifyStage> stage)
    : stage_(std::move(stage)), planes_(2 * rgb_bytes(stage_->picture())) {}

void RowsOfPairs::write(const FramePair& pair, uint8_t* left, uint8_t* right) {
  const Size size = stage_->picture();
  uint8_t* const right_planes = planes_.data() + rgb_bytes(size);
  const PlanarView views[2] = {{planes_.data(), size.width, size.height}, {right_planes, size.width, size.height}};
  (*stage_)(pair.left, pair.right, views[0], views[1], pair.order, scratch_);
  copy_interleaved(views[0], size, left);
  copy_interleaved(views[1], size, right);
}

}  // namespace endosdk
