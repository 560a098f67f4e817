// The Python module endosdk._core: the list of its parts.
#include "bindings.hpp"

PYBIND11_MODULE(_core, m) {
  m.doc() = "The compiled core of endosdk. Private: use the Python package instead.";
  m.attr("version") = ENDOSDK_VERSION;
  endosdk::bind_errors(m);
  endosdk::bind_facts(m);
  endosdk::bind_rectification(m);
  endosdk::bind_kernels(m);
  endosdk::bind_frame_path(m);
  endosdk::bind_measure(m);
  endosdk::bind_models(m);
  endosdk::bind_model_functions(m);
}
