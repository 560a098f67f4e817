// The little JSON that the library needs: to write its reports, to tell whether a model's metadata is well formed, and to
// read the file of a rig.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace endosdk {

// Whether the text is one JSON value (RFC 8259).
bool is_json(std::string_view text);

// A field of an object: its name and its value, as the text has them.
struct JsonField {
  std::string_view name;
  std::string_view value;
};

// Nothing where the text is no such JSON value. Each field or item is JSON itself.
std::optional<std::vector<JsonField>> json_fields(std::string_view object);
std::optional<std::vector<std::string_view>> json_items(std::string_view array);
std::optional<double> json_value_of_number(std::string_view number);
std::optional<std::string_view> json_value_of_string(std::string_view string);  // only of one without escapes

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
