// Memory, watched from below: malloc itself is replaced in this program.
//
// An allocation belongs to ONNX Runtime, or the loader, where its code is on the call stack and none of ours was called from
// it: the runtime calls our functions of model files. All others are ours. Ours must be none for a frame, and each of ours must
// be allowed to fail without more damage than a status.
#include <dlfcn.h>
#include <execinfo.h>
#include <link.h>

#include <atomic>
#include <cerrno>
#include <cmath>
#include <new>

#include "frame.hpp"

extern "C" {
void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* old, size_t size);
void* __libc_memalign(size_t alignment, size_t size);
}

namespace {

struct Range {
  uintptr_t begin = 0;
  uintptr_t end = 0;

  bool holds(const void* address) const {
    const auto place = reinterpret_cast<uintptr_t>(address);
    return place >= begin && place < end;
  }
};

Range library_code;
Range runtime_code;
Range loader_code;
std::atomic<bool> watching{false};
std::atomic<long> ours{0};
std::atomic<long> fail_at{-1};
thread_local bool inside = false;  // backtrace may allocate, too

bool belongs_to_runtime() {
  void* frames[48];
  const int count = backtrace(frames, 48);
  for (int i = 0; i < count; ++i) {
    if (library_code.holds(frames[i])) return false;
    if (runtime_code.holds(frames[i]) || loader_code.holds(frames[i])) return true;
  }
  return false;
}

// Whether the allocation that `caller` asks for is to fail.
bool note(const void* caller) {
  if (!watching.load(std::memory_order_relaxed) || inside) return false;
  if (runtime_code.holds(caller)) return false;  // the common case, told without a walk up the stack
  inside = true;
  const bool is_ours = !belongs_to_runtime();
  const bool fails = is_ours && ours.fetch_add(1) == fail_at.load();
  inside = false;
  if (fails) errno = ENOMEM;
  return fails;
}

}  // namespace

extern "C" {
#define CALLER __builtin_return_address(0)
void* malloc(size_t size) { return note(CALLER) ? nullptr : __libc_malloc(size); }
void* calloc(size_t count, size_t size) { return note(CALLER) ? nullptr : __libc_calloc(count, size); }
void* realloc(void* old, size_t size) { return note(CALLER) ? nullptr : __libc_realloc(old, size); }
void* aligned_alloc(size_t alignment, size_t size) { return note(CALLER) ? nullptr : __libc_memalign(alignment, size); }
}

// Replaced as well, so that the caller seen is the one that wants the memory and not the C++ library.
void* operator new(size_t size) {
  void* memory = note(CALLER) ? nullptr : __libc_malloc(size);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, size_t) noexcept { std::free(memory); }

namespace {

Range range_of(const char* part_of_name) {
  struct Search {
    const char* name;
    Range found;
  } search{part_of_name, {}};
  dl_iterate_phdr(
      [](dl_phdr_info* info, size_t, void* data) {
        auto& wanted = *static_cast<Search*>(data);
        if (std::strstr(info->dlpi_name, wanted.name) == nullptr) return 0;
        for (int i = 0; i < info->dlpi_phnum; ++i) {
          const auto& header = info->dlpi_phdr[i];
          if (header.p_type != PT_LOAD) continue;
          const uintptr_t begin = info->dlpi_addr + header.p_vaddr;
          if (wanted.found.begin == 0) wanted.found.begin = begin;
          wanted.found.end = begin + header.p_memsz;
        }
        return 1;
      },
      &search);
  CHECK(search.found.begin != 0);
  return search.found;
}

template <typename Call>
long count_ours(const Call& call) {
  ours = 0;
  watching = true;
  call();
  watching = false;
  return ours;
}

void frames_allocate_nothing(const Places& at, bool raw, int network_width, int threads) {
  endo_options options = default_options(at);
  options.threads = threads;
  options.network_width = network_width;
  options.network_height = network_width * height / width;
  const Opened estimator(at, options);
  const endo_calibration rig = raw_rig(width, height);
  if (raw) CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  CHECK(endo_prepare(estimator.get(), width, height) == ENDO_OK);
  const Pair pair(width, height, 9);
  Output out(pixels, raw);
  const endo_image left = pair.left_image();
  const endo_image right = pair.right_image();
  static uint8_t rectified[3 * pixels];
  const auto rectify = [&] { return endo_rectify(estimator.get(), &left, &right, rectified, nullptr, sizeof rectified); };
  CHECK(rectify() == ENDO_OK);
  const long count = count_ours([&] {
    for (int frame = 0; frame < 50; ++frame) CHECK(estimator.predict(pair, out) == ENDO_OK && rectify() == ENDO_OK);
  });
  if (count != 0) std::fprintf(stderr, "%ld allocations of ours in 50 frames\n", count);
  CHECK(count == 0);
}

// From the first one on: opening the stream has prepared it.
void frames_of_a_stream_allocate_nothing(const Places& at, int threads) {
  endo_options options = default_options(at);
  options.threads = threads;
  options.network_width = width;
  options.network_height = height;
  const Opened estimator(at, options);
  const endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  endo_stream* stream = nullptr;
  CHECK(endo_stream_open(estimator.get(), width, height, nullptr, &stream) == ENDO_OK);
  const Pair pair(width, height, 9);
  const endo_image left = pair.left_image();
  const endo_image right = pair.right_image();
  Output out(pixels, true);
  const long count = count_ours([&] {
    for (int frame = 0; frame < 20; ++frame) {
      endo_result* received = nullptr;
      CHECK(endo_stream_submit(stream, &left, &right, &out.result) == ENDO_OK);
      CHECK(endo_stream_receive(stream, &received) == ENDO_OK && received == &out.result);
    }
  });
  if (count != 0) std::fprintf(stderr, "%ld allocations of ours in 20 frames of a stream\n", count);
  CHECK(count == 0);
  endo_stream_close(stream);
}

// Calls with the 1st, 2nd, 3rd ... allocation failing, until none is left to fail.
template <typename Call>
int survive_every_failure(const char* what, const Call& call) {
  for (int n = 0;; ++n) {
    fail_at = n;
    ours = 0;
    watching = true;
    const endo_status status = call();
    watching = false;
    fail_at = -1;
    if (ours <= n) {
      CHECK(status == ENDO_OK);
      return n;
    }
    // A failed look for a file or a library may be reported as such; nothing else may come of it, but success.
    const bool typed = status == ENDO_OUT_OF_MEMORY || status == ENDO_RUNTIME_MISSING || status == ENDO_MODEL_NOT_FOUND;
    if (!typed && status != ENDO_OK) {
      std::fprintf(stderr, "%s, allocation %d: %s\n", what, n, endo_last_error());
      std::exit(1);
    }
  }
}

void failing_allocations_are_reported(const Places& at) {
  const endo_options options = default_options(at);
  endo_estimator* handle = nullptr;
  const int opening = survive_every_failure("open", [&] {
    const endo_status status = endo_open_file(at.model.c_str(), &options, &handle);
    CHECK((handle != nullptr) == (status == ENDO_OK));
    if (status == ENDO_OK && fail_at >= 0 && ours <= fail_at) return status;
    endo_close(handle);
    return status;
  });
  const endo_calibration rig = raw_rig(width, height);
  const int calibrating =
      survive_every_failure("set_calibration", [&] { return endo_set_calibration(handle, &rig); });
  const Pair pair(width, height, 9);
  Output out(pixels, true);
  const endo_image left = pair.left_image();
  const endo_image right = pair.right_image();
  const int predicting = survive_every_failure("predict", [&] {
    const endo_status status = endo_predict(handle, &left, &right, &out.result);
    if (status != ENDO_OK) CHECK(std::isnan(out.depth[0]) && out.result.quality == ENDO_QUALITY_INVALID);
    return status;
  });
  const int testing = survive_every_failure("self test", [&] { return endo_self_test(handle); });
  size_t needed = 0;
  const int reporting =
      survive_every_failure("diagnostics", [&] { return endo_get_diagnostics(handle, nullptr, 0, &needed); });
  endo_stream* stream = nullptr;
  const int streaming = survive_every_failure("stream", [&] {
    const endo_status status = endo_stream_open(handle, width, height, nullptr, &stream);
    CHECK((stream != nullptr) == (status == ENDO_OK));
    endo_stream_close(stream);
    return status;
  });
  std::fill_n(out.depth.begin(), pixels, 80.0f);
  const double outline[] = {40, 30, 120, 30, 120, 70, 40, 70};
  endo_area area{};
  area.struct_size = sizeof area;
  const int measuring = survive_every_failure("area", [&] { return endo_area_inside(&rig, &out.result, outline, 4, &area); });
  CHECK(endo_predict(handle, &left, &right, &out.result) == ENDO_OK);
  endo_close(handle);
  std::printf("survived the failure of each of %d + %d + %d + %d + %d + %d + %d allocations\n", opening, calibrating, predicting,
              testing, reporting, streaming, measuring);
  CHECK(opening > 10 && calibrating > 0 && predicting > 10 && streaming > 10 && measuring > 0);
}

}  // namespace

int main(int argc, char** argv) {
  Places at = places(argc, argv);
  { const Opened once(at); }  // maps the runtime
  void* frames[4];
  backtrace(frames, 4);  // loads what it needs
  library_code = range_of("libendosdk");
  runtime_code = range_of("libonnxruntime.so");
  loader_code = range_of("ld-linux");
  for (const bool raw : {false, true}) {
    frames_allocate_nothing(at, raw, 0, 1);
    frames_allocate_nothing(at, raw, 0, 2);
    frames_allocate_nothing(at, raw, 80, 1);
  }
  failing_allocations_are_reported(at);
  for (int i = 3; i < argc; ++i) {  // models with functions of ours
    at.model = argv[i];
    for (const int threads : {1, 2}) {
      frames_allocate_nothing(at, true, width, threads);
      frames_of_a_stream_allocate_nothing(at, threads);
    }
  }
}
