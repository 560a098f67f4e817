// Functions of model files that this library computes itself. A file defines each by standard operators, which any
// runtime can run; the loops here give the same numbers, but for their last digits, in a fraction of the time.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <mutex>
#include <ostream>
#include <vector>

#include "platform/threads.hpp"

namespace endosdk {

// The sides of a tensor. It takes no memory of its own, as every frame has many.
class Shape {
 public:
  static constexpr size_t most_sides = 8;

  // INFERENCE_FAILED where there are more sides than any function knows.
  explicit Shape(size_t count);
  Shape(std::initializer_list<int64_t> sides) : Shape(sides.size()) { std::copy(sides.begin(), sides.end(), sides_.begin()); }

  int64_t operator[](size_t i) const { return sides_[i]; }
  int64_t* data() { return sides_.data(); }
  const int64_t* data() const { return sides_.data(); }
  size_t size() const { return count_; }
  const int64_t* begin() const { return data(); }
  const int64_t* end() const { return data() + count_; }

  // As in [any, 3, 240], where a side that may be any is below 0.
  friend std::ostream& operator<<(std::ostream& out, const Shape& shape);

 private:
  size_t count_;
  std::array<int64_t, most_sides> sides_{};
};

// What is called for each row, or block of rows.
using RowBody = FunctionReference<int>;

enum class Element { uint8, float32 };

// One call of a function: what it reads and writes, and the threads that it may use.
class FunctionCall {
 public:
  virtual ~FunctionCall() = default;

  virtual Shape shape(int input) const = 0;
  virtual const void* data(int input) const = 0;
  virtual void* output(int place, const Shape& shape) = 0;

  // Calls `body` once for each index below `count`, on several threads at a time.
  void parallel(int64_t count, RowBody body);

  const float* floats(int input) const { return static_cast<const float*>(data(input)); }
  const uint8_t* bytes(int input) const { return static_cast<const uint8_t*>(data(input)); }
  float* float_output(int place, const Shape& shape) { return static_cast<float*>(output(place, shape)); }

 private:
  virtual void run(int count, RowBody body) = 0;
};

// Memory between the steps of a call, kept for the next one.
class Scratch {
 public:
  class Lent {
   public:
    Lent(Scratch& owner, size_t count);
    ~Lent();
    Lent(const Lent&) = delete;
    Lent& operator=(const Lent&) = delete;

    float* data() { return values_.data(); }

   private:
    Scratch& owner_;
    std::vector<float> values_;
  };

  // While it exists, a function that is called for the first time reserves memory for so many calls at the same time.
  class Expect {
   public:
    explicit Expect(int calls);
    ~Expect();
    Expect(const Expect&) = delete;
    Expect& operator=(const Expect&) = delete;
  };

 private:
  std::vector<float> lend(size_t count);

  std::mutex mutex_;
  size_t calls_ = 0;  // at the same time; 0 before the first one
  size_t lent_ = 0;
  std::vector<std::vector<float>> spare_;  // it has room for those that are lent
};

// Calls `body(y, memory)` for each row, several rows at a time. `memory` has `values` floats, which no other thread uses.
template <typename Body>
void for_each_row(FunctionCall& call, Scratch& scratch, int64_t rows, size_t values, const Body& body) {
  constexpr int64_t block = 4;
  const int64_t blocks = (rows + block - 1) / block;
  Scratch::Lent memory(scratch, values * static_cast<size_t>(blocks));
  call.parallel(blocks, [&](int index) {
    float* const own = memory.data() + static_cast<size_t>(index) * values;
    for (int64_t y = index * block; y < std::min((index + 1) * block, rows); ++y) body(static_cast<int>(y), own);
  });
}

class Function {
 public:
  virtual ~Function() = default;

  // INFERENCE_FAILED where shapes do not fit each other.
  virtual void compute(FunctionCall& call) = 0;
};

// A number that a call in a model file gives; -1 where it gives none of that name.
using FunctionSettings = std::function<double(const char* name)>;

// A setting that must be above 0. Throws MODEL_METADATA where it is not.
float positive_setting(const FunctionSettings& settings, const char* name);

constexpr size_t most_inputs = 11;

struct FunctionKind {
  const char* name;
  std::array<Element, most_inputs> inputs;
  int input_count;
  std::array<Element, 3> outputs;
  int output_count;
  std::unique_ptr<Function> (*make)(const FunctionSettings& settings);
};

// The i-th kind; null beyond the last.
const FunctionKind* function_kind(int i);

// Throws unless a shape is as it must be; a side of -1 may be any that a picture has.
void check_shape(const char* argument, const Shape& found, const Shape& wanted);

std::unique_ptr<Function> make_read_views(const FunctionSettings& settings);
std::unique_ptr<Function> make_read_smaller(const FunctionSettings& settings);
std::unique_ptr<Function> make_planes_around(const FunctionSettings& settings);
std::unique_ptr<Function> make_compare_views(const FunctionSettings& settings);
std::unique_ptr<Function> make_answer_of_planes(const FunctionSettings& settings);
std::unique_ptr<Function> make_choose_surface(const FunctionSettings& settings);
std::unique_ptr<Function> make_match_evidence(const FunctionSettings& settings);
std::unique_ptr<Function> make_clues_of_answer(const FunctionSettings& settings);
std::unique_ptr<Function> make_scale_of_errors(const FunctionSettings& settings);
std::unique_ptr<Function> make_volume_of_pairs(const FunctionSettings& settings);
std::unique_ptr<Function> make_thin_convolution(const FunctionSettings& settings);
std::unique_ptr<Function> make_confidence_of_scale(const FunctionSettings& settings);

}  // namespace endosdk
