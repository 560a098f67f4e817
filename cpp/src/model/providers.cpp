#include "model/providers.hpp"

#include <algorithm>
#include <cctype>

#include "kernels/kernels.hpp"

namespace endosdk {
namespace {

bool equal_in_any_case(std::string_view a, std::string_view b) {
  const auto lower = [](char c) { return std::tolower(static_cast<unsigned char>(c)); };
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [&](char x, char y) { return lower(x) == lower(y); });
}

const Provider* find(std::string_view name) {
  for (const Provider& p : providers) {
    if (equal_in_any_case(name, p.name) || equal_in_any_case(name, p.full_name)) return &p;
  }
  return nullptr;
}

}  // namespace

std::string full_provider_name(std::string_view name) {
  const Provider* known = find(name);
  return known != nullptr ? known->full_name : std::string(name);
}

std::string call_name_of_provider(std::string_view name) {
  const Provider* known = find(name);
  return known != nullptr ? known->call_name : std::string(name);
}

bool wants_float32_model(std::string_view provider) {
  const Provider* known = find(provider);
  if (known == nullptr) return true;  // an unknown accelerator
  return known->wants_float32_models || !has_integer_units();
}

bool shares_processor(std::string_view provider) {
  const Provider* known = find(provider);
  return known != nullptr && known->shares_processor;
}

}  // namespace endosdk
