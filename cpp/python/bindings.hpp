// The parts of the Python module endosdk._core.
#pragma once

#include <pybind11/pybind11.h>

namespace endosdk {

void bind_facts(pybind11::module_& m);
void bind_errors(pybind11::module_& m);
void bind_rectification(pybind11::module_& m);
void bind_kernels(pybind11::module_& m);
void bind_frame_path(pybind11::module_& m);
void bind_measure(pybind11::module_& m);
void bind_models(pybind11::module_& m);
void bind_model_functions(pybind11::module_& m);

}  // namespace endosdk
