// A host's thread with as little stack as the header allows: every call of a device's day, with models as they are shipped.
#include <pthread.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "support.hpp"

namespace {

constexpr size_t stack_bytes = size_t{256} << 10;
constexpr int width = 960;
constexpr int height = 720;

// What a host asks of a frame. A plane gives it a depth everywhere.
void measure(const endo_calibration& rig, endo_result& result) {
  std::fill_n(result.depth, size_t{width} * height, 80.0f);
  std::fill_n(result.sigma, size_t{width} * height, 0.5f);
  std::vector<double> outline;
  for (int i = 0; i < 1000; ++i) {
    const double angle = 2.0 * 3.14159265358979 * i / 1000;
    outline.insert(outline.end(), {480.0 + 200.0 * std::cos(angle), 360.0 + 200.0 * std::sin(angle)});
  }
  endo_area area{};
  area.struct_size = sizeof area;
  CHECK(endo_area_inside(&rig, &result, outline.data(), outline.size() / 2, &area) == ENDO_OK && area.flat > 0.0);
  endo_measured length{};
  length.struct_size = sizeof length;
  CHECK(endo_path_length(&rig, &result, outline.data(), outline.size() / 2, &length) == ENDO_OK);
  endo_point point{};
  point.struct_size = sizeof point;
  CHECK(endo_point_at(&rig, &result, 480.0, 360.0, &point) == ENDO_OK);
  CHECK(endo_rectified_to_raw(&rig, 0.0, 0, outline.data(), outline.size() / 2, outline.data()) == ENDO_OK);
}

void stream(const Opened& estimator, const endo_image& left, const endo_image& right, endo_result& result) {
  endo_stream* opened = nullptr;
  CHECK(endo_stream_open(estimator.get(), width, height, nullptr, &opened) == ENDO_OK);
  CHECK(endo_stream_follow_rig(opened) == ENDO_OK && endo_stream_set_temporal(opened, 1) == ENDO_OK);
  for (int i = 0; i < 2; ++i) {
    endo_result* received = nullptr;
    CHECK(endo_stream_submit(opened, &left, &right, &result) == ENDO_OK);
    CHECK(endo_stream_receive(opened, &received) == ENDO_OK && received == &result);
  }
  endo_stream_close(opened);
}

// Its reader calls itself for what is nested.
void read_rig(const std::string& file) {
  const std::string text = read_file(file);
  endo_calibration rig{};
  rig.struct_size = sizeof rig;
  CHECK(endo_read_calibration(text.data(), text.size(), &rig) == ENDO_OK);
  const std::string nested(100'000, '[');
  CHECK(endo_read_calibration(nested.data(), nested.size(), &rig) == ENDO_CALIBRATION_UNREADABLE);
}

// `beside`: also what is the same with every model. A stream computes its networks on threads of its own.
void use(const Places& at, int threads, bool beside) {
  endo_options options = default_options(at);
  options.threads = threads;
  const Opened estimator(at, options);
  const endo_calibration rig = raw_rig(width, height);
  CHECK(endo_set_calibration(estimator.get(), &rig) == ENDO_OK);
  CHECK(endo_prepare(estimator.get(), width, height) == ENDO_OK);
  Output out(size_t{width} * height, true);
  const Pair pair(width, height, 20);
  CHECK(estimator.predict(pair, out) == ENDO_OK && out.result.frame == 1);
  if (!beside) return;
  measure(rig, out.result);
  const endo_image left = pair.left_image();
  const endo_image right = pair.right_image();
  std::vector<uint8_t> rectified(size_t{3} * width * height);
  CHECK(endo_rectify(estimator.get(), &left, &right, rectified.data(), nullptr, rectified.size()) == ENDO_OK);
  stream(estimator, left, right, out.result);
  CHECK(endo_self_test(estimator.get()) == ENDO_OK);
  std::vector<char> report(8192);
  CHECK(endo_get_diagnostics(estimator.get(), report.data(), report.size(), nullptr) == ENDO_OK);
}

struct Task {
  Places at;
  bool beside;
};

// With one thread the whole network is computed on the caller's stack.
void* use_models(void* given) {
  const Task& task = *static_cast<const Task*>(given);
  const std::string& model = task.at.model;
  read_rig(model.substr(0, model.rfind('/')) + "/../examples/data/rig.json");
  for (const int threads : {1, 2}) use(task.at, threads, task.beside);
  return nullptr;
}

void run_on_a_small_stack(Task task) {
  pthread_attr_t attributes;
  pthread_t thread;
  CHECK(pthread_attr_init(&attributes) == 0 && pthread_attr_setstacksize(&attributes, stack_bytes) == 0);
  CHECK(pthread_create(&thread, &attributes, use_models, &task) == 0);
  CHECK(pthread_join(thread, nullptr) == 0 && pthread_attr_destroy(&attributes) == 0);
}

}  // namespace

int main(int argc, char** argv) {
  Places at = places(argc, argv);
  const std::string folder = at.model.substr(0, at.model.rfind('/'));
  for (const char* model : {"/fast.onnx", "/fast-fp32.onnx", "/wang2020.onnx"}) {
    at.model = folder + model;
    run_on_a_small_stack({at, std::string(model) == "/fast.onnx"});
  }
}
