// Model files: their bytes, their hash and their metadata.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "maps/upsampling.hpp"

namespace endosdk {

constexpr const char* model_key_prefix = "endosdk.";  // of the metadata keys that are ours
constexpr const char* model_format_version = "1";

struct ModelFile {
  std::vector<char> data;
  std::string origin;
  std::string sha256;
  bool is_sealed = false;  // true: the file has a seal, and its bytes match it
};

// The text for these constants in the metadata of a model.
std::string text_of(const Upsampling& upsampling);

// The `endosdk.*` metadata of a model.
struct ModelInfo {
  std::string name;
  std::string version;
  int input_multiple = 1;  // both sides of the input are padded to a multiple of this, px
  int output_stride = 1;   // the output grid is the input grid divided by this
  int max_disparity = 0;   // px at the input's width
  int max_candidate_disparity = 0;      // largest disparity that the network considers, px at the input's width; 0: not stated
  int inference_width = 0;     // px; frames are resized to this width unless the caller sets a size; 0: not stated
  Upsampling upsampling;
  std::string license;
  std::string intended_use;
  std::string training;  // JSON
  std::string sha256;    // of the model's bytes
};

// The host's requirements for a model's bytes. They are checked before the bytes are parsed.
struct ModelProof {
  std::string sha256;                                // 64 hexadecimal digits; empty: any
  std::function<void(const ModelFile&)> signature{};  // throws if the signature is wrong; null: none is required

  bool is_given() const { return !sha256.empty() || signature != nullptr; }
};

// Hash, signature and content are checked on the same bytes that are kept. These bytes hold the whole model.
ModelFile read_model(const std::string& path, const ModelProof& proof);
ModelFile copy_model(const void* data, size_t size, const ModelProof& proof);

using MetadataLookup = std::function<std::optional<std::string>(const std::string& key)>;

// Throws an error that names the key if one is missing or wrong.
ModelInfo parse_metadata(const MetadataLookup& lookup, const std::string& sha256);

}  // namespace endosdk
