// The worker threads that all kernels share.
//
// The caller of parallel_for works, too. Workers start with the first loop that needs them, and sleep after a moment without
// work. If they are busy with the loop of another caller, a loop runs on its own caller alone, so callers never wait for each
// other. Each calling thread sets how many threads its loops may use, so that two estimators of one process do not decide for
// each other. After fork(), the child starts its own workers.
#pragma once

#include <memory>
#include <type_traits>

#include "platform/errors.hpp"
#include "platform/thread_start.hpp"

namespace endosdk {

constexpr int max_threads = 256;

// The number of cores that this process may use, but not more threads than the kernels can use well.
int default_thread_count();

// Number of threads that a loop of the calling thread may use, including this thread. It is default_thread_count() until it is
// set.
int thread_count();

// The error ENDO_OUT_OF_MEMORY for: the system started only some of the further threads that were wanted.
Error short_of_threads(int wanted, int started);

// Throws this error unless the system can run `count` further threads at a time. The threads end before the call returns.
void reserve_threads(int count);

// Sets the number for later loops of the calling thread, 1 to max_threads. With 1, they run on this thread alone.
void set_thread_count(int count);

// Sets the number while the object lives. Each worker that starts meanwhile calls the hook before it works.
class LoopThreads {
 public:
  explicit LoopThreads(int count, const ThreadHook& hook = {});
  ~LoopThreads();

  LoopThreads(const LoopThreads&) = delete;
  LoopThreads& operator=(const LoopThreads&) = delete;

 private:
  int count_before_;
  ThreadHook hook_before_;
};

// A reference to a function, which must live longer than the reference. It allocates nothing.
template <typename... Arguments>
class FunctionReference {
 public:
  template <typename Function, typename = std::enable_if_t<!std::is_same_v<std::decay_t<Function>, FunctionReference>>>
  FunctionReference(Function&& function)  // implicit, so that a lambda can be passed where it is written
      : object_(const_cast<void*>(static_cast<const void*>(std::addressof(function)))),
        call_([](void* object, Arguments... arguments) { (*static_cast<std::remove_reference_t<Function>*>(object))(arguments...); }) {}

  void operator()(Arguments... arguments) const { call_(object_, arguments...); }

 private:
  void* object_;
  void (*call_)(void*, Arguments...);
};

// The body of a loop. It is called as body(begin, end, worker), with `worker` below thread_count().
using LoopBody = FunctionReference<int, int, int>;

// Calls `body` for blocks of at most `block` indices that together cover 0 to count. Only workers below `workers` take part: a
// caller with scratch memory per worker passes for how many workers it has memory. An exception of the body, on any thread,
// reaches the caller after all workers have left the loop. Blocks that have not begun are skipped. Of several exceptions, the
// first is kept.
void parallel_for(int count, int block, LoopBody body, int workers = max_threads);

// Does the same while the caller runs `own`. Other threads begin with the blocks; the caller joins them when `own` is done.
// Loops inside `own` run on the caller's thread alone.
void parallel_for_beside(FunctionReference<> own, int count, int block, LoopBody body);

}  // namespace endosdk
