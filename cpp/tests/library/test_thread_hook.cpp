// The host's function sees every thread that the library starts, by its name and from inside, and may bind it to a core.
#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <chrono>
#include <map>
#include <mutex>
#include <thread>

#include "support.hpp"
#include "use.hpp"

namespace {

constexpr int width = 96;
constexpr int height = 64;
constexpr int threads = 3;

int a_core() {
  cpu_set_t allowed;
  CHECK(sched_getaffinity(0, sizeof allowed, &allowed) == 0);
  int core = 0;
  while (!CPU_ISSET(core, &allowed)) ++core;
  return core;
}

// What a host keeps of the threads that it was shown.
struct Seen {
  int core = a_core();
  std::mutex mutex{};
  std::map<long, std::string> names{};

  static void note(void* context, const char* name) {
    auto& seen = *static_cast<Seen*>(context);
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(seen.core, &one);
    CHECK(sched_setaffinity(0, sizeof one, &one) == 0);  // of the calling thread
    const std::lock_guard lock(seen.mutex);
    CHECK(seen.names.emplace(syscall(SYS_gettid), name).second);  // once
  }

  long count(const std::string& name) {
    const std::lock_guard lock(mutex);
    return std::count_if(names.begin(), names.end(), [&](const auto& entry) { return entry.second == name; });
  }
};

// The value of a line such as "Name:\tendosdk-stream".
std::string status_of(long thread, const std::string& key) {
  std::ifstream file("/proc/self/task/" + std::to_string(thread) + "/status");
  for (std::string line; std::getline(file, line);) {
    if (line.rfind(key + ":\t", 0) == 0) return line.substr(key.size() + 2);
  }
  return "no such thread";
}

#ifdef __SANITIZE_THREAD__
constexpr long of_the_sanitizer = 1;  // it starts one beside the program's first
#else
constexpr long of_the_sanitizer = 0;
#endif

// A thread that was joined is still listed for a moment.
bool threads_become(long count) {
  for (int tries = 0; tries < 2000 && use_now().threads != count + of_the_sanitizer; ++tries) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return use_now().threads == count + of_the_sanitizer;
}

// Once the program has started a thread.
long own_threads() { return use_now().threads - of_the_sanitizer; }

endo_options hooked(const Places& at, Seen& seen) {
  endo_options options = default_options(at);
  options.threads = threads;
  options.thread_started = Seen::note;
  options.thread_context = &seen;
  return options;
}

// Neither a received frame nor a question about a rig starts a kernel thread, however many cores the calling thread has.
void an_estimator_of_one_thread_starts_its_stream_alone(const Places& at) {
  constexpr int large_width = 480;
  constexpr int large_height = 360;
  const long before = use_now().threads;
  Seen seen;
  endo_options options = hooked(at, seen);
  options.threads = 1;
  const Opened estimator(at, options);
  endo_calibration rig = raw_rig(large_width, large_height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  endo_rectification rectification{};
  rectification.struct_size = sizeof rectification;
  CHECK(endo_get_rectification(&rig, 0.0, &rectification) == ENDO_OK);
  endo_stream* stream = nullptr;
  CHECK(endo_stream_open(estimator.get(), large_width, large_height, nullptr, &stream) == ENDO_OK);
  const Pair pair(large_width, large_height, 9);
  const endo_image left = pair.left_image();
  const endo_image right = pair.right_image();
  Output out(size_t{large_width} * large_height, true);
  for (int i = 0; i < 4; ++i) {
    CHECK(endo_stream_submit(stream, &left, &right, &out.result) == ENDO_OK);
    endo_result* received = nullptr;
    CHECK(endo_stream_receive(stream, &received) == ENDO_OK && received == &out.result);
  }
  CHECK(seen.names.size() == 1 && seen.count("endosdk-stream") == 1);
  CHECK(threads_become(before + 1));
  for (int again = 0; again < 2; ++again) CHECK(endo_stream_follow_rig(stream) == ENDO_OK);
  CHECK(seen.names.size() == 2 && seen.count("endosdk-follow") == 1);
  CHECK(threads_become(before + 2));
  endo_stream_close(stream);
  CHECK(threads_become(before));
}

void every_thread_is_shown_to_the_host(const Places& at) {
  const long before = own_threads();
  Seen seen;
  const Opened estimator(at, hooked(at, seen));
  CHECK(seen.count("endosdk-session") == threads - 1 && seen.names.size() == threads - 1);
  CHECK(endo_prepare(estimator.get(), width, height) == ENDO_OK);
  CHECK(seen.count("endosdk-kernels") == threads - 1);
  endo_stream* stream = nullptr;
  CHECK(endo_stream_open(estimator.get(), width, height, nullptr, &stream) == ENDO_OK);
  const Pair pair(width, height, 9);
  const endo_image left = pair.left_image();
  const endo_image right = pair.right_image();
  Output out(size_t{width} * height);
  for (int i = 0; i < threads; ++i) {
    CHECK(endo_stream_submit(stream, &left, &right, &out.result) == ENDO_OK);
    endo_result* received = nullptr;
    CHECK(endo_stream_receive(stream, &received) == ENDO_OK && received == &out.result);
  }
  CHECK(seen.count("endosdk-stream") == threads);
  CHECK(seen.count("endosdk-follow") == 0 && endo_stream_follow_rig(stream) == ENDO_CALIBRATION_REQUIRED);
  CHECK(threads_become(before + static_cast<long>(seen.names.size())));  // there is none that the host does not know
  for (const auto& [thread, name] : seen.names) {
    CHECK(status_of(thread, "Name") == name);
    CHECK(status_of(thread, "Cpus_allowed_list") == std::to_string(seen.core));
    const unsigned long long blocked = std::stoull(status_of(thread, "SigBlk"), nullptr, 16);
    CHECK((blocked >> (SIGTERM - 1) & 1) == 1 && (blocked >> (SIGSEGV - 1) & 1) == 0);
  }
  endo_stream_close(stream);
}

// The kernel threads are there already.
void a_second_estimator_shows_the_threads_of_its_own(const Places& at) {
  Seen seen;
  const Opened estimator(at, hooked(at, seen));
  CHECK(endo_prepare(estimator.get(), width, height) == ENDO_OK);
  CHECK(seen.count("endosdk-session") == threads - 1 && seen.names.size() == threads - 1);
}

void closing_leaves_the_kernel_threads_alone(long before) { CHECK(threads_become(before + threads - 1)); }

void sessions_of_one_thread_start_none(const Places& at) {
  Seen seen;
  endo_options options = hooked(at, seen);
  options.threads = 1;
  const Opened estimator(at, options);
  CHECK(endo_prepare(estimator.get(), width, height) == ENDO_OK);
  CHECK(seen.names.empty());
}

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  an_estimator_of_one_thread_starts_its_stream_alone(at);  // first: kernel threads stay
  const long before = own_threads();
  every_thread_is_shown_to_the_host(at);
  a_second_estimator_shows_the_threads_of_its_own(at);
  closing_leaves_the_kernel_threads_alone(before);
  sessions_of_one_thread_start_none(at);
}
