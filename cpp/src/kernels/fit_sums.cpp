// Sums of a robust fit. The file is compiled once per instruction set. Each sum has a fixed number of lanes, so that every set
// rounds alike.
#include <string.h>

#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

typedef double Doubles __attribute__((vector_size(fit_lanes / 2 * sizeof(double))));

constexpr int chunk = 8 * fit_lanes;  // measurements at a time; they stay in the nearest cache
constexpr int half = fit_lanes / 2;  // lanes; as many as most registers hold

// The terms and the rest of a chunk of measurements, and the same values times their weight.
struct Chunk {
  double values[fit_terms + 1][chunk];
  double weighted[fit_terms + 1][chunk];
};

// Computes how much each measurement counts.
void weigh(const FitSums& fit, int first, int count, float* __restrict out) {
  const float* const weight = fit.weight + first;
  if (fit.robust == Robust::none) {
    for (int i = 0; i < count; ++i) out[i] = weight[i] > 0.0f ? 1.0f : 0.0f;
    return;
  }
  const float* const rest = fit.rest + first;
  const float per_limit = 1.0f / fit.limit;
  const bool cut = fit.robust == Robust::tukey;
  const float* term[fit_terms];
  for (int t = 0; t < fit_terms; ++t) term[t] = fit.terms[t] + first;
  for (int i = 0; i < count; ++i) {
    float left = rest[i];
    for (int t = 0; t < fit_terms; ++t) left -= fit.step[t] * term[t][i];
    const float share = (left < 0.0f ? -left : left) * per_limit;
    const float inside = 1.0f - share * share;
    const float tukey = share < 1.0f ? inside * inside : 0.0f;
    const float huber = share <= 1.0f ? 1.0f : 1.0f / share;
    const float counts = weight[i] * (cut ? tukey : huber);
    out[i] = weight[i] > 0.0f ? counts : 0.0f;
  }
}

void multiply(const float* values, const float* weight, int count, double* __restrict value, double* __restrict weighted) {
  for (int i = 0; i < count; ++i) {
    value[i] = static_cast<double>(values[i]);
    weighted[i] = static_cast<double>(weight[i]) * value[i];
  }
}

void read(const FitSums& fit, int first, int count, Chunk& out) {
  float weight[chunk], one[chunk];
  weigh(fit, first, count, weight);
  for (int t = 0; t <= fit_terms; ++t) {
    const float* values = t < fit_terms ? fit.terms[t] + first : fit.rest + first;
    if (t == fit_terms && fit.robust == Robust::none) {
      for (int i = 0; i < count; ++i) one[i] = 1.0f;
      values = one;
    }
    multiply(values, weight, count, out.values[t], out.weighted[t]);
  }
}

// Adds the products of one term, or of the rest, with the terms up to it. The sums at a time are so few that each has a
// register.
template <int term>
void add_products(const Chunk& of, int count, Doubles (*sums)[2]) {
  constexpr int products = term < fit_terms ? term + 1 : fit_terms;
  Doubles found[products][2];
  for (int k = 0; k < products; ++k) {
    for (int h = 0; h < 2; ++h) found[k][h] = sums[k][h];
  }
  for (int i = 0; i < count; i += fit_lanes) {
    for (int h = 0; h < 2; ++h) {
      Doubles weighted, value;
      memcpy(&weighted, of.weighted[term] + i + h * half, sizeof(Doubles));
      for (int k = 0; k < products; ++k) {
        memcpy(&value, of.values[k] + i + h * half, sizeof(Doubles));
        found[k][h] += weighted * value;
      }
    }
  }
  for (int k = 0; k < products; ++k) {
    for (int h = 0; h < 2; ++h) sums[k][h] = found[k][h];
  }
}

}  // namespace

void add_up_fit(const FitSums& fit) {
  static_assert(fit_terms == 6);
  Doubles sums[fit_sums][2] = {};
  Chunk some;
  for (int first = 0; first < fit.count; first += chunk) {
    const int count = fit.count - first < chunk ? fit.count - first : chunk;
    read(fit, first, count, some);
    add_products<0>(some, count, sums);
    add_products<1>(some, count, sums + 1);
    add_products<2>(some, count, sums + 3);
    add_products<3>(some, count, sums + 6);
    add_products<4>(some, count, sums + 10);
    add_products<5>(some, count, sums + 15);
    add_products<6>(some, count, sums + 21);
  }
  for (int s = 0; s < fit_sums; ++s) {
    double sum = 0.0;
    for (int lane = 0; lane < fit_lanes; ++lane) sum += sums[s][lane / half][lane % half];
    fit.sums[s] = sum;
  }
}

}  // namespace endosdk::ENDOSDK_ISA
