#include "kernels/kernels.hpp"

#include <atomic>
#include <cstring>
#include <iterator>
#include <string>

#include "platform/errors.hpp"
#include "platform/lists.hpp"
#include "platform/system.hpp"
#include "kernels/sets.hpp"
#ifdef ENDOSDK_X86_KERNELS
#include "kernels/x86_features.hpp"
#endif

#define ENDOSDK_ADDRESS(result, name, parameters) name,
#define ENDOSDK_SET(isa)                                                 \
  namespace endosdk::isa {                                               \
  constexpr Kernels set{#isa, ENDOSDK_FOR_EACH_KERNEL(ENDOSDK_ADDRESS)}; \
  }

ENDOSDK_SET(plain)
#ifdef ENDOSDK_X86_KERNELS
ENDOSDK_SET(avx2)
ENDOSDK_SET(avx512)
#endif
#ifdef ENDOSDK_ARM_KERNELS
ENDOSDK_SET(neon)
#endif

namespace endosdk {
namespace {

bool runs_plain() { return true; }

struct Choice {
  Kernels kernels;
  bool (*runs)();
};

// The sets of this build, best first.
constexpr Choice choices[] = {
#ifdef ENDOSDK_X86_KERNELS
    {avx512::set, has_avx512},
    {avx2::set, has_avx2},
#endif
#ifdef ENDOSDK_ARM_KERNELS
    {neon::set, runs_plain},
#endif
    {plain::set, runs_plain},
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
  return has_avx2();
#else
  return system::has_arm_dot_products();
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
    append_item(available, choice.kernels.name);
  }
  reject("isa", "must be one that this processor runs (" + available + ")", name);
}

}  // namespace endosdk
