// What this binary is and how it was made.
#pragma once

#include <string>

namespace endosdk {

const char* version_text();

// JSON, made when the library is built.
const char* build_info();

}  // namespace endosdk
