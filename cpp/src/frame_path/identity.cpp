#include "frame_path/identity.hpp"

#include "platform/system.hpp"

namespace endosdk {

Identity identity_of(const ModelInfo& model, const SessionFacts& session, const Rig* rig) {
  static const std::string device = system::processor_name();
  return {ENDOSDK_VERSION,         model.name,       model.version,
          model.sha256,            rig != nullptr ? rig->sha256() : "",
          session.runtime_version, session.runtime_sha256, session.provider,
          device};
}

}  // namespace endosdk
