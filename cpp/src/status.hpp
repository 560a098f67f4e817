// The one exception of the layers above the kernels: it carries the status that the C interface returns.
#pragma once

#include <endosdk/endosdk.h>

#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace endosdk {

class Error : public std::runtime_error {
 public:
  Error(endo_status status, const std::string& message) : std::runtime_error(message), status_(status) {}

  endo_status status() const noexcept { return status_; }

 private:
  endo_status status_;
};

template <typename Value>
[[noreturn]] void fail(endo_status status, std::string_view argument, std::string_view rule, const Value& value) {
  std::ostringstream message;
  message << argument << ": " << rule << "; got " << value;
  throw Error(status, message.str());
}

template <typename Value>
void require(bool holds, endo_status status, std::string_view argument, std::string_view rule, const Value& value) {
  if (!holds) fail(status, argument, rule, value);
}

}  // namespace endosdk
