// Finds out which instruction sets this x86 processor and its operating system can run. Compilers have a built-in function for
// this, but not all of them support it: Zig's always answers no, so the plain kernels would be used.
#pragma once

#include <cpuid.h>

#include <cstdint>

namespace endosdk {

// Whether the system saves these parts of the registers when it switches threads; `parts` are bits of XCR0.
inline bool system_keeps(uint32_t parts) {
  constexpr uint32_t osxsave = 1u << 27;
  uint32_t a = 0, b = 0, c = 0, d = 0;
  if (__get_cpuid(1, &a, &b, &c, &d) == 0 || (c & osxsave) == 0) return false;
  uint32_t low = 0, high = 0;
  __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
  return (low & parts) == parts;
}

// Tests feature bits of CPUID leaf 7, EBX.
inline bool has_features(uint32_t bits) {
  uint32_t a = 0, b = 0, c = 0, d = 0;
  return __get_cpuid_count(7, 0, &a, &b, &c, &d) != 0 && (b & bits) == bits;
}

inline bool has_avx2() {
  constexpr uint32_t ymm = 0x6;
  return system_keeps(ymm) && has_features(1u << 5);
}

// AVX-512 with the parts F (foundation), DQ, BW and VL.
inline bool has_avx512() {
  constexpr uint32_t zmm = 0xe6;
  return has_avx2() && system_keeps(zmm) && has_features(1u << 16 | 1u << 17 | 1u << 30 | 1u << 31);
}

}  // namespace endosdk
