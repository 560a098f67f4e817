// A plugin host that opens and closes the library again and again. Its worker threads outlive every estimator, so its
// code must stay, and the next opening must find them and not start others.
#include <dlfcn.h>

#include <filesystem>

#include "frame.hpp"

namespace {

long count_threads() {
  const std::filesystem::directory_iterator threads("/proc/self/task");
  return std::distance(begin(threads), end(threads));
}

template <typename Function>
Function* find(void* library, const char* name) {
  void* found = dlsym(library, name);
  CHECK(found != nullptr);
  return reinterpret_cast<Function*>(found);
}

void load_use_and_close(const char* path, const Places& at) {
  void* library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  CHECK(library != nullptr);
  endo_options options;
  CHECK(find<decltype(endo_options_init)>(library, "endo_options_init")(&options, sizeof options) == ENDO_OK);
  options.runtime_library = at.runtime.c_str();
  options.threads = 4;
  endo_estimator* handle = nullptr;
  CHECK(find<decltype(endo_open_file)>(library, "endo_open_file")(at.model.c_str(), &options, &handle) == ENDO_OK);
  const Pair pair(width, height, 9);
  const endo_image left = pair.left_image();
  const endo_image right = pair.right_image();
  Output out(pixels);
  CHECK(find<decltype(endo_predict)>(library, "endo_predict")(handle, &left, &right, &out.result) == ENDO_OK);
  find<decltype(endo_close)>(library, "endo_close")(handle);
  CHECK(dlclose(library) == 0);
}

}  // namespace

int main(int argc, char** argv) {
  CHECK(argc == 4);
  const Places at = places(argc, argv);
  const char* path = argv[3];
  load_use_and_close(path, at);
  void* still = dlopen(path, RTLD_NOW | RTLD_NOLOAD);
  CHECK(still != nullptr && dlclose(still) == 0);
  const long threads = count_threads();
  for (int i = 0; i < 5; ++i) load_use_and_close(path, at);
  CHECK(count_threads() == threads);
}
