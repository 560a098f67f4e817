// What the frame path asks of whoever runs the network: libendosdk's own ONNX Runtime session, or the Python package's.
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

// Of the network's input: a picture, padded to the model's multiple.
Size padded_size(Size picture, const ModelInfo& model);

// What one run reads and writes. The frame path owns it, so that the rectifier writes where the network reads.
class SessionBuffers {
 public:
  // For pictures of this size.
  SessionBuffers(Size picture, const ModelInfo& model);

  Size input() const { return input_; }

  // Zeros until they are written: the memory is touched here, so that the first frame does not pay for it.
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

// What reports say of a session.
struct SessionFacts {
  std::string provider;  // the runtime's own name of it
  ProviderOptions provider_options;
  std::string runtime_version;
  std::string runtime_library;  // path; empty where the host does not know it
  std::string runtime_sha256;   // of its library's file
  bool telemetry_on = false;    // the host opened the runtime first, with its telemetry on
};

class Session {
 public:
  // The network, tied to one set of buffers. Runs of different ones may overlap.
  class Run {
   public:
    virtual ~Run() = default;
    virtual void operator()() = 0;

    // Makes this run, and later ones, fail soon, from any thread, until `resume`.
    virtual void stop() = 0;
    virtual void resume() = 0;
  };

  virtual ~Session() = default;

  virtual const ModelInfo& model() const = 0;
  virtual const SessionFacts& facts() const = 0;

  // A session for inputs of exactly this size. Null where that makes no difference: this one takes any.
  virtual std::shared_ptr<Session> for_size(Size input) = 0;

  // The buffers must live as long as what is returned, and keep their place. Not for a session that `for_size` makes
  // others of.
  virtual std::unique_ptr<Run> bind(SessionBuffers& buffers) = 0;

  // A session whose runs stay on the thread that calls, so that several frames can run at a time. Null where that makes
  // no difference: this one serves.
  virtual std::shared_ptr<Session> for_one_thread_each() = 0;
};

}  // namespace endosdk
