// The metadata of a model as Python holds it, for the parser of the core.
#pragma once

#include <map>
#include <optional>
#include <string>

namespace endosdk {

// A function that finds the value of a key. It refers to the metadata, which must live longer.
inline auto lookup_in(const std::map<std::string, std::string>& metadata) {
  return [&metadata](const std::string& key) -> std::optional<std::string> {
    const auto found = metadata.find(key);
    return found == metadata.end() ? std::nullopt : std::optional(found->second);
  };
}

}  // namespace endosdk
