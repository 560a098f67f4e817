// Compares functions/runtime_table.hpp with the runtime's own header, at compile time only.
#include "functions/runtime_table.hpp"

#include <type_traits>

#include "library/onnxruntime.hpp"
#include "library/runtime.hpp"

namespace endosdk {
namespace {

static_assert(runtime_table::api_version == runtime_api);

#define ENDOSDK_SAME_PLACE(entry, function) \
  static_assert(runtime_table::entry::place * sizeof(void*) == offsetof(OrtApi, function));

ENDOSDK_SAME_PLACE(CreateStatus, CreateStatus)
ENDOSDK_SAME_PLACE(CreateCustomOpDomain, CreateCustomOpDomain)
ENDOSDK_SAME_PLACE(CustomOpDomainAdd, CustomOpDomain_Add)
ENDOSDK_SAME_PLACE(AddCustomOpDomain, AddCustomOpDomain)
ENDOSDK_SAME_PLACE(GetTensorMutableData, GetTensorMutableData)
ENDOSDK_SAME_PLACE(GetDimensionsCount, GetDimensionsCount)
ENDOSDK_SAME_PLACE(GetDimensions, GetDimensions)
ENDOSDK_SAME_PLACE(GetTensorTypeAndShape, GetTensorTypeAndShape)
ENDOSDK_SAME_PLACE(KernelInfoGetFloat, KernelInfoGetAttribute_float)
ENDOSDK_SAME_PLACE(KernelInfoGetInt, KernelInfoGetAttribute_int64)
ENDOSDK_SAME_PLACE(GetInput, KernelContext_GetInput)
ENDOSDK_SAME_PLACE(GetOutput, KernelContext_GetOutput)
ENDOSDK_SAME_PLACE(ReleaseStatus, ReleaseStatus)
ENDOSDK_SAME_PLACE(ReleaseTensorInfo, ReleaseTensorTypeAndShapeInfo)
ENDOSDK_SAME_PLACE(ParallelFor, KernelContext_ParallelFor)

#define ENDOSDK_SAME_MEMBER(member, theirs) \
  static_assert(offsetof(runtime_table::CustomOp, member) == offsetof(OrtCustomOp, theirs));

static_assert(sizeof(runtime_table::CustomOp) == sizeof(OrtCustomOp));
ENDOSDK_SAME_MEMBER(version, version)
ENDOSDK_SAME_MEMBER(name, GetName)
ENDOSDK_SAME_MEMBER(provider, GetExecutionProviderType)
ENDOSDK_SAME_MEMBER(input_type, GetInputType)
ENDOSDK_SAME_MEMBER(input_count, GetInputTypeCount)
ENDOSDK_SAME_MEMBER(output_type, GetOutputType)
ENDOSDK_SAME_MEMBER(output_count, GetOutputTypeCount)
ENDOSDK_SAME_MEMBER(destroy, KernelDestroy)
ENDOSDK_SAME_MEMBER(input_kind, GetInputCharacteristic)
ENDOSDK_SAME_MEMBER(output_kind, GetOutputCharacteristic)
ENDOSDK_SAME_MEMBER(input_memory, GetInputMemoryType)
ENDOSDK_SAME_MEMBER(least_variadic_inputs, GetVariadicInputMinArity)
ENDOSDK_SAME_MEMBER(variadic_inputs_alike, GetVariadicInputHomogeneity)
ENDOSDK_SAME_MEMBER(least_variadic_outputs, GetVariadicOutputMinArity)
ENDOSDK_SAME_MEMBER(variadic_outputs_alike, GetVariadicOutputHomogeneity)
ENDOSDK_SAME_MEMBER(create_kernel_2, CreateKernelV2)
ENDOSDK_SAME_MEMBER(compute_2, KernelComputeV2)
ENDOSDK_SAME_MEMBER(first_version, GetStartVersion)
ENDOSDK_SAME_MEMBER(last_version, GetEndVersion)

static_assert(sizeof(OrtApiBase) == sizeof(runtime_table::ApiBase));
static_assert(offsetof(OrtApiBase, GetApi) == offsetof(runtime_table::ApiBase, get_api));

}  // namespace
}  // namespace endosdk
