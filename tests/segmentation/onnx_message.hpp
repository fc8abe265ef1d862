#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace stillmap::test {

/// Protocol Buffers by hand, so that tests can write files that no library would; field numbers
/// are those of onnx.proto.
class Message {
 public:
  Message& number(int field, std::uint64_t value);
  Message& real(int field, float value);
  Message& bytes(int field, std::string_view value);
  Message& message(int field, const Message& value) { return bytes(field, value.text_); }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  void varint(std::uint64_t value);

  std::string text_;
};

using Sizes = std::vector<std::int64_t>;

/// A tensor of 32-bit floats.
[[nodiscard]] Message float_tensor(std::string_view name, const Sizes& shape,
                                   const std::vector<float>& values);
[[nodiscard]] Message whole_tensor(std::string_view name, const std::vector<std::int64_t>& values);
/// An input or output; a size of 0 is left open.
[[nodiscard]] Message value_info(std::string_view name, const Sizes& shape);

[[nodiscard]] Message whole_attribute(std::string_view name, std::int64_t value);
[[nodiscard]] Message list_attribute(std::string_view name, const Sizes& values);
[[nodiscard]] Message real_attribute(std::string_view name, float value);
[[nodiscard]] Message text_attribute(std::string_view name, std::string_view value);

[[nodiscard]] Message onnx_node(std::string_view operation, const std::vector<std::string>& inputs,
                                const std::string& output, const std::vector<Message>& attributes);
/// The whole file around a graph.
[[nodiscard]] std::string onnx_file(const Message& graph, int operator_set = 13);

}  // namespace stillmap::test
