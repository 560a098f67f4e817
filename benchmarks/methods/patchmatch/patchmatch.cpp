// PatchMatch stereo: Bleyer, Rhemann, Rother, "PatchMatch Stereo - Stereo Matching with Slanted Support Windows", BMVC
// 2011. Each pixel has a plane of its own, found by trying its neighbours' planes, those of the other view, and random
// changes. Random numbers depend on seed, view, round and pixel alone, and rows wait for the row before them, so the
// result does not depend on the number of threads.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <thread>

#include "fill.hpp"
#include "matching_cost.hpp"

namespace patchmatch {

namespace {

class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t stream, std::uint64_t pixel)
      : state_(seed * 0x9e3779b97f4a7c15ULL ^ (stream << 40) ^ pixel) {
    next();
  }
  float between(float low, float high) {
    return low + (high - low) * (static_cast<float>(next() >> 40) * 0x1p-24F);
  }

 private:
  std::uint64_t next() {  // SplitMix64
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15ULL;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }
  std::uint64_t state_;
};

struct Normal {
  float x, y, z;
};

Plane through(int x, int y, float disparity, Normal n) {
  const float length = std::sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
  // A plane seen edge-on has no slope that a window could use.
  const float z = std::max(std::abs(n.z) / length, 0.05F);
  const float a = -n.x / length / z, b = -n.y / length / z;
  return {a, b, disparity - a * static_cast<float>(x) - b * static_cast<float>(y)};
}

Normal normal_of(const Plane& plane) {
  const float length = std::sqrt(plane.a * plane.a + plane.b * plane.b + 1.0F);
  return {-plane.a / length, -plane.b / length, 1.0F / length};
}

// One view on its way to an answer.
struct Side {
  Side(const View& own, const View& match, int direction)
      : view(own), other(match), sign(direction), planes(view.size()), costs(view.size()) {}
  const View& view;
  const View& other;
  int sign;
  std::vector<Plane> planes;
  std::vector<float> costs;
};

class Solver {
 public:
  Solver(const View& left, const View& right, const Settings& settings)
      : settings_(settings), left(left, right, 1), right(right, left, -1) {}

  void run() {
    for (Side* side : {&left, &right}) {
      each_row(false, [&](int y, Window& window, auto wait) { start_row(*side, y, window, wait); });
    }
    for (int round = 0; round < settings_.iterations; ++round) {
      improve(left, right, round);
      improve(right, left, round);
    }
  }

 private:
  Settings settings_;

 public:
  Side left, right;

 private:
  // Run `work` for all rows, in order or in reverse. It is given a function that waits until the row before has
  // passed a column, and returns after reporting its own.
  template <typename Work>
  void each_row(bool reverse, Work work) {
    const int rows = left.view.height, threads = std::max(1, settings_.threads);
    const auto done = std::make_unique<std::atomic<int>[]>(static_cast<std::size_t>(rows));
    auto run = [&](int first) {
      Window window(settings_.radius);
      for (int step = first; step < rows; step += threads) {
        auto turn = [&, step](int passed) {  // this row has passed `passed` columns; may it go on?
          done[static_cast<std::size_t>(step)].store(passed, std::memory_order_release);
          if (step == 0) return;
          const auto& ahead = done[static_cast<std::size_t>(step - 1)];
          while (ahead.load(std::memory_order_acquire) <= passed && passed < left.view.width) std::this_thread::yield();
        };
        work(reverse ? rows - 1 - step : step, window, turn);
      }
    };
    std::vector<std::thread> pool;
    for (int i = 1; i < threads; ++i) pool.emplace_back(run, i);
    run(0);
    for (auto& thread : pool) thread.join();
  }

  template <typename Turn>
  void start_row(Side& side, int y, Window& window, Turn) {
    const int width = side.view.width;
    for (int x = 0; x < width; ++x) {
      const auto here = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      Random random(settings_.seed, side.sign > 0 ? 0 : 1, here);
      const float disparity = random.between(0.0F, static_cast<float>(settings_.max_disparity));
      const Normal n{random.between(-1, 1), random.between(-1, 1), random.between(-1, 1)};
      side.planes[here] = through(x, y, disparity, n);
      window.centre(side.view, x, y);
      side.costs[here] =
          window.cost(side.view, side.other, side.planes[here], side.sign, settings_.max_disparity, 1e30F);
    }
  }

  void improve(Side& side, const Side& opposite, int round) {
    const int width = side.view.width, height = side.view.height;
    const bool reverse = round % 2 == 1;
    const auto guests = planes_of_matches(side, opposite);
    each_row(reverse, [&](int y, Window& window, auto turn) {
      const int above = reverse ? y + 1 : y - 1;
      for (int step = 0; step < width; ++step) {
        turn(step);
        const int x = reverse ? width - 1 - step : step, beside = reverse ? x + 1 : x - 1;
        const std::ptrdiff_t here = static_cast<std::ptrdiff_t>(y) * width + x;
        window.centre(side.view, x, y);
        if (beside >= 0 && beside < width) consider(side, window, x, y, side.planes[index(y, beside)]);
        if (above >= 0 && above < height) consider(side, window, x, y, side.planes[index(above, x)]);
        for (std::ptrdiff_t i = guests.first[here]; i < guests.first[here + 1]; ++i) {
          consider(side, window, x, y, guests.planes[static_cast<std::size_t>(i)]);
        }
        refine(side, window, x, y, round);
      }
      turn(width);
    });
  }

  struct Guests {
    std::vector<Plane> planes;
    std::vector<std::ptrdiff_t> first;  // of each pixel, and the end
  };

  // The planes of the other view whose match is this pixel, written as planes of this view.
  Guests planes_of_matches(const Side& side, const Side& opposite) const {
    const int width = side.view.width, height = side.view.height;
    const std::size_t size = side.planes.size();
    std::vector<std::ptrdiff_t> target(size, -1);
    Guests guests{std::vector<Plane>(size), std::vector<std::ptrdiff_t>(size + 2, 0)};
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const int match = x - opposite.sign * static_cast<int>(std::lround(opposite.planes[index(y, x)].at(x, y)));
        if (match < 0 || match >= width) continue;
        target[index(y, x)] = static_cast<std::ptrdiff_t>(index(y, match));
        ++guests.first[index(y, match) + 2];
      }
    }
    for (std::size_t i = 2; i < size + 2; ++i) guests.first[i] += guests.first[i - 1];
    for (std::size_t i = 0; i < size; ++i) {
      if (target[i] < 0) continue;
      const Plane& plane = opposite.planes[i];
      // x' = x - s d(x): the plane d = a x + b y + c becomes (a x' + b y + c) / (1 - s a).
      const float scale = 1.0F / std::max(1.0F - static_cast<float>(opposite.sign) * plane.a, 0.05F);
      auto& slot = guests.first[static_cast<std::size_t>(target[i]) + 1];
      guests.planes[static_cast<std::size_t>(slot++)] = {plane.a * scale, plane.b * scale, plane.c * scale};
    }
    return guests;
  }

  void consider(Side& side, const Window& window, int x, int y, const Plane& plane) const {
    if (plane == side.planes[index(y, x)]) return;  // neighbours often share one already
    const float disparity = plane.at(x, y);
    if (disparity < 0.0F || disparity > static_cast<float>(settings_.max_disparity)) return;
    float& best = side.costs[index(y, x)];
    const float cost = window.cost(side.view, side.other, plane, side.sign, settings_.max_disparity, best);
    if (cost < best) {
      best = cost;
      side.planes[index(y, x)] = plane;
    }
  }

  void refine(Side& side, const Window& window, int x, int y, int round) const {
    const auto stream = static_cast<std::uint64_t>(2 + 2 * round + (side.sign > 0 ? 0 : 1));
    Random random(settings_.seed, stream, index(y, x));
    float reach = 1.0F;
    for (float range = 0.5F * static_cast<float>(settings_.max_disparity); range >= 0.1F; range *= 0.5F, reach *= 0.5F) {
      const Plane& now = side.planes[index(y, x)];
      const Normal n = normal_of(now);
      const float disparity = now.at(x, y) + random.between(-range, range);
      const Normal turned{n.x + random.between(-reach, reach), n.y + random.between(-reach, reach),
                          n.z + random.between(-reach, reach)};
      consider(side, window, x, y, through(x, y, disparity, turned));
    }
  }

  [[nodiscard]] std::size_t index(int y, int x) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(left.view.width) + static_cast<std::size_t>(x);
  }
};

}  // namespace

}  // namespace patchmatch

extern "C" {

// Match a pair of RGB pictures [height, width, 3]. `checked` has NaN where the views disagree, `filled` none.
void patchmatch_compute(const std::uint8_t* left, const std::uint8_t* right, int height, int width,
                        const patchmatch::Settings* settings, float* checked, float* filled) {
  using namespace patchmatch;
  const View views[2] = {View(left, height, width), View(right, height, width)};
  Solver solver(views[0], views[1], *settings);
  solver.run();
  check(solver.left.planes, solver.right.planes, height, width, checked);
  std::vector<float> rough(solver.left.planes.size());
  fill(solver.left.planes, height, width, settings->max_disparity, checked, rough.data());
  const int threads = std::max(1, settings->threads);
  std::vector<std::thread> pool;
  for (int i = 0; i < threads; ++i) {
    pool.emplace_back([&, i] {
      smooth(views[0], settings->radius, checked, rough, height * i / threads, height * (i + 1) / threads, filled);
    });
  }
  for (auto& thread : pool) thread.join();
}

// Cost of the plane (a, b, c) at one pixel of the left view, for the tests.
float patchmatch_cost(const std::uint8_t* left, const std::uint8_t* right, int height, int width, int x, int y,
                      const float* plane, int radius, int max_disparity) {
  using namespace patchmatch;
  const View views[2] = {View(left, height, width), View(right, height, width)};
  Window window(radius);
  window.centre(views[0], x, y);
  return window.cost(views[0], views[1], {plane[0], plane[1], plane[2]}, 1, max_disparity, 1e30F);
}

// Fill and smooth a checked map whose planes are fronto-parallel, for the tests.
void patchmatch_fill(const std::uint8_t* left, int height, int width, int radius, int max_disparity,
                     const float* disparity, const float* checked, float* filled) {
  using namespace patchmatch;
  const View view(left, height, width);
  std::vector<Plane> planes(view.size());
  for (std::size_t i = 0; i < planes.size(); ++i) planes[i] = {0.0F, 0.0F, disparity[i]};
  std::vector<float> rough(planes.size());
  fill(planes, height, width, max_disparity, checked, rough.data());
  smooth(view, radius, checked, rough, 0, height, filled);
}
}
