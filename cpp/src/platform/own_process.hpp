// The process that an object was made in. A forked child has none of its threads, and finds its locks as they were held.
#pragma once

#include "platform/errors.hpp"
#include "platform/system.hpp"

namespace endosdk {

class OwnProcess {
 public:
  bool is_this() const { return id_ == system::process_id(); }

  // To be asked before any lock is taken.
  void check() const {
    require(is_this(), "estimator", "must be used in the process that opened it", "a child that was forked");
  }

 private:
  long id_ = system::process_id();
};

}  // namespace endosdk
