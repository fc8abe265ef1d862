#include "core/segmentation/onnx_input.hpp"

#include <gtest/gtest.h>

#include "tests/segmentation/tiny_onnx.hpp"

namespace stillmap {
namespace {

using Shape = std::vector<std::int64_t>;

TEST(DeclaredInputShape, IsTheOneInTheFile) {
  EXPECT_EQ(declared_input_shape(test::onnx_bytes(test::random_network(8, 300, 3))),
            (Shape{1, 5, 8, 300}));
}

TEST(DeclaredInputShape, IsEmptyOrWholeInEveryTruncatedFile) {
  const std::string whole = test::onnx_bytes(test::random_network(8, 300, 3));
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const Shape shape = declared_input_shape(whole.substr(0, size));
    EXPECT_TRUE(shape.empty() || shape == (Shape{1, 5, 8, 300})) << "cut to " << size;
  }
}

TEST(DeclaredInputShape, IsEmptyForBytesThatAreNoModel) {
  EXPECT_EQ(declared_input_shape(std::string(1000, '\xff')), Shape{});
  EXPECT_EQ(declared_input_shape("hello"), Shape{});
}

}  // namespace
}  // namespace stillmap
