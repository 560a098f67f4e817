// The threads of a session are those that were offered: ONNX Runtime gets more where it wants more, and spare ones end.
#include <pthread.h>

#include <atomic>
#include <csignal>

#include "library/session_threads.hpp"
#include "support.hpp"

using namespace endosdk;

namespace {

constexpr int taken = 3;  // by a session that was told to use one more: its caller works, too

void count(void* context, const char* name) {
  CHECK(std::strcmp(name, "endosdk-session") == 0);
  ++*static_cast<std::atomic<int>*>(context);
}

// Makes a session, ends it, and counts the threads that were started for it.
void make_session(const Places& at, int offered, std::atomic<int>& started) {
  const std::shared_ptr<const Runtime> runtime = Runtime::open(at.runtime, "", {});
  const OrtApi& api = runtime->api();
  const auto check = [&](OrtStatus* status) { runtime->check(status, ENDO_INTERNAL, "runtime", "must do it"); };
  OrtEnv* environment = nullptr;
  check(api.CreateEnv(ORT_LOGGING_LEVEL_FATAL, "test", &environment));
  const OrtHandle<OrtEnv> held_environment(environment, api.ReleaseEnv);
  OrtSessionOptions* options = nullptr;
  check(api.CreateSessionOptions(&options));
  const OrtHandle<OrtSessionOptions> held_options(options, api.ReleaseSessionOptions);
  check(api.SetIntraOpNumThreads(options, taken + 1));
  SessionThreads threads(offered, {count, &started, nullptr});
  CHECK(started == offered);
  threads.offer(*runtime, options);
  const std::string model = read_file(at.model);
  OrtSession* session = nullptr;
  check(api.CreateSessionFromArray(environment, model.data(), model.size(), options, &session));
  const OrtHandle<OrtSession> held(session, api.ReleaseSession);
  threads.end_spare();
}

int started_for(const Places& at, int offered) {
  std::atomic<int> started{0};
  make_session(at, offered, started);
  return started;
}

// A signal that arrives before a thread's first statement would run the host's handler on a thread of the library.
void threads_begin_with_signals_blocked() {
  sigset_t before, within, after;
  CHECK(pthread_sigmask(SIG_SETMASK, nullptr, &before) == 0 && sigismember(&before, SIGTERM) == 0);
  new_thread([&] { CHECK(pthread_sigmask(SIG_SETMASK, nullptr, &within) == 0); }).join();
  CHECK(sigismember(&within, SIGTERM) == 1 && sigismember(&within, SIGRTMIN) == 1 && sigismember(&within, SIGSEGV) == 0);
  CHECK(pthread_sigmask(SIG_SETMASK, nullptr, &after) == 0 && sigismember(&after, SIGTERM) == 0);
}

}  // namespace

int main(int argc, char** argv) {
  threads_begin_with_signals_blocked();
  const Places at = places(argc, argv);
  CHECK(started_for(at, taken) == taken);
  CHECK(started_for(at, taken + 2) == taken + 2);
  CHECK(started_for(at, 1) == taken);
}
