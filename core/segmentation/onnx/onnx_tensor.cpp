#include "core/segmentation/onnx/onnx_tensor.hpp"

#include <onnx/onnx_pb.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>

namespace stillmap {
namespace {

static_assert(std::endian::native == std::endian::little, "ONNX's raw data are little-endian");

constexpr std::int64_t max_values = std::int64_t{1} << 28;

std::optional<std::int64_t> product(const onnx::TensorProto& tensor) {
  std::int64_t count = 1;
  for (const std::int64_t size : tensor.dims()) {
    if (size < 0 || size > max_values) return std::nullopt;
    if (size > 0 && count > max_values / size) return std::nullopt;
    count *= size;
  }
  return count;
}

template <class T, class Field>
std::vector<T> values(const onnx::TensorProto& tensor, const Field& field) {
  if (!tensor.has_raw_data()) return {field.begin(), field.end()};
  std::vector<T> read(tensor.raw_data().size() / sizeof(T));
  std::memcpy(read.data(), tensor.raw_data().data(), read.size() * sizeof(T));
  return read;
}

/// Values that the file holds, of the types that matter here.
std::int64_t stored_values(const onnx::TensorProto& tensor) {
  const bool is_float = tensor.data_type() == onnx::TensorProto::FLOAT;
  if (tensor.has_raw_data()) {
    const std::size_t bytes = is_float ? sizeof(float) : sizeof(std::int64_t);
    if (tensor.raw_data().size() % bytes != 0) return -1;
    return static_cast<std::int64_t>(tensor.raw_data().size() / bytes);
  }
  return is_float ? tensor.float_data_size() : tensor.int64_data_size();
}

}  // namespace

std::string tensor_fault(const onnx::TensorProto& tensor) {
  const std::string name = "weights '" + tensor.name() + "'";
  if (tensor.data_location() == onnx::TensorProto::EXTERNAL || tensor.external_data_size() > 0) {
    return name + " lie in another file; export the network as one file";
  }
  const std::optional<std::int64_t> wanted = product(tensor);
  if (!wanted) return name + " have dimensions that are negative or absurd";
  const bool is_float = tensor.data_type() == onnx::TensorProto::FLOAT;
  if (!is_float && tensor.data_type() != onnx::TensorProto::INT64) return {};
  if (const std::int64_t stored = stored_values(tensor); stored != *wanted) {
    return name + " are not whole: their dimensions want " + std::to_string(*wanted) +
           " values, the file does not hold as many";
  }
  const std::vector<float> numbers = float_values(tensor);
  const bool finite = std::ranges::all_of(numbers, [](float x) { return std::isfinite(x); });
  return finite ? std::string() : name + " are not all finite numbers";
}

std::size_t value_count(const onnx::TensorProto& tensor) {
  return static_cast<std::size_t>(product(tensor).value_or(0));
}

std::vector<float> float_values(const onnx::TensorProto& tensor) {
  if (tensor.data_type() != onnx::TensorProto::FLOAT) return {};
  return values<float>(tensor, tensor.float_data());
}

std::vector<std::int64_t> int_values(const onnx::TensorProto& tensor) {
  if (tensor.data_type() != onnx::TensorProto::INT64) return {};
  return values<std::int64_t>(tensor, tensor.int64_data());
}

}  // namespace stillmap
