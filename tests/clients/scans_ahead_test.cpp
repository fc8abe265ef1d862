#include "clients/commands/mapping/scans_ahead.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/dataset/dataset_error.hpp"

namespace stillmap::cli {
namespace {

/// Scans of number + 2 points, of which the first is too near; number 5 is damaged.
class NumberedScans final : public ScanSource {
 public:
  static constexpr std::size_t scans = 12, damaged = 5;

  [[nodiscard]] std::size_t size() const override { return scans; }
  [[nodiscard]] std::filesystem::path name(std::size_t i) const override {
    return "scan " + std::to_string(i);
  }
  [[nodiscard]] std::int64_t stamp_ns(std::size_t i) const override {
    return static_cast<std::int64_t>(i) * 100'000'000;
  }
  [[nodiscard]] std::optional<SensorModel> sensor() const override { return vlp_16(); }
  [[nodiscard]] DatasetFrame read(std::size_t i) const override {
    if (i == damaged) throw DatasetError(name(i), "is damaged");
    DatasetFrame frame;
    frame.scan.points_lidar.emplace_back(0.01F, 0.0F, 0.0F);
    for (std::size_t k = 0; k <= i; ++k)
      frame.scan.points_lidar.emplace_back(5.0F, static_cast<float>(k), 0.0F);
    return frame;
  }
};

/// As many labels as the scan has points; which class, says their number. Fails for 3 points.
class CountingSegmenter final : public Segmenter {
 public:
  explicit CountingSegmenter(std::size_t concurrent_scans) : concurrent_scans_(concurrent_scans) {}

  [[nodiscard]] std::string name() const override { return "counting"; }
  [[nodiscard]] std::size_t concurrent_scans() const override { return concurrent_scans_; }
  [[nodiscard]] PointLabels segment(const Scan& scan) override {
    if (scan.size() == 3) throw std::runtime_error("the network is broken");
    const auto label = static_cast<SemanticClass>(scan.size());
    return {std::vector(scan.size(), label), std::vector(scan.size(), 1.0F)};
  }

 private:
  std::size_t concurrent_scans_;
};

class ScansAheadTest : public testing::TestWithParam<std::size_t> {
 protected:
  ScanDataset dataset_{std::make_shared<NumberedScans>()};
  ScansAhead scans_{dataset_, {}, std::make_unique<CountingSegmenter>(GetParam())};
};

TEST_P(ScansAheadTest, GivesScansInTheirOrderWithTheirOwnLabels) {
  const auto labels = scans_.segmenter();
  EXPECT_EQ(labels->name(), "counting");
  scans_.start(1, NumberedScans::scans);
  for (std::size_t number = 1; number < NumberedScans::scans; ++number) {
    if (number == NumberedScans::damaged) {
      EXPECT_THROW((void)scans_.read(), DatasetError);
      continue;
    }
    const DatasetFrame frame = scans_.read();
    ASSERT_EQ(frame.scan.size(), number + 2);
    const Scan prepared = drop_unusable_points(frame.scan, {});
    if (prepared.size() == 3) {
      EXPECT_THROW((void)labels->segment(prepared), std::runtime_error);
    } else {
      EXPECT_EQ(labels->segment(prepared).classes,
                std::vector(number + 1, static_cast<SemanticClass>(number + 1)));
    }
  }
}

TEST_P(ScansAheadTest, ScansMayBeLeftUnsegmentedAndTheRunMayEndEarly) {
  const auto labels = scans_.segmenter();
  scans_.start(0, NumberedScans::scans);
  for (std::size_t number = 0; number < 4; ++number) static_cast<void>(scans_.read());
  const Scan prepared = drop_unusable_points(scans_.read().scan, {});
  EXPECT_EQ(labels->segment(prepared).classes.size(), 5U);
}

INSTANTIATE_TEST_SUITE_P(ScansAtATime, ScansAheadTest, testing::Values(1U, 2U, 5U));

}  // namespace
}  // namespace stillmap::cli
