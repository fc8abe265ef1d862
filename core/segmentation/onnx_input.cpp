#include "core/segmentation/onnx_input.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>

namespace stillmap {
namespace {

// Numbers of the fields in onnx.proto.
namespace field {
constexpr std::uint64_t model_graph = 7;
constexpr std::uint64_t graph_initializer = 5;
constexpr std::uint64_t graph_input = 11;
constexpr std::uint64_t tensor_name = 8;
constexpr std::uint64_t value_name = 1;
constexpr std::uint64_t value_type = 2;
constexpr std::uint64_t type_tensor = 1;
constexpr std::uint64_t tensor_shape = 2;
constexpr std::uint64_t shape_dimension = 1;
constexpr std::uint64_t dimension_size = 1;
}  // namespace field

struct Field {
  std::uint64_t number = 0;
  /// Of a number field.
  std::uint64_t value = 0;
  /// Of a text or message field.
  std::string_view bytes;
};

/// Takes the fields of a Protocol Buffers message one by one; ends early where it is damaged.
class MessageReader {
 public:
  explicit MessageReader(std::string_view message) : rest_(message) {}

  std::optional<Field> next() {
    const std::optional<std::uint64_t> tag = varint();
    if (!tag) return std::nullopt;
    Field field{.number = *tag >> 3U, .value = 0, .bytes = {}};
    const std::optional<std::uint64_t> size = size_of(*tag & 7U, field.value);
    if (!size || *size > rest_.size()) return std::nullopt;
    field.bytes = rest_.substr(0, *size);
    rest_.remove_prefix(*size);
    return field;
  }

 private:
  /// Bytes that follow the tag, by its wire type; a number is read into `value` at once.
  std::optional<std::uint64_t> size_of(std::uint64_t wire_type, std::uint64_t& value) {
    switch (wire_type) {
      case 0: {
        const std::optional<std::uint64_t> number = varint();
        if (!number) return std::nullopt;
        value = *number;
        return 0;
      }
      case 1:
        return 8;
      case 2:
        return varint();
      case 5:
        return 4;
      default:
        return std::nullopt;
    }
  }

  std::optional<std::uint64_t> varint() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64 && !rest_.empty(); shift += 7) {
      const auto byte = static_cast<unsigned char>(rest_.front());
      rest_.remove_prefix(1);
      value |= static_cast<std::uint64_t>(byte & 0x7FU) << shift;
      if ((byte & 0x80U) == 0) return value;
    }
    return std::nullopt;
  }

  std::string_view rest_;
};

/// All fields of one number.
std::vector<Field> fields(std::string_view message, std::uint64_t number) {
  std::vector<Field> found;
  MessageReader reader(message);
  while (const std::optional<Field> field = reader.next()) {
    if (field->number == number) found.push_back(*field);
  }
  return found;
}

std::string_view bytes_of(std::string_view message, std::uint64_t number) {
  const std::vector<Field> found = fields(message, number);
  return found.empty() ? std::string_view() : found.front().bytes;
}

std::vector<std::int64_t> shape_of(std::string_view value_info) {
  const std::string_view tensor =
      bytes_of(bytes_of(value_info, field::value_type), field::type_tensor);
  std::vector<std::int64_t> shape;
  for (const Field& dimension :
       fields(bytes_of(tensor, field::tensor_shape), field::shape_dimension)) {
    const std::vector<Field> size = fields(dimension.bytes, field::dimension_size);
    shape.push_back(size.empty() ? 0 : static_cast<std::int64_t>(size.front().value));
  }
  return shape;
}

}  // namespace

std::vector<std::int64_t> declared_input_shape(std::string_view onnx_bytes) {
  const std::string_view graph = bytes_of(onnx_bytes, field::model_graph);
  std::vector<std::string_view> weights;
  for (const Field& tensor : fields(graph, field::graph_initializer)) {
    weights.push_back(bytes_of(tensor.bytes, field::tensor_name));
  }
  for (const Field& input : fields(graph, field::graph_input)) {
    // Old files list their weights among the inputs.
    const std::string_view name = bytes_of(input.bytes, field::value_name);
    if (std::ranges::find(weights, name) == weights.end()) return shape_of(input.bytes);
  }
  return {};
}

}  // namespace stillmap
