#include "model/model.hpp"

#include <algorithm>
#include <charconv>
#include <sstream>
#include <string_view>

#include "platform/json.hpp"
#include "model/seal.hpp"
#include "model/weights.hpp"
#include "platform/lists.hpp"
#include "platform/sha256.hpp"
#include "platform/errors.hpp"
#include "platform/system.hpp"

namespace endosdk {
namespace {

// Keys that not every model has.
constexpr const char* max_candidate_disparity_key = "max_candidate_disparity";
constexpr const char* inference_width_key = "inference_width";
constexpr const char* upsampling_key = "upsampling";

const std::string prefix = model_key_prefix;

void check_content(ModelFile& model, const ModelProof& proof) {
  model.sha256 = sha256(model.data.data(), model.data.size());
  check_sha256(model.sha256, proof.sha256, ENDO_MODEL_HASH_MISMATCH, "model", model.origin);
  if (proof.signature) proof.signature(model);
  const std::string_view bytes = {model.data.data(), model.data.size()};
  model.is_sealed = check_seal(bytes, model.origin);
  check_weights_are_inside(bytes, model.origin);
}

std::string required(const MetadataLookup& lookup, const std::string& key) {
  const std::optional<std::string> value = lookup(prefix + key);
  require(value && !value->empty(), ENDO_MODEL_METADATA, prefix + key,
          "a model for endosdk must carry this metadata key", "nothing");
  return *value;
}

int positive(const MetadataLookup& lookup, const std::string& key) {
  const std::string text = required(lookup, key);
  int number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  // Nine digits are enough for any side length or disparity.
  const bool whole = text.size() <= 9 && error == std::errc() && end == text.data() + text.size();
  require(whole && number > 0, ENDO_MODEL_METADATA, prefix + key, "must be a positive whole number", in_quotes(text));
  return number;
}

// Whether a name is safe as the name of a folder: it must not lead to another place.
bool is_plain_name(std::string_view name) {
  const auto is_letter_or_digit = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  };
  const auto is_plain = [&](char c) { return is_letter_or_digit(c) || c == '.' || c == '_' || c == '-'; };
  return name.size() <= 100 && is_letter_or_digit(name.front()) && std::all_of(name.begin(), name.end(), is_plain);
}

// The value of a key, or 0 if the model does not have it.
int optional(const MetadataLookup& lookup, const std::string& key) {
  return lookup(prefix + key) ? positive(lookup, key) : 0;
}

// Reads a word and the number after it from the start of the text, and removes both. Returns 0 if the text begins otherwise.
float number_after(std::string_view word, std::string_view& text) {
  float number = 0.0f;
  if (text.substr(0, word.size()) != word) return 0.0f;
  text.remove_prefix(word.size());
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  text.remove_prefix(static_cast<size_t>(end - text.data()));
  return error == std::errc() ? number : 0.0f;
}

Upsampling parse_upsampling(const std::string& stated) {
  std::string_view rest = stated;
  Upsampling found;
  const float reach = number_after("joint_bilateral reach=", rest);
  found.unlike = number_after(" unlike=", rest);
  found.least_likeness = number_after(" least_likeness=", rest);
  const bool known = rest.empty() && reach == upsampling_reach && found.unlike > 0.0f && found.least_likeness > 0.0f;
  require(known, ENDO_MODEL_METADATA, prefix + upsampling_key, Text("must be of the form ", text_of(Upsampling())),
          in_quotes(stated));
  return found;
}

}  // namespace

std::string text_of(const Upsampling& u) {
  std::ostringstream text;
  text << "joint_bilateral reach=" << upsampling_reach << " unlike=" << u.unlike << " least_likeness=" << u.least_likeness;
  return text.str();
}

// Ours have 3 MB at most. Whoever wants more opens it from memory.
constexpr size_t largest_model_file = size_t{256} << 20;

ModelFile read_model(const std::string& path, const ModelProof& proof) {
  std::string why;
  std::optional<std::vector<char>> bytes = system::read_file(path, largest_model_file, why);
  require(bytes.has_value(), ENDO_MODEL_NOT_FOUND, "path", "must be a model file that can be read",
          in_quotes(path) + ": " + why);
  ModelFile model;
  model.origin = path;
  model.data = std::move(*bytes);
  check_content(model, proof);
  return model;
}

ModelFile copy_model(const void* data, size_t size, const ModelProof& proof) {
  ModelFile model;
  model.origin = "<memory>";
  model.data.assign(static_cast<const char*>(data), static_cast<const char*>(data) + size);
  check_content(model, proof);
  return model;
}

ModelInfo parse_metadata(const MetadataLookup& lookup, const std::string& sha256) {
  const std::string format = required(lookup, "format_version");
  require(format == model_format_version, ENDO_MODEL_METADATA, prefix + "format_version",
          std::string("this release reads format ") + model_format_version, in_quotes(format));
  const std::string order = required(lookup, "channel_order");
  require(order == "rgb", ENDO_MODEL_METADATA, prefix + "channel_order", "must be rgb", in_quotes(order));
  ModelInfo info;
  info.training = required(lookup, "training");
  require(is_json(info.training) && info.training[info.training.find_first_not_of(" \t\r\n")] == '{', ENDO_MODEL_METADATA,
          prefix + "training", "must be a JSON object", "another text");
  info.name = required(lookup, "name");
  require(is_plain_name(info.name), ENDO_MODEL_METADATA, prefix + "name",
          "must be 1 to 100 letters, digits, '.', '_' or '-', and begin with a letter or a digit", in_quotes(info.name));
  info.version = required(lookup, "version");
  info.input_multiple = positive(lookup, "input_multiple");
  info.output_stride = positive(lookup, "output_stride");
  require(info.input_multiple % info.output_stride == 0, ENDO_MODEL_METADATA, prefix + "output_stride",
          Text("must divide input_multiple, ", info.input_multiple), info.output_stride);
  info.max_disparity = positive(lookup, "max_disparity");
  info.max_candidate_disparity = optional(lookup, max_candidate_disparity_key);
  require(info.max_candidate_disparity <= info.max_disparity, ENDO_MODEL_METADATA, prefix + max_candidate_disparity_key,
          Text("must be at most max_disparity, ", info.max_disparity), info.max_candidate_disparity);
  info.inference_width = optional(lookup, inference_width_key);
  if (const auto stated = lookup(prefix + upsampling_key)) info.upsampling = parse_upsampling(*stated);
  info.license = required(lookup, "license");
  info.intended_use = required(lookup, "intended_use");
  info.sha256 = sha256;
  return info;
}

}  // namespace endosdk
