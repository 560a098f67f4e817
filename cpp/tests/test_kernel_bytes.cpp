// Every kernel on pseudo-random rows: all sets of this processor must give the same bytes, and so must other processors,
// which is what the printed hashes are for.
//
//     test_kernel_bytes                      check, and print a hash for each kernel
//     test_kernel_bytes SET KERNEL REPEATS   compute each row so often, for counting the instructions of the kernel alone
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "check.hpp"
#include "kernels/kernels.hpp"
#include "platform/sha256.hpp"

using namespace endosdk;

namespace {

constexpr int width = 331;  // no multiple of any vector
constexpr int height = 24;

uint32_t state = 1;
uint32_t draw() { return state = state * 1664525u + 1013904223u; }
float draw_float(float low, float high) {
  return low + (high - low) * static_cast<float>(draw() >> 8) * (1.0f / static_cast<float>(1 << 24));
}

int repeats = 1;

// Kernels read nothing that they have written, so a row may be computed again.
template <typename Kernel>
void compute(const Kernel& kernel) {
  for (int i = 0; i < repeats; ++i) kernel();
}

std::vector<uint8_t> bytes(size_t count) {
  std::vector<uint8_t> values(count);
  for (uint8_t& value : values) value = static_cast<uint8_t>(draw() >> 24);
  return values;
}

std::vector<float> floats(size_t count, float low, float high) {
  std::vector<float> values(count);
  for (float& value : values) value = draw_float(low, high);
  return values;
}

// What a kernel wrote. Processors differ in the sign of what is no number, which means nothing.
class Output {
 public:
  void add(const std::vector<uint8_t>& values) { content_.append(values.begin(), values.end()); }

  void add(std::vector<float> values) {
    for (float& value : values) value = std::isnan(value) ? std::nanf("") : value;
    content_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
  }

  std::string hash() const { return sha256(content_.data(), content_.size()); }

 private:
  std::string content_;
};

// `wander` in pixels: how far neighbours in the output lie apart in the source.
void remap(Output& out, int channels, uint32_t wander) {
  const std::vector<uint8_t> image = bytes(static_cast<size_t>(width * height * channels));
  std::vector<uint32_t> corner(width);
  std::vector<uint16_t> fraction(width);
  for (int i = 0; i < width; ++i) {
    const uint32_t x = (static_cast<uint32_t>(i) + (draw() >> 16) % wander) % (width - remap_reach);
    const uint32_t y = (3 + (draw() >> 20) % (wander > 4 ? 16 : 1));
    corner[static_cast<size_t>(i)] = y << 16 | x;
    fraction[static_cast<size_t>(i)] = static_cast<uint16_t>((draw() >> 8) & 0x7f7f);
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

// What is left across the rows, and the fit that explains it.
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
    kernels().row_step_row({left.data(), right.data(), width, rows, row, cells, disparity.data(), offset.data(), wanted.data(), sums.data()});
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

// Of the functions of model files: one row of each width, or so many cells.
void smaller(Output& out) {
  for (const int groups : {1, 7, 40}) {
    const std::vector<uint8_t> view = bytes(static_cast<size_t>(6 * 4 * groups));
    const uint8_t* rows[6];
    for (int i = 0; i < 6; ++i) rows[i] = view.data() + 4 * groups * i;
    std::vector<float> pixels(static_cast<size_t>(9 * groups));
    std::vector<float> bright(static_cast<size_t>(3 * groups));
    compute([&] {
      kernels().smaller_row({{rows[0], rows[1], rows[2]}, {rows[3], rows[4], rows[5]}, 5.0f / 6.0f, groups, pixels.data(),
                             1.0f / 9.0f, true, bright.data()});
    });
    out.add(pixels);
    out.add(bright);
  }
}

void compare(Output& out) {
  for (const int columns : {2, 4}) {
    for (const int cells : {1, 2, 33, 120}) {
      const int pixels = comparison_cell * cells;
      const std::vector<float> left = floats(static_cast<size_t>(pixels), 0.0f, 255.0f);
      const std::vector<float> right = floats(static_cast<size_t>(pixels), 0.0f, 255.0f);
      const std::vector<float> upper = floats(static_cast<size_t>(cells), 0.0f, 90.0f);
      const std::vector<float> lower = floats(static_cast<size_t>(cells), 0.0f, 90.0f);
      std::vector<float> scratch(static_cast<size_t>(CompareRow::scratch_values(pixels)));
      std::vector<float> means(static_cast<size_t>(view_moments * pixels / columns));
      CompareRow row = {left.data(), right.data(), pixels, upper.data(), lower.data(), 0.375f, columns, 0.125f, true,
                        scratch.data(), {}};
      for (int i = 0; i < view_moments; ++i) row.means[i] = means.data() + i * (pixels / columns);
      compute([&] { kernels().compare_row(row); });
      out.add(means);
    }
  }
}

void solve(Output& out) {
  constexpr int rows = 5;
  constexpr int reach = 3;
  for (const int cells : {1, 8, 45, 120}) {
    const size_t plane = static_cast<size_t>(rows * cells);
    const std::vector<float> moments = floats(view_moments * plane, -20.0f, 20.0f);
    const std::vector<float> share = floats(static_cast<size_t>(cells), 0.01f, 0.05f);
    std::vector<float> scratch(static_cast<size_t>(SolveRow::scratch_values(cells, reach)));
    std::vector<float> step(static_cast<size_t>(cells)), texture = step, mismatch = step;
    SolveRow row = {{},    static_cast<ptrdiff_t>(plane), rows, cells, reach,          share.data(), 4.0f,
                    0.25f, 0.125f,                        2.0f, scratch.data(), step.data(), texture.data(), mismatch.data()};
    for (int y = 0; y < rows; ++y) row.rows[y] = moments.data() + y * cells;
    compute([&] { kernels().solve_row(row); });
    for (const auto& found : {step, texture, mismatch}) out.add(found);
  }
}

void extremes(Output& out) {
  for (const int cells : {1, 2, 7, 120}) {
    const std::vector<float> map = floats(static_cast<size_t>(4 * cells), 0.0f, 120.0f);
    std::vector<float> scratch(static_cast<size_t>(ExtremesRow::scratch_values(cells)));
    std::vector<float> most(static_cast<size_t>(cells)), least = most;
    ExtremesRow row = {{}, 4, cells, scratch.data(), most.data(), least.data()};
    for (int y = 0; y < row.count; ++y) row.rows[y] = map.data() + y * cells;
    compute([&] { kernels().extremes_row(row); });
    out.add(most);
    out.add(least);
  }
}

void soft_argmin(Output& out) {
  for (const int planes : {1, 5, 22}) {
    const std::vector<float> cost = floats(static_cast<size_t>(planes * soft_argmin_width), -30.0f, 30.0f);
    std::vector<float> index, value;
    for (int i = 0; i < planes; ++i) {
      index.push_back(static_cast<float>(i));
      value.push_back(static_cast<float>(i < 12 ? i : 2 * i - 12));
    }
    std::vector<float> mean(soft_argmin_width), excess = mean;
    compute([&] {
      kernels().soft_argmin_cells(
          {cost.data(), index.data(), value.data(), planes, 2.0f, 12.0f, 2.0f, mean.data(), excess.data()});
    });
    out.add(mean);
    out.add(excess);
  }
}

void choose(Output& out) {
  for (const int cells : {1, 9, 60}) {
    const auto drawn = [&](float low, float high) { return floats(static_cast<size_t>(cells), low, high); };
    const std::vector<float> disparity = drawn(0.0f, 120.0f), beside = drawn(0.0f, 120.0f);
    const std::vector<float> near = drawn(0.0f, 120.0f), far = drawn(0.0f, 120.0f);
    std::vector<std::vector<float>> parts;
    for (int i = 0; i < 10; ++i) parts.push_back(drawn(-6.0f, 6.0f));
    std::vector<float> mixed(static_cast<size_t>(cells + 2));
    std::vector<float> answer(static_cast<size_t>(2 * cells)), change = answer, rough = answer;
    const auto both = [&](size_t first) { return std::pair(parts[first].data(), parts[first + 1].data()); };
    ChooseRow row = {};
    row.disparity = disparity.data();
    row.beside = beside.data();
    std::tie(row.correction[0], row.correction[1]) = both(0);
    std::tie(row.belief[0], row.belief[1]) = both(2);
    std::tie(row.to_near[0], row.to_near[1]) = both(4);
    std::tie(row.to_far[0], row.to_far[1]) = both(6);
    std::tie(row.step[0], row.step[1]) = both(8);
    row.near = near.data();
    row.far = far.data();
    row.cells = cells;
    row.mixed = mixed.data() + 1;
    row.answer = answer.data();
    row.change = change.data();
    row.rough = rough.data();
    compute([&] { kernels().choose_row(row); });
    for (const auto& found : {answer, change, rough}) out.add(found);
  }
}

const std::map<std::string, std::function<void(Output&)>> works = {
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
    {"smaller", smaller},
    {"compare", compare},
    {"solve", solve},
    {"extremes", extremes},
    {"soft_argmin", soft_argmin},
    {"choose", choose},
};

std::string hash_of(const char* set, const std::function<void(Output&)>& work) {
  choose_kernels(set);
  state = 1;
  Output out;
  work(out);
  return out.hash();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 4) {
    repeats = std::atoi(argv[3]);
    hash_of(argv[1], works.at(argv[2]));
    return 0;
  }
  for (const auto& [name, work] : works) {
    const std::string expected = hash_of("plain", work);
    std::printf("%s %s\n", name.c_str(), expected.c_str());
    for (int i = 0; kernel_set(i) != nullptr; ++i) {
      const char* set = kernel_set(i);
      if (!rejection([&] { choose_kernels(set); }).empty()) continue;
      const bool same = hash_of(set, work) == expected;
      if (!same) std::fprintf(stderr, "%s differs in %s\n", name.c_str(), set);
      CHECK(same);
    }
  }
  return 0;
}
