#include "tests/segmentation/onnx_builder.hpp"

#include <array>
#include <cmath>
#include <cstring>

namespace stillmap::test {
namespace {

/// AttributeProto.AttributeType.
enum AttributeType { float_type = 1, int_type = 2, string_type = 3, ints_type = 7 };
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

Message int64_tensor(std::string_view name, const std::vector<std::int64_t>& values) {
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

Message int_attribute(std::string_view name, std::int64_t value) {
  return Message().bytes(1, name).number(3, static_cast<std::uint64_t>(value)).number(20, int_type);
}

Message ints_attribute(std::string_view name, const Sizes& values) {
  Message message;
  message.bytes(1, name);
  for (const std::int64_t value : values) message.number(8, static_cast<std::uint64_t>(value));
  return message.number(20, ints_type);
}

Message float_attribute(std::string_view name, float value) {
  return Message().bytes(1, name).real(2, value).number(20, float_type);
}

Message string_attribute(std::string_view name, std::string_view value) {
  return Message().bytes(1, name).bytes(4, value).number(20, string_type);
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

OnnxBuilder::OnnxBuilder(int channels, int rows, int columns)
    : input_shape_{1, channels, rows, columns} {
  channels_["input"] = channels;
}

std::string OnnxBuilder::node(const std::string& operation, const std::vector<std::string>& inputs,
                              int channels, const std::vector<Message>& attributes) {
  const std::string output = fresh_name();
  graph_.message(1, onnx_node(operation, inputs, output, attributes));
  channels_[output] = channels;
  return output;
}

std::string OnnxBuilder::weights(const Message& tensor, const std::string& name) {
  graph_.message(5, tensor);
  return name;
}

std::string OnnxBuilder::float_weights(const Sizes& shape, float spread, float middle) {
  std::uniform_real_distribution<float> any(middle - spread, middle + spread);
  std::size_t count = 1;
  for (const std::int64_t size : shape) count *= static_cast<std::size_t>(size);
  std::vector<float> values(count);
  for (float& value : values) value = any(random_);
  const std::string name = fresh_name();
  return weights(float_tensor(name, shape, values), name);
}

std::string OnnxBuilder::windowed(const std::string& operation, const std::string& input,
                                  int outputs, const Window& window, bool bias) {
  const std::int64_t inputs = channels(input);
  const bool transposed = operation == "ConvTranspose";
  // Keeps the variance of values from layer to layer (He et al., 2015).
  const double fan_in =
      static_cast<double>(inputs * window.kernel[0] * window.kernel[1]) /
      (transposed ? static_cast<double>(window.stride[0] * window.stride[1]) : 1.0);
  const auto spread = static_cast<float>(std::sqrt(6.0 / fan_in));
  const Sizes shape = transposed ? Sizes{inputs, outputs, window.kernel[0], window.kernel[1]}
                                 : Sizes{outputs, inputs, window.kernel[0], window.kernel[1]};
  std::vector<std::string> all{input, float_weights(shape, spread)};
  if (bias) all.push_back(float_weights({outputs}, 0.5F));
  return node(
      operation, all, outputs,
      {ints_attribute("kernel_shape", window.kernel), ints_attribute("strides", window.stride),
       ints_attribute(
           "pads", {window.padding[0], window.padding[1], window.padding[0], window.padding[1]})});
}

std::string OnnxBuilder::convolve(const std::string& input, int outputs, const Window& window,
                                  bool bias) {
  return windowed("Conv", input, outputs, window, bias);
}

std::string OnnxBuilder::transpose(const std::string& input, int outputs, const Window& window,
                                   bool bias) {
  return windowed("ConvTranspose", input, outputs, window, bias);
}

std::string OnnxBuilder::normalise(const std::string& input, float scale) {
  const std::int64_t size = channels(input);
  return node("BatchNormalization",
              {input, float_weights({size}, 0.3F * scale, scale), float_weights({size}, 0.3F),
               float_weights({size}, 0.3F), float_weights({size}, 0.3F, 1.0F)},
              channels(input), {float_attribute("epsilon", 1e-5F)});
}

std::string OnnxBuilder::activate(const std::string& input) {
  return node("LeakyRelu", {input}, channels(input), {float_attribute("alpha", 0.1F)});
}

std::string OnnxBuilder::add(const std::string& first, const std::string& second) {
  return node("Add", {first, second}, channels(first));
}

std::string OnnxBuilder::softmax(const std::string& input, SoftmaxStyle style) {
  const int size = channels(input);
  if (style == SoftmaxStyle::whole) {
    return node("Softmax", {input}, size, {int_attribute("axis", 1)});
  }
  operator_set_ = 9;
  if (style == SoftmaxStyle::in_parts) {
    const std::string powers = node("Exp", {input}, size);
    const std::string sum =
        node("ReduceSum", {powers}, 1, {ints_attribute("axes", {1}), int_attribute("keepdims", 1)});
    return node("Div", {powers, sum}, size);
  }
  const std::vector<Message> swap{ints_attribute("perm", {0, 3, 2, 1})};
  const std::string last = node("Transpose", {input}, size, swap);
  const std::string soft = node("Softmax", {last}, size, {int_attribute("axis", 3)});
  return node("Transpose", {soft}, size, swap);
}

std::string OnnxBuilder::bytes(const std::string& output) const {
  Message graph = graph_;
  graph.bytes(2, "network")
      .message(11, value_info("input", input_shape_))
      .message(12, value_info(output, {1, channels(output), input_shape_[2], input_shape_[3]}));
  return onnx_file(graph, operator_set_);
}

namespace {

const Window one_by_one{};
const Window three_by_three{.kernel = {3, 3}, .padding = {1, 1}};
const Window one_by_four{.kernel = {1, 4}, .stride = {1, 2}, .padding = {0, 1}};

std::string layer(OnnxBuilder& network, const std::string& input, int outputs, const Window& window,
                  float scale = 1.0F) {
  return network.activate(network.normalise(network.convolve(input, outputs, window), scale));
}

/// The sum stands after the second activation.
std::string block(OnnxBuilder& network, const std::string& input, int middle) {
  const int outputs = network.channels(input);
  // As in trained networks; otherwise values would double from block to block.
  constexpr float share = 0.2F;
  const std::string narrow = layer(network, input, middle, one_by_one);
  return network.add(layer(network, narrow, outputs, three_by_three, share), input);
}

std::string upsample(OnnxBuilder& network, const std::string& input, int outputs,
                     const Window& window) {
  return network.activate(network.normalise(network.transpose(input, outputs, window, true)));
}

}  // namespace

std::string darknet_bytes(int layers, int stem, int rows, int columns, int classes) {
  const std::array<int, 5> blocks =
      layers == 21 ? std::array{1, 1, 2, 2, 1} : std::array{1, 2, 8, 8, 4};
  OnnxBuilder network(5, rows, columns);
  std::string x = layer(network, "input", stem, three_by_three);
  std::vector<std::string> skips;
  for (std::size_t stage = 0; stage < blocks.size(); ++stage) {
    skips.push_back(x);
    const int middle = network.channels(x);
    x = layer(network, x, 2 * middle, {.kernel = {3, 3}, .stride = {1, 2}, .padding = {1, 1}});
    for (int i = 0; i < blocks[stage]; ++i) x = block(network, x, middle);
  }
  for (; !skips.empty(); skips.pop_back()) {
    const int before = network.channels(x);
    x = upsample(network, x, before / 2, one_by_four);
    x = network.add(block(network, x, before), skips.back());
  }
  x = network.convolve(x, classes, three_by_three, true);
  return network.bytes(network.softmax(x, SoftmaxStyle::in_parts));
}

std::string light_bytes(int stem, int rows, int columns, int classes) {
  OnnxBuilder network(5, rows, columns);
  std::string x =
      layer(network, "input", stem, {.kernel = {3, 3}, .stride = {1, 2}, .padding = {1, 1}});
  std::vector<std::string> skips;
  const std::vector<Sizes> strides{{1, 2}, {2, 2}, {2, 1}};
  for (const Sizes& stride : strides) {
    skips.push_back(x);
    const int outputs = 2 * network.channels(x);
    x = layer(network, x, outputs, {.kernel = {3, 3}, .stride = stride, .padding = {1, 1}});
    x = block(network, x, outputs / 2);
  }
  for (std::size_t i = strides.size(); i-- > 0;) {
    const int outputs = network.channels(skips[i]);
    x = network.add(upsample(network, x, outputs, {.kernel = strides[i], .stride = strides[i]}),
                    skips[i]);
    x = block(network, x, outputs / 2);
  }
  x = network.transpose(x, classes, one_by_four, true);
  return network.bytes(network.softmax(x));
}

}  // namespace stillmap::test
