// The session of libendosdk: a model in ONNX Runtime, which is opened at run time.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "frame_path/session.hpp"
#include "library/log_reader.hpp"
#include "library/runtime.hpp"
#include "library/session_interface.hpp"
#include "library/session_threads.hpp"
#include "model/providers.hpp"

namespace endosdk {

struct SessionSettings {
  std::string provider = "cpu";  // short name or the runtime's own
  ProviderOptions provider_options;
  int threads = 1;
  bool spinning = false;
  ThreadHook thread_hook{};
};

// For an accelerator, a session without a size is a reader: it reads the model's metadata, on the processor. `for_size` makes
// the sessions that run the network.
class OrtStereoSession : public Session {
 public:
  OrtStereoSession(std::shared_ptr<const Runtime> runtime, std::shared_ptr<const ModelFile> model,
                   const SessionSettings& settings, const Log& log);

  const ModelInfo& model() const override { return info_; }
  const SessionFacts& facts() const override { return facts_; }
  std::shared_ptr<Session> for_size(Size input) override;
  std::unique_ptr<Run> bind(SessionBuffers& buffers) override;
  std::shared_ptr<Session> for_one_thread_each() override;

 private:
  class BoundRun;

  OrtStereoSession(const OrtStereoSession& reader, Size input);

  // Whether the provider may have its own memory, so that each frame is copied to it.
  bool copies_inputs() const { return facts_.provider != cpu_provider; }
  bool is_reader() const { return copies_inputs() && !sides_; }
  void open();
  void read_metadata();
  void check_provider(OrtStatus* status) const;
  void add_provider(OrtSessionOptions* options) const;
  void append_provider(OrtSessionOptions* options, const std::vector<const char*>& keys,
                       const std::vector<const char*>& values) const;

  std::shared_ptr<const Runtime> runtime_;
  std::shared_ptr<const ModelFile> file_;
  SessionSettings settings_;
  LogReader log_;
  std::optional<OpenSides> sides_;  // only in a session for one size
  SessionFacts facts_;
  ModelInfo info_;
  OrtHandle<OrtEnv> environment_;
  std::unique_ptr<SessionThreads> threads_;
  OrtHandle<OrtSession> session_;
  mutable std::mutex running_;  // held during a run if the provider copies inputs
};

}  // namespace endosdk
