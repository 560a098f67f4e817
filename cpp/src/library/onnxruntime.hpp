// Includes ONNX Runtime's own header. On Windows it is written for Microsoft's compiler only, so MinGW needs these definitions.
#pragma once

#ifdef __MINGW32__
#include <sal.h>
#ifndef _stdcall  // clang defines it
#define _stdcall __stdcall
#endif
#define _Frees_ptr_opt_
#endif

#include <onnxruntime_c_api.h>
