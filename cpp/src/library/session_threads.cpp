#include "library/session_threads.hpp"

#include <system_error>

#include "platform/threads.hpp"

namespace endosdk {

SessionThreads::SessionThreads(int count, const ThreadHook& hook) : hook_(hook) {
  try {
    while (threads_.size() < static_cast<size_t>(count)) start();
  } catch (const std::system_error&) {
    end_spare();
    throw short_of_threads(count, static_cast<int>(threads_.size()));
  } catch (...) {
    end_spare();
    throw;
  }
  std::unique_lock lock(mutex_);
  change_.wait(lock, [&] { return begun_ == threads_.size(); });
}

SessionThreads::~SessionThreads() { end_spare(); }

void SessionThreads::offer(const Runtime& runtime, OrtSessionOptions* options) {
  const OrtApi& api = runtime.api();
  const auto check = [&](OrtStatus* status) { runtime.check(status, ENDO_INTERNAL, "runtime", "must take its threads"); };
  check(api.SessionOptionsSetCustomCreateThreadFn(options, create));
  check(api.SessionOptionsSetCustomThreadCreationOptions(options, this));
  check(api.SessionOptionsSetCustomJoinThreadFn(options, join));
}

void SessionThreads::end_spare() {
  {
    const std::lock_guard lock(mutex_);
    over_ = true;
  }
  change_.notify_all();
  for (; taken_ < threads_.size(); ++taken_) threads_[taken_]->thread.join();
}

void SessionThreads::start() {
  threads_.reserve(threads_.size() + 1);  // so that no thread is lost for want of memory
  auto made = std::make_unique<Thread>();
  made->thread = new_thread([this, self = made.get()] { serve(*self); });
  threads_.push_back(std::move(made));
}

void SessionThreads::serve(Thread& self) {
  start_thread("endosdk-session", hook_);
  {
    std::unique_lock lock(mutex_);
    ++begun_;
    change_.notify_all();
    change_.wait(lock, [&] { return self.work != nullptr || over_; });
  }
  if (self.work != nullptr) self.work(self.argument);
}

// Called by the runtime while it makes the session.
OrtCustomThreadHandle SessionThreads::create(void* threads, OrtThreadWorkerFn work, void* argument) {
  auto& self = *static_cast<SessionThreads*>(threads);
  try {
    if (self.taken_ == self.threads_.size()) self.start();  // a runtime that wants more than it was told to use
  } catch (...) {
    return nullptr;
  }
  Thread* next = self.threads_[self.taken_++].get();
  {
    const std::lock_guard lock(self.mutex_);
    next->work = work;
    next->argument = argument;
  }
  self.change_.notify_all();
  return reinterpret_cast<OrtCustomThreadHandle>(next);
}

void SessionThreads::join(OrtCustomThreadHandle handle) {
  // The type of a handle is const, the thread behind it is not.
  auto* taken = reinterpret_cast<Thread*>(const_cast<OrtCustomHandleType*>(handle));
  taken->thread.join();
}

}  // namespace endosdk
