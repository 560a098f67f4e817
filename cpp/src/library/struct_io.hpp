// Reads and writes structs of the C interface, with the size that the caller knows.
#pragma once

#include <endosdk/endosdk.h>

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "platform/errors.hpp"

namespace endosdk {

constexpr size_t largest_struct = 65536;  // a larger struct_size was certainly never set

inline void check_struct_size(size_t size, size_t first, const char* argument) {
  require(size >= first && size <= largest_struct, ENDO_INVALID_ARGUMENT, Text(argument, ".struct_size"),
          Text("must be sizeof the struct, at least ", first), size);
}

// A copy of the fields that both the caller and this library know.
template <typename Struct>
Struct known_fields(const Struct* given, size_t first, const char* argument) {
  require(given != nullptr, ENDO_INVALID_ARGUMENT, argument, "must not be NULL", "NULL");
  const size_t size = given->struct_size;
  check_struct_size(size, first, argument);
  Struct known{};
  std::memcpy(&known, given, std::min(size, sizeof(Struct)));
  return known;
}

// Throws unless all fields that only the caller knows are zero.
template <typename Struct>
void check_newer_fields(const Struct* given, const char* argument) {
  const size_t size = given->struct_size;
  const auto* bytes = reinterpret_cast<const unsigned char*>(given);
  const bool understood = std::all_of(bytes + std::min(size, sizeof(Struct)), bytes + size, [](auto b) { return b == 0; });
  require(understood, ENDO_INVALID_ARGUMENT, argument, "must use no field newer than this library", "a newer field");
}

template <typename Struct>
Struct read_struct(const Struct* given, size_t first, const char* argument) {
  const Struct known = known_fields(given, first, argument);
  check_newer_fields(given, argument);
  return known;
}

template <typename Struct>
void write_struct(Struct known, size_t size, Struct* target) {
  known.struct_size = static_cast<uint32_t>(size);
  std::memcpy(target, &known, std::min(size, sizeof(Struct)));
}

template <typename Rule, typename Value>
void require_argument(bool holds, const char* argument, const Rule& rule, const Value& value) {
  require(holds, ENDO_INVALID_ARGUMENT, argument, rule, value);
}

}  // namespace endosdk
