// Test rows for the kernels of the frame path.
#include <cmath>
#include <vector>

#include "kernel_work.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {
namespace {

constexpr int width = 331;  // not a multiple of the length of any vector
constexpr int height = 24;

// `wander`, in pixels, is how far apart neighbours of the output lie in the source.
void remap(Output& out, int channels, uint32_t wander) {
  const std::vector<uint8_t> image = bytes(static_cast<size_t>(width * height * channels));
  std::vector<uint32_t> corner(width);
  std::vector<uint16_t> fraction(width);
  for (int i = 0; i < width; ++i) {
    const uint32_t x = (static_cast<uint32_t>(i) + (draws.next() >> 16) % wander) % (width - remap_reach);
    const uint32_t y = (3 + (draws.next() >> 20) % (wander > 4 ? 16 : 1));
    corner[static_cast<size_t>(i)] = y << 16 | x;
    fraction[static_cast<size_t>(i)] = static_cast<uint16_t>((draws.next() >> 8) & 0x7f7f);
  }
  for (const int count : {1, 7, 8, 9, 31, width}) {
    std::vector<uint8_t> planes[3];
    for (auto& plane : planes) plane.assign(static_cast<size_t>(count), 0);
    const RemapSpan span = {corner.data(), fraction.data(), count};
    const ptrdiff_t stride = width * channels;
    compute([&] {
      if (channels == 1) kernels().remap_gray(image.data(), stride, span, planes[0].data());
      else kernels().remap_rgb(image.data(), stride, span, planes[0].data(), planes[1].data(), planes[2].data());
    });
    for (const auto& plane : planes) out.add(plane);
  }
}

void split(Output& out) {
  for (const int count : {1, 15, 16, 17, width}) {
    const std::vector<uint8_t> row = bytes(static_cast<size_t>(3 * count));
    std::vector<uint8_t> planes[3];
    for (auto& plane : planes) plane.assign(static_cast<size_t>(count), 0);
    compute([&] { kernels().split_rgb(row.data(), count, planes[0].data(), planes[1].data(), planes[2].data()); });
    for (const auto& plane : planes) out.add(plane);
  }
}

void reduce(Output& out) {
  for (const int channels : {1, 3}) {
    for (const int factor : {2, 3, 5, 16}) {
      const Reduction reduction = {factor, channels, width / factor};
      const std::vector<uint8_t> image = bytes(static_cast<size_t>(width * channels * factor));
      std::vector<uint16_t> scratch(static_cast<size_t>(reduction.scratch()));
      std::vector<uint8_t> row(static_cast<size_t>(reduction.width * channels));
      compute([&] { kernels().reduce_row(image.data(), width * channels, reduction, scratch.data(), row.data()); });
      out.add(row);
    }
  }
}

void resize(Output& out) {
  for (const float scale : {0.13f, 0.5f, 1.0f, 2.3f}) {
    const std::vector<float> upper = floats(1000 + stretch_reach, 0.0f, 200.0f);
    const std::vector<float> lower = floats(1000 + stretch_reach, 0.0f, 200.0f);
    std::vector<float> value(upper.size()), step(upper.size()), weight = floats(width, 0.0f, 1.0f), row(width);
    std::vector<int32_t> index(width);
    for (int i = 0; i < width; ++i) index[static_cast<size_t>(i)] = static_cast<int32_t>(static_cast<float>(i) * scale);
    compute([&] {
      const int count = static_cast<int>(value.size());
      kernels().blend_rows(upper.data(), lower.data(), 0.37f, 1.7f, count, value.data(), step.data());
      kernels().stretch_row(value.data(), step.data(), index.data(), weight.data(), width, row.data());
    });
    out.add(value);
    out.add(step);
    out.add(row);
  }
}

void joint_bilateral(Output& out) {
  for (const int factor : {2, 3, 8}) {
    constexpr int count = 97;
    constexpr int taps = joint_bilateral_taps;
    const std::vector<uint8_t> view = bytes(static_cast<size_t>(3 * count * factor * factor));
    const size_t pixels = static_cast<size_t>(count * factor);
    std::vector<std::vector<float>> cells;
    JointBilateralRow row = {};
    for (int t = 0; t < taps; ++t) {
      for (int p = 0; p < joint_bilateral_planes; ++p) {
        cells.push_back(floats(count + taps, 0.0f, p < 3 ? 255.0f : 40.0f));
      }
    }
    for (int t = 0; t < taps; ++t) {
      for (int p = 0; p < joint_bilateral_planes; ++p) {
        row.cells[t][p] = cells[static_cast<size_t>(t * joint_bilateral_planes + p)].data();
      }
    }
    const std::vector<float> share = floats(static_cast<size_t>(factor * taps * taps), 0.0f, 1.0f);
    std::vector<int> start(static_cast<size_t>(factor));
    for (int phase = 0; phase < factor; ++phase) start[static_cast<size_t>(phase)] = phase & 1;
    std::vector<float> answer(pixels), mean(count), trust(count), trusted(count);
    for (int channel = 0; channel < 3; ++channel) row.view[channel] = view.data() + static_cast<size_t>(channel) * pixels;
    row.start = start.data();
    row.share = share.data();
    row.factor = factor;
    row.likeness_per_difference = 1.0f / 90.0f;
    row.least_likeness = 0.01f;
    row.count = count;
    row.out = answer.data();
    const std::vector<float> confidence = floats(count, -0.1f, 1.1f);
    compute([&] {
      kernels().joint_bilateral_row(row);
      kernels().mean_cells(view.data(), static_cast<ptrdiff_t>(pixels), factor, count, mean.data());
      kernels().trust_cells(cells[3].data(), confidence.data(), count, trust.data(), trusted.data());
    });
    for (const auto* values : {&answer, &mean, &trust, &trusted}) out.add(*values);
  }
}

void correlation(Output& out) {
  constexpr int cells = width / 2;
  for (const int unit : {1, 2, 3}) {
    const std::vector<uint8_t> view = bytes(static_cast<size_t>(3 * 2 * unit * width * unit));
    std::vector<float> scratch(width), brightness(width);
    BrightnessRow row = {};
    for (int c = 0; c < 3; ++c) row.channel[c] = view.data() + static_cast<size_t>(c * 2 * unit * width * unit);
    row.stride = width * unit;
    row.unit = unit;
    row.count = width;
    row.scratch = scratch.data();
    row.out = brightness.data();
    compute([&] { kernels().brightness_row(row); });
    out.add(brightness);
  }
  const std::vector<float> left = floats(width, 0.0f, 255.0f), right = floats(width, 0.0f, 255.0f);
  std::vector<float> disparity = floats(cells + 2, 0.0f, 60.0f);
  disparity[7] = std::nanf("");
  std::vector<float> scratch(static_cast<size_t>(correlation_sums * (cells + 2 * correlation_reach)));
  std::vector<float> sums(static_cast<size_t>(correlation_sums * cells)), agrees(cells), support(cells), odds(cells), seen(cells), own(cells);
  const MatchRow match = {left.data(), right.data(), width, disparity.data() + 1, cells, scratch.data(), sums.data()};
  const std::vector<float> beyond(sums.size());
  CorrelationRow row = {};
  row.sums[0] = beyond.data();
  for (int i = 1; i < correlation_window; ++i) row.sums[i] = sums.data();
  for (auto& d : row.disparity) d = disparity.data();
  row.cells = cells;
  row.left_noise = 1.5f;
  row.right_noise = 2.0f;
  row.correlation = agrees.data();
  row.support = support.data();
  row.odds = odds.data();
  const std::vector<float> confidence = floats(cells, -0.1f, 1.1f);
  compute([&] {
    kernels().match_row(match);
    kernels().correlation_row(row);
    kernels().trust_row({confidence.data(), support.data(), odds.data(), cells, 1.5f, seen.data(), own.data()});
  });
  for (const auto* values : {&sums, &agrees, &support, &odds, &seen, &own}) out.add(*values);
}

void texture(Output& out) {
  for (const int count : {0, 1, 2, 3, 17, 129, 130, 131, width}) {
    const std::vector<uint8_t> view = bytes(static_cast<size_t>(3 * width));
    std::vector<uint16_t> differences(width);
    compute([&] { kernels().noise_row(view.data(), view.data() + width, view.data() + 2 * width, count, differences.data()); });
    for (const uint16_t value : differences) out.add(std::vector<float>{static_cast<float>(value)});
  }
  const std::vector<float> levels = floats(static_cast<size_t>(tile_cells * width), 0.0f, 255.0f);
  std::vector<float> roughness(width / tile_cells);
  compute([&] { kernels().tile_row({levels.data(), width, width / tile_cells, roughness.data()}); });
  out.add(roughness);
  std::vector<float> correlation = floats(width, -1.0f, 1.0f), sums(width), squares(width), known(width);
  correlation[7] = std::nanf("");
  kernels().add_known(correlation.data(), width, sums.data(), squares.data(), known.data());
  for (const auto* values : {&sums, &squares, &known}) out.add(*values);
}

void motion(Output& out) {
  constexpr size_t cells = motion_patch * motion_patch;
  const std::vector<float> map = floats(static_cast<size_t>((motion_patch + 1) * width), 0.0f, 255.0f);
  const std::vector<float> along_x = floats(cells, -9.0f, 9.0f), along_y = floats(cells, -9.0f, 9.0f), seen = floats(cells, -99.0f, 99.0f);
  std::vector<float> found(cells), sums(2);
  for (const float along : {0.0f, 0.3f}) {
    compute([&] {
      kernels().blend_patch(map.data() + 5, width, along, 0.8f, found.data());
      kernels().motion_sums(found.data(), seen.data(), along_x.data(), along_y.data(), sums.data());
    });
    out.add(found);
    out.add(sums);
  }
}

// The vertical disparity, and the fit that explains it.
void rig(Output& out) {
  constexpr int cells = width / 2;
  constexpr int windows = (cells - 1) / 2;
  constexpr int rows = 9;
  const std::vector<float> left = floats(static_cast<size_t>(rows * width), 0.0f, 255.0f);
  const std::vector<float> right = floats(static_cast<size_t>(rows * width), 0.0f, 255.0f);
  std::vector<float> disparity = floats(cells, 0.0f, 30.0f);
  disparity[9] = std::nanf("");
  const std::vector<float> offset = floats(cells, -1.0f, 1.0f), wanted(cells, 1.0f);
  std::vector<float> sums(static_cast<size_t>(row_step_sums * cells)), step(windows), weight(windows);
  for (int row = 3; row < 6; ++row) {
    kernels().row_step_row({left.data(), right.data(), width, rows, row, cells, disparity.data(), offset.data(), wanted.data(), 1.3f, sums.data()});
  }
  compute([&] { kernels().row_windows({sums.data(), cells, windows, 0.1f, 2.0f, 20.0f, 2.0f, step.data(), weight.data()}); });
  for (const auto* values : {&sums, &step, &weight}) out.add(*values);
  constexpr int count = 19 * fit_lanes;
  std::vector<std::vector<float>> terms;
  FitSums fit{};
  for (int t = 0; t < fit_terms; ++t) {
    terms.push_back(floats(count, -1.0f, 1.0f));
    fit.step[t] = 0.1f;
  }
  for (int t = 0; t < fit_terms; ++t) fit.terms[t] = terms[static_cast<size_t>(t)].data();
  const std::vector<float> rest = floats(count, -1.0f, 1.0f), counts = floats(count, -0.1f, 1.0f);
  std::vector<double> found(fit_sums);
  fit.rest = rest.data();
  fit.weight = counts.data();
  fit.count = count;
  fit.limit = 0.6f;
  fit.sums = found.data();
  for (const Robust robust : {Robust::none, Robust::huber, Robust::tukey}) {
    fit.robust = robust;
    compute([&] { kernels().add_up_fit(fit); });
    for (const double sum : found) out.add(std::vector<float>{static_cast<float>(sum), static_cast<float>(sum - static_cast<double>(static_cast<float>(sum)))});
  }
}

void depth(Output& out) {
  for (const bool metric : {false, true}) {
    std::vector<float> disparity = floats(width, -3.0f, 90.0f);
    const std::vector<float> confidence = floats(width, 0.0f, 1.0f);
    disparity[20] = std::nanf("");
    const std::vector<uint8_t> brightness = bytes(width);
    std::vector<uint8_t> inside_left(width, 1), valid_left(width, 1), valid_right(width, 1), reasons(width);
    for (int i = 40; i < 51; ++i) inside_left[static_cast<size_t>(i)] = 0;
    for (int i = 0; i < 9; ++i) valid_left[static_cast<size_t>(i)] = valid_right[static_cast<size_t>(width - 1 - i)] = 0;
    if (metric) valid_right[100] = 0;
    std::vector<float> z(width), sigma(width);
    const DepthLimits limits = {0.5f, 0.5f, 80.0f, metric, 2400.0f, 1.5f, 20.0f, 400.0f, 0.002f};
    const std::vector<float> own = floats(width, 0.0f, 1.0f);
    const DepthRow row = {disparity.data(),  confidence.data(),  own.data(),     brightness.data(), inside_left.data(),
                          valid_left.data(), valid_right.data(), reasons.data(), z.data(),          sigma.data(), width};
    int valid = 0;
    compute([&] { valid = kernels().depth_row(row, limits); });
    out.add(reasons);
    out.add(z);
    out.add(sigma);
    out.add(std::vector<float>{static_cast<float>(valid)});
  }
}

}  // namespace

const Works& frame_works() {
  static const Works works = {
      {"rectify", [](Output& out) { remap(out, 3, 2); }},
      {"rectify_apart", [](Output& out) { remap(out, 3, 40); }},
      {"rectify_gray", [](Output& out) { remap(out, 1, 9); }},
      {"split", split},
      {"reduce", reduce},
      {"resize", resize},
      {"joint_bilateral", joint_bilateral},
      {"correlation", correlation},
      {"texture", texture},
      {"motion", motion},
      {"rig", rig},
      {"depth", depth},
  };
  return works;
}

}  // namespace endosdk
