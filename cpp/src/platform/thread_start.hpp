// How each thread of this library begins: it leaves signals to the host, gets its name, and the host may set its priority and
// its cores.
#pragma once

#include <endosdk/endosdk.h>

#include <thread>
#include <utility>

#include "platform/host_gate.hpp"
#include "platform/system.hpp"

namespace endosdk {

// The host's function, if there is one.
struct ThreadHook {
  endo_thread_function function = nullptr;
  void* context = nullptr;
  HostGate* gate = nullptr;
};

// A thread in which no signal of the host arrives: also not before its first statement, as it begins with the signals blocked.
template <typename Body>
std::thread new_thread(Body body) {
  std::thread thread;
  system::with_signals_blocked([&] { thread = std::thread(std::move(body)); });
  return thread;
}

// To be called once, by the thread itself and before it works.
inline void start_thread(const char* name, const ThreadHook& hook) {
  system::block_signals();
  system::name_this_thread(name);
  if (hook.function != nullptr) HostGate::pass(hook.gate, [&] { hook.function(hook.context, name); });
}

}  // namespace endosdk
