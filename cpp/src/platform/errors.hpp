// The only exception type of this code. It names the argument, the rule that the argument broke and the value seen. It also
// carries the status code for C and Python.
#pragma once

#include <endosdk/endosdk.h>

#include <sstream>
#include <stdexcept>
#include <string>

#include "platform/text.hpp"

namespace endosdk {

class Error : public std::runtime_error {
 public:
  Error(endo_status status, std::string argument, std::string rule, std::string value)
      : std::runtime_error(argument + ": " + rule + "; got " + value),
        status_(status),
        argument_(std::move(argument)),
        rule_(std::move(rule)),
        value_(std::move(value)) {}

  endo_status status() const noexcept { return status_; }
  const std::string& argument() const noexcept { return argument_; }
  const std::string& rule() const noexcept { return rule_; }
  const std::string& value() const noexcept { return value_; }

 private:
  endo_status status_;
  std::string argument_;
  std::string rule_;
  std::string value_;
};

template <typename Part>
std::string as_text(const Part& part) {
  std::ostringstream text;
  text << part;
  return text.str();
}

// Argument, rule and value may be anything that can be written to a stream. A message of several parts is a Text.
template <typename Argument, typename Rule, typename Value>
[[noreturn]] void fail(endo_status status, const Argument& argument, const Rule& rule, const Value& value) {
  throw Error(status, as_text(argument), as_text(rule), as_text(value));
}

template <typename Argument, typename Rule, typename Value>
void require(bool holds, endo_status status, const Argument& argument, const Rule& rule, const Value& value) {
  if (!holds) fail(status, argument, rule, value);
}

// The same for ENDO_INVALID_ARGUMENT, because most rules are about arguments.
template <typename Argument, typename Rule, typename Value>
[[noreturn]] void reject(const Argument& argument, const Rule& rule, const Value& value) {
  fail(ENDO_INVALID_ARGUMENT, argument, rule, value);
}

template <typename Argument, typename Rule, typename Value>
void require(bool holds, const Argument& argument, const Rule& rule, const Value& value) {
  if (!holds) reject(argument, rule, value);
}

}  // namespace endosdk
