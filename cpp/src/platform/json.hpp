// The JSON functions that the library needs. It writes reports, checks whether a model's metadata is well formed, and reads rig
// files.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace endosdk {

// Whether the text is one JSON value (RFC 8259).
bool is_json(std::string_view text);

// A field of an object: its name and its value, both as they are in the text.
struct JsonField {
  std::string_view name;
  std::string_view value;
};

// All return nothing if the text is not a JSON value of this kind. The values of fields, and items, are JSON texts themselves.
std::optional<std::vector<JsonField>> json_fields(std::string_view object);
std::optional<std::vector<std::string_view>> json_items(std::string_view array);
std::optional<double> json_value_of_number(std::string_view number);
std::optional<std::string_view> json_value_of_string(std::string_view string);  // without escapes only

// The text in quotes, escaped as JSON requires. JSON is UTF-8. A byte that is not UTF-8, for example in a file path, becomes
// U+FFFD, the replacement character.
std::string json_string(std::string_view text);

// The shortest digits that read back as the same number, in the form of Python's repr. For finite numbers only.
std::string json_number(double value);

// Writes an object, field by field.
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
