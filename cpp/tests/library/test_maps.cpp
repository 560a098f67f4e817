// What a frame gives: disparity, depth, reasons and rectified pictures, whatever the layout of its pixels.
#include <algorithm>
#include <cmath>

#include "frame.hpp"

namespace {

void finds_the_disparity_of_a_plane(const Places& at) {
  const Opened estimator(at);
  Output out(pixels);
  CHECK(endo_prepare(estimator.get(), width, height) == ENDO_OK);
  CHECK(estimator.predict(Pair(width, height, 9), out) == ENDO_OK);
  CHECK(std::fabs(middle(out.disparity) - 9.0f) < 0.5f);
  CHECK(out.result.frame == 1 && out.result.quality == ENDO_QUALITY_OK && out.result.valid_share > 0.5);
  CHECK(out.result.session_ms > 0.0 && out.result.late == 0);
  for (size_t i = 0; i < pixels; ++i) {
    const long wanted = out.reasons[i] != 0 ? 0 : std::lround(256.0 * static_cast<double>(out.disparity[i]));
    CHECK(std::labs(out.disparity_u16[i] - wanted) <= 1);
  }
}

void a_rig_gives_depth(const Places& at) {
  const Opened estimator(at);
  Output out(pixels, true);
  const Pair pair(width, height, 9);
  expect(estimator.predict(pair, out), ENDO_CALIBRATION_REQUIRED, "endo_set_calibration");
  endo_geometry geometry{};
  geometry.struct_size = sizeof geometry;
  expect(endo_get_geometry(estimator.get(), &geometry), ENDO_CALIBRATION_REQUIRED, "calibration");

  const endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  CHECK(endo_get_geometry(estimator.get(), &geometry) == ENDO_OK);
  CHECK(geometry.rectifies == 1 && geometry.focal_px > 0.0 && std::fabs(geometry.baseline_mm - 4.6) < 0.01);
  CHECK(estimator.predict(pair, out) == ENDO_OK);
  for (size_t i = 0; i < pixels; ++i) {
    CHECK(std::isnan(out.depth[i]) == (out.reasons[i] != 0) && std::isnan(out.sigma[i]) == (out.reasons[i] != 0));
    if (out.reasons[i] != 0) continue;
    const double depth = geometry.focal_px * geometry.baseline_mm / (static_cast<double>(out.disparity[i]) + geometry.doffs);
    CHECK(std::fabs(static_cast<double>(out.depth[i]) - depth) <= 1e-5 * depth);
    CHECK(std::fabs((depth < 6553.5 ? depth : 0.0) - 0.1 * out.depth_u16[i]) <= 0.06);
  }
  expect(estimator.predict(Pair(width, height + 8, 9), out), ENDO_INVALID_ARGUMENT, "capacity");
  Output larger(pixels + 8 * width, true);
  expect(estimator.predict(Pair(width, height + 8, 9), larger), ENDO_CALIBRATION_SIZE_MISMATCH, "160x104");
  CHECK(endo_set_calibration(estimator.get(), nullptr) == ENDO_OK);
  expect(estimator.predict(pair, out), ENDO_CALIBRATION_REQUIRED, "depth");
}

void surfaces_beyond_the_range_are_out_of_range(const Places& at) {
  const auto share = [&](int disparity) {
    const Opened estimator(at);
    Output out(pixels);
    CHECK(estimator.predict(Pair(width, height, disparity), out) == ENDO_OK);
    const auto marked = std::count_if(out.reasons.begin(), out.reasons.end(),
                                      [](int r) { return (r & ENDO_REASON_OUT_OF_RANGE) != 0; });
    return static_cast<double>(marked) / static_cast<double>(pixels);
  };
  CHECK(share(9) < 0.02);
  CHECK(share(31) > 0.4);  // the tiny model's last disparity
}

// A plane with a nearer surface, glare, a part without texture and a dark rim, as the left or the right camera sees it.
std::vector<uint8_t> view_with_everything(int w, int h, bool right) {
  const int far_px = right ? 9 : 0;
  const int near_px = right ? 24 : 0;
  std::vector<uint8_t> view = plane(w, h, far_px);
  const std::vector<uint8_t> nearer = plane(w, h, near_px + 1000);
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      const auto within = [&](int left, int top, int wide, int high) {
        return x >= left && x < left + wide && y >= top && y < top + high;
      };
      const size_t first = static_cast<size_t>(3 * (y * w + x));
      const auto fill = [&](uint8_t value) { std::fill_n(view.begin() + static_cast<ptrdiff_t>(first), 3, value); };
      if (within(150 - near_px, 80, 80, 70)) std::copy_n(nearer.begin() + static_cast<ptrdiff_t>(first), 3, view.begin() + static_cast<ptrdiff_t>(first));
      if (within(90 - far_px, 40, 30, 30)) fill(255);
      if (within(100 - far_px, 160, 40, 40)) fill(90);
      if (std::hypot(x - w / 2, y - h / 2) > 150.0) fill(6);
    }
  }
  return view;
}

void every_pixel_without_depth_has_a_reason_and_every_frame_a_status(const Places& at) {
  constexpr int w = 320;
  constexpr int h = 240;
  constexpr size_t count = size_t{w} * h;
  const Opened estimator(at);
  endo_calibration rig = raw_rig(w, h);
  remove_distortion(rig);
  rig.translation[1] = 0.0;
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  Output out(count, true);
  const auto reasons_of = [&](const Pair& pair) {
    CHECK(estimator.predict(pair, out) == ENDO_OK);
    int seen = 0;
    size_t valid = 0;
    for (size_t i = 0; i < count; ++i) {
      const bool has_depth = std::isfinite(out.depth[i]);
      CHECK(has_depth == (out.reasons[i] == 0) && std::isfinite(out.sigma[i]) == has_depth);
      CHECK(has_depth || (std::isnan(out.depth[i]) && out.disparity_u16[i] == 0 && out.depth_u16[i] == 0));
      seen |= out.reasons[i];
      valid += has_depth ? 1 : 0;
    }
    CHECK(out.result.valid_share == static_cast<double>(valid) / static_cast<double>(count));
    return seen;
  };
  Pair pair(w, h, 9);
  pair.left = view_with_everything(w, h, false);
  pair.right = view_with_everything(w, h, true);
  int every = 0;
#define ADD(name, bit, meaning) every |= (bit);
  ENDO_REASONS(ADD)
#undef ADD
  CHECK(reasons_of(pair) == every);  // each of them, and no other bit
  CHECK(out.result.valid_share > 0.5 && out.result.quality == ENDO_QUALITY_OK && out.result.causes == 0);

  std::fill(pair.right.begin(), pair.right.end(), uint8_t{0});
  CHECK(reasons_of(pair) != 0);
  CHECK(out.result.valid_share == 0.0 && out.result.quality == ENDO_QUALITY_INVALID && out.result.causes != 0);
}

// What a device sees when a camera fails: the frame must not pass for a good one.
void views_that_do_not_belong_together_are_invalid(const Places& at) {
  struct Lines {
    std::string seen;
    static void add(void* self, int32_t, const char* line) { static_cast<Lines*>(self)->seen += line; }
  } lines;
  endo_options options = default_options(at);
  options.log = Lines::add;
  options.log_context = &lines;
  const Opened estimator(at, options);
  const Pair good(width, height, 9);
  const auto quality = [&](const std::vector<uint8_t>& left, const std::vector<uint8_t>& right) {
    Pair pair = good;
    pair.left = left;
    pair.right = right;
    Output out(pixels);
    CHECK(estimator.predict(pair, out) == ENDO_OK);
    return out.result.quality;
  };
  const std::vector<uint8_t> black(3 * pixels, 0);
  const std::vector<uint8_t> gray(3 * pixels, 128);
  const std::vector<uint8_t> other_scene(good.left.rbegin(), good.left.rend());
  CHECK(quality(good.left, good.right) == ENDO_QUALITY_OK && lines.seen.empty());
  for (const auto* covered : {&black, &gray}) {
    CHECK(quality(*covered, *covered) == ENDO_QUALITY_INVALID);
    CHECK(quality(*covered, good.right) == ENDO_QUALITY_INVALID);
    CHECK(quality(good.left, *covered) == ENDO_QUALITY_INVALID);
  }
  CHECK(quality(good.left, good.left) == ENDO_QUALITY_INVALID);
  CHECK(quality(good.left, other_scene) == ENDO_QUALITY_INVALID);
  CHECK(lines.seen.find("do not show the same") != std::string::npos);
  lines.seen.clear();
  CHECK(quality(good.left, good.right) == ENDO_QUALITY_OK && lines.seen.empty());
}

void every_layout_of_a_frame_gives_the_same(const Places& at) {
  const Opened estimator(at);
  const Pair pair(width, height, 9);
  Output plain(pixels);
  CHECK(estimator.predict(pair, plain) == ENDO_OK);
  constexpr int pitch = 3 * width + 17;
  std::vector<uint8_t> left(size_t{pitch} * height);
  std::vector<uint8_t> right(left.size());
  for (int y = 0; y < height; ++y) {  // bottom-up, padded rows, blue first
    for (int x = 0; x < 3 * width; ++x) {
      const size_t from = static_cast<size_t>(3 * width * y + x / 3 * 3 + 2 - x % 3);
      const size_t to = static_cast<size_t>(pitch * (height - 1 - y) + x);
      left[to] = pair.left[from];
      right[to] = pair.right[from];
    }
  }
  const size_t top = size_t{pitch} * (height - 1);
  const endo_image l = {sizeof l, ENDO_BGR8, left.data() + top, width, height, -pitch};
  const endo_image r = {sizeof r, ENDO_BGR8, right.data() + top, width, height, -pitch};
  Output turned(pixels);
  CHECK(endo_predict(estimator.get(), &l, &r, &turned.result) == ENDO_OK);
  CHECK(turned.disparity == plain.disparity && turned.confidence == plain.confidence && turned.reasons == plain.reasons);

  const endo_image gray = {sizeof gray, ENDO_GRAY8, pair.left.data(), width, height, 0};
  CHECK(endo_predict(estimator.get(), &gray, &gray, &turned.result) == ENDO_OK);
  CHECK(std::fabs(middle(turned.disparity)) < 0.5f);
}

void the_rectified_pair_can_be_seen(const Places& at) {
  const Opened estimator(at);
  const Pair pair(width, height, 9);
  std::vector<uint8_t> left(3 * pixels);
  expect(endo_get_rectified(estimator.get(), left.data(), nullptr, left.size()), ENDO_INVALID_ARGUMENT, "no frame yet");
  Output out(pixels);
  CHECK(estimator.predict(pair, out) == ENDO_OK);
  expect(endo_get_rectified(estimator.get(), left.data(), nullptr, 5), ENDO_INVALID_ARGUMENT, "capacity");
  CHECK(endo_get_rectified(estimator.get(), left.data(), nullptr, left.size()) == ENDO_OK);
  CHECK(left == pair.left);

  // Neither a call that failed nor a stream of another size takes it away.
  expect(estimator.predict(Pair(width, height + 8, 9), out), ENDO_INVALID_ARGUMENT, "capacity");
  const endo_calibration other = raw_rig(width + 32, height);
  endo_stream* stream = nullptr;
  CHECK(endo_stream_open(estimator.get(), 2 * width, 2 * height, nullptr, &stream) == ENDO_OK);
  std::vector<char> report(8192);
  CHECK(endo_get_diagnostics(estimator.get(), report.data(), report.size(), nullptr) == ENDO_OK);
  CHECK(std::strstr(report.data(), "\"network_width\":160,\"network_height\":96,") != nullptr);
  std::fill(left.begin(), left.end(), uint8_t{0});
  CHECK(endo_get_rectified(estimator.get(), left.data(), nullptr, left.size()) == ENDO_OK && left == pair.left);
  endo_stream_close(stream);

  CHECK(endo_set_calibration(estimator.get(), &other) == ENDO_OK);
  Output wide(pixels + 32 * height);
  const Pair wide_pair(width + 32, height, 9);
  CHECK(estimator.predict(wide_pair, wide) == ENDO_OK);
  expect(estimator.predict(pair, wide), ENDO_CALIBRATION_SIZE_MISMATCH, "192x96");
  std::vector<uint8_t> seen(3 * (pixels + 32 * height));
  CHECK(endo_get_rectified(estimator.get(), seen.data(), nullptr, seen.size()) == ENDO_OK);

  const endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  expect(endo_get_rectified(estimator.get(), left.data(), nullptr, left.size()), ENDO_INVALID_ARGUMENT, "no frame yet");
}

void a_result_is_measured_with_its_own_rig(const Places& at) {
  const Opened estimator(at);
  endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  Output out(pixels, true);
  CHECK(estimator.predict(Pair(width, height, 9), out) == ENDO_OK && out.reasons[pixels / 2 + width / 2] == 0);
  endo_point point{};
  point.struct_size = sizeof point;
  const auto measure = [&] { return endo_point_at(&rig, &out.result, width / 2, height / 2, &point); };
  CHECK(measure() == ENDO_OK && std::fabs(point.xyz[2] - static_cast<double>(middle(out.depth))) < 0.1);
  rig.translation[0] -= 0.1;
  expect(measure(), ENDO_INVALID_ARGUMENT, "calibration: must be the one that the result was computed with");
  out.result.identity = {};  // a result that does not say
  CHECK(measure() == ENDO_OK);
}

// A rectified rig with principal points apart: the network's right view is moved, but not the one that the maps go with.
void a_rectified_pair_comes_back_as_it_is(const Places& at) {
  const Opened estimator(at);
  endo_calibration rig = raw_rig(width, height);
  remove_distortion(rig);
  rig.translation[1] = 0.0;
  rig.right_matrix[2] += 6.0;
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  endo_geometry geometry{};
  geometry.struct_size = sizeof geometry;
  CHECK(endo_get_geometry(estimator.get(), &geometry) == ENDO_OK && geometry.rectifies == 0 && geometry.doffs == 6.0);
  const Pair pair(width, height, 9);
  const endo_image l = pair.left_image();
  const endo_image r = pair.right_image();
  std::vector<uint8_t> left(3 * pixels);
  std::vector<uint8_t> right(3 * pixels);
  CHECK(endo_rectify(estimator.get(), &l, &r, left.data(), right.data(), left.size()) == ENDO_OK);
  CHECK(left == pair.left && right == pair.right);
  std::vector<uint8_t> both(3 * pixels + 1);
  CHECK(endo_rectify(estimator.get(), &l, &r, both.data(), both.data() + 1, left.size()) == ENDO_INVALID_ARGUMENT);
  CHECK(std::string(endo_last_error()).find("the right output: must not lie in the memory of the left output; got ") == 0);
  CHECK(endo_rectify(estimator.get(), &l, &r, nullptr, both.data(), left.size()) == ENDO_OK);
  Output out(pixels);
  CHECK(estimator.predict(pair, out) == ENDO_OK && std::fabs(middle(out.disparity) - 9.0f) < 0.5f);
  CHECK(endo_get_rectified(estimator.get(), left.data(), right.data(), left.size()) == ENDO_OK);
  CHECK(left == pair.left && right != pair.right);
}

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  finds_the_disparity_of_a_plane(at);
  a_rig_gives_depth(at);
  surfaces_beyond_the_range_are_out_of_range(at);
  every_pixel_without_depth_has_a_reason_and_every_frame_a_status(at);
  views_that_do_not_belong_together_are_invalid(at);
  every_layout_of_a_frame_gives_the_same(at);
  the_rectified_pair_can_be_seen(at);
  a_rectified_pair_comes_back_as_it_is(at);
  a_result_is_measured_with_its_own_rig(at);
}
