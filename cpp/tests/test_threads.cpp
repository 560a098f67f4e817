// The pool under several callers while its size changes: for the thread sanitizer, and for answers that must add up.
#include <atomic>
#include <thread>
#include <vector>

#include "check.hpp"
#include "threads.hpp"

using namespace endosdk;

namespace {

void test_every_index_once(int count, int block) {
  std::vector<std::atomic<int>> visits(static_cast<size_t>(count));
  parallel_for(count, block, [&](int begin, int end, int worker) {
    CHECK(begin < end && end <= count && end - begin <= block);
    CHECK(worker >= 0 && worker < max_threads);
    for (int i = begin; i < end; ++i) ++visits[static_cast<size_t>(i)];
  });
  for (const std::atomic<int>& visit : visits) CHECK(visit == 1);
}

void test_worker_limit() {
  set_thread_count(4);
  for (int repeat = 0; repeat < 200; ++repeat) {
    std::atomic<int> highest{0};
    const auto body = [&](int, int, int worker) {
      for (int seen = highest; seen < worker && !highest.compare_exchange_weak(seen, worker);) {
      }
    };
    parallel_for(64, 1, body, 2);
    CHECK(highest < 2);
  }
}

void test_loops_inside_loops() {
  std::atomic<int> sum{0};
  parallel_for(8, 1, [&](int, int, int) {
    parallel_for(10, 3, [&](int begin, int end, int) { sum += end - begin; });
  });
  CHECK(sum == 80);
}

void test_callers_and_changing_size() {
  std::atomic<bool> stop{false};
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 3; ++caller) {
    callers.emplace_back([] {
      for (int repeat = 0; repeat < 300; ++repeat) test_every_index_once(50, 7);
    });
  }
  std::thread changer([&] {
    for (int size = 1; !stop; size = size % 5 + 1) set_thread_count(size);
  });
  for (std::thread& caller : callers) caller.join();
  stop = true;
  changer.join();
}

}  // namespace

int main() {
  for (const int threads : {1, 2, 5}) {
    set_thread_count(threads);
    CHECK(thread_count() == threads);
    for (const int count : {0, 1, 2, 16, 17, 1000}) test_every_index_once(count, 16);
  }
  test_worker_limit();
  test_loops_inside_loops();
  test_callers_and_changing_size();
  CHECK(rejection([] { set_thread_count(0); }) == "threads: must be 1 to 256; got 0");
  return 0;
}
