#include "python_session.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <map>

#include "metadata_lookup.hpp"
#include "model/runtime_resources.hpp"

namespace py = pybind11;

namespace endosdk {
namespace {

// An array over memory of the frame path. This memory outlives the array.
template <typename Value>
py::array_t<Value> array_over(Value* data, std::vector<py::ssize_t> shape) {
  return py::array_t<Value>(std::move(shape), data, py::capsule(data, [](void*) {}));
}

py::array_t<uint8_t> picture(const PlanarView& view) { return array_over(view.data, {3, view.height, view.width}); }

py::array_t<float> map(const MutableFloatView& view) { return array_over(view.data, {view.height, view.width}); }

// Keeps Python's state of a thread until the thread ends. Without it, each call from a thread of the frame path would make a
// new one, and so would the end of each exception; Python ends the process if there is no memory for that.
class PythonThread {
 public:
  PythonThread() {
    if (PyGILState_GetThisThreadState() != nullptr) return;  // a thread of Python
    require_memory(state_bytes, "thread");
    state_ = PyGILState_Ensure();
    PyEval_SaveThread();
    made_ = true;
  }

  ~PythonThread() {
    if (!made_ || _Py_IsFinalizing()) return;
    PyGILState_Ensure();
    PyGILState_Release(PyGILState_LOCKED);
    PyGILState_Release(state_);
  }

  PythonThread(const PythonThread&) = delete;
  PythonThread& operator=(const PythonThread&) = delete;

 private:
  static constexpr size_t state_bytes = size_t{1} << 20;

  PyGILState_STATE state_ = PyGILState_UNLOCKED;
  bool made_ = false;
};

ModelInfo info_of(const py::object& session) {
  const auto metadata = py::cast<std::map<std::string, std::string>>(session.attr("metadata"));
  return parse_metadata(lookup_in(metadata), py::cast<std::string>(session.attr("sha256")));
}

}  // namespace

class PythonSession::BoundRun : public Session::Run {
 public:
  explicit BoundRun(const py::object& run)
      : run_(run.attr("run")), stop_(run.attr("stop")), resume_(run.attr("resume")) {}

  ~BoundRun() override {
    const py::gil_scoped_acquire gil;
    run_ = stop_ = resume_ = py::object();
  }

  void operator()() override { call(run_); }
  void stop() override { call(stop_); }
  void resume() override { call(resume_); }

 private:
  static void call(const py::object& method) {
    thread_local const PythonThread thread;
    const py::gil_scoped_acquire gil;
    method();
  }

  py::object run_, stop_, resume_;
};

PythonSession::PythonSession(py::object session)
    : session_(std::move(session)),
      info_(info_of(session_)),
      facts_{py::cast<std::string>(session_.attr("provider")),
             py::cast<ProviderOptions>(session_.attr("provider_options").attr("items")()), py::cast<std::string>(session_.attr("runtime_version")),
             py::cast<std::string>(session_.attr("runtime_library")), py::cast<std::string>(session_.attr("runtime_sha256")),
             py::cast<bool>(session_.attr("telemetry_on"))} {}

PythonSession::~PythonSession() {
  const py::gil_scoped_acquire gil;
  session_ = py::object();
}

std::shared_ptr<Session> PythonSession::for_size(Size input) {
  const py::gil_scoped_acquire gil;
  const py::object other = session_.attr("for_size")(input.height, input.width);
  return other.is_none() ? nullptr : std::make_shared<PythonSession>(other);
}

std::unique_ptr<Session::Run> PythonSession::bind(SessionBuffers& buffers) {
  const py::gil_scoped_acquire gil;
  return std::make_unique<BoundRun>(session_.attr("bind")(picture(buffers.left()), picture(buffers.right()),
                                                          map(buffers.disparity()), map(buffers.confidence())));
}

std::shared_ptr<Session> PythonSession::for_one_thread_each() {
  const py::gil_scoped_acquire gil;
  const py::object other = session_.attr("for_one_thread_each")();
  return other.is_none() ? nullptr : std::make_shared<PythonSession>(other);
}

}  // namespace endosdk
