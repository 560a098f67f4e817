// Lists and quoted texts for messages.
#pragma once

#include <string>
#include <string_view>

namespace endosdk {

// Appends an item, after a separator if it is not the first.
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
