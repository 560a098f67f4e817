// A text that is assembled only when it is read, so that a check that passes allocates nothing in the frame path.
#pragma once

#include <ostream>
#include <tuple>
#include <utility>

namespace endosdk {

template <typename... Parts>
class Text {
 public:
  explicit Text(Parts... parts) : parts_(std::move(parts)...) {}

  friend std::ostream& operator<<(std::ostream& out, const Text& text) {
    std::apply([&](const auto&... part) { (out << ... << part); }, text.parts_);
    return out;
  }

 private:
  std::tuple<Parts...> parts_;
};

}  // namespace endosdk
