// A guard around every function of the C interface. It turns an exception into a status, and a message for this thread.
#pragma once

#include <endosdk/endosdk.h>

#include <new>
#include <stdexcept>
#include <system_error>

#include "platform/errors.hpp"

namespace endosdk {

// As `short_of_threads` says it. A thread is often refused for want of memory, so to tell that must not take any.
constexpr const char* no_thread = "threads: the system must be able to start 1 more; got 0";

// The message of this thread's last failed call.
const char* last_error();

// Keeps the message for last_error() and returns the status.
endo_status report(endo_status status, const char* message);

// Runs the body of a function. No exception leaves this function.
template <typename Body>
endo_status guarded(const Body& body) noexcept {
  try {
    body();
    return ENDO_OK;
  } catch (const Error& error) {
    return report(error.status(), error.what());
  } catch (const std::bad_alloc&) {
    return report(ENDO_OUT_OF_MEMORY, "out of memory");
  } catch (const std::length_error&) {  // a container was asked for more than any memory holds
    return report(ENDO_OUT_OF_MEMORY, "out of memory");
  } catch (const std::system_error& error) {
    // The C++ library throws this error code if no further thread can be started.
    const bool used_up = error.code() == std::errc::resource_unavailable_try_again;
    return used_up ? report(ENDO_OUT_OF_MEMORY, no_thread) : report(ENDO_INTERNAL, error.what());
  } catch (const std::exception& error) {
    return report(ENDO_INTERNAL, error.what());
  } catch (...) {
    return report(ENDO_INTERNAL, "internal: an unknown exception");
  }
}

template <typename Pointer>
void require_pointer(Pointer pointer, const char* argument) {
  require(pointer != nullptr, ENDO_INVALID_ARGUMENT, argument, "must not be NULL", "NULL");
}

}  // namespace endosdk
