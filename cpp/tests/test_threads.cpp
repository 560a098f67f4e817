// Tests the pool with several callers that want different numbers of threads. The sums must be right, and the thread sanitizer
// must find nothing.
#include <atomic>
#include <new>
#include <thread>
#include <vector>

#include "check.hpp"
#include "platform/threads.hpp"

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

// The caller does its own work, with loops in it, while other threads may already run blocks of the loop beside it.
void test_work_beside_a_loop() {
  for (const int threads : {1, 2, 4}) {
    set_thread_count(threads);
    for (int repeat = 0; repeat < 200; ++repeat) {
      const std::thread::id caller = std::this_thread::get_id();
      std::atomic<int> sum{0};
      int own = 0;
      const auto work = [&] {
        CHECK(std::this_thread::get_id() == caller);
        parallel_for(10, 1, [&](int begin, int end, int worker) {
          CHECK(std::this_thread::get_id() == caller && worker == 0);
          own += end - begin;
        });
      };
      parallel_for_beside(work, 100, 3, [&](int begin, int end, int) { sum += end - begin; });
      CHECK(own == 10 && sum == 100);
    }
    const auto fails = [] { throw std::runtime_error("own work"); };
    CHECK(rejection([&] { parallel_for_beside(fails, 100, 3, [](int, int, int) {}); }) == "own work");
    CHECK(rejection([&] { parallel_for_beside([] {}, 100, 3, [](int, int, int) { throw std::runtime_error("body"); }); }) == "body");
    std::atomic<int> after{0};
    parallel_for(64, 1, [&](int begin, int end, int) { after += end - begin; });
    CHECK(after == 64);
  }
}

void test_loops_inside_loops() {
  std::atomic<int> sum{0};
  parallel_for(8, 1, [&](int, int, int) {
    parallel_for(10, 3, [&](int begin, int end, int) { sum += end - begin; });
  });
  CHECK(sum == 80);
}

void test_callers_with_different_counts() {
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 4; ++caller) {
    callers.emplace_back([caller] {
      for (int repeat = 0; repeat < 300; ++repeat) {
        const int count = (caller + repeat) % 5 + 1;
        const LoopThreads threads(count);
        test_every_index_once(50, 7);
        CHECK(thread_count() == count);
      }
    });
  }
  for (std::thread& caller : callers) caller.join();
}

void test_each_thread_has_its_own_count() {
  set_thread_count(3);
  std::thread([] {
    CHECK(thread_count() == default_thread_count());
    {
      const LoopThreads alone(1);
      CHECK(thread_count() == 1);
    }
    CHECK(thread_count() == default_thread_count());
  }).join();
  CHECK(thread_count() == 3);
}

// The caller must get the exception, whichever thread throws it. The caller may be this thread.
void test_what_a_body_throws_reaches_the_caller() {
  constexpr int threads = 3;
  set_thread_count(threads);
  for (int repeat = 0; repeat < 100; ++repeat) {
    for (int thrower = -1; thrower < threads; ++thrower) {  // -1: all of them
      std::atomic<int> inside{0};
      std::atomic<bool> over{false};
      const auto body = [&](int, int, int worker) {
        const std::vector<int> held(100, worker);  // must be freed
        ++inside;
        while (thrower >= 0 && worker != thrower && !over) std::this_thread::yield();  // waits for the thrower
        --inside;
        if (thrower < 0 || worker == thrower) {
          over = true;
          throw std::bad_alloc();
        }
      };
      bool caught = false;
      try {
        parallel_for(64, 1, body);
      } catch (const std::bad_alloc&) {
        caught = true;
      }
      CHECK(caught && inside == 0);
    }
    test_every_index_once(64, 1);
  }
}

}  // namespace

int main() {
  for (const int threads : {1, 2, 5}) {
    set_thread_count(threads);
    CHECK(thread_count() == threads);
    for (const int count : {0, 1, 2, 16, 17, 1000}) test_every_index_once(count, 16);
  }
  test_worker_limit();
  test_work_beside_a_loop();
  test_loops_inside_loops();
  test_callers_with_different_counts();
  test_each_thread_has_its_own_count();
  test_what_a_body_throws_reaches_the_caller();
  CHECK(rejection([] { set_thread_count(0); }) == "threads: must be 1 to 256; got 0");
  return 0;
}
