// What each shipped model answers to the built-in pair of bands: means of its maps in cells of the picture.
#pragma once

#include <array>
#include <string>

#include "images/size.hpp"

namespace endosdk {

constexpr Size golden_picture = {320, 256};
constexpr int golden_columns = 12;
constexpr int golden_rows = 9;

using GoldenCells = std::array<float, golden_columns * golden_rows>;

struct GoldenAnswer {
  const char* sha256;      // of the model file
  GoldenCells disparity;   // px
  GoldenCells confidence;  // 0..1
};

// Null for a model that is not shipped.
const GoldenAnswer* golden_answer(const std::string& model_sha256);

}  // namespace endosdk
