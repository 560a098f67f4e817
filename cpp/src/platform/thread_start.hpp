// How each thread of this library begins: it leaves signals to the host, gets its name, and the host may set its priority and
// its cores.
#pragma once

#include <endosdk/endosdk.h>

#include "platform/host_gate.hpp"
#include "platform/system.hpp"

namespace endosdk {

// The host's function, if there is one.
struct ThreadHook {
  endo_thread_function function = nullptr;
  void* context = nullptr;
  HostGate* gate = nullptr;
};

// To be called once, by the thread itself and before it works.
inline void start_thread(const char* name, const ThreadHook& hook) {
  system::block_signals();
  system::name_this_thread(name);
  if (hook.function != nullptr) HostGate::pass(hook.gate, [&] { hook.function(hook.context, name); });
}

}  // namespace endosdk
