// From two camera frames of one size to the pictures that the network sees.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "frame_path/frame.hpp"
#include "images/image.hpp"
#include "images/rectify.hpp"
#include "geometry/pose_error.hpp"
#include "geometry/rig.hpp"
#include "maps/matched_views.hpp"
#include "maps/overlays.hpp"

namespace endosdk {

class RectifyStage {
 public:
  // Raw frames of a rig are rectified; frames without a rig, or of a rectified one, are only repacked, or resized when
  // the network works at another size. A rectified rig whose principal points lie apart sees what is beyond
  // focal * baseline / doffs at negative disparities, which no network finds: its right view is moved by doffs. Without a
  // network the pictures are those that the maps lie over, at their own size, and nothing is moved.
  // Maps of large frames take a while: `checkpoint` is called between them, and may throw.
  // `corrected`: turns of the right camera against its calibration that the rectification undoes; they need a rig.
  RectifyStage(Size frame, const Rig* rig, std::optional<Size> network, const std::function<void()>& checkpoint,
               const PoseVector& corrected = {});
  RectifyStage(const RectifyStage&) = delete;
  RectifyStage& operator=(const RectifyStage&) = delete;

  Size frame() const { return frame_; }
  Size picture() const { return picture_; }

  void operator()(const ImageView& left, const ImageView& right, const PlanarView& out_left, const PlanarView& out_right,
                  ChannelOrder order, RectifyScratch& scratch) const;

  const PoseVector& corrected() const { return corrected_; }

  // Frame pixels by which the right view of a rectified rig is moved to the left.
  double right_shift() const { return right_shift_; }

  // The same, as it follows from the rig; null: none.
  static double right_shift_of(const Rig* rig);

  // Of view of left and right, as the rig states them; null where it does not.
  MatchedViews::Fields fields() const { return {fields_[0] ? &*fields_[0] : nullptr, fields_[1] ? &*fields_[1] : nullptr}; }

  const BlocksOfCells& blocks() const { return blocks_; }

  // Masks of the frame's size; null when every pixel is valid.
  const uint8_t* valid_left() const { return masks_[0]; }
  const uint8_t* valid_right() const { return masks_[1]; }

 private:
  // Places in the raw frame that the middles of cells show, row by row. A null rig: the frames are only resized.
  std::vector<Point> places_of_cells(const Rig* rig, bool right) const;
  void place_field(const Rig& rig, bool right);
  void place_blocks(const Rig* rig);

  Size frame_;
  Size picture_;
  PoseVector corrected_{};
  double right_shift_ = 0.0;
  bool moves_ = false;  // whether pixels come to lie elsewhere, other than by resizing
  std::optional<Rectifier> rectifier_;
  // The masks belong to the maps that are returned, which keep the size of the frames: of other pictures they are not those
  // of the rectifier.
  std::vector<uint8_t> own_masks_[2];
  const uint8_t* masks_[2] = {nullptr, nullptr};
  std::optional<FieldOfView> fields_[2];
  BlocksOfCells blocks_;
};

// Pairs of frames as a stage gives them, in tight RGB rows. It keeps its memory from one pair to the next.
class RowsOfPairs {
 public:
  explicit RowsOfPairs(std::shared_ptr<const RectifyStage> stage);

  const RectifyStage& stage() const { return *stage_; }
  void write(const FramePair& pair, uint8_t* left, uint8_t* right);

 private:
  std::shared_ptr<const RectifyStage> stage_;
  std::vector<uint8_t> planes_;
  RectifyScratch scratch_;
};

}  // namespace endosdk
