#include "core/segmentation/mirrored_view.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/segmentation/network_input.hpp"
#include "core/segmentation/network_segmenter.hpp"
#include "core/segmentation/open_network.hpp"
#include "tests/segmentation/onnx_builder.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

ModelDescription uneven_model() {
  const test::TinyNetwork network = test::random_network(8, 32, 20);
  ModelDescription model = test::describe(network);
  model.network_file = test::write_model(test::onnx_bytes(network));
  model.statistics.mean[index(InputChannel::y)] = 0.7F;
  model.statistics.deviation[index(InputChannel::y)] = 3.0F;
  return model;
}

TEST(MirroredView, IsTheInputOfTheMirroredScan) {
  const ModelDescription model = uneven_model();
  // Few, so that pixels are empty, too.
  const Scan scan = test::random_scan(150, 4);
  Scan other = scan;
  for (Eigen::Vector3f& p : other.points_lidar) p.y() = -p.y();
  const RangeImage image = test::project(scan, model);
  const std::vector<float> input = make_network_input(scan, image, model);
  const std::vector<float> expected = make_network_input(other, test::project(other, model), model);
  const std::vector<float> found = mirrored(input, 32, model.statistics);
  ASSERT_EQ(found.size(), expected.size());
  EXPECT_GT(std::ranges::count(found, 0.0F), 100);
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-4F) << i;
}

TEST(MirroredView, GivesTheMeanOfBothProbabilities) {
  const ModelDescription model = uneven_model();
  const std::size_t columns = 32;
  const Scan scan = test::random_scan(600, 4);
  const std::vector<float> input = make_network_input(scan, test::project(scan, model), model);
  const auto network = open_network(model, {}).network;
  const std::vector<float> one = network->probabilities(input);
  const std::vector<float> other =
      network->probabilities(mirrored(input, columns, model.statistics));
  const PixelOutputs found = run_mirrored_too(*network, input, columns, model.statistics);
  const std::size_t pixels = input.size() / model.statistics.channels;
  ASSERT_EQ(found.output.size(), pixels);
  const PixelOutputs alone = network->run(input);
  EXPECT_NE(found.output, alone.output);
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    const std::size_t opposite = pixel / columns * columns + columns - 1 - pixel % columns;
    float most = 0.0F;
    for (std::size_t k = 0; k < 20; ++k)
      most = std::max(most, 0.5F * (one[k * pixels + pixel] + other[k * pixels + opposite]));
    const std::size_t k = found.output[pixel];
    EXPECT_NEAR(0.5F * (one[k * pixels + pixel] + other[k * pixels + opposite]), most, 1e-5F);
    EXPECT_NEAR(found.confidence[pixel], most, 1e-4F);
  }
}

TEST(MirroredView, FindsTheSameInAMirroredScan) {
  ModelDescription model = uneven_model();
  const Scan scan = test::random_scan(600, 4);
  Scan other = scan;
  for (Eigen::Vector3f& p : other.points_lidar) p.y() = -p.y();
  EXPECT_NE(open_model(model)->segment(scan).classes, open_model(model)->segment(other).classes);
  model.mirrored = true;
  EXPECT_EQ(open_model(model)->segment(scan).classes, open_model(model)->segment(other).classes);
  EXPECT_NE(open_model(model)->details().find("mirrored"), std::string::npos);
}

}  // namespace
}  // namespace stillmap
