// Declares the kernels of one instruction set, once per set.
#pragma once

#include "kernels/kernels.hpp"

#define ENDOSDK_DECLARE_KERNELS(isa)                                                                                  \
  namespace endosdk::isa {                                                                                            \
  void reduce_row(const uint8_t* source, ptrdiff_t stride, const Reduction& reduction, uint16_t* scratch,             \
                  uint8_t* out);                                                                                      \
  void remap_rgb(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* c0, uint8_t* c1, uint8_t* c2);     \
  void remap_gray(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* out);                             \
  void split_rgb(const uint8_t* source, int count, uint8_t* c0, uint8_t* c1, uint8_t* c2);                            \
  void blend_rows(const float* upper, const float* lower, float weight, float gain, int count, float* value,          \
                  float* step);                                                                                       \
  void stretch_row(const float* value, const float* step, const int32_t* index, const float* weight, int count,       \
                   float* out);                                                                                       \
  void mean_cells(const uint8_t* rows, ptrdiff_t stride, int factor, int count, float* out);                          \
  void trust_cells(const float* disparity, const float* confidence, int count, float* trust, float* trusted);         \
  void joint_bilateral_row(const JointBilateralRow& row);                                                                              \
  int depth_row(const DepthRow& row, const DepthLimits& limits);                                                      \
  }

ENDOSDK_DECLARE_KERNELS(plain)
ENDOSDK_DECLARE_KERNELS(avx2)
ENDOSDK_DECLARE_KERNELS(avx512)

#undef ENDOSDK_DECLARE_KERNELS
