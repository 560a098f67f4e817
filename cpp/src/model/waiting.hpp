// How threads of ONNX Runtime wait for one another, in the settings of its sessions.
#pragma once

#include <array>

namespace endosdk {

struct SessionSetting {
  const char* key;
  const char* value;
};

// Threads that poll give up after a time that most waits between two operations do not reach. Versions before 1.26 do not know
// it, and poll until the run ends. Between two runs, rectification and post-processing need the cores.
inline std::array<SessionSetting, 3> waiting_settings(bool polls) {
  return {{
      {"session.intra_op.allow_spinning", polls ? "1" : "0"},
      {"session.intra_op.spin_duration_us", polls ? "50" : "0"},
      {"session.force_spinning_stop", "1"},
  }};
}

}  // namespace endosdk
