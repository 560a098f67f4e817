// The small frame that most tests of the library use.
#pragma once

#include <cstddef>
#include <vector>

#include "support.hpp"

constexpr int width = 160;
constexpr int height = 96;
constexpr size_t pixels = size_t{width} * height;

inline float middle(const std::vector<float>& map) { return map[pixels / 2 + width / 2]; }
