// A host's thread with as little stack as the header allows: every call of a device's day, with models as they are shipped.
#include <pthread.h>

#include <string>

#include "support.hpp"

namespace {

constexpr size_t stack_bytes = size_t{256} << 10;
constexpr int width = 960;
constexpr int height = 720;

void use(const Places& at, int threads) {
  endo_options options = default_options(at);
  options.threads = threads;
  const Opened estimator(at, options);
  const endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  CHECK(endo_prepare(estimator.get(), width, height) == ENDO_OK);
  Output out(size_t{width} * height, true);
  CHECK(estimator.predict(Pair(width, height, 20), out) == ENDO_OK && out.result.frame == 1);
  CHECK(endo_self_test(estimator.get()) == ENDO_OK);
  std::vector<char> report(8192);
  CHECK(endo_get_diagnostics(estimator.get(), report.data(), report.size(), nullptr) == ENDO_OK);
}

// With one thread the whole network is computed on the caller's stack.
void* use_models(void* places) {
  for (const int threads : {1, 2}) use(*static_cast<const Places*>(places), threads);
  return nullptr;
}

void run_on_a_small_stack(Places at) {
  pthread_attr_t attributes;
  pthread_t thread;
  CHECK(pthread_attr_init(&attributes) == 0 && pthread_attr_setstacksize(&attributes, stack_bytes) == 0);
  CHECK(pthread_create(&thread, &attributes, use_models, &at) == 0);
  CHECK(pthread_join(thread, nullptr) == 0 && pthread_attr_destroy(&attributes) == 0);
}

}  // namespace

int main(int argc, char** argv) {
  Places at = places(argc, argv);
  const std::string folder = at.model.substr(0, at.model.rfind('/'));
  for (const char* model : {"/fast.onnx", "/fast-fp32.onnx", "/wang2020.onnx"}) {
    at.model = folder + model;
    run_on_a_small_stack(at);
  }
}
