#include "library/open_request.hpp"

#include <algorithm>
#include <functional>
#include <optional>
#include <utility>

#include "library/signature.hpp"
#include "library/struct_io.hpp"
#include "platform/sha256.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr size_t first_options = 104;  // size in the first release; it only grows
static_assert(sizeof(endo_options) >= first_options);

endo_options default_options() {
  endo_options options{};
  options.struct_size = sizeof options;
  options.log_level = ENDO_LOG_WARNING;
  options.provider = "cpu";
  const FramePathSettings defaults;
  options.min_confidence = defaults.limits.min_confidence;
  options.min_depth_mm = defaults.limits.min_depth_mm;
  options.max_depth_mm = defaults.limits.max_depth_mm;
  options.depth_unit_mm = defaults.limits.depth_unit_mm;
  options.deadline_ms = defaults.deadline_ms;
  return options;
}

// Turns NULL, which means "any" or "search", into an empty text. An empty text from the caller is a mistake, for example a
// variable that was never filled. It must not switch off the check that the caller wanted.
std::string text_or_nothing(const char* text, const char* argument) {
  require_argument(text == nullptr || *text != '\0', argument, "must be NULL or not empty", "''");
  return text != nullptr ? text : "";
}

Bytes bytes_or_nothing(const unsigned char* data, size_t size, const char* argument) {
  require_argument((data == nullptr) == (size == 0), argument, "must be given with its size, or neither of the two",
                   Text(data == nullptr ? "NULL" : "bytes", " and size ", size));
  return size == 0 ? Bytes() : Bytes(data, data + size);
}

std::optional<Signer> signer_of(const endo_options& o) {
  Signer signer = {bytes_or_nothing(o.public_key, o.public_key_size, "public_key"),
                   text_or_nothing(o.crypto_library, "crypto_library")};
  if (signer.public_key.empty()) return std::nullopt;
  require_argument(signer.public_key.size() == public_key_size, "public_key",
                   Text("must be the ", public_key_size, " bytes of an Ed25519 public key"), Text(o.public_key_size, " bytes"));
  const bool filled = std::any_of(signer.public_key.begin(), signer.public_key.end(), [](auto byte) { return byte != 0; });
  require_argument(filled, "public_key", "must be a key: to anybody's signature zeros may fit", "zeros");
  return signer;
}

// The function that checks a model's signature; null if no public key is given. A signature alone proves nothing, so it needs a
// key.
std::function<void(const ModelFile&)> check_by(const std::optional<Signer>& signer, Bytes signature) {
  require_argument(signer.has_value() || signature.empty(), "public_key", "must be given where there is a signature", "NULL");
  if (!signer) return nullptr;
  return [signer = *signer, signature = std::move(signature)](const ModelFile& model) {
    check_signature(model, signer, signature);
  };
}

// Checks the options that the frame path does not check itself.
void check_numbers(const endo_options& o) {
  require_argument(o.spinning == 0 || o.spinning == 1, "spinning", "must be 0 or 1", o.spinning);
  require_argument(o.log_level >= ENDO_LOG_ERROR && o.log_level <= ENDO_LOG_INFO, "log_level", "must be an endo_log_level",
                   o.log_level);
}

// Also of the file that this machine does not open: another one of the fleet does.
void check_pins(const OpenRequest& request, bool is_signed) {
  check_sha256_form(request.model_proof.sha256, "model_sha256");
  check_sha256_form(request.float32_model_proof.sha256, "float32_model_sha256");
  check_sha256_form(request.runtime_sha256, "runtime_sha256");
  const bool pinned = !request.model_proof.sha256.empty() && !is_signed;
  const bool open_door = pinned && !request.float32_model.empty() && request.float32_model_proof.sha256.empty();
  require_argument(!open_door, "float32_model_sha256", "must be given where model_sha256 and float32_model are, and no public_key",
                   "NULL");
}

ProviderOptions provider_options(const endo_options& o) {
  std::vector<std::string> texts;
  for (const char* const* text = o.provider_options; text != nullptr && *text != nullptr; ++text) texts.emplace_back(*text);
  return checked_provider_options(o.provider != nullptr ? o.provider : cpu_provider, parse_provider_options(texts));
}

std::optional<Size> network_size(const endo_options& o) {
  if (o.network_width == 0 && o.network_height == 0) return std::nullopt;
  return Size{o.network_width, o.network_height};
}

}  // namespace

void write_default_options(endo_options* options, size_t struct_size) {
  check_struct_size(struct_size, first_options, "options");
  std::memset(options, 0, struct_size);
  write_struct(default_options(), struct_size, options);
}

OpenRequest open_request(const endo_options* options) {
  const endo_options o = options != nullptr ? read_struct(options, first_options, "options") : default_options();
  check_numbers(o);
  OpenRequest request;
  request.float32_model = text_or_nothing(o.float32_model, "float32_model");
  request.model_proof.sha256 = text_or_nothing(o.model_sha256, "model_sha256");
  request.float32_model_proof.sha256 = text_or_nothing(o.float32_model_sha256, "float32_model_sha256");
  request.runtime_sha256 = text_or_nothing(o.runtime_sha256, "runtime_sha256");
  check_pins(request, o.public_key != nullptr);
  const std::optional<Signer> signer = signer_of(o);
  request.model_proof.signature = check_by(signer, bytes_or_nothing(o.signature, o.signature_size, "signature"));
  request.float32_model_proof.signature = check_by(
      signer, bytes_or_nothing(o.float32_model_signature, o.float32_model_signature_size, "float32_model_signature"));
  request.runtime_library = text_or_nothing(o.runtime_library, "runtime_library");
  FramePathSettings& s = request.settings;
  s.threads = o.threads;
  s.network = network_size(o);
  s.limits = {o.min_confidence, o.min_depth_mm, o.max_depth_mm, o.depth_unit_mm};
  s.deadline_ms = o.deadline_ms;
  s.max_age_ms = o.max_age_ms;
  s.host_gate = std::make_shared<HostGate>();
  s.log = s.frame_log = {o.log, o.log_context, o.log_level, s.host_gate.get()};
  s.thread_hook = {o.thread_started, o.thread_context, s.host_gate.get()};
  check_settings(s);
  if (s.threads == 0) s.threads = default_thread_count();
  if (o.provider != nullptr) request.session.provider = o.provider;
  request.session.provider_options = provider_options(o);
  request.session.threads = s.threads;
  request.session.spinning = o.spinning == 1;
  request.session.thread_hook = s.thread_hook;
  return request;
}

}  // namespace endosdk
