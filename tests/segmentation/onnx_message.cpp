#include "tests/segmentation/onnx_message.hpp"

#include <cstring>

namespace stillmap::test {
namespace {

enum AttributeType { real_type = 1, whole_type = 2, text_type = 3, whole_list_type = 7 };
constexpr int float_values = 1;
constexpr int int64_values = 7;

template <class T>
std::string raw(const std::vector<T>& values) {
  std::string bytes(values.size() * sizeof(T), '\0');
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

}  // namespace

void Message::varint(std::uint64_t value) {
  for (; value >= 0x80U; value >>= 7U) text_ += static_cast<char>((value & 0x7FU) | 0x80U);
  text_ += static_cast<char>(value);
}

Message& Message::number(int field, std::uint64_t value) {
  varint(static_cast<std::uint64_t>(field) << 3U);
  varint(value);
  return *this;
}

Message& Message::real(int field, float value) {
  varint((static_cast<std::uint64_t>(field) << 3U) | 5U);
  text_ += raw(std::vector<float>{value});
  return *this;
}

Message& Message::bytes(int field, std::string_view value) {
  varint((static_cast<std::uint64_t>(field) << 3U) | 2U);
  varint(value.size());
  text_ += value;
  return *this;
}

Message float_tensor(std::string_view name, const Sizes& shape, const std::vector<float>& values) {
  Message message;
  for (const std::int64_t size : shape) message.number(1, static_cast<std::uint64_t>(size));
  return message.number(2, float_values).bytes(8, name).bytes(9, raw(values));
}

Message whole_tensor(std::string_view name, const std::vector<std::int64_t>& values) {
  return Message()
      .number(1, values.size())
      .number(2, int64_values)
      .bytes(8, name)
      .bytes(9, raw(values));
}

Message value_info(std::string_view name, const Sizes& shape) {
  Message dimensions;
  for (const std::int64_t size : shape) {
    dimensions.message(1, size == 0 ? Message().bytes(2, "any")
                                    : Message().number(1, static_cast<std::uint64_t>(size)));
  }
  const Message tensor_type = Message().number(1, float_values).message(2, dimensions);
  return Message().bytes(1, name).message(2, Message().message(1, tensor_type));
}

Message whole_attribute(std::string_view name, std::int64_t value) {
  return Message()
      .bytes(1, name)
      .number(3, static_cast<std::uint64_t>(value))
      .number(20, whole_type);
}

Message list_attribute(std::string_view name, const Sizes& values) {
  Message message;
  message.bytes(1, name);
  for (const std::int64_t value : values) message.number(8, static_cast<std::uint64_t>(value));
  return message.number(20, whole_list_type);
}

Message real_attribute(std::string_view name, float value) {
  return Message().bytes(1, name).real(2, value).number(20, real_type);
}

Message text_attribute(std::string_view name, std::string_view value) {
  return Message().bytes(1, name).bytes(4, value).number(20, text_type);
}

Message onnx_node(std::string_view operation, const std::vector<std::string>& inputs,
                  const std::string& output, const std::vector<Message>& attributes) {
  Message node;
  for (const std::string& input : inputs) node.bytes(1, input);
  node.bytes(2, output).bytes(3, "make_" + output).bytes(4, operation);
  for (const Message& attribute : attributes) node.message(5, attribute);
  return node;
}

std::string onnx_file(const Message& graph, int operator_set) {
  constexpr int ir_version = 7;
  return Message()
      .number(1, ir_version)
      .message(7, graph)
      .message(8, Message().bytes(1, "").number(2, static_cast<std::uint64_t>(operator_set)))
      .text();
}

}  // namespace stillmap::test
