// Ed25519 signatures of models, checked by OpenSSL's libcrypto, which is opened only where a signature is asked for.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "model/model.hpp"

namespace endosdk {

using Bytes = std::vector<unsigned char>;

constexpr size_t public_key_size = 32;

// Whose signature a model must have.
struct Signer {
  Bytes public_key;            // of public_key_size
  std::string crypto_library;  // path of libcrypto; empty: where the system looks
};

// Refuses a model unless this is the signer's signature of its very bytes. Empty: it has none.
void check_signature(const ModelFile& model, const Signer& signer, const Bytes& signature);

}  // namespace endosdk
