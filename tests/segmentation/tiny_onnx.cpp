#include "tests/segmentation/tiny_onnx.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <random>
#include <string_view>

namespace stillmap::test {
namespace {

/// Protocol Buffers by hand: field numbers are those of onnx.proto.
class Message {
 public:
  Message& number(int field, std::uint64_t value) {
    varint(static_cast<std::uint64_t>(field) << 3U);
    varint(value);
    return *this;
  }
  Message& bytes(int field, std::string_view value) {
    varint((static_cast<std::uint64_t>(field) << 3U) | 2U);
    varint(value.size());
    text_ += value;
    return *this;
  }
  Message& message(int field, const Message& value) { return bytes(field, value.text_); }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  void varint(std::uint64_t value) {
    for (; value >= 0x80U; value >>= 7U) text_ += static_cast<char>((value & 0x7FU) | 0x80U);
    text_ += static_cast<char>(value);
  }

  std::string text_;
};

constexpr int float_type = 1;

Message tensor(std::string_view name, const std::vector<int>& shape,
               const std::vector<float>& values) {
  std::string raw(values.size() * sizeof(float), '\0');
  std::memcpy(raw.data(), values.data(), raw.size());
  Message message;
  for (const int size : shape) message.number(1, static_cast<std::uint64_t>(size));
  return message.number(2, float_type).bytes(8, name).bytes(9, raw);
}

Message value_info(std::string_view name, const std::vector<int>& shape) {
  Message dimensions;
  for (const int size : shape) {
    dimensions.message(1, Message().number(1, static_cast<std::uint64_t>(size)));
  }
  const Message tensor_type = Message().number(1, float_type).message(2, dimensions);
  return Message().bytes(1, name).message(2, Message().message(1, tensor_type));
}

Message convolution(const TinyNetwork& network) {
  constexpr int ints = 7;
  return Message()
      .bytes(1, "input")
      .bytes(1, "weights")
      .bytes(1, "bias")
      .bytes(2, "logits")
      .bytes(3, "head")
      .bytes(4, network.operation)
      .message(5, Message().bytes(1, "kernel_shape").number(8, 1).number(8, 1).number(20, ints));
}

Message soft_max() {
  constexpr int integer = 2;
  return Message()
      .bytes(1, "logits")
      .bytes(2, "probabilities")
      .bytes(3, "softmax")
      .bytes(4, "Softmax")
      .message(5, Message().bytes(1, "axis").number(3, 1).number(20, integer));
}

}  // namespace

TinyNetwork random_network(int rows, int columns, int classes) {
  TinyNetwork network{.rows = rows, .columns = columns};
  std::mt19937 random(7);
  std::uniform_real_distribution<float> any(-1.0F, 1.0F);
  for (int i = 0; i < classes * 5; ++i) network.weights.push_back(any(random));
  for (int i = 0; i < classes; ++i) network.bias.push_back(any(random));
  return network;
}

std::string onnx_bytes(const TinyNetwork& network) {
  const auto classes = static_cast<int>(network.bias.size());
  Message graph;
  graph.message(1, convolution(network));
  if (network.softmax) graph.message(1, soft_max());
  graph.bytes(2, "tiny")
      .message(5, tensor("weights", {classes, network.weight_channels, 1, 1}, network.weights))
      .message(5, tensor("bias", {classes}, network.bias))
      .message(11, value_info("input", {1, network.input_channels, network.rows, network.columns}))
      .message(12, value_info(network.softmax ? "probabilities" : "logits",
                              {1, classes, network.rows, network.columns}));
  constexpr int ir_version = 7;
  constexpr int opset = 13;
  return Message()
      .number(1, ir_version)
      .message(7, graph)
      .message(8, Message().bytes(1, "").number(2, opset))
      .text();
}

std::filesystem::path write_model(const std::string& bytes) {
  const auto* const test = ::testing::UnitTest::GetInstance()->current_test_info();
  const std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) /
                                       (std::string(test->test_suite_name()) + "." + test->name());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "model.onnx", std::ios::binary) << bytes;
  return folder / "model.onnx";
}

}  // namespace stillmap::test
