#include "threads.hpp"

#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "errors.hpp"

namespace endosdk {
namespace {

thread_local bool is_alone = false;

int default_threads() {
  constexpr int plenty = 8;  // beyond this the kernels wait for memory
  cpu_set_t cores;
  CPU_ZERO(&cores);
  const int available = sched_getaffinity(0, sizeof(cores), &cores) == 0
                            ? CPU_COUNT(&cores)
                            : static_cast<int>(std::thread::hardware_concurrency());
  return std::clamp(available, 1, plenty);
}

// One loop while it runs. Workers take blocks from a shared counter, so a slow or late worker costs little.
struct Loop {
  const LoopBody* body = nullptr;
  int count = 0;
  int block = 1;
  int workers = 0;
  std::atomic<int> next{0};

  void work(int worker) {
    for (int begin = next.fetch_add(block); begin < count; begin = next.fetch_add(block)) {
      (*body)(begin, std::min(begin + block, count), worker);
    }
  }
};

class Pool {
 public:
  explicit Pool(int size) : size_(size) {}
  ~Pool() { stop(); }

  int size() const { return size_; }

  void resize(int size) {
    const std::lock_guard running(running_);
    stop();
    size_ = size;
  }

  void run(int count, int block, const LoopBody& body, int workers) {
    const int blocks = (count + block - 1) / block;
    const std::unique_lock running(running_, std::try_to_lock);
    if (blocks < 2 || !running.owns_lock() || size_ == 1) {
      for (int begin = 0; begin < count; begin += block) body(begin, std::min(begin + block, count), 0);
      return;
    }
    start();
    {
      const std::lock_guard lock(mutex_);
      loop_.body = &body;
      loop_.count = count;
      loop_.block = block;
      loop_.workers = workers;
      loop_.next = 0;
      ++generation_;
      open_ = true;
    }
    wake_.notify_all();
    loop_.work(0);
    // Only workers that joined in time matter: one that other programs keep from running must not delay the frame.
    std::unique_lock lock(mutex_);
    open_ = false;
    done_.wait(lock, [&] { return active_ == 0; });
  }

 private:
  void start() {
    while (static_cast<int>(workers_.size()) < size_ - 1) {
      const int worker = static_cast<int>(workers_.size()) + 1;
      workers_.emplace_back([this, worker, seen = generation_]() mutable { serve(worker, seen); });
    }
  }

  void stop() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
    for (std::thread& worker : workers_) worker.join();
    workers_.clear();
    stopping_ = false;
  }

  void serve(int worker, unsigned seen) {
    std::unique_lock lock(mutex_);
    for (;;) {
      wake_.wait(lock, [&] { return stopping_ || generation_ != seen; });
      if (stopping_) return;
      seen = generation_;
      if (!open_ || worker >= loop_.workers) continue;
      ++active_;
      lock.unlock();
      loop_.work(worker);
      lock.lock();
      if (--active_ == 0) done_.notify_one();
    }
  }

  std::atomic<int> size_;
  std::mutex running_;  // held by the caller whose loop the workers serve
  std::mutex mutex_;    // guards everything below
  std::condition_variable wake_;
  std::condition_variable done_;
  std::vector<std::thread> workers_;
  Loop loop_;
  unsigned generation_ = 0;
  int active_ = 0;     // workers inside the loop
  bool open_ = false;  // workers may still join the loop
  bool stopping_ = false;
};

// Never destroyed: at exit the workers sleep and hold nothing, and joining them from a destructor could deadlock.
Pool* pool_instance = nullptr;
std::mutex pool_mutex;

// A forked child has none of the parent's threads and cannot use their locks: it leaves the old pool alone and makes
// its own. The mutex is held across the fork so that the child finds it in a known state.
void before_fork() { pool_mutex.lock(); }
void after_fork_parent() { pool_mutex.unlock(); }
void after_fork_child() {
  if (pool_instance != nullptr) pool_instance = new Pool(pool_instance->size());
  pool_mutex.unlock();
}

Pool& pool() {
  const std::lock_guard lock(pool_mutex);
  if (pool_instance == nullptr) {
    pool_instance = new Pool(default_threads());
    pthread_atfork(before_fork, after_fork_parent, after_fork_child);
  }
  return *pool_instance;
}

}  // namespace

int thread_count() { return pool().size(); }

void set_thread_count(int count) {
  require(count >= 1 && count <= max_threads, "threads", "must be 1 to " + std::to_string(max_threads), count);
  pool().resize(count);
}

void stay_alone() { is_alone = true; }

void parallel_for(int count, int block, LoopBody body, int workers) {
  if (is_alone) {
    for (int begin = 0; begin < count; begin += block) body(begin, std::min(begin + block, count), 0);
  } else {
    pool().run(count, block, body, workers);
  }
}

}  // namespace endosdk
