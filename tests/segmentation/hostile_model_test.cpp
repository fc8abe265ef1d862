// Damaged and malicious files: both engines must refuse them with a message.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <limits>

#include "core/segmentation/model_error.hpp"
#include "core/segmentation/onednn_network.hpp"
#include "core/segmentation/opencv_network.hpp"
#include "tests/segmentation/onnx_builder.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

using test::float_tensor;
using test::ints_attribute;
using test::Message;
using test::onnx_file;
using test::onnx_node;
using test::OnnxBuilder;
using test::value_info;
using ::testing::AnyOf;
using ::testing::HasSubstr;

constexpr std::int64_t rows = 4, columns = 8, classes = 3;

struct TestedEngine {
  const char* name;
  std::function<void(const ModelDescription&)> open;
};
void PrintTo(const TestedEngine& engine, std::ostream* out) { *out << engine.name; }

class HostileModel : public ::testing::TestWithParam<TestedEngine> {
 protected:
  /// The engine's error message; empty when it accepts the file.
  static std::string refusal(const std::string& bytes) {
    ModelDescription model = test::describe_family(rows, columns, classes);
    model.network_file = test::write_model(bytes);
    return refusal_of(model);
  }
  static std::string refusal_of(const ModelDescription& model) {
    try {
      GetParam().open(model);
      return {};
    } catch (const ModelError& error) {
      EXPECT_THAT(error.what(), HasSubstr(model.network_file.string()));
      return error.what();
    }
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, HostileModel,
                         ::testing::Values(TestedEngine{"onednn",
                                                        [](const ModelDescription& model) {
                                                          const OneDnnNetwork network(
                                                              model, Precision::fp32);
                                                        }},
                                           TestedEngine{"opencv",
                                                        [](const ModelDescription& model) {
                                                          const OpenCvNetwork network(model);
                                                        }}),
                         [](const auto& info) { return std::string(info.param.name); });

const std::vector<float> weights(15, 0.25F);
Message kernel_shape() { return ints_attribute("kernel_shape", {1, 1}); }

/// A network of one 1x1 convolution, of which a test replaces a part.
struct Parts {
  Message weights_tensor = float_tensor("w", {classes, 5, 1, 1}, weights);
  Message node = onnx_node("Conv", {"input", "w"}, "output", {kernel_shape()});
  Message input = value_info("input", {1, 5, rows, columns});
  Message output = value_info("output", {1, classes, rows, columns});

  [[nodiscard]] std::string bytes() const {
    return onnx_file(Message()
                         .message(1, node)
                         .bytes(2, "hostile")
                         .message(5, weights_tensor)
                         .message(11, input)
                         .message(12, output));
  }
};

TEST_P(HostileModel, TakesASoundOne) { EXPECT_EQ(refusal(Parts().bytes()), ""); }

TEST_P(HostileModel, IsRefusedCutAnywhere) {
  const std::string whole = Parts().bytes();
  // The last field is the operator set; every cut before it removes something required.
  for (std::size_t size = 0; size + 8 < whole.size(); ++size) {
    EXPECT_NE(refusal(whole.substr(0, size)), "") << "cut to " << size << " bytes";
  }
}

TEST_P(HostileModel, DoesNotCrashWithAnyByteChanged) {
  const std::string whole = Parts().bytes();
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string changed = whole;
    changed[at] = static_cast<char>(~static_cast<unsigned char>(changed[at]));
    (void)refusal(changed);
  }
}

TEST_P(HostileModel, IsRefusedWhenItIsNoModelAtAll) {
  EXPECT_THAT(refusal(""), HasSubstr("ONNX"));
  EXPECT_THAT(refusal(std::string(4096, '\x5a')), HasSubstr("ONNX"));
  ModelDescription model = test::describe_family(rows, columns, classes);
  model.network_file = test::write_model("") / "missing.onnx";
  EXPECT_THAT(refusal_of(model), HasSubstr("is not a file"));
  model.network_file = test::write_model("").parent_path();
  EXPECT_THAT(refusal_of(model), HasSubstr("is not a file"));
}

TEST_P(HostileModel, IsRefusedWithWeightsThatAreNotFinite) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), -std::numeric_limits<float>::infinity()}) {
    std::vector<float> poisoned = weights;
    poisoned[7] = bad;
    Parts parts;
    parts.weights_tensor = float_tensor("w", {classes, 5, 1, 1}, poisoned);
    EXPECT_THAT(refusal(parts.bytes()), HasSubstr("'w' are not all finite"));
  }
}

TEST_P(HostileModel, IsRefusedWithDimensionsThatAreWrong) {
  const auto with_shape = [](const test::Sizes& shape) {
    Parts parts;
    parts.weights_tensor = float_tensor("w", shape, weights);
    return refusal(parts.bytes());
  };
  EXPECT_THAT(with_shape({std::int64_t{1} << 31, 5, 1, 1}), HasSubstr("absurd"));
  EXPECT_THAT(with_shape({std::int64_t{1} << 62, std::int64_t{1} << 62, 4, 1}),
              HasSubstr("absurd"));
  EXPECT_THAT(with_shape({-3, 5, 1, 1}), HasSubstr("negative"));
  EXPECT_THAT(with_shape({classes, 6, 1, 1}), HasSubstr("not whole"));
  EXPECT_THAT(with_shape({classes, 5, 0, 1}), HasSubstr("not whole"));
  EXPECT_NE(with_shape({15}), "");
  EXPECT_NE(with_shape({5, classes, 1, 1}), "");
}

TEST_P(HostileModel, IsRefusedWithAnInputOrOutputOfAnotherSize) {
  Parts parts;
  parts.input = value_info("input", {1, 5, rows, std::int64_t{1} << 31});
  EXPECT_THAT(refusal(parts.bytes()), HasSubstr("wants an input of 1x5x4x2147483648"));
  parts.input = value_info("input", {1, 4, rows, columns});
  EXPECT_THAT(refusal(parts.bytes()), HasSubstr("wants an input of 1x4x4x8"));
  ModelDescription model = test::describe_family(rows, columns, classes + 1);
  model.network_file = test::write_model(Parts().bytes());
  EXPECT_THAT(refusal_of(model), HasSubstr("output of 1x3x4x8, but 1x4x4x8"));
}

TEST_P(HostileModel, IsRefusedWithNegativePaddingOrNoStride) {
  Parts parts;
  parts.node = onnx_node("Conv", {"input", "w"}, "output",
                         {kernel_shape(), ints_attribute("pads", {-1, 0, 0, 0})});
  EXPECT_NE(refusal(parts.bytes()), "");
  parts.node = onnx_node("Conv", {"input", "w"}, "output",
                         {kernel_shape(), ints_attribute("strides", {0, 0})});
  EXPECT_NE(refusal(parts.bytes()), "");
}

TEST_P(HostileModel, IsRefusedWhenItReadsWhatIsNotThere) {
  Parts parts;
  parts.node = onnx_node("Conv", {"input", "weights"}, "output", {});
  EXPECT_THAT(refusal(parts.bytes()), HasSubstr("reads 'weights', which is neither"));
  parts = {};
  parts.output = value_info("other", {1, classes, rows, columns});
  EXPECT_THAT(refusal(parts.bytes()), HasSubstr("no layer makes the network's output 'other'"));
}

TEST_P(HostileModel, IsRefusedWithACycle) {
  Parts parts;
  parts.node = onnx_node("Add", {"input", "output"}, "output", {});
  EXPECT_THAT(refusal(parts.bytes()), HasSubstr("cycle"));
}

TEST_P(HostileModel, IsRefusedWhenATensorIsMadeTwice) {
  Parts parts;
  parts.node = onnx_node("Conv", {"input", "w"}, "w", {});
  EXPECT_THAT(refusal(parts.bytes()), HasSubstr("is there already"));
}

TEST_P(HostileModel, IsRefusedWithWeightsInAnotherFile) {
  Parts parts;
  const Message place = Message().bytes(1, "location").bytes(2, "/etc/passwd");
  parts.weights_tensor = Message().number(1, 3).number(1, 5).number(1, 1).number(1, 1);
  parts.weights_tensor.number(2, 1).bytes(8, "w").message(13, place).number(14, 1);
  EXPECT_THAT(refusal(parts.bytes()), HasSubstr("another file"));
}

TEST_P(HostileModel, IsRefusedWithSeveralInputsOrOutputsOrWithoutLayers) {
  const Parts parts;
  const auto graph = [&] {
    return Message().message(1, parts.node).bytes(2, "g").message(5, parts.weights_tensor);
  };
  const Message second = value_info("second", {1, 5, rows, columns});
  EXPECT_THAT(refusal(onnx_file(
                  graph().message(11, parts.input).message(11, second).message(12, parts.output))),
              HasSubstr("exactly one input"));
  EXPECT_THAT(refusal(onnx_file(graph().message(11, parts.input))), HasSubstr("0 outputs"));
  EXPECT_THAT(refusal(onnx_file(Message().message(11, parts.input).message(12, parts.output))),
              HasSubstr("no layer in it"));
}

TEST_P(HostileModel, IsRefusedWhenItsScoresOverflow) {
  OnnxBuilder network(5, rows, columns);
  const std::string huge =
      network.weights(float_tensor("h", {5, 5, 1, 1}, std::vector<float>(25, 3e38F)), "h");
  const std::string once = network.node("Conv", {"input", huge}, 5, {kernel_shape()});
  const std::string twice = network.node("Conv", {once, huge}, 5, {kernel_shape()});
  EXPECT_THAT(refusal(network.bytes(network.convolve(twice, classes, {}))),
              HasSubstr("not finite"));
}

}  // namespace
}  // namespace stillmap
