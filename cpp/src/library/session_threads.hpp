// The threads in which ONNX Runtime computes one session. It hangs where the system runs out of threads while it starts
// its own, so they are started here, before it asks for them.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "library/runtime.hpp"
#include "platform/thread_start.hpp"

namespace endosdk {

class SessionThreads {
 public:
  // Returns when all have begun. OUT_OF_MEMORY: the system started only some.
  SessionThreads(int count, const ThreadHook& hook);
  ~SessionThreads();
  SessionThreads(const SessionThreads&) = delete;
  SessionThreads& operator=(const SessionThreads&) = delete;

  // The session that is made with these options takes its threads from here. It must end before this object does.
  void offer(const Runtime& runtime, OrtSessionOptions* options);

  // Ends those that the session did not take.
  void end_spare();

 private:
  // While it waits for work, and while it does it. The runtime joins those that it took.
  struct Thread {
    std::thread thread;
    OrtThreadWorkerFn work = nullptr;
    void* argument = nullptr;
  };

  static OrtCustomThreadHandle create(void* threads, OrtThreadWorkerFn work, void* argument);
  static void join(OrtCustomThreadHandle handle);

  void start();
  void serve(Thread& self);

  const ThreadHook hook_;
  std::vector<std::unique_ptr<Thread>> threads_;
  size_t taken_ = 0;

  std::mutex mutex_;  // guards what follows, and the work of each thread
  std::condition_variable change_;
  size_t begun_ = 0;
  bool over_ = false;  // who has no work yet gets none
};

}  // namespace endosdk
