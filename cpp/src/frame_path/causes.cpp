#include "frame_path/causes.hpp"

#include <algorithm>

namespace endosdk {
namespace {

constexpr bool numbers_are_places() {
  for (int i = 0; i < cause_count; ++i) {
    if (static_cast<int>(cause_facts[i].cause) != i) return false;
  }
  return true;
}
static_assert(numbers_are_places());

// False for NaN, whichever side is bad.
bool beyond(double measure, double limit, Bad bad) { return bad == Bad::high ? measure >= limit : measure < limit; }

}  // namespace

Quality Causes::level(Cause cause) const {
  const CauseFact& fact = cause_facts[index(cause)];
  const double measured = measure(cause);
  if (beyond(measured, fact.invalid, fact.bad)) return Quality::invalid;
  return beyond(measured, cause == Cause::rig_moved ? least_turn_ : fact.degraded, fact.bad) ? Quality::degraded : Quality::ok;
}

void Causes::set_focal(double widths) { least_turn_ = least_turn(widths); }

uint64_t Causes::bits() const {
  uint64_t bits = 0;
  for (const CauseFact& fact : cause_facts) {
    if (raised(fact.cause)) bits |= uint64_t{1} << static_cast<int>(fact.cause);
  }
  return bits;
}

Quality Causes::status() const {
  Quality worst = Quality::ok;
  for (const CauseFact& fact : cause_facts) worst = std::max(worst, level(fact.cause));
  return worst;
}

double least_turn(double widths) { return fact_of(ENDO_CAUSE_RIG_MOVED)->degraded * std::min(1.0, focal_of_table / widths); }

const CauseFact* fact_of(int cause) { return cause >= 0 && cause < cause_count ? &cause_facts[cause] : nullptr; }

}  // namespace endosdk
