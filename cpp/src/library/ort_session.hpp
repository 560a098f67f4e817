// The session of libendosdk: a model in an ONNX Runtime that was opened at run time.
#pragma once

#include <memory>
#include <string>

#include "frame_path/session.hpp"
#include "library/runtime.hpp"
#include "platform/log.hpp"

namespace endosdk {

struct SessionSettings {
  std::string provider = "cpu";  // short name or the runtime's own
  int threads = 0;               // 0: the runtime chooses
  bool spinning = true;
};

class OrtStereoSession : public Session {
 public:
  OrtStereoSession(std::shared_ptr<const Runtime> runtime, std::shared_ptr<const ModelFile> model,
                   const SessionSettings& settings, const Log& log);

  const ModelInfo& model() const override { return info_; }
  const SessionFacts& facts() const override { return facts_; }
  std::unique_ptr<Run> bind(SessionBuffers& buffers) override;
  std::shared_ptr<Session> for_one_thread_each() override;

 private:
  class BoundRun;

  void open();
  void read_metadata();
  void add_provider(OrtSessionOptions* options) const;

  std::shared_ptr<const Runtime> runtime_;
  std::shared_ptr<const ModelFile> file_;
  SessionSettings settings_;
  Log log_;
  SessionFacts facts_;
  ModelInfo info_;
  OrtHandle<OrtEnv> environment_;
  OrtHandle<OrtSession> session_;
};

}  // namespace endosdk
