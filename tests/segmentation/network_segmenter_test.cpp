#include "core/segmentation/network_segmenter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <limits>
#include <numbers>
#include <thread>
#include <vector>

#include "core/lidar/range_image.hpp"
#include "core/segmentation/open_network.hpp"
#include "tests/segmentation/onnx_builder.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

using test::describe;
using test::onnx_bytes;
using test::random_network;
using test::random_scan;
using test::TinyNetwork;
using test::write_model;

struct Expected {
  std::size_t output;
  double probability;
};

/// The tiny network by hand, on the point that a pixel shows.
Expected by_hand(const Scan& scan, std::size_t point, const TinyNetwork& network,
                 const InputStatistics& statistics) {
  const Eigen::Vector3d p = scan.points_lidar[point].cast<double>();
  const std::array<double, 5> raw{p.norm(), p.x(), p.y(), p.z(), scan.intensity[point]};
  std::vector<double> scores;
  for (std::size_t n = 0; n < network.bias.size(); ++n) {
    scores.push_back(network.bias[n]);
    for (std::size_t c = 0; c < 5; ++c) {
      scores[n] +=
          network.weights[n * 5 + c] * (raw[c] - statistics.mean[c]) / statistics.deviation[c];
    }
  }
  const auto best = std::max_element(scores.begin(), scores.end());
  double sum = 0.0;
  for (const double score : scores) sum += std::exp(score - *best);
  return {static_cast<std::size_t>(best - scores.begin()), 1.0 / sum};
}

/// The nearest of all points in the pixel of `point`.
std::size_t shown_point(const Scan& scan, const RangeImage& image, std::size_t point) {
  std::size_t nearest = point;
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const bool same = image.pixel_of_point()[i] == image.pixel_of_point()[point];
    if (same && scan.points_lidar[i].norm() < scan.points_lidar[nearest].norm()) nearest = i;
  }
  return nearest;
}

struct Fixture {
  TinyNetwork network = random_network(8, 32, 20);
  ModelDescription model = describe(network);
  Fixture() { model.network_file = write_model(onnx_bytes(network)); }
};

TEST(NetworkSegmenter, GivesEveryPointTheClassThatItsPixelHasByHand) {
  const Fixture fixture;
  const Scan scan = random_scan(600, 4);
  const PointLabels labels = open_model(fixture.model)->segment(scan);
  const RangeImage image = test::project(scan, fixture.model);
  ASSERT_EQ(labels.classes.size(), scan.size());
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const Expected expected =
        by_hand(scan, shown_point(scan, image, i), fixture.network, fixture.model.statistics);
    EXPECT_EQ(static_cast<std::size_t>(labels.classes[i]), expected.output) << "point " << i;
    EXPECT_NEAR(labels.confidence[i], expected.probability, 1e-4) << "point " << i;
  }
}

TEST(NetworkSegmenter, MapsOutputsToClasses) {
  Fixture fixture;
  const Scan scan = random_scan(600, 4);
  const PointLabels plain = open_model(fixture.model)->segment(scan);
  std::ranges::reverse(fixture.model.classes);
  const PointLabels mapped = open_model(fixture.model)->segment(scan);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    EXPECT_EQ(static_cast<int>(mapped.classes[i]), 19 - static_cast<int>(plain.classes[i]));
  }
}

TEST(NetworkSegmenter, LetsTheNeighboursVoteWhenAsked) {
  Fixture fixture;
  const Scan scan = random_scan(600, 4);
  const RangeImage image = test::project(scan, fixture.model);
  const PointLabels own = open_model(fixture.model)->segment(scan);
  PixelLabels pixels{.classes = std::vector(image.pixel_count(), SemanticClass::unlabeled),
                     .confidence = std::vector(image.pixel_count(), 0.0F)};
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const auto pixel = static_cast<std::size_t>(image.pixel_of_point()[i]);
    pixels.classes[pixel] = own.classes[i];
    pixels.confidence[pixel] = own.confidence[i];
  }
  fixture.model.knn = KnnConfig{};
  const PointLabels voted = open_model(fixture.model)->segment(scan);
  EXPECT_EQ(voted.classes, knn_labels(image, pixels, KnnConfig{}).classes);
  EXPECT_NE(voted.classes, own.classes);
}

TEST(NetworkSegmenter, LetsVoxelsVoteAfterTheImageWhenAsked) {
  Fixture fixture;
  fixture.model.knn = KnnConfig{};
  Scan scan = random_scan(600, 4);
  // So near that points share voxels.
  for (Eigen::Vector3f& point : scan.points_lidar) point *= 0.1F;
  const PointLabels before = open_model(fixture.model)->segment(scan);
  fixture.model.voxel_votes = VoxelVoteConfig{.edge_m = 0.2, .height_m = 0.2};
  PointLabels expected = before;
  vote_in_voxels(scan.points_lidar, *fixture.model.voxel_votes, expected);
  const PointLabels once = expected;
  EXPECT_EQ(open_model(fixture.model)->segment(scan).classes, once.classes);
  fixture.model.unsure_votes = UnsureVoteConfig{.edge_m = 0.6};
  const PointLabels voted = open_model(fixture.model)->segment(scan);
  vote_where_unsure(scan.points_lidar, *fixture.model.unsure_votes, expected);
  EXPECT_NE(expected.classes, once.classes);
  EXPECT_EQ(voted.classes, expected.classes);
  EXPECT_EQ(voted.confidence, expected.confidence);
  EXPECT_NE(voted.classes, before.classes);
}

TEST(NetworkSegmenter, GivesNoLabelsForAnEmptyScan) {
  EXPECT_TRUE(open_model(Fixture().model)->segment({}).empty());
}

TEST(NetworkSegmenter, LeavesPointsThatCannotBeProjectedUnlabeled) {
  Scan scan = random_scan(50, 2);
  scan.points_lidar[3].x() = std::numeric_limits<float>::quiet_NaN();
  scan.points_lidar[4].setZero();
  const PointLabels labels = open_model(Fixture().model)->segment(scan);
  EXPECT_EQ(labels.classes[3], SemanticClass::unlabeled);
  EXPECT_EQ(labels.classes[4], SemanticClass::unlabeled);
  EXPECT_EQ(labels.confidence[3], 0.0F);
}

/// Has no finite scores for the left half of an image of two columns.
class HalfBlind final : public SegmentationNetwork {
 public:
  PixelOutputs run(std::span<const float> input) override {
    PixelOutputs outputs;
    for (std::size_t i = 0; i < input.size() / plain_input_channels; ++i) {
      outputs.output.push_back(i % 2 == 0 ? PixelOutputs::no_output : 9);
      outputs.confidence.push_back(i % 2 == 0 ? 0.0F : 1.0F);
    }
    return outputs;
  }
  std::vector<float> probabilities(std::span<const float> /*input*/) override { return {}; }
  [[nodiscard]] std::string engine() const override { return "half blind"; }
};

/// Gives one class for all pixels of images of this size.
class OneClass final : public SegmentationNetwork {
 public:
  OneClass(std::size_t pixels, std::uint8_t output) : pixels_(pixels), output_(output) {}
  PixelOutputs run(std::span<const float> input) override {
    EXPECT_EQ(input.size(), pixels_ * plain_input_channels);
    return {.output = std::vector(pixels_, output_), .confidence = std::vector(pixels_, 1.0F)};
  }
  std::vector<float> probabilities(std::span<const float> /*input*/) override { return {}; }
  [[nodiscard]] std::string engine() const override { return "one class"; }

 private:
  std::size_t pixels_;
  std::uint8_t output_;
};

/// Keeps how many pixels of the last image saw something.
class CountsPixels final : public SegmentationNetwork {
 public:
  explicit CountsPixels(std::size_t& seen) : seen_(seen) {}
  PixelOutputs run(std::span<const float> input) override {
    const std::size_t pixels = input.size() / plain_input_channels;
    const auto ranges = input.first(pixels);
    seen_ = pixels - static_cast<std::size_t>(std::ranges::count(ranges, 0.0F));
    return {.output = std::vector<std::uint8_t>(pixels, 9),
            .confidence = std::vector(pixels, 1.0F)};
  }
  std::vector<float> probabilities(std::span<const float> /*input*/) override { return {}; }
  [[nodiscard]] std::string engine() const override { return "counts pixels"; }

 private:
  std::size_t& seen_;
};

/// A ring of points, `azimuths` to the turn.
Scan level_ring(int azimuths) {
  Scan scan;
  for (int k = 0; k < azimuths; ++k) {
    const double a = 2.0 * std::numbers::pi * (k + 0.5) / azimuths;
    scan.points_lidar.push_back(
        Eigen::Vector3d(9.0 * std::cos(a), 9.0 * std::sin(a), 0.1).cast<float>());
  }
  return scan;
}

TEST(NetworkSegmenter, FillsTheGapsOfALidarThatFiresAtFewerAzimuthsThanTheImageHasColumns) {
  ModelDescription model = describe(random_network(2, 64, 20));
  model.follow_sensor = true;
  std::size_t seen = 0;
  NetworkSegmenter labels(model, std::make_unique<CountsPixels>(seen));
  EXPECT_EQ(labels.segment(level_ring(32)).classes, std::vector(32, SemanticClass::road));
  EXPECT_EQ(seen, 64U);
  static_cast<void>(labels.segment(level_ring(54)));
  EXPECT_EQ(seen, 54U) << "as real lidars have them in images of their width";
  static_cast<void>(labels.segment(level_ring(8)));
  EXPECT_EQ(seen, 8U) << "too far apart to be one surface";
  model.follow_sensor = false;
  NetworkSegmenter published(model, std::make_unique<CountsPixels>(seen));
  static_cast<void>(published.segment(level_ring(32)));
  EXPECT_EQ(seen, 32U) << "an image of fixed size is the published one";
}

/// Keeps the lowest height that the last image showed, as the network has it.
class KeepsLowest final : public SegmentationNetwork {
 public:
  KeepsLowest(const InputStatistics& statistics, float& lowest_m)
      : statistics_(statistics), lowest_m_(lowest_m) {}
  PixelOutputs run(std::span<const float> input) override {
    const std::size_t pixels = input.size() / plain_input_channels;
    const auto heights = input.subspan(index(InputChannel::z) * pixels, pixels);
    lowest_m_ = std::ranges::min(heights) * statistics_.deviation[index(InputChannel::z)] +
                statistics_.mean[index(InputChannel::z)];
    return {.output = std::vector<std::uint8_t>(pixels, 9),
            .confidence = std::vector(pixels, 1.0F)};
  }
  std::vector<float> probabilities(std::span<const float> /*input*/) override { return {}; }
  [[nodiscard]] std::string engine() const override { return "keeps lowest"; }

 private:
  InputStatistics statistics_;
  float& lowest_m_;
};

TEST(NetworkSegmenter, SeesACloudInTheFrameOfTheRobotFromWhereItsBeamsStart) {
  // A floor of 30 m x 30 m, from its middle in the frame of a robot on it, and walls around it.
  Scan scan;
  for (int x = -30; x <= 30; ++x)
    for (int y = -30; y <= 30; ++y)
      scan.points_lidar.emplace_back(0.5F * static_cast<float>(x), 0.5F * static_cast<float>(y),
                                     std::abs(x) == 30 ? 0.05F * static_cast<float>(y + 31) : 0.0F);
  ModelDescription model = describe(random_network(8, 64, 20));
  model.follow_sensor = true;
  model.lidar_height_m = 1.5;
  float lowest_m = 0.0F;
  NetworkSegmenter labels(model, std::make_unique<KeepsLowest>(model.statistics, lowest_m));
  static_cast<void>(labels.segment(scan));
  EXPECT_NEAR(lowest_m, -1.5F, 0.01F);
  labels.set_mount(Eigen::Isometry3d(Eigen::Translation3d(0.0, 0.0, 1.5)));
  static_cast<void>(labels.segment(scan));
  EXPECT_GT(lowest_m, -1.2F) << "what is told is believed";
}

TEST(NetworkSegmenter, UsesTheResolutionLevelThatIsSet) {
  NetworkSegmenter labels(describe(random_network(2, 32, 20)), std::make_unique<OneClass>(64U, 9));
  EXPECT_EQ(labels.relative_costs(), std::vector{1.0});
  labels.add_lower_resolution(16, std::make_unique<OneClass>(32U, 1));
  EXPECT_EQ(labels.relative_costs(), (std::vector{1.0, 0.5}));
  EXPECT_EQ(labels.details(), "one class, image 2x32 down to 16");
  const Scan scan = random_scan(5, 2);
  EXPECT_EQ(labels.image_columns(), 32);
  EXPECT_EQ(labels.segment(scan).classes, std::vector(5, SemanticClass::road));
  labels.set_resolution_level(1);
  EXPECT_EQ(labels.image_columns(), 16);
  EXPECT_EQ(labels.segment(scan).classes, std::vector(5, SemanticClass::car));
  labels.set_resolution_level(0);
  EXPECT_EQ(labels.segment(scan).classes, std::vector(5, SemanticClass::road));
}

TEST(NetworkSegmenter, OpensAModelInAllItsWidths) {
  ModelDescription model = test::describe_family(16, 128, 20);
  model.network_file = write_model(test::light_bytes(8, 0, 0, 20));
  EXPECT_EQ(open_multi_resolution_model(model)->relative_costs(), std::vector{1.0});
  model.min_columns = 32;
  const auto labels = open_multi_resolution_model(model);
  EXPECT_EQ(labels->relative_costs(), (std::vector{1.0, 0.5, 0.25}));
  const Scan scan = random_scan(600, 4);
  labels->set_resolution_level(1);
  ModelDescription narrow = model;
  narrow.columns = 64;
  EXPECT_EQ(labels->segment(scan).classes, open_model(narrow)->segment(scan).classes);
  model.min_columns = 112;
  EXPECT_EQ(open_multi_resolution_model(model)->relative_costs(), (std::vector{1.0, 0.875}));
}

TEST(NetworkSegmenter, GivesTheSameLabelsForSeveralScansAtATime) {
  ModelDescription model = test::describe_family(16, 128, 20);
  model.network_file = write_model(test::light_bytes(8, 0, 0, 20));
  const EngineOptions one_thread{.threads = 1};
  NetworkSegmenter labels(model, open_network(model, one_thread).network);
  // On one core, too, as sanitizers have it.
  labels.allow_concurrent_scans(4, [&](int) { return open_network(model, one_thread).network; });
  std::vector<Scan> scans;
  std::vector<std::vector<SemanticClass>> expected;
  for (const unsigned seed : {1U, 2U, 3U, 4U}) {
    scans.push_back(random_scan(600, seed));
    expected.push_back(labels.segment(scans.back()).classes);
  }
  labels.set_parallelism(Parallelism::across_scans);
  std::vector<std::jthread> threads;
  for (std::size_t n = 0; n < scans.size(); ++n) {
    threads.emplace_back([&, n] {
      for (int i = 0; i < 20; ++i) EXPECT_EQ(labels.segment(scans[n]).classes, expected[n]);
    });
  }
}

double cpu_s(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

TEST(NetworkSegmenter, OneThreadWorksOnAScanWhereSeveralScansAreWorkedOnAtATime) {
  ModelDescription model = test::describe_family(16, 128, 20);
  model.network_file = write_model(test::light_bytes(8, 0, 0, 20));
  const auto labels = open_model(model);
  if (labels->concurrent_scans() == 1) GTEST_SKIP() << "one core";
  const Scan scan = random_scan(600, 4);
  labels->set_parallelism(Parallelism::across_scans);
  static_cast<void>(labels->segment(scan));
  std::jthread([&] {
    static_cast<void>(labels->segment(scan));
    const double others_before_s = cpu_s(CLOCK_PROCESS_CPUTIME_ID) - cpu_s(CLOCK_THREAD_CPUTIME_ID);
    const double before_s = cpu_s(CLOCK_THREAD_CPUTIME_ID);
    for (int i = 0; i < 50; ++i) static_cast<void>(labels->segment(scan));
    const double own_s = cpu_s(CLOCK_THREAD_CPUTIME_ID) - before_s;
    const double others_s =
        cpu_s(CLOCK_PROCESS_CPUTIME_ID) - cpu_s(CLOCK_THREAD_CPUTIME_ID) - others_before_s;
    EXPECT_LT(others_s, 0.2 * own_s);
  });
}

TEST(NetworkSegmenter, KeepsTheNumberOfThreadsThatIsSet) {
  ModelDescription model = test::describe_family(16, 128, 20);
  model.network_file = write_model(test::light_bytes(8, 0, 0, 20));
  EXPECT_EQ(open_model(model, {.threads = 2})->concurrent_scans(), 1U);
  EXPECT_EQ(open_model(model, {.engine = EngineOptions::Engine::opencv})->concurrent_scans(), 1U);
}

TEST(NetworkSegmenter, ScansTakeTurnsWhereTheModelCannotBeOpenedAgain) {
  ModelDescription model = test::describe_family(16, 128, 20);
  model.network_file = write_model(test::light_bytes(8, 0, 0, 20));
  const auto labels = open_model(model);
  const Scan scan = random_scan(600, 4);
  const std::vector<SemanticClass> expected = labels->segment(scan).classes;
  std::filesystem::remove(model.network_file);
  labels->set_parallelism(Parallelism::across_scans);
  std::vector<std::jthread> threads;
  for (int n = 0; n < 3; ++n)
    threads.emplace_back([&] { EXPECT_EQ(labels->segment(scan).classes, expected); });
}

TEST(NetworkSegmenter, LeavesPointsUnlabeledWhereTheNetworkFails) {
  const ModelDescription model = describe(random_network(1, 2, 20));
  NetworkSegmenter labels(model, std::make_unique<HalfBlind>());
  Scan scan;
  scan.points_lidar = {{0.0F, 5.0F, 0.0F}, {0.0F, -5.0F, 0.0F}};
  EXPECT_EQ(labels.segment(scan).classes,
            (std::vector{SemanticClass::unlabeled, SemanticClass::road}));
}

}  // namespace
}  // namespace stillmap
