// The sessions of one model. On an accelerator each size of frame has one of its own, which is compiled for that size.
#pragma once

#include <memory>
#include <vector>

#include "frame_path/session.hpp"

namespace endosdk {

class Sessions {
 public:
  // Sessions kept at a time. To compile one takes up to minutes; a device has few sizes.
  static constexpr size_t kept = 4;

  explicit Sessions(std::shared_ptr<Session> any) : any_(std::move(any)) {}

  // What the model says of itself, and where it runs.
  const Session& any() const { return *any_; }

  // The session that runs pictures of this size, made when it is asked for first. Of those for one size each, the one
  // that was asked for longest ago goes when there are too many; who still holds it keeps it.
  std::shared_ptr<Session> of(Size picture);

  // The same, where frames are computed on one thread each.
  std::shared_ptr<Session> for_one_thread_each(Size picture);

  void drop();

 private:
  struct Sized {
    Size input;
    std::shared_ptr<Session> session;
  };

  const std::shared_ptr<Session> any_;
  std::shared_ptr<Session> one_thread_each_;
  std::vector<Sized> sized_;  // the latest first
};

}  // namespace endosdk
