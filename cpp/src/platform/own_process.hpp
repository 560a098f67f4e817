// The process in which an object was created. A forked child must not use the object: the child has none of its threads, and
// its locks may be held forever.
#pragma once

#include "platform/errors.hpp"
#include "platform/system.hpp"

namespace endosdk {

class OwnProcess {
 public:
  bool is_this() const { return id_ == system::process_id(); }

  // Must be called before any lock is taken.
  void check() const {
    require(is_this(), "estimator", "must be used in the process that opened it", "a child that was forked");
  }

 private:
  long id_ = system::process_id();
};

}  // namespace endosdk
