// The worker threads that all kernels share.
//
// The caller of parallel_for works too; workers sleep while there is nothing to do and start with the first loop that
// needs them. When the workers are busy with another caller's loop, a loop runs on its own caller alone, so callers
// never wait for each other. After fork() the child starts workers of its own.
#pragma once

#include <memory>
#include <type_traits>

namespace endosdk {

// Threads that a loop may use, the caller included.
int thread_count();

// 1 to max_threads. Waits for a running loop to end.
constexpr int max_threads = 256;
void set_thread_count(int count);

// Makes every later loop of the calling thread run on that thread alone: for callers that compute several frames at a
// time, one per thread.
void stay_alone();

// A reference to the body of a loop; it is called as body(begin, end, worker) with worker below thread_count().
class LoopBody {
 public:
  template <typename Body, typename = std::enable_if_t<!std::is_same_v<std::decay_t<Body>, LoopBody>>>
  LoopBody(Body&& body)  // implicit, so that a lambda can be passed where it is written
      : object_(const_cast<void*>(static_cast<const void*>(std::addressof(body)))),
        call_([](void* object, int begin, int end, int worker) {
          (*static_cast<std::remove_reference_t<Body>*>(object))(begin, end, worker);
        }) {}

  void operator()(int begin, int end, int worker) const { call_(object_, begin, end, worker); }

 private:
  void* object_;
  void (*call_)(void*, int, int, int);
};

// Calls `body` for blocks of at most `block` indices that together cover 0 to count. Only workers below `workers` take
// part: a body with scratch memory per worker passes how many it has. The body must not throw.
void parallel_for(int count, int block, LoopBody body, int workers = max_threads);

}  // namespace endosdk
