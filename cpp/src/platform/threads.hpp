// The worker threads that all kernels share.
//
// The caller of parallel_for works too; workers sleep when there has been nothing to do for a moment, and start with the
// first loop that needs them. When the workers are busy with another caller's loop, a loop runs on its own caller alone, so callers
// never wait for each other. How many threads a loop may use is the calling thread's own setting, so that two estimators
// of one process do not decide for each other. After fork() the child starts workers of its own.
#pragma once

#include <memory>
#include <type_traits>

#include "platform/errors.hpp"
#include "platform/thread_start.hpp"

namespace endosdk {

constexpr int max_threads = 256;

// As many as the cores this process may use, but no more than keep the kernels busy.
int default_thread_count();

// Threads that a loop of the calling thread may use, itself included; default_thread_count() until it is set.
int thread_count();

// OUT_OF_MEMORY: the system started only some of the further threads that were wanted.
Error short_of_threads(int wanted, int started);

// Throws that unless the system can start so many further threads at a time. None of them stays.
void reserve_threads(int count);

// For the later loops of the calling thread, 1 to max_threads. With 1 they run on that thread alone.
void set_thread_count(int count);

// The same for as long as the object lives. Workers that start meanwhile are handed to the hook, each before it works.
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

// A reference to a function, which must live longer. Making one takes no memory.
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

// The body of a loop; it is called as body(begin, end, worker) with worker below thread_count().
using LoopBody = FunctionReference<int, int, int>;

// Calls `body` for blocks of at most `block` indices that together cover 0 to count. Only workers below `workers` take
// part: a body with scratch memory per worker passes how many it has. What a body throws, on whichever thread, reaches
// the caller once no worker is in the loop. Blocks that have not begun are left out; of several exceptions the first is
// kept.
void parallel_for(int count, int block, LoopBody body, int workers = max_threads);

// The same, beside work of the caller's own: other threads begin with the blocks, and the caller takes part once `own` is
// done. Loops within it run on its thread alone.
void parallel_for_beside(FunctionReference<> own, int count, int block, LoopBody body);

}  // namespace endosdk
