#include "platform/json.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>

namespace endosdk {
namespace {

// Checks the syntax only. For an object or array that it splits, it keeps where the parts are in the text.
class Syntax {
 public:
  explicit Syntax(std::string_view text) : rest_(text) {}

  bool fields(std::vector<JsonField>& found) {
    space();
    return take('{') && list('}', [&] {
      space();
      const std::string_view name = taken([&] { return string(); });
      space();
      if (name.empty() || !take(':')) return false;
      space();
      const std::string_view own = taken([&] { return value(1); });
      if (!own.empty()) found.push_back({name.substr(1, name.size() - 2), own});
      return !own.empty();
    }) && ends();
  }

  bool items(std::vector<std::string_view>& found) {
    space();
    return take('[') && list(']', [&] {
      space();
      const std::string_view own = taken([&] { return value(1); });
      if (!own.empty()) found.push_back(own);
      return !own.empty();
    }) && ends();
  }

  bool is_number() { return number() && rest_.empty(); }
  bool is_string() { return string() && rest_.empty(); }

  bool holds() {
    return value(0) && ends();
  }

 private:
  static constexpr int deepest = 200;  // enough for any metadata, and a hostile file cannot overflow the stack

  bool ends() {
    space();
    return rest_.empty();
  }

  // The text that `part` consumes; empty if `part` fails.
  template <typename Part>
  std::string_view taken(const Part& part) {
    const std::string_view before = rest_;
    return part() ? before.substr(0, before.size() - rest_.size()) : std::string_view();
  }

  char peek() const { return rest_.empty() ? '\0' : rest_.front(); }

  bool take(char c) {
    if (peek() != c || rest_.empty()) return false;
    rest_.remove_prefix(1);
    return true;
  }

  bool take(std::string_view word) {
    if (rest_.substr(0, word.size()) != word) return false;
    rest_.remove_prefix(word.size());
    return true;
  }

  void space() {
    while (peek() == ' ' || peek() == '\t' || peek() == '\n' || peek() == '\r') rest_.remove_prefix(1);
  }

  bool digits() {
    const std::string_view before = rest_;
    while (peek() >= '0' && peek() <= '9') rest_.remove_prefix(1);
    return rest_.size() < before.size();
  }

  bool number() {
    take('-');
    if (!take('0') && !digits()) return false;
    if (take('.') && !digits()) return false;
    if (!take('e') && !take('E')) return true;
    if (!take('+')) take('-');
    return digits();
  }

  bool hex_digits() {
    for (int i = 0; i < 4; ++i) {
      const char c = peek();
      if (!((c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F'))) return false;
      rest_.remove_prefix(1);
    }
    return true;
  }

  bool string() {
    if (!take('"')) return false;
    while (!rest_.empty() && peek() != '"') {
      if (static_cast<unsigned char>(peek()) < 0x20) return false;
      if (!take('\\')) {
        rest_.remove_prefix(1);
      } else if (take('u')) {
        if (!hex_digits()) return false;
      } else if (rest_.empty() || std::string_view("\"\\/bfnrt").find(peek()) == std::string_view::npos) {
        return false;
      } else {
        rest_.remove_prefix(1);
      }
    }
    return take('"');
  }

  bool member(int depth) {
    space();
    if (!string()) return false;
    space();
    return take(':') && value(depth);
  }

  template <typename Item>
  bool list(char close, const Item& item) {
    space();
    if (take(close)) return true;
    do {
      if (!item()) return false;
      space();
    } while (take(','));
    return take(close);
  }

  bool value(int depth) {
    if (depth > deepest) return false;
    space();
    if (take('{')) return list('}', [&] { return member(depth + 1); });
    if (take('[')) return list(']', [&] { return value(depth + 1); });
    if (peek() == '"') return string();
    return take("true") || take("false") || take("null") || number();
  }

  std::string_view rest_;
};

// Length in bytes of the UTF-8 character at the start of the text; 0 if there is none.
size_t character_length(std::string_view text) {
  const auto byte = [&](size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
  const unsigned first = byte(0);
  if (first < 0x80) return 1;
  const size_t length = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  if (first < 0xc2 || first > 0xf4) return 0;
  for (size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0u) != 0x80u) return 0;
  }
  // Not valid: an overlong form, half of a UTF-16 surrogate pair, or a code beyond the last character.
  const unsigned second = byte(1);
  const bool stray = (first == 0xe0 && second < 0xa0) || (first == 0xed && second >= 0xa0) ||
                     (first == 0xf0 && second < 0x90) || (first == 0xf4 && second >= 0x90);
  return stray ? 0 : length;
}

}  // namespace

bool is_json(std::string_view text) { return Syntax(text).holds(); }

std::optional<std::vector<JsonField>> json_fields(std::string_view object) {
  std::vector<JsonField> found;
  return Syntax(object).fields(found) ? std::optional(found) : std::nullopt;
}

std::optional<std::vector<std::string_view>> json_items(std::string_view array) {
  std::vector<std::string_view> found;
  return Syntax(array).items(found) ? std::optional(found) : std::nullopt;
}

std::optional<double> json_value_of_number(std::string_view number) {
  if (!Syntax(number).is_number()) return std::nullopt;
  double value = 0.0;
  const std::from_chars_result read = std::from_chars(number.data(), number.data() + number.size(), value);
  return read.ec == std::errc() ? std::optional(value) : std::nullopt;
}

std::optional<std::string_view> json_value_of_string(std::string_view string) {
  const bool plain = Syntax(string).is_string() && string.find('\\') == std::string_view::npos;
  return plain ? std::optional(string.substr(1, string.size() - 2)) : std::nullopt;
}

std::string json_string(std::string_view text) {
  std::string out = "\"";
  while (!text.empty()) {
    const char c = text.front();
    const size_t length = character_length(text);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      const char* hex = "0123456789abcdef";
      out += "\\u00";
      out += hex[c >> 4];
      out += hex[c & 15];
    } else if (length == 0) {
      out += "\\ufffd";
    } else {
      out += text.substr(0, length);
    }
    text.remove_prefix(std::max(length, size_t{1}));
  }
  return out + "\"";
}

std::string json_number(double value) {
  char text[32];
  const std::to_chars_result scientific = std::to_chars(text, text + sizeof text, value, std::chars_format::scientific);
  const std::string_view shortest(text, static_cast<size_t>(scientific.ptr - text));
  const size_t mark = shortest.find('e');
  const int exponent = std::atoi(std::string(shortest.substr(mark + 1)).c_str());
  // Python writes numbers from 1e-4 to 1e16 without an exponent, and with ".0" if they are whole, so that they read back as
  // floats.
  if (exponent < -4 || exponent >= 16) return std::string(shortest);
  const std::to_chars_result fixed = std::to_chars(text, text + sizeof text, value, std::chars_format::fixed);
  std::string out(text, fixed.ptr);
  if (out.find('.') == std::string::npos) out += ".0";
  return out;
}

JsonObject& JsonObject::number(std::string_view key, double value) {
  return raw(key, std::isfinite(value) ? json_number(value) : "null");
}

JsonObject& JsonObject::raw(std::string_view key, std::string_view json) {
  if (body_.size() > 1) body_ += ',';
  body_ += json_string(key);
  body_ += ':';
  body_ += json;
  return *this;
}

}  // namespace endosdk
