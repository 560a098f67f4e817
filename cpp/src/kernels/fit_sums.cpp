// Sums of a robust fit, compiled once per instruction set. They are kept in lanes of their own, so that every set rounds
// alike.
#include <string.h>

#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

typedef float Floats __attribute__((vector_size(fit_lanes * sizeof(float))));
typedef double Doubles __attribute__((vector_size(fit_lanes * sizeof(double))));
typedef int32_t Ints __attribute__((vector_size(fit_lanes * sizeof(int32_t))));

}  // namespace

void add_up_fit(const FitSums& fit) {
  const Floats zero = {};
  const Floats one = zero + 1.0f;
  Doubles sums[fit_sums] = {};
  const float per_limit = 1.0f / fit.limit;
  for (int i = 0; i < fit.count; i += fit_lanes) {
    Floats terms[fit_terms], rest, weight;
    for (int t = 0; t < fit_terms; ++t) memcpy(&terms[t], fit.terms[t] + i, sizeof(Floats));
    memcpy(&rest, fit.rest + i, sizeof(Floats));
    memcpy(&weight, fit.weight + i, sizeof(Floats));
    const Ints measured = weight > zero;
    if (fit.robust == Robust::none) {
      weight = measured ? one : zero;
      rest = one;
    } else {
      Floats left = rest;
      for (int t = 0; t < fit_terms; ++t) left -= fit.step[t] * terms[t];
      const Floats share = (left < zero ? -left : left) * per_limit;
      const Floats inside = one - share * share;
      const Floats counts = fit.robust == Robust::tukey ? (share < one ? inside * inside : zero) : (share <= one ? one : one / share);
      weight = measured ? weight * counts : zero;
    }
    const Doubles factor = __builtin_convertvector(weight, Doubles);
    Doubles values[fit_terms + 1];
    for (int t = 0; t < fit_terms; ++t) values[t] = __builtin_convertvector(terms[t], Doubles);
    values[fit_terms] = __builtin_convertvector(rest, Doubles);
    int s = 0;
    for (int t = 0; t <= fit_terms; ++t) {
      const Doubles weighted = factor * values[t];
      for (int k = 0; k <= t && s < fit_sums; ++k) sums[s++] += weighted * values[k];
    }
  }
  for (int s = 0; s < fit_sums; ++s) {
    double sum = 0.0;
    for (int lane = 0; lane < fit_lanes; ++lane) sum += sums[s][lane];
    fit.sums[s] = sum;
  }
}

}  // namespace endosdk::ENDOSDK_ISA
