// Which nodes of a model compute floats from the pictures, as opposed to the arithmetic of shapes and indices.
#pragma once

#include <set>
#include <string>
#include <string_view>

namespace endosdk {

// The names of the nodes of an ONNX file that give floats which follow from the pictures. Nodes that read a picture, that is,
// turn whole numbers into floats, are left out. Throws ENDO_MODEL_UNREADABLE if the bytes cannot be ONNX.
std::set<std::string> nodes_with_picture_floats(std::string_view model, const std::string& origin);

}  // namespace endosdk
