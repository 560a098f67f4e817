// The little JSON that the library needs: to write its reports, and to tell whether a model's metadata is well formed.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace endosdk {

// Whether the text is one JSON value (RFC 8259).
bool is_json(std::string_view text);

// In quotes, with everything escaped that must be. JSON is UTF-8: a byte that is not, as in the path of a file, becomes
// U+FFFD, the character for what cannot be shown.
std::string json_string(std::string_view text);

// The shortest digits that read back as the same number, in the form Python's repr gives them; finite numbers only.
std::string json_number(double value);

// An object, field by field.
class JsonObject {
 public:
  JsonObject& text(std::string_view key, std::string_view value) { return raw(key, json_string(value)); }
  JsonObject& number(std::string_view key, double value);  // null when not finite
  JsonObject& count(std::string_view key, uint64_t value) { return raw(key, std::to_string(value)); }
  JsonObject& flag(std::string_view key, bool value) { return raw(key, value ? "true" : "false"); }
  JsonObject& raw(std::string_view key, std::string_view json);  // a value that is JSON already
  std::string done() const { return body_ + "}"; }

 private:
  std::string body_ = "{";
};

}  // namespace endosdk
