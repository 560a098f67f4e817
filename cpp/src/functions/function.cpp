#include "functions/function.hpp"

#include <atomic>
#include <iterator>
#include <string>

#include "platform/errors.hpp"
#include "platform/lists.hpp"

namespace endosdk {
namespace {

// A file may ask for any shape, also for one without values; loops count in 32 bits.
constexpr int64_t longest_shape_side = 1 << 20;
constexpr int64_t most_values = 1 << 28;

std::atomic<int> calls_at_once{1};

constexpr Element bytes = Element::uint8;
constexpr Element floats = Element::float32;

constexpr FunctionKind kinds[] = {
    {"ReadViews", {bytes, bytes}, 2, {bytes, floats}, 2, make_read_views},
    {"ReadSmaller", {bytes, bytes}, 2, {floats, floats}, 2, make_read_smaller},
    {"PlanesAroundBytes", {bytes}, 1, {bytes}, 1, make_planes_around},
    {"AnswerOfPlanes", {floats, floats}, 2, {floats, floats}, 2, make_answer_of_planes},
    {"CompareViews", {floats, floats}, 2, {floats, floats, floats}, 3, make_compare_views},
    {"ChooseSurface", {floats, floats, floats, floats}, 4, {floats, floats, floats}, 3, make_choose_surface},
    {"VolumeOfPairsBytes", {bytes, floats, bytes, bytes, floats, bytes, floats, bytes}, 8, {bytes}, 1, make_volume_of_pairs},
    {"ThinConvolution", {floats, floats, floats}, 3, {floats}, 1, make_thin_convolution},
    {"MatchEvidence", {floats, floats}, 2, {floats}, 1, make_match_evidence},
    {"CluesOfAnswer", {floats, floats, floats, floats}, 4, {floats, floats}, 2, make_clues_of_answer},
    {"ScaleOfErrors",
     {floats, floats, floats, floats, floats, floats, floats, floats, floats, floats, floats},
     11,
     {floats},
     1,
     make_scale_of_errors},
    {"ConfidenceOfScale", {floats}, 1, {floats}, 1, make_confidence_of_scale},
};

}  // namespace

Shape::Shape(size_t count) : count_(count) {
  require(count <= most_sides, ENDO_INFERENCE_FAILED, "shape", Text("must have at most ", most_sides, " sides"), count);
}

std::ostream& operator<<(std::ostream& out, const Shape& shape) {
  std::string sides;
  for (const int64_t side : shape) append_item(sides, side < 0 ? "any" : std::to_string(side));
  return out << "[" << sides << "]";
}

Scratch::Lent::Lent(Scratch& owner, size_t count) : owner_(owner), values_(owner.lend(count)) {}

Scratch::Lent::~Lent() {
  const std::lock_guard lock(owner_.mutex_);
  owner_.spare_.push_back(std::move(values_));
  --owner_.lent_;
}

Scratch::Expect::Expect(int calls) { calls_at_once = calls; }

Scratch::Expect::~Expect() { calls_at_once = 1; }

std::vector<float> Scratch::lend(size_t count) {
  const std::lock_guard lock(mutex_);
  if (calls_ == 0) calls_ = static_cast<size_t>(calls_at_once);
  const size_t all = std::max(lent_ + 1, calls_);
  spare_.reserve(all);
  while (lent_ + spare_.size() < all) spare_.emplace_back();
  for (std::vector<float>& spare : spare_) {
    if (spare.size() < count) spare.resize(count);
  }
  std::vector<float> values = std::move(spare_.back());
  spare_.pop_back();
  ++lent_;
  return values;
}

const FunctionKind* function_kind(int i) { return i < static_cast<int>(std::size(kinds)) ? &kinds[i] : nullptr; }

float positive_setting(const FunctionSettings& settings, const char* name) {
  const double found = settings(name);
  require(found > 0.0, ENDO_MODEL_METADATA, name, "must be above 0", found);
  return static_cast<float>(found);
}

void FunctionCall::parallel(int64_t count, RowBody body) {
  require(count <= most_values, ENDO_INFERENCE_FAILED, "shape", Text("must have at most ", most_values, " rows"), count);
  run(static_cast<int>(count), body);
}

void check_shape(const char* argument, const Shape& found, const Shape& wanted) {
  bool fits = found.size() == wanted.size();
  for (size_t i = 0; fits && i < wanted.size(); ++i) fits = wanted[i] < 0 ? found[i] <= longest_shape_side : found[i] == wanted[i];
  require(fits, ENDO_INFERENCE_FAILED, argument, Text("must have the shape ", wanted), found);
}

}  // namespace endosdk
