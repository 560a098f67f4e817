// SHA-256 (FIPS 180-4), to tell models and calibrations apart and to refuse a model that is not the expected one.
#pragma once

#include <cstddef>
#include <string>

namespace endosdk {

// 64 lower-case hexadecimal digits.
std::string sha256(const void* data, size_t size);

}  // namespace endosdk
