#pragma once

#include <cstdint>
#include <map>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace stillmap::test {

/// A protocol buffer message written field by field, so that tests can write files that no library
/// would; field numbers as in onnx.proto.
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
[[nodiscard]] Message int64_tensor(std::string_view name, const std::vector<std::int64_t>& values);
/// An input or output; a size of 0 is dynamic.
[[nodiscard]] Message value_info(std::string_view name, const Sizes& shape);

[[nodiscard]] Message int_attribute(std::string_view name, std::int64_t value);
[[nodiscard]] Message ints_attribute(std::string_view name, const Sizes& values);
[[nodiscard]] Message float_attribute(std::string_view name, float value);
[[nodiscard]] Message string_attribute(std::string_view name, std::string_view value);

[[nodiscard]] Message onnx_node(std::string_view operation, const std::vector<std::string>& inputs,
                                const std::string& output, const std::vector<Message>& attributes);
/// The whole file around a graph.
[[nodiscard]] std::string onnx_file(const Message& graph, int operator_set = 13);

/// Rows and columns of a kernel, its stride, and the zeros on each side.
struct Window {
  Sizes kernel{1, 1};
  Sizes stride{1, 1};
  Sizes padding{0, 0};
};

/// How an exporter writes a soft-max over the channels.
enum class SoftmaxStyle { whole, in_parts, between_transposes };

/// Writes ONNX networks layer by layer, with random weights from a fixed seed. Each function takes
/// names of tensors and returns the name of its output.
class OnnxBuilder {
 public:
  /// A size of 0 is dynamic.
  OnnxBuilder(int channels, int rows, int columns);

  std::string convolve(const std::string& input, int outputs, const Window& window,
                       bool bias = false);
  std::string transpose(const std::string& input, int outputs, const Window& window,
                        bool bias = false);
  /// A batch norm that scales the channels by about `scale`.
  std::string normalise(const std::string& input, float scale = 1.0F);
  std::string activate(const std::string& input);
  std::string add(const std::string& first, const std::string& second);
  std::string softmax(const std::string& input, SoftmaxStyle style = SoftmaxStyle::whole);
  /// Any other node; `channels`: of its output.
  std::string node(const std::string& operation, const std::vector<std::string>& inputs,
                   int channels, const std::vector<Message>& attributes = {});
  /// Adds a tensor as weights.
  std::string weights(const Message& tensor, const std::string& name);

  /// The ONNX file of the network whose output is this tensor.
  [[nodiscard]] std::string bytes(const std::string& output) const;
  [[nodiscard]] int channels(const std::string& tensor) const { return channels_.at(tensor); }

 private:
  std::string float_weights(const Sizes& shape, float spread, float middle = 0.0F);
  std::string fresh_name() { return std::string("t").append(std::to_string(++names_)); }
  std::string windowed(const std::string& operation, const std::string& input, int outputs,
                       const Window& window, bool bias);

  std::mt19937 random_{11};
  Sizes input_shape_;
  Message graph_;
  std::map<std::string, int> channels_;
  int names_ = 0;
  int operator_set_ = 13;
};

/// DarkNet21 or DarkNet53 as lidar-bonnetal defines it, but with `stem` channels where it has 32.
[[nodiscard]] std::string darknet_bytes(int layers, int stem, int rows, int columns, int classes);

/// A light member of the family: stem of stride (1, 2), stages of strides (1, 2), (2, 2) and (2,
/// 1), transposed convolutions with kernel = stride, head (1, 4) over (1, 2).
[[nodiscard]] std::string light_bytes(int stem, int rows, int columns, int classes);

}  // namespace stillmap::test
