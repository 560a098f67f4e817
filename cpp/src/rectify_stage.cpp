#include "rectify_stage.hpp"

#include "status.hpp"

namespace endosdk {
namespace {

bool same(Size a, Size b) { return a.width == b.width && a.height == b.height; }

auto text(Size size) { return Text(size.width, "x", size.height); }

}  // namespace

RectifyStage::RectifyStage(Size frame, const Rig* rig, std::optional<Size> network,
                           const std::function<void()>& checkpoint)
    : frame_(frame), picture_(network.value_or(frame)), is_raw_(rig != nullptr && !rig->is_rectified()) {
  require(frame.width > 0 && frame.height > 0, ENDO_INVALID_ARGUMENT, "size", "must be at least 1x1", text(frame));
  require(rig == nullptr || same(rig->size(), frame), ENDO_CALIBRATION_SIZE_MISMATCH, "calibration",
          Text("must be for frames of ", text(frame)), text(rig != nullptr ? rig->size() : Size()));
  const bool resized = !same(picture_, frame_);
  if (!is_raw_ && !resized) return;
  const Rig source = is_raw_ ? *rig : Rig::identity(frame);
  const Border border = is_raw_ ? Border::fading : Border::whole;
  rectifier_.emplace(source.rectifier(source.geometry().scaled(picture_), border));
  checkpoint();
  if (is_raw_ && resized) full_.emplace(source.rectifier(source.geometry(), border));
  checkpoint();
}

void RectifyStage::operator()(const ImageView& left, const ImageView& right, const PlanarView& out_left,
                              const PlanarView& out_right, ChannelOrder order, RectifyScratch& scratch) const {
  if (rectifier_) {
    rectifier_->rectify(left, right, out_left, out_right, order, scratch);
  } else {
    pack(left, right, out_left, out_right, order);
  }
}

}  // namespace endosdk
