// The part of ONNX Runtime's C interface that functions need, in the memory layout of the runtime. The Python module is built
// without the runtime's header, so it needs this copy. Places in the runtime's table never change. The C library has the
// header, and checks all of this against it at compile time (library/runtime_table.cpp).
#pragma once

#include <cstddef>
#include <cstdint>

#ifdef _WIN32
#define ENDOSDK_ORT_CALL __stdcall
#else
#define ENDOSDK_ORT_CALL
#endif

namespace endosdk::runtime_table {

constexpr uint32_t api_version = 21;

using Status = void;  // null: all is well
using Value = void;
using TensorInfo = void;
using Context = void;
using Options = void;
using Domain = void;
using KernelInfo = void;

// A place in the table, and the type of the function at this place.
template <int Place, typename Type>
struct Entry {
  static constexpr int place = Place;
  using type = Type;
};

using CreateStatus = Entry<0, Status*(ENDOSDK_ORT_CALL*)(int code, const char* message)>;
using CreateCustomOpDomain = Entry<26, Status*(ENDOSDK_ORT_CALL*)(const char* name, Domain** out)>;
using CustomOpDomainAdd = Entry<27, Status*(ENDOSDK_ORT_CALL*)(Domain* domain, const struct CustomOp* op)>;
using AddCustomOpDomain = Entry<28, Status*(ENDOSDK_ORT_CALL*)(Options* options, Domain* domain)>;
using GetTensorMutableData = Entry<51, Status*(ENDOSDK_ORT_CALL*)(Value* value, void** out)>;
using GetDimensionsCount = Entry<61, Status*(ENDOSDK_ORT_CALL*)(const TensorInfo* info, size_t* out)>;
using GetDimensions = Entry<62, Status*(ENDOSDK_ORT_CALL*)(const TensorInfo* info, int64_t* sides, size_t count)>;
using GetTensorTypeAndShape = Entry<65, Status*(ENDOSDK_ORT_CALL*)(const Value* value, TensorInfo** out)>;
using KernelInfoGetFloat = Entry<85, Status*(ENDOSDK_ORT_CALL*)(const KernelInfo* info, const char* name, float* out)>;
using KernelInfoGetInt = Entry<86, Status*(ENDOSDK_ORT_CALL*)(const KernelInfo* info, const char* name, int64_t* out)>;
using GetInput = Entry<90, Status*(ENDOSDK_ORT_CALL*)(const Context* context, size_t place, const Value** out)>;
using GetOutput =
    Entry<91, Status*(ENDOSDK_ORT_CALL*)(Context* context, size_t place, const int64_t* sides, size_t count, Value** out)>;
using ReleaseStatus = Entry<93, void(ENDOSDK_ORT_CALL*)(Status* status)>;
using ReleaseTensorInfo = Entry<99, void(ENDOSDK_ORT_CALL*)(TensorInfo* info)>;
using ParallelFor = Entry<274, Status*(ENDOSDK_ORT_CALL*)(const Context* context, void (*body)(void* user, size_t index),
                                                         size_t count, size_t batches, void* user)>;

// The runtime's table of functions.
class Api {
 public:
  explicit Api(const void* table) : table_(static_cast<const Slot*>(table)) {}

  template <typename Wanted, typename... Arguments>
  auto call(Arguments... arguments) const {
    return reinterpret_cast<typename Wanted::type>(table_[Wanted::place])(arguments...);
  }

 private:
  using Slot = void (*)();
  const Slot* table_;
};

// Gives the table for a version.
struct ApiBase {
  const void*(ENDOSDK_ORT_CALL* get_api)(uint32_t version);
  const char*(ENDOSDK_ORT_CALL* get_version)();
};

// One of our own operators, in the layout that the runtime of `api_version` reads.
struct CustomOp {
  uint32_t version;
  void*(ENDOSDK_ORT_CALL* create_kernel)(const CustomOp* op, const void* api, const KernelInfo* info);
  const char*(ENDOSDK_ORT_CALL* name)(const CustomOp* op);
  const char*(ENDOSDK_ORT_CALL* provider)(const CustomOp* op);
  int(ENDOSDK_ORT_CALL* input_type)(const CustomOp* op, size_t place);
  size_t(ENDOSDK_ORT_CALL* input_count)(const CustomOp* op);
  int(ENDOSDK_ORT_CALL* output_type)(const CustomOp* op, size_t place);
  size_t(ENDOSDK_ORT_CALL* output_count)(const CustomOp* op);
  void(ENDOSDK_ORT_CALL* compute)(void* kernel, Context* context);
  void(ENDOSDK_ORT_CALL* destroy)(void* kernel);
  int(ENDOSDK_ORT_CALL* input_kind)(const CustomOp* op, size_t place);
  int(ENDOSDK_ORT_CALL* output_kind)(const CustomOp* op, size_t place);
  int(ENDOSDK_ORT_CALL* input_memory)(const CustomOp* op, size_t place);
  int(ENDOSDK_ORT_CALL* least_variadic_inputs)(const CustomOp* op);
  int(ENDOSDK_ORT_CALL* variadic_inputs_alike)(const CustomOp* op);
  int(ENDOSDK_ORT_CALL* least_variadic_outputs)(const CustomOp* op);
  int(ENDOSDK_ORT_CALL* variadic_outputs_alike)(const CustomOp* op);
  Status*(ENDOSDK_ORT_CALL* create_kernel_2)(const CustomOp* op, const void* api, const KernelInfo* info, void** kernel);
  Status*(ENDOSDK_ORT_CALL* compute_2)(void* kernel, Context* context);
  Status*(ENDOSDK_ORT_CALL* infer_shapes)(const CustomOp* op, void* context);
  int(ENDOSDK_ORT_CALL* first_version)(const CustomOp* op);
  int(ENDOSDK_ORT_CALL* last_version)(const CustomOp* op);
  size_t(ENDOSDK_ORT_CALL* may_inplace)(int** inputs, int** outputs);
  void(ENDOSDK_ORT_CALL* release_may_inplace)(int* inputs, int* outputs);
  size_t(ENDOSDK_ORT_CALL* aliases)(int** inputs, int** outputs);
  void(ENDOSDK_ORT_CALL* release_aliases)(int* inputs, int* outputs);
};

}  // namespace endosdk::runtime_table
