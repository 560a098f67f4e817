// Version of this binary, and how it was built.
#pragma once

#include <string>

namespace endosdk {

const char* version_text();
const char* commit_text();

// A JSON text that is written when the library is built.
const char* build_info();

}  // namespace endosdk
