// SHA-256 (FIPS 180-4), to tell models and calibrations apart and to refuse a model that is not the expected one.
#pragma once

#include <endosdk/endosdk.h>

#include <cstddef>
#include <string>

namespace endosdk {

// 64 lower-case hexadecimal digits.
std::string sha256(const void* data, size_t size);

// Refuses what does not hash to the 64 digits that `argument`_sha256 asks for; an empty `expected` asks for nothing.
void check_sha256(const std::string& seen, const std::string& expected, endo_status mismatch, const std::string& argument,
                  const std::string& origin);

}  // namespace endosdk
