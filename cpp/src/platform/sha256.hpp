// SHA-256 (FIPS 180-4). It identifies models and calibrations, and lets the library refuse a model that is not the expected
// one.
#pragma once

#include <endosdk/endosdk.h>

#include <cstddef>
#include <string>

namespace endosdk {

// 64 lower-case hexadecimal digits.
std::string sha256(const void* data, size_t size);

// Refuses a text that is neither empty nor 64 hexadecimal digits.
void check_sha256_form(const std::string& text, const std::string& argument);

// Throws `mismatch` if the hash `seen` is not `expected`, the 64 digits given as `argument`_sha256. An empty `expected` accepts
// any hash.
void check_sha256(const std::string& seen, const std::string& expected, endo_status mismatch, const std::string& argument,
                  const std::string& origin);

}  // namespace endosdk
