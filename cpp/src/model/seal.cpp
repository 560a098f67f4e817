#include "model/seal.hpp"

#include <algorithm>
#include <optional>

#include "platform/errors.hpp"
#include "platform/sha256.hpp"

namespace endosdk {
namespace {

constexpr size_t digits = 64;

std::optional<size_t> position_of_digits(std::string_view model) {
  const size_t first = model.find(seal_mark);
  if (first == std::string_view::npos) return std::nullopt;
  int count = 0;
  for (size_t at = first; at != std::string_view::npos; at = model.find(seal_mark, at + seal_mark.size())) ++count;
  require(count == 1, ENDO_MODEL_METADATA, seal_key, "must stand in a model once", Text(count, " times"));
  return first + seal_mark.size();
}

std::string hash_of(std::string_view model, size_t position) {
  std::string content(model);
  content.replace(position, digits, empty_seal());
  return sha256(content.data(), content.size());
}

// Makes damaged digits printable: they may be any bytes, but a message is text.
std::string readable(std::string_view text) {
  std::string result(text);
  std::replace_if(result.begin(), result.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return result;
}

}  // namespace

std::string empty_seal() { return std::string(digits, '0'); }

bool check_seal(std::string_view model, const std::string& origin) {
  const std::optional<size_t> position = position_of_digits(model);
  if (!position) return false;
  const std::string_view stated = model.substr(*position, digits);
  const std::string found = hash_of(model, *position);
  require(found == stated, ENDO_MODEL_HASH_MISMATCH, "model",
          Text(origin, " must hold the bytes that were sealed, ", readable(stated)), found);
  return true;
}

std::string seal(std::string_view model) {
  const std::optional<size_t> position = position_of_digits(model);
  require(position && model.substr(*position, digits) == empty_seal(), ENDO_MODEL_METADATA, seal_key,
          Text("must hold ", empty_seal(), " before the model is sealed"), "something else");
  std::string sealed(model);
  return sealed.replace(*position, digits, hash_of(model, *position));
}

}  // namespace endosdk
