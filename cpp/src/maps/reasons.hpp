// Why a pixel is not valid: the bits of the public header, as a table.
#pragma once

#include <endosdk/endosdk.h>

namespace endosdk {

struct ReasonFact {
  endo_reason bit;
  const char* name;
  const char* meaning;
};

#define ENDOSDK_REASON_FACT(name, bit, meaning) {ENDO_REASON_##name, #name, meaning},
constexpr ReasonFact reason_facts[] = {ENDO_REASONS(ENDOSDK_REASON_FACT)};
#undef ENDOSDK_REASON_FACT

constexpr int saturation_level = 250;  // grey level that all three channels reach

}  // namespace endosdk
