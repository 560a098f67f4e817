// Model files: their bytes and hash, and what they say of themselves.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace endosdk {

struct ModelFile {
  std::vector<char> data;
  std::string origin;
  std::string sha256;
};

// The endosdk.* metadata of a model; the same keys and rules as in the Python package.
struct ModelInfo {
  std::string name;
  std::string version;
  int input_multiple = 1;  // both sides of the input are padded to a multiple of this, px
  int output_stride = 1;   // the output grid is the input grid divided by this
  int max_disparity = 0;   // px at the input's width
  int last_plane = 0;      // the largest disparity the network has a plane for, px at the input's width; 0: not stated
  int usual_width = 0;     // px; wider frames are seen at this width unless the caller sets a size; 0: none named
  std::string license;
  std::string intended_use;
};

// Hash and content are of the very bytes that are kept, which hold all of the model. An empty `expected` accepts any hash.
ModelFile read_model(const std::string& path, const std::string& expected);
ModelFile copy_model(const void* data, size_t size, const std::string& expected);

using MetadataLookup = std::function<std::optional<std::string>(const std::string& key)>;

ModelInfo parse_metadata(const MetadataLookup& lookup);

}  // namespace endosdk
