// ONNX Runtime's own header, which for Windows is written for Microsoft's compiler alone.
#pragma once

#ifdef __MINGW32__
#include <sal.h>
#define _stdcall __stdcall
#define _Frees_ptr_opt_
#endif

#include <onnxruntime_c_api.h>
