// What this binary is and how it was made.
#pragma once

#include <string>

namespace endosdk {

const char* version_text();

// JSON, made at compile time.
const char* build_info();

}  // namespace endosdk
