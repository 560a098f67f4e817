// Argument checks of the core: every failure names the argument, the rule it broke and the value that was seen.
#pragma once

#include <sstream>
#include <stdexcept>
#include <string_view>

#include "text.hpp"

namespace endosdk {

// Argument, rule and value may be anything that can be written to a stream; what must be put together is a Text.
template <typename Rule, typename Value>
[[noreturn]] void reject(std::string_view argument, const Rule& rule, const Value& value) {
  std::ostringstream message;
  message << argument << ": " << rule << "; got " << value;
  throw std::invalid_argument(message.str());
}

template <typename Rule, typename Value>
void require(bool holds, std::string_view argument, const Rule& rule, const Value& value) {
  if (!holds) reject(argument, rule, value);
}

}  // namespace endosdk
