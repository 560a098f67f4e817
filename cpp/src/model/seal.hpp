// The seal of a model file: a hash of all its bytes, kept inside it, so that a damaged file is noticed wherever it is.
//
// The metadata key endosdk.content_sha256 holds 64 hexadecimal digits: the SHA-256 of the file with these digits replaced
// by zeros. No parser is needed to check it: the digits follow the only place where the mark stands.
#pragma once

#include <string>
#include <string_view>

namespace endosdk {

constexpr std::string_view seal_key = "endosdk.content_sha256";

// The value of the key before a model is sealed.
std::string empty_seal();

// The entry as protocol buffers write it, up to the digits: field 1, length, key; field 2, length.
constexpr std::string_view seal_mark = "\x0a\x16" "endosdk.content_sha256" "\x12\x40";
static_assert(seal_mark.substr(2, seal_key.size()) == seal_key && seal_mark[1] == seal_key.size());

// Whether a model is sealed. Throws ENDO_MODEL_HASH_MISMATCH where its bytes are not those that were sealed; `origin` is
// for the message.
bool check_seal(std::string_view model, const std::string& origin);

// The bytes of a model, whose key holds the empty seal, with the hash in its place.
std::string seal(std::string_view model);

}  // namespace endosdk
