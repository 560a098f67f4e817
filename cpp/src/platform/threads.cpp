#include "platform/threads.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "platform/system.hpp"

namespace endosdk {
namespace {

thread_local int wanted_threads = 0;  // 0: the default
thread_local bool is_in_loop = false;  // whether this thread has begun a loop that has not ended
thread_local ThreadHook worker_hook;  // for workers that start in loops of this thread

// Waits actively for a short time. The loops of a frame follow each other within microseconds. To fall asleep and wake up takes
// longer than many of these loops. The thread does not yield: another program that waits for the core could keep it for
// milliseconds.
template <typename Condition>
void look_for(const Condition& condition) {
  constexpr auto patience = std::chrono::microseconds(50);
  const auto end = std::chrono::steady_clock::now() + patience;
  while (!condition() && std::chrono::steady_clock::now() < end) {
  }
}

struct InLoop {
  InLoop() { is_in_loop = true; }
  ~InLoop() { is_in_loop = false; }
};

// One loop while it runs. Workers take blocks from a shared counter, so a slow or late worker costs little.
struct Loop {
  const LoopBody* body = nullptr;
  int count = 0;
  int block = 1;
  int workers = 0;
  std::atomic<int> next{0};
  std::atomic<bool> failed{false};
  std::exception_ptr failure;  // of the body that failed first; only this body writes here

  void work(int worker) noexcept {
    try {
      for (int begin = next.fetch_add(block); begin < count; begin = next.fetch_add(block)) {
        (*body)(begin, std::min(begin + block, count), worker);
      }
    } catch (...) {
      stop();
    }
  }

  void run_own(const FunctionReference<>& own) noexcept {
    try {
      own();
    } catch (...) {
      stop();
    }
  }

  // Ends the loop early, and keeps the exception that is being handled if it is the first.
  void stop() noexcept {
    if (!failed.exchange(true)) failure = std::current_exception();
    next = count;
  }
};

void run_alone(int count, int block, const LoopBody& body) {
  for (int begin = 0; begin < count; begin += block) body(begin, std::min(begin + block, count), 0);
}

class Pool {
 public:
  // `own` is null if the caller has no work of its own.
  void run(const FunctionReference<>* own, int count, int block, const LoopBody& body, int workers) {
    const std::unique_lock running(running_, std::try_to_lock);
    if (!running.owns_lock()) {
      const InLoop in_loop;
      if (own != nullptr) (*own)();
      run_alone(count, block, body);
      return;
    }
    const InLoop in_loop;
    start(workers - 1);
    {
      const std::lock_guard lock(mutex_);
      loop_.body = &body;
      loop_.count = count;
      loop_.block = block;
      loop_.workers = workers;
      loop_.next = 0;
      loop_.failed = false;
      ++generation_;
      open_ = true;
    }
    wake_.notify_all();
    if (own != nullptr) loop_.run_own(*own);
    loop_.work(0);
    // Waits only for workers that have joined: a worker that other programs keep from running must not delay the frame.
    std::unique_lock lock(mutex_);
    open_ = false;
    lock.unlock();
    look_for([&] { return active_ == 0; });
    lock.lock();
    done_.wait(lock, [&] { return active_ == 0; });
    const std::exception_ptr failure = std::exchange(loop_.failure, nullptr);
    lock.unlock();
    if (failure) std::rethrow_exception(failure);
  }

 private:
  void start(int workers) {
    if (started_ >= workers) return;
    for (; started_ < workers; ++started_) {
      try {
        new_thread([this, worker = started_ + 1, seen = generation_.load(), hook = worker_hook] {
          serve(worker, seen, hook);
        }).detach();
      } catch (const std::system_error&) {
        break;  // the system has no thread left: the loop runs on the existing ones
      }
    }
    // Waits until every new worker has called the hook: it must not be called after the host's own call has ended.
    std::unique_lock lock(mutex_);
    done_.wait(lock, [&] { return begun_ == started_; });
  }

  [[noreturn]] void serve(int worker, unsigned seen, const ThreadHook& hook) {
    start_thread("endosdk-kernels", hook);
    std::unique_lock lock(mutex_);
    ++begun_;
    done_.notify_one();
    for (;;) {
      lock.unlock();
      look_for([&] { return generation_ != seen; });
      lock.lock();
      wake_.wait(lock, [&] { return generation_ != seen; });
      seen = generation_;
      if (!open_ || worker >= loop_.workers) continue;
      ++active_;
      lock.unlock();
      loop_.work(worker);
      lock.lock();
      if (--active_ == 0) done_.notify_one();
    }
  }

  std::mutex running_;  // held by the caller whose loop the workers serve
  int started_ = 0;     // workers; guarded by running_
  std::mutex mutex_;    // guards everything below; atomic members may be read without it
  std::condition_variable wake_;
  std::condition_variable done_;
  Loop loop_;
  std::atomic<unsigned> generation_ = 0;
  int begun_ = 0;      // workers that have called the hook
  std::atomic<int> active_ = 0;  // workers inside the loop
  bool open_ = false;  // workers may still join the loop
};

// The pool is never destroyed, and its workers never end. At exit they sleep and hold nothing. Joining them could deadlock.
Pool* pool_instance = nullptr;
std::mutex pool_mutex;

// A forked child has none of the parent's threads and cannot use their locks. So it abandons the old pool and makes its own.
// The mutex is held during the fork, so that the child finds it in a known state.
void before_fork() { pool_mutex.lock(); }
void after_fork_parent() { pool_mutex.unlock(); }
void after_fork_child() {
  if (pool_instance != nullptr) pool_instance = new Pool();
  pool_mutex.unlock();
}

Pool& pool() {
  const std::lock_guard lock(pool_mutex);
  if (pool_instance == nullptr) {
    pool_instance = new Pool();
    system::on_fork(before_fork, after_fork_parent, after_fork_child);
  }
  return *pool_instance;
}

}  // namespace

int default_thread_count() {
  constexpr int plenty = 8;  // beyond this the kernels wait for memory
  return std::clamp(system::usable_cores(), 1, plenty);
}

Error short_of_threads(int wanted, int started) {
  const Text rule("the system must be able to start ", wanted, " more");
  return {ENDO_OUT_OF_MEMORY, "threads", as_text(rule), as_text(started)};
}

namespace {

// Threads that only wait. The destructor ends them, however the scope is left.
class WaitingThreads {
 public:
  ~WaitingThreads() {
    {
      const std::lock_guard lock(mutex_);
      may_end_ = true;
    }
    change_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  // Starts up to `count` threads, as many as the system allows, and returns how many run.
  int start(int count) {
    threads_.reserve(static_cast<size_t>(count));
    try {
      for (int i = 0; i < count; ++i) threads_.push_back(new_thread([this] { wait(); }));
    } catch (const std::system_error&) {
      // The returned number tells the caller that the system has no more threads.
    }
    return static_cast<int>(threads_.size());
  }

 private:
  void wait() {
    std::unique_lock lock(mutex_);
    change_.wait(lock, [this] { return may_end_; });
  }

  std::mutex mutex_;  // guards the next two
  std::condition_variable change_;
  bool may_end_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace

void reserve_threads(int count) {
  WaitingThreads threads;
  const int started = threads.start(count);
  if (started < count) throw short_of_threads(count, started);
}

int thread_count() { return wanted_threads > 0 ? wanted_threads : default_thread_count(); }

void set_thread_count(int count) {
  require(count >= 1 && count <= max_threads, "threads", Text("must be 1 to ", max_threads), count);
  wanted_threads = count;
}

LoopThreads::LoopThreads(int count, const ThreadHook& hook) : count_before_(thread_count()), hook_before_(worker_hook) {
  set_thread_count(count);
  worker_hook = hook;
}

LoopThreads::~LoopThreads() {
  set_thread_count(count_before_);
  worker_hook = hook_before_;
}

void parallel_for(int count, int block, LoopBody body, int workers) {
  const int threads = std::min(thread_count(), workers);
  if (threads < 2 || count <= block || is_in_loop) {
    run_alone(count, block, body);
  } else {
    pool().run(nullptr, count, block, body, threads);
  }
}

void parallel_for_beside(FunctionReference<> own, int count, int block, LoopBody body) {
  if (thread_count() < 2 || is_in_loop) {
    own();
    run_alone(count, block, body);
  } else {
    pool().run(&own, count, block, body, thread_count());
  }
}

}  // namespace endosdk
