// Turns errors of the core into those of the Python package, with the same code and text as in C.
#include <new>
#include <stdexcept>
#include <system_error>

#include "bindings.hpp"
#include "platform/errors.hpp"
#include "platform/threads.hpp"

namespace py = pybind11;

namespace endosdk {
namespace {

void raise_error(endo_status status, const std::string& argument, const std::string& rule, const std::string& value) {
  const py::object error =
      py::module_::import("endosdk.errors").attr("error_of")(static_cast<int>(status), argument, rule, value);
  PyErr_SetObject(py::type::of(error).ptr(), error.ptr());
}

void raise_error(const Error& error) { raise_error(error.status(), error.argument(), error.rule(), error.value()); }

void translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const Error& error) {
    raise_error(error);
  } catch (const std::bad_alloc&) {
    raise_error(ENDO_OUT_OF_MEMORY, "", "out of memory", "");
  } catch (const std::length_error&) {  // a container was asked for more than any memory holds
    raise_error(ENDO_OUT_OF_MEMORY, "", "out of memory", "");
  } catch (const std::system_error& error) {
    // The C++ library throws this error code if no further thread can be started. pybind11 handles all other codes.
    if (error.code() != std::errc::resource_unavailable_try_again) throw;
    raise_error(short_of_threads(1, 0));
  }
}

}  // namespace

void bind_errors(py::module_&) { py::register_local_exception_translator(translate); }

}  // namespace endosdk
