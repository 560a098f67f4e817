#include "functions/custom_ops.hpp"

#include <array>
#include <exception>
#include <map>
#include <memory>
#include <vector>

#include "functions/function.hpp"
#include "functions/runtime_table.hpp"
#include "platform/errors.hpp"

namespace endosdk {
namespace {

using namespace runtime_table;  // NOLINT(google-build-using-namespace): this file is all about it

constexpr int fail_code = 1;        // ORT_FAIL
constexpr int any_type = 0;         // ONNX_TENSOR_ELEMENT_DATA_TYPE_UNDEFINED
constexpr int float_type = 1;       // ..._FLOAT
constexpr int uint8_type = 2;       // ..._UINT8
constexpr int required_kind = 0;    // INPUT_OUTPUT_REQUIRED
constexpr int variadic_kind = 2;    // INPUT_OUTPUT_VARIADIC
constexpr int default_memory = 0;   // OrtMemTypeDefault

int type_of(Element element) { return element == Element::uint8 ? uint8_type : float_type; }

// A failed call of the runtime, which keeps what it says.
struct Failure {
  Status* status;
};

void check(Status* status) {
  if (status != nullptr) throw Failure{status};
}

// Runs `body` and turns what it throws into a status.
template <typename Body>
Status* guarded(const Api& api, const Body& body) {
  try {
    body();
    return nullptr;
  } catch (const Failure& failure) {
    return failure.status;
  } catch (const std::exception& error) {
    return api.call<CreateStatus>(fail_code, error.what());
  }
}

// One operation of a session's graph.
struct Kernel {
  Api api;
  const FunctionKind* kind;
  std::unique_ptr<Function> function;
};

class RuntimeCall : public FunctionCall {
 public:
  RuntimeCall(const Api& api, Context* context, int inputs) : api_(api), context_(context) {
    for (int i = 0; i < inputs; ++i) inputs_[static_cast<size_t>(i)] = read(i);
  }

  Shape shape(int input) const override { return inputs_[static_cast<size_t>(input)].shape; }
  const void* data(int input) const override { return inputs_[static_cast<size_t>(input)].data; }

  void* output(int place, const Shape& shape) override {
    Value* value = nullptr;
    check(api_.call<GetOutput>(context_, static_cast<size_t>(place), shape.data(), shape.size(), &value));
    return data_of(value);
  }

  void run(int count, RowBody body) override {
    struct Work {
      RowBody body;
      std::mutex mutex;
      std::exception_ptr error;
    } work{body, {}, nullptr};
    // What a body throws must not pass through the runtime.
    const auto one = [](void* user, size_t index) {
      Work& shared = *static_cast<Work*>(user);
      try {
        shared.body(static_cast<int>(index));
      } catch (...) {
        const std::lock_guard lock(shared.mutex);
        shared.error = std::current_exception();
      }
    };
    check(api_.call<ParallelFor>(context_, static_cast<void (*)(void*, size_t)>(one), static_cast<size_t>(count), size_t{0},
                                 static_cast<void*>(&work)));
    if (work.error) std::rethrow_exception(work.error);
  }

 private:
  struct Input {
    Shape shape{};
    const void* data = nullptr;
  };

  void* data_of(Value* value) const {
    void* data = nullptr;
    check(api_.call<GetTensorMutableData>(value, &data));
    return data;
  }

  Input read(int place) const {
    const Value* value = nullptr;
    check(api_.call<GetInput>(context_, static_cast<size_t>(place), &value));
    TensorInfo* info = nullptr;
    check(api_.call<GetTensorTypeAndShape>(value, &info));
    const auto release = [this](TensorInfo* taken) { api_.call<ReleaseTensorInfo>(taken); };
    const std::unique_ptr<TensorInfo, decltype(release)> held(info, release);
    size_t rank = 0;
    check(api_.call<GetDimensionsCount>(info, &rank));
    Shape shape(rank);
    check(api_.call<GetDimensions>(info, shape.data(), rank));
    return {shape, data_of(const_cast<Value*>(value))};
  }

  const Api& api_;
  Context* context_;
  std::array<Input, most_inputs> inputs_{};
};

// A kind of function as the runtime asks for it.
struct Operator : CustomOp {
  const FunctionKind* kind = nullptr;
};

const FunctionKind& kind_of(const CustomOp* op) { return *static_cast<const Operator*>(op)->kind; }

double setting(const Api& api, const KernelInfo* info, const char* name) {
  float number = 0.0f;
  int64_t whole = 0;
  Status* status = api.call<KernelInfoGetFloat>(info, name, &number);
  if (status == nullptr) return static_cast<double>(number);
  api.call<ReleaseStatus>(status);
  status = api.call<KernelInfoGetInt>(info, name, &whole);
  if (status == nullptr) return static_cast<double>(whole);
  api.call<ReleaseStatus>(status);
  return -1.0;
}

Status* ENDOSDK_ORT_CALL create_kernel(const CustomOp* op, const void* table, const KernelInfo* info, void** kernel) {
  const Api api(table);
  return guarded(api, [&] {
    const FunctionKind& kind = kind_of(op);
    *kernel = new Kernel{api, &kind, kind.make([&](const char* name) { return setting(api, info, name); })};
  });
}

Status* ENDOSDK_ORT_CALL compute(void* made, Context* context) {
  Kernel& kernel = *static_cast<Kernel*>(made);
  return guarded(kernel.api, [&] {
    RuntimeCall call(kernel.api, context, kernel.kind->input_count);
    kernel.function->compute(call);
  });
}

Operator operator_of(const FunctionKind& kind) {
  Operator op{};
  op.version = api_version;
  op.name = [](const CustomOp* self) { return kind_of(self).name; };
  op.provider = [](const CustomOp*) { return "CPUExecutionProvider"; };
  // After the inputs of the function come sizes that its body reads, however many, of any type.
  op.input_count = [](const CustomOp* self) { return static_cast<size_t>(kind_of(self).input_count) + 1; };
  op.input_type = [](const CustomOp* self, size_t place) {
    const FunctionKind& own = kind_of(self);
    return place < static_cast<size_t>(own.input_count) ? type_of(own.inputs[place]) : any_type;
  };
  op.input_kind = [](const CustomOp* self, size_t place) {
    return place < static_cast<size_t>(kind_of(self).input_count) ? required_kind : variadic_kind;
  };
  op.output_count = [](const CustomOp* self) { return static_cast<size_t>(kind_of(self).output_count); };
  op.output_type = [](const CustomOp* self, size_t place) { return type_of(kind_of(self).outputs[place]); };
  op.output_kind = [](const CustomOp*, size_t) { return required_kind; };
  op.input_memory = [](const CustomOp*, size_t) { return default_memory; };
  op.least_variadic_inputs = [](const CustomOp*) { return 0; };
  op.variadic_inputs_alike = [](const CustomOp*) { return 0; };
  op.least_variadic_outputs = [](const CustomOp*) { return 0; };
  op.variadic_outputs_alike = [](const CustomOp*) { return 0; };
  op.create_kernel_2 = create_kernel;
  op.compute_2 = compute;
  op.destroy = [](void* kernel) { delete static_cast<Kernel*>(kernel); };
  op.first_version = [](const CustomOp*) { return 1; };
  op.last_version = [](const CustomOp*) { return 1; };
  op.kind = &kind;
  return op;
}

// The operators must outlive every session.
const std::vector<Operator>& operators() {
  static const auto* const all = [] {
    auto* made = new std::vector<Operator>;
    for (int i = 0; function_kind(i) != nullptr; ++i) made->push_back(operator_of(*function_kind(i)));
    return made;
  }();
  return *all;
}

// So must what holds them: one for each runtime of the process.
Domain* domain_of(const void* table) {
  static std::mutex mutex;
  static auto* const domains = new std::map<const void*, Domain*>;
  const std::lock_guard lock(mutex);
  Domain*& domain = (*domains)[table];
  if (domain == nullptr) {
    const Api api(table);
    Domain* made = nullptr;
    check(api.call<CreateCustomOpDomain>("endosdk", &made));
    for (const Operator& op : operators()) check(api.call<CustomOpDomainAdd>(made, static_cast<const CustomOp*>(&op)));
    domain = made;
  }
  return domain;
}

}  // namespace

void* add_functions(const void* table, void* options) {
  const Api api(table);
  return guarded(api, [&] { check(api.call<AddCustomOpDomain>(options, domain_of(table))); });
}

}  // namespace endosdk
