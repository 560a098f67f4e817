// Ed25519 signatures of models. OpenSSL's libcrypto checks them; it is opened only if a signature is required.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "model/model.hpp"

namespace endosdk {

using Bytes = std::vector<unsigned char>;

constexpr size_t public_key_size = 32;

// The signer whose signature a model must have.
struct Signer {
  Bytes public_key;            // public_key_size bytes
  std::string crypto_library;  // path of libcrypto; empty: searched in the system's places
};

// Throws unless `signature` is the signer's signature of exactly these bytes. An empty signature means that the model has none.
void check_signature(const ModelFile& model, const Signer& signer, const Bytes& signature);

}  // namespace endosdk
