#include "library/log_reader.hpp"

namespace endosdk {

// Called from within the runtime, which no exception may enter.
void ORT_API_CALL LogReader::forward(void* reader, OrtLoggingLevel severity, const char*, const char*, const char*,
                                     const char* message) {
  auto& self = *static_cast<LogReader*>(reader);
  const endo_log_level level = severity >= ORT_LOGGING_LEVEL_ERROR     ? ENDO_LOG_ERROR
                               : severity == ORT_LOGGING_LEVEL_WARNING ? ENDO_LOG_WARNING
                                                                       : ENDO_LOG_INFO;
  try {
    if (self.reading_) self.lines_.read(message);
    if (severity < self.severity()) return;
    self.log_(level, message);
  } catch (...) {
    // The line is lost; the frame is not.
  }
}

// Of its own progress the runtime tells hundreds of lines for each session, between which ours would be lost.
OrtLoggingLevel LogReader::severity() const {
  return log_.level >= ENDO_LOG_INFO ? ORT_LOGGING_LEVEL_WARNING : ORT_LOGGING_LEVEL_ERROR;
}

const Placement& LogReader::stop_reading() {
  reading_ = false;
  return lines_.placement();
}

}  // namespace endosdk
