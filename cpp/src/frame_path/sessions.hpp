// The sessions of one model. On an accelerator, each size of frame has its own session, which is compiled for this size.
#pragma once

#include <memory>
#include <vector>

#include "frame_path/session.hpp"

namespace endosdk {

class Sessions {
 public:
  // Number of sessions that are kept. Compiling a session takes up to minutes, and a device uses few sizes.
  static constexpr size_t kept = 4;

  explicit Sessions(std::shared_ptr<Session> any) : any_(std::move(any)) {}

  // The session from which the model's metadata and the provider are read.
  const Session& any() const { return *any_; }

  // The session for pictures of this size. It is created when it is first requested. If there are too many sessions for single
  // sizes, the one that was requested longest ago is removed. Callers that still hold it can still use it.
  std::shared_ptr<Session> of(Size picture);

  // The same, if each frame is computed on one thread.
  std::shared_ptr<Session> for_one_thread_each(Size picture);

  void drop();

 private:
  struct Sized {
    Size input;
    std::shared_ptr<Session> session;
  };

  const std::shared_ptr<Session> any_;
  std::shared_ptr<Session> one_thread_each_;
  std::vector<Sized> sized_;  // the last requested first
};

}  // namespace endosdk
