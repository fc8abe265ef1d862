#include "core/segmentation/int8_calibration.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "core/segmentation/graph/network_graph.hpp"

namespace stillmap {
namespace {

using Ranges = std::map<std::string, std::vector<float>>;

TEST(ActivationRanges, FindTheLargestMagnitudeOfEachChannelOverAllImages) {
  ActivationRanges ranges;
  ranges.add("a", std::vector<float>{1.0F, -3.5F, 0.5F, 2.0F}, 2);
  ranges.add("a", std::vector<float>{-2.0F, 1.0F}, 2);
  ranges.add("b", std::vector<float>{0.0F}, 1);
  EXPECT_EQ(ranges.ranges(1.0), (Ranges{{"a", {2.0F, 3.5F}}, {"b", {0.0F}}}));
}

TEST(ActivationRanges, LeaveOutTheShareThatMayBeCutOff) {
  std::mt19937 random(3);
  std::normal_distribution<float> any(0.0F, 2.0F);
  std::vector<float> values(100000);
  for (float& value : values) value = any(random);
  ActivationRanges ranges;
  ranges.add("x", values, 1);
  for (float& value : values) value = std::abs(value);
  std::ranges::sort(values);
  for (const double share : {0.5, 0.99, 0.9999}) {
    const float exact = values[static_cast<std::size_t>(share * 100000.0) - 1];
    EXPECT_GE(ranges.ranges(share).at("x").front(), exact);
    EXPECT_LE(ranges.ranges(share).at("x").front(), 1.07F * exact);
  }
}

TEST(ActivationRanges, TakeNumbersOfAnySize) {
  ActivationRanges ranges;
  ranges.add("x", std::vector<float>{1e-30F, 1e30F}, 2);
  EXPECT_EQ(ranges.ranges(1.0).at("x"), (std::vector{1e-30F, 1e30F}));
  EXPECT_EQ(ranges.ranges(0.5).at("x").front(), 1e-30F);
}

TEST(ActivationRanges, DoNotCountWhatIsNoNumber) {
  ActivationRanges ranges;
  ranges.add("x",
             std::vector<float>{std::numeric_limits<float>::quiet_NaN(), 1.0F,
                                std::numeric_limits<float>::infinity()},
             1);
  EXPECT_EQ(ranges.ranges(1.0).at("x"), std::vector{1.0F});
}

NetworkGraph graph_of_two_tensors() {
  NetworkGraph graph;
  graph.tensors = {{.name = "a", .shape = {.channels = 2, .rows = 4, .columns = 4}},
                   {.name = "b", .shape = {.channels = 1, .rows = 4, .columns = 4}}};
  return graph;
}

TEST(Int8Calibration, FitsANetworkOfTheSameTensors) {
  const NetworkGraph graph = graph_of_two_tensors();
  // A channel may have been 0 in all scans, a tensor may need no range, and others are not read.
  for (const Ranges& ranges : {Ranges{{"a", {0.0F, 1.0F}}, {"b", {2.0F}}}, Ranges{{"b", {2.0F}}},
                               Ranges{{"c", {1.0F, 2.0F, 3.0F}}}})
    EXPECT_EQ(
        calibration_fault(graph, {.made = "", .range_of_channels = ranges, .float_layers = {}}),
        "");
}

TEST(Int8Calibration, IsDamagedWithOtherCountsOrNothingButZeros) {
  const NetworkGraph graph = graph_of_two_tensors();
  const auto fault = [&](const Ranges& ranges) {
    return calibration_fault(graph, {.made = "", .range_of_channels = ranges, .float_layers = {}});
  };
  EXPECT_EQ(fault({{"a", {1.0F}}}), "ranges: 'a' has 1 numbers, and the tensor 2 channels");
  EXPECT_EQ(fault({{"b", {}}}), "ranges: 'b' has 0 numbers, and the tensor 1 channels");
  EXPECT_EQ(fault({{"a", {0.0F, 0.0F}}, {"b", {2.0F}}}),
            "ranges: 'a' has 2 zeros: no scan could be segmented with them");
}

}  // namespace
}  // namespace stillmap
