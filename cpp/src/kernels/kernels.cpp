#include "kernels/kernels.hpp"

#include <atomic>
#include <cstring>
#include <iterator>
#include <string>

#include "platform/errors.hpp"
#include "kernels/sets.hpp"

namespace endosdk {
namespace {

#define ENDOSDK_KERNELS(isa) \
  {#isa,            isa::reduce_row,  isa::remap_rgb,  isa::remap_gray,  isa::split_rgb, isa::blend_rows, \
   isa::stretch_row, isa::mean_cells, isa::trust_cells, isa::joint_bilateral_row, isa::depth_row}

bool runs_plain() { return true; }

#ifdef ENDOSDK_X86_KERNELS
bool runs_avx2() { return __builtin_cpu_supports("avx2"); }
bool runs_avx512() {
  return runs_avx2() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
}
#endif

struct Choice {
  Kernels kernels;
  bool (*runs)();
};

// Best first.
constexpr Choice choices[] = {
#ifdef ENDOSDK_X86_KERNELS
    {ENDOSDK_KERNELS(avx512), runs_avx512},
    {ENDOSDK_KERNELS(avx2), runs_avx2},
#endif
    {ENDOSDK_KERNELS(plain), runs_plain},
};

const Kernels* best() {
  for (const Choice& choice : choices) {
    if (choice.runs()) return &choice.kernels;
  }
  return nullptr;  // not reached: the last choice always runs
}

std::atomic<const Kernels*>& chosen() {
  static std::atomic<const Kernels*> current{best()};
  return current;
}

}  // namespace

const Kernels& kernels() { return *chosen().load(std::memory_order_relaxed); }

bool has_integer_units() {
#ifdef ENDOSDK_X86_KERNELS
  return runs_avx2();
#else
  return false;
#endif
}

const char* kernel_set(int i) { return i < static_cast<int>(std::size(choices)) ? choices[i].kernels.name : nullptr; }

void choose_kernels(const char* name) {
  std::string available;
  for (const Choice& choice : choices) {
    if (!choice.runs()) continue;
    if (std::strcmp(choice.kernels.name, name) == 0) {
      chosen().store(&choice.kernels, std::memory_order_relaxed);
      return;
    }
    available += (available.empty() ? "" : ", ") + std::string(choice.kernels.name);
  }
  reject("isa", "must be one that this processor runs (" + available + ")", name);
}

}  // namespace endosdk
