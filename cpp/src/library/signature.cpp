#include "library/signature.hpp"

#include <memory>
#include <new>

#include "platform/errors.hpp"
#include "platform/lists.hpp"
#include "platform/system.hpp"

namespace endosdk {
namespace {

constexpr const char* library_rule = "OpenSSL's libcrypto of version 1.1.1 or 3 must be installed, or named by "
                                     "options.crypto_library";
constexpr size_t signature_size = 64;

// The functions of libcrypto that are called here. Their names are the same in versions 1.1.1 and 3.
struct Crypto {
  static constexpr int ed25519 = 1087;  // EVP_PKEY_ED25519

  void* (*new_raw_public_key)(int type, void* engine, const unsigned char* key, size_t size) = nullptr;
  void (*free_key)(void* key) = nullptr;
  void* (*new_context)() = nullptr;
  void (*free_context)(void* context) = nullptr;
  int (*verify_init)(void* context, void** key_context, const void* digest, void* engine, void* key) = nullptr;
  int (*verify)(void* context, const unsigned char* signature, size_t signature_size, const unsigned char* data,
                size_t size) = nullptr;
  int (*set_error_mark)() = nullptr;
  int (*pop_to_error_mark)() = nullptr;

  // Finds the functions. Returns false if the library lacks one.
  bool load(void* library) {
    return find(library, "EVP_PKEY_new_raw_public_key", new_raw_public_key) && find(library, "EVP_PKEY_free", free_key) &&
           find(library, "EVP_MD_CTX_new", new_context) && find(library, "EVP_MD_CTX_free", free_context) &&
           find(library, "EVP_DigestVerifyInit", verify_init) && find(library, "EVP_DigestVerify", verify) &&
           find(library, "ERR_set_mark", set_error_mark) && find(library, "ERR_pop_to_mark", pop_to_error_mark);
  }

 private:
  template <typename Function>
  static bool find(void* library, const char* name, Function& function) {
    function = reinterpret_cast<Function>(system::symbol(library, name));
    return function != nullptr;
  }
};

// Opens libcrypto. A library that is used is never closed, because it keeps state for the whole process.
Crypto open_crypto(const std::string& path) {
  std::string tried;
  const auto pass_on = [&](const std::string& reason) { append_item(tried, reason, "; "); };
  for (const std::string& place : path.empty() ? system::crypto_places() : std::vector{path}) {
    std::string why;
    void* library = system::open_library(place, why);
    Crypto crypto;
    if (library != nullptr && crypto.load(library)) return crypto;
    pass_on(library == nullptr ? why : place + ", another library");
    if (library != nullptr) system::close_library(library);
  }
  fail(ENDO_DEPENDENCY_MISSING, "crypto_library", library_rule, tried);
}

// Removes errors of calls made here from libcrypto's error queue of this thread, which belongs to the host.
class ErrorMark {
 public:
  explicit ErrorMark(const Crypto& crypto) : crypto_(crypto) { crypto_.set_error_mark(); }
  ~ErrorMark() { crypto_.pop_to_error_mark(); }
  ErrorMark(const ErrorMark&) = delete;
  ErrorMark& operator=(const ErrorMark&) = delete;

 private:
  const Crypto& crypto_;
};

bool holds(const Crypto& crypto, const std::vector<char>& data, const Bytes& key, const Bytes& signature) {
  const ErrorMark mark(crypto);
  const std::unique_ptr<void, void (*)(void*)> context(crypto.new_context(), crypto.free_context);
  if (context == nullptr) throw std::bad_alloc();
  const std::unique_ptr<void, void (*)(void*)> held(
      crypto.new_raw_public_key(Crypto::ed25519, nullptr, key.data(), key.size()), crypto.free_key);
  const bool ready = held != nullptr && crypto.verify_init(context.get(), nullptr, nullptr, nullptr, held.get()) == 1;
  require(ready, ENDO_DEPENDENCY_MISSING, "crypto_library", library_rule, "a libcrypto without Ed25519");
  const auto* bytes = reinterpret_cast<const unsigned char*>(data.data());
  return crypto.verify(context.get(), signature.data(), signature.size(), bytes, data.size()) == 1;
}

}  // namespace

void check_signature(const ModelFile& model, const Signer& signer, const Bytes& signature) {
  const std::string rule = model.origin + " must have a valid Ed25519 signature by this key";
  const auto refuse = [&](bool unless, const std::string& seen) {
    require(unless, ENDO_MODEL_HASH_MISMATCH, "model", rule, seen);
  };
  refuse(!signature.empty(), "none");
  refuse(signature.size() == signature_size, std::to_string(signature.size()) + " bytes of signature, not 64");
  refuse(holds(open_crypto(signer.crypto_library), model.data, signer.public_key, signature),
         "one of other bytes or by another key");
}

}  // namespace endosdk
