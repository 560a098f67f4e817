// The threads of a session are those that were offered: ONNX Runtime gets more where it wants more, and spare ones end.
#include <atomic>

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

}  // namespace

int main(int argc, char** argv) {
  const Places at = places(argc, argv);
  CHECK(started_for(at, taken) == taken);
  CHECK(started_for(at, taken + 2) == taken + 2);
  CHECK(started_for(at, 1) == taken);
}
