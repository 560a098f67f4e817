// A machine at its limits: no further thread, no further memory. Both are one status, wherever they are missed.
#include <dlfcn.h>
#include <pthread.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cmath>
#include <limits>

#include "frame.hpp"

namespace {

constexpr int plenty = std::numeric_limits<int>::max();
std::atomic<int> threads_left{plenty};

}  // namespace

// Found before the system's own, by ONNX Runtime, too.
extern "C" [[gnu::visibility("default")]] int pthread_create(pthread_t* thread, const pthread_attr_t* attributes,
                                                             void* (*start)(void*), void* argument) {
  if (threads_left.fetch_sub(1) <= 0) return EAGAIN;
  static const auto real = reinterpret_cast<decltype(&pthread_create)>(dlsym(RTLD_NEXT, "pthread_create"));
  return real(thread, attributes, start, argument);
}

namespace {

// Some threads and then none is the case that ONNX Runtime waits for ever in.
void a_runtime_without_threads_is_out_of_resources(const Places& at) {
  constexpr int wanted = 8;
  constexpr unsigned longest_s = 60;
  endo_options options = default_options(at);
  options.threads = wanted;
  endo_estimator* handle = nullptr;
  alarm(longest_s);  // ends a test that hangs
  for (int left = 0; left < wanted - 1; ++left) {  // the thread that calls works, too
    threads_left = left;
    expect(endo_open_file(at.model.c_str(), &options, &handle), ENDO_OUT_OF_MEMORY, "threads");
    CHECK(handle == nullptr);
  }
  alarm(0);
  threads_left = plenty;
  CHECK(endo_open_file(at.model.c_str(), &options, &handle) == ENDO_OK);
  endo_close(handle);
}

rlim_t mapped_bytes() {
  std::ifstream file("/proc/self/statm");
  rlim_t pages = 0;
  CHECK(file >> pages);
  return pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE));
}

void allow(rlim_t bytes) {
  const rlimit limit = {bytes, RLIM_INFINITY};
  CHECK(setrlimit(RLIMIT_AS, &limit) == 0);
}

// With a little more memory each time: first our own layers miss it, then the network, in the end nobody.
void a_network_without_memory_is_out_of_memory(const Places& at) {
  constexpr int w = 1280;
  constexpr int h = 960;
  constexpr rlim_t step = rlim_t{2} << 20;
  endo_options options = default_options(at);
  options.network_width = w;
  options.network_height = h;
  const Opened estimator(at, options);
  const Pair pair(w, h, 9);
  Output out(size_t{w} * h);
  bool we_were_short = false, network_was_short = false;
  for (rlim_t more = 0;; more += step) {
    allow(mapped_bytes() + more);
    const endo_status status = estimator.predict(pair, out);
    allow(RLIM_INFINITY);
    if (status == ENDO_OK) break;
    expect(status, ENDO_OUT_OF_MEMORY, "");
    CHECK(std::isnan(out.disparity[0]) && out.result.quality == ENDO_QUALITY_INVALID);
    we_were_short |= std::strcmp(endo_last_error(), "out of memory [OUT_OF_MEMORY]") == 0;
    network_was_short |= std::strstr(endo_last_error(), "session") != nullptr;
  }
  CHECK(we_were_short && network_was_short);
}

// How a call ends in a process of its own; a signal fails the test.
template <typename Call>
int status_elsewhere(const Call& call) {
  const pid_t child = fork();
  CHECK(child >= 0);
  if (child == 0) _exit(call());
  int ended = 0;
  CHECK(waitpid(child, &ended, 0) == child);
  CHECK(WIFEXITED(ended));
  return WEXITSTATUS(ended);
}

// With a little more memory each time, ONNX Runtime not loaded before, and more threads than the caller.
void opening_without_memory_is_out_of_memory(const Places& at) {
  constexpr rlim_t step = rlim_t{2} << 20;
  endo_options options = default_options(at);
  options.threads = 4;
  int failed = 0;
  for (rlim_t more = 0;; more += step, ++failed) {
    const int status = status_elsewhere([&]() -> int {
      endo_estimator* handle = nullptr;
      allow(mapped_bytes() + more);
      return endo_open_file(at.model.c_str(), &options, &handle);
    });
    if (status == ENDO_OK) break;
    CHECK(status == ENDO_OUT_OF_MEMORY);
  }
  CHECK(failed > 10);
}

// What becomes of the first frame of a process that may have so much more memory than it has once the model is open.
int first_frame_within(rlim_t more, const Places& at, const endo_options& options, const Pair& pair) {
  return status_elsewhere([&]() -> int {
    const Opened estimator(at, options);
    Output out(static_cast<size_t>(pair.width * pair.height));
    allow(mapped_bytes() + more);
    return estimator.predict(pair, out);
  });
}

// Whichever thread of ours misses it, in whichever step: what follows the network needs the last megabytes.
void a_worker_without_memory_is_out_of_memory(const Places& at) {
  constexpr int w = 1280;
  constexpr int h = 960;
  constexpr rlim_t megabyte = rlim_t{1} << 20;
  constexpr rlim_t watched = 6 * megabyte;
  constexpr rlim_t step = megabyte / 8;
  endo_options options = default_options(at);
  options.threads = 2;
  options.network_width = w / 8;
  options.network_height = h / 8;
  const Pair pair(w, h, 9);
  rlim_t too_little = 0;
  rlim_t enough = 1024 * megabyte;
  CHECK(first_frame_within(enough, at, options, pair) == ENDO_OK);
  while (enough - too_little > megabyte) {
    const rlim_t middle = (too_little + enough) / 2;
    const int status = first_frame_within(middle, at, options, pair);
    CHECK(status == ENDO_OK || status == ENDO_OUT_OF_MEMORY);
    (status == ENDO_OK ? enough : too_little) = middle;
  }
  CHECK(enough > watched);
  for (rlim_t more = enough - watched; more < enough; more += step) {
    const int status = first_frame_within(more, at, options, pair);
    CHECK(status == ENDO_OK || status == ENDO_OUT_OF_MEMORY);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  // Before this process loads the runtime, and has threads, which its children would lack.
  opening_without_memory_is_out_of_memory(at);
  a_worker_without_memory_is_out_of_memory(at);
  a_runtime_without_threads_is_out_of_resources(at);
  a_network_without_memory_is_out_of_memory(at);
}
