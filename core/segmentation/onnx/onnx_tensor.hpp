#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace onnx {
class TensorProto;
}  // namespace onnx

namespace stillmap {

/// What is wrong with a tensor that is stored in an ONNX file; empty when it can be used.
[[nodiscard]] std::string tensor_fault(const onnx::TensorProto& tensor);

/// Number of values, by the tensor's dimensions. The tensor has no fault.
[[nodiscard]] std::size_t value_count(const onnx::TensorProto& tensor);

/// The values of a tensor without a fault; empty when it is not one of this type.
[[nodiscard]] std::vector<float> float_values(const onnx::TensorProto& tensor);
[[nodiscard]] std::vector<std::int64_t> int_values(const onnx::TensorProto& tensor);

}  // namespace stillmap
