// Lists and quotations, as messages show them.
#pragma once

#include <string>
#include <string_view>

namespace endosdk {

// Adds an item, behind a separator where it is not the first.
inline void append_item(std::string& list, std::string_view item, std::string_view separator = ", ") {
  if (!list.empty()) list += separator;
  list += item;
}

inline std::string in_quotes(std::string_view text) {
  std::string quoted = "'";
  quoted += text;
  return quoted += '\'';
}

}  // namespace endosdk
