// Reads the messages of a protobuf file field by field, without their schema.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "platform/errors.hpp"

namespace endosdk {

// One field of a protobuf message.
struct Field {
  uint64_t number = 0;
  uint64_t value = 0;      // if the field is a whole number
  std::string_view bytes;  // if the field is a text or a message
};

// The fields of one message. Throws ENDO_MODEL_UNREADABLE if the bytes are no message. `origin` is for the message of the error.
class Fields {
 public:
  Fields(std::string_view message, const std::string& origin) : rest_(message), origin_(origin) {}

  std::optional<Field> next() {
    if (rest_.empty()) return std::nullopt;
    const uint64_t tag = varint();
    Field field;
    field.number = tag >> 3;
    switch (tag & 7) {
      case 0: field.value = varint(); break;
      case 1: take(8); break;
      case 2: field.bytes = take(varint()); break;
      case 5: take(4); break;
      default: refuse();
    }
    return field;
  }

  [[noreturn]] void refuse() const {
    fail(ENDO_MODEL_UNREADABLE, "model", Text(origin_, " must be an ONNX file that runs here"), "other bytes");
  }

 private:
  std::string_view take(uint64_t count) {
    if (count > rest_.size()) refuse();
    const std::string_view taken = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return taken;
  }

  uint64_t varint() {
    uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      const auto byte = static_cast<unsigned char>(take(1).front());
      value |= uint64_t{byte & 0x7fu} << shift;
      if (byte < 0x80) return value;
    }
    refuse();
  }

  std::string_view rest_;
  const std::string& origin_;
};

}  // namespace endosdk
