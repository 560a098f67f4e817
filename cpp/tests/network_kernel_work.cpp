// Test rows for the kernels behind the functions of model files. Rows have several widths or numbers of cells.
#include <tuple>
#include <utility>
#include <vector>

#include "kernel_work.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {
namespace {

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
    for (const int reach : {1, 2, longest_reach}) {
      ExtremesRow row = {{}, 4, cells, reach, scratch.data(), most.data(), least.data()};
      for (int y = 0; y < row.count; ++y) row.rows[y] = map.data() + y * cells;
      compute([&] { kernels().extremes_row(row); });
      out.add(most);
      out.add(least);
    }
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

void thin(Output& out) {
  constexpr int inputs = 9;
  for (const int outputs : {4, 8}) {
    for (const int cells : {1, 32, 50, 120}) {
      const auto stride = static_cast<size_t>(cells + thin_width);
      const std::vector<float> values = floats(inputs * stride, -2.0f, 2.0f);
      const std::vector<float> weights = floats(static_cast<size_t>(inputs * outputs), -1.0f, 1.0f);
      const std::vector<float> bias = floats(static_cast<size_t>(outputs), -1.0f, 1.0f);
      const float* taps[inputs];
      for (size_t i = 0; i < inputs; ++i) taps[i] = values.data() + i * stride;
      std::vector<float> found(static_cast<size_t>(outputs * cells));
      compute([&] {
        kernels().thin_row({taps, inputs, outputs, weights.data(), bias.data(), -0.5f, cells, found.data(), cells});
      });
      out.add(found);
    }
  }
}

void add(Output& out) {
  for (const int count : {1, 31, 64, 1000}) {
    const std::vector<uint8_t> a = bytes(static_cast<size_t>(count));
    const std::vector<uint8_t> b = bytes(static_cast<size_t>(count));
    std::vector<uint8_t> found(static_cast<size_t>(count));
    compute([&] { kernels().add_bytes(a.data(), b.data(), {1.25f, 0.75f, -130.0f, 3.0f}, count, found.data()); });
    out.add(found);
  }
}

void confidence(Output& out) {
  for (const int cells : {1, 9, 70}) {
    const std::vector<float> scale = floats(static_cast<size_t>(cells), -4.6f, 4.6f);
    const std::vector<float> beside = floats(static_cast<size_t>(cells), -4.6f, 4.6f);
    std::vector<float> mixed(static_cast<size_t>(cells + 2));
    std::vector<float> found(static_cast<size_t>(2 * cells));
    compute([&] { kernels().confidence_row({scale.data(), beside.data(), cells, mixed.data() + 1, found.data()}); });
    out.add(found);
  }
}

void logarithms(Output& out) {
  for (const int count : {1, 17, 120}) {
    const std::vector<float> values = floats(static_cast<size_t>(count), 0.0f, 200.0f);
    std::vector<float> found(static_cast<size_t>(count));
    compute([&] { kernels().log_row(values.data(), 0.0625f, 0.02f, count, found.data()); });
    out.add(found);
  }
}

}  // namespace

const Works& network_works() {
  static const Works works = {
      {"smaller", smaller},   {"compare", compare},         {"solve", solve},
      {"extremes", extremes}, {"soft_argmin", soft_argmin}, {"choose", choose},
      {"thin", thin},         {"confidence", confidence},   {"logarithms", logarithms},
      {"add", add},
  };
  return works;
}

}  // namespace endosdk
