// Declares the kernels of each instruction set.
#pragma once

#include "kernels/kernels.hpp"

#define ENDOSDK_DECLARE(result, name, parameters) result name parameters;

namespace endosdk::plain {
ENDOSDK_FOR_EACH_KERNEL(ENDOSDK_DECLARE)
}
namespace endosdk::avx2 {
ENDOSDK_FOR_EACH_KERNEL(ENDOSDK_DECLARE)
}
namespace endosdk::avx512 {
ENDOSDK_FOR_EACH_KERNEL(ENDOSDK_DECLARE)
}
namespace endosdk::neon {
ENDOSDK_FOR_EACH_KERNEL(ENDOSDK_DECLARE)
}

#undef ENDOSDK_DECLARE
