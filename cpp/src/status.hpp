// The one exception of the layers above the kernels: it carries the status that the C interface returns.
#pragma once

#include <endosdk/endosdk.h>

#include <sstream>
#include <stdexcept>
#include <string>

#include "text.hpp"

namespace endosdk {

class Error : public std::runtime_error {
 public:
  Error(endo_status status, const std::string& message) : std::runtime_error(message), status_(status) {}

  endo_status status() const noexcept { return status_; }

 private:
  endo_status status_;
};

// Argument, rule and value may be anything that can be written to a stream; what must be put together is a Text.
template <typename Argument, typename Rule, typename Value>
[[noreturn]] void fail(endo_status status, const Argument& argument, const Rule& rule, const Value& value) {
  std::ostringstream message;
  message << argument << ": " << rule << "; got " << value;
  throw Error(status, message.str());
}

template <typename Argument, typename Rule, typename Value>
void require(bool holds, endo_status status, const Argument& argument, const Rule& rule, const Value& value) {
  if (!holds) fail(status, argument, rule, value);
}

}  // namespace endosdk
