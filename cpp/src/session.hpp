// A loaded model, the memory it reads and writes, and the call that runs it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "image.hpp"
#include "log.hpp"
#include "model.hpp"
#include "rectify.hpp"
#include "resize.hpp"
#include "runtime.hpp"

namespace endosdk {

struct SessionSettings {
  std::string provider = "cpu";  // short name or the runtime's own
  int threads = 0;               // 0: the runtime chooses
  bool spinning = true;
};

class Session {
 public:
  Session(std::shared_ptr<const Runtime> runtime, const ModelFile& model, const SessionSettings& settings, const Log& log);

  const Runtime& runtime() const { return *runtime_; }
  const ModelInfo& info() const { return info_; }
  const std::string& model_sha256() const { return model_sha256_; }
  const std::string& provider() const { return provider_; }

  // Input and output memory of one size, bound to the session: write into left and right, run, read the others.
  class Buffers {
   public:
    Buffers(const Session& session, Size picture);

    PlanarView left();
    PlanarView right();
    FloatView disparity() const;
    FloatView confidence() const;

   private:
    friend class Session;
    Size input_;
    Size grid_;
    std::vector<uint8_t> pixels_;  // both inputs
    std::vector<float> maps_;      // both outputs
    std::vector<OrtHandle<OrtValue>> values_;
    OrtHandle<OrtIoBinding> binding_;
  };

  // One caller at a time.
  void run(Buffers& buffers);

  // Makes runs end early, from any thread, until `resume`.
  void terminate();
  void resume();

 private:
  void open(const ModelFile& model, const SessionSettings& settings);
  void read_metadata();
  void add_provider(OrtSessionOptions* options) const;

  std::shared_ptr<const Runtime> runtime_;
  Log log_;
  std::string provider_;
  std::string model_sha256_;
  ModelInfo info_;
  OrtHandle<OrtEnv> environment_;
  OrtHandle<OrtSession> session_;
  OrtHandle<OrtRunOptions> run_options_;
};

}  // namespace endosdk
