// The interface through which the frame path runs the network. It has two implementations: libendosdk's own ONNX Runtime
// session, and the session of the Python package.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "images/image.hpp"
#include "images/resize.hpp"
#include "images/size.hpp"
#include "model/model.hpp"
#include "model/provider_options.hpp"

namespace endosdk {

// Size of the network's input: the picture, padded to the model's multiple.
Size padded_size(Size picture, const ModelInfo& model);

// The memory that one run reads and writes. The frame path owns it, so that the rectifier writes where the network reads.
class SessionBuffers {
 public:
  // Allocates the memory for pictures of this size.
  SessionBuffers(Size picture, const ModelInfo& model);

  Size input() const { return input_; }

  // The memory is filled with zeros at construction, so that the first frame does not pay for its first use.
  PlanarView left() { return {pixels_.data(), input_.width, input_.height}; }
  PlanarView right() { return {pixels_.data() + pixels_.size() / 2, input_.width, input_.height}; }
  MutableFloatView disparity() { return {maps_.data(), grid_.width, grid_.height}; }
  MutableFloatView confidence() { return {maps_.data() + maps_.size() / 2, grid_.width, grid_.height}; }

 private:
  Size input_;
  Size grid_;
  std::vector<uint8_t> pixels_;  // both inputs
  std::vector<float> maps_;      // both outputs
};

// Facts about a session, for reports.
struct SessionFacts {
  std::string provider;  // by the runtime's own name
  ProviderOptions provider_options;
  std::string runtime_version;
  std::string runtime_library;  // path; empty where the host does not know it
  std::string runtime_sha256;   // of its library's file
  bool telemetry_on = false;    // the host opened the runtime first, with its telemetry on
};

class Session {
 public:
  // The network, bound to one set of buffers. Runs with different buffers may overlap.
  class Run {
   public:
    virtual ~Run() = default;
    virtual void operator()() = 0;

    // Makes this run and later ones fail soon, until `resume` is called. May be called from any thread.
    virtual void stop() = 0;
    virtual void resume() = 0;
  };

  virtual ~Session() = default;

  virtual const ModelInfo& model() const = 0;
  virtual const SessionFacts& facts() const = 0;

  // A session for inputs of exactly this size. Null if this session takes any size.
  virtual std::shared_ptr<Session> for_size(Size input) = 0;

  // The buffers must live as long as the returned run, and keep their addresses. Must not be called on a session whose
  // `for_size` returns another session.
  virtual std::unique_ptr<Run> bind(SessionBuffers& buffers) = 0;

  // A session whose runs stay on the calling thread, so that several frames can run at the same time. Null if this session can
  // be used for that.
  virtual std::shared_ptr<Session> for_one_thread_each() = 0;
};

}  // namespace endosdk
