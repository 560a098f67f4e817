// The seal of a model file: a hash of all its bytes, stored inside the file, so that every reader can detect damage.
//
// The metadata key endosdk.content_sha256 holds 64 hexadecimal digits. They are the SHA-256 of the file with these digits
// replaced by zeros. The check needs no parser: the digits follow `seal_mark`, which occurs only once in the file.
#pragma once

#include <string>
#include <string_view>

namespace endosdk {

constexpr std::string_view seal_key = "endosdk.content_sha256";

// The value of the key before a model is sealed.
std::string empty_seal();

// The start of the entry in protocol buffer format, up to the digits: field 1, length, key; field 2, length.
constexpr std::string_view seal_mark = "\x0a\x16" "endosdk.content_sha256" "\x12\x40";
static_assert(seal_mark.substr(2, seal_key.size()) == seal_key && seal_mark[1] == seal_key.size());

// Returns whether a model is sealed. Throws ENDO_MODEL_HASH_MISMATCH if its bytes have changed since it was sealed. `origin` is
// for the message.
bool check_seal(std::string_view model, const std::string& origin);

// Returns the bytes of a model with the hash in place of the empty seal.
std::string seal(std::string_view model);

}  // namespace endosdk
