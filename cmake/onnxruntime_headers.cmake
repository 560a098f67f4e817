# Finds ONNX Runtime's C header, 1.21 or later: where -DONNXRUNTIME_INCLUDE_DIR says, where the system has it, or in
# Debian's package, which is downloaded but not installed. Only the header is needed: the library is opened at run time.
set(fetched "${PROJECT_SOURCE_DIR}/build/onnxruntime-headers")
find_path(ONNXRUNTIME_INCLUDE_DIR onnxruntime_c_api.h PATHS "${fetched}" PATH_SUFFIXES onnxruntime)
if(NOT ONNXRUNTIME_INCLUDE_DIR)
  message(STATUS "Fetching the headers of ONNX Runtime through apt")
  execute_process(COMMAND "${PROJECT_SOURCE_DIR}/scripts/fetch_onnxruntime_headers.sh" "${fetched}" RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "No headers of ONNX Runtime: pass -DONNXRUNTIME_INCLUDE_DIR=<folder of onnxruntime_c_api.h>")
  endif()
  set(ONNXRUNTIME_INCLUDE_DIR "${fetched}" CACHE PATH "Folder of onnxruntime_c_api.h" FORCE)
endif()
