#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"
#include "tests/odometry/box_sequence.hpp"

namespace stillmap {
namespace {

using ::testing::HasSubstr;

/// A mapper that has mapped some scans, beside one that never sees a bad one.
class MapperRejection : public ::testing::Test {
 protected:
  MapperRejection()
      : sequence_(test::street(), 6), mapper_(new_mapper()), untouched_(new_mapper()) {
    for (std::size_t k = 0; k < 5; ++k) {
      EXPECT_TRUE(mapper_.process(sequence_.scans[k].scan));
      EXPECT_TRUE(untouched_.process(sequence_.scans[k].scan));
    }
  }

  /// The scan is refused with this counter and reason, and leaves no trace.
  void expect_refused(const Scan& scan, const char* counter, const char* reason) {
    const auto view = mapper_.map_snapshot();
    EXPECT_FALSE(mapper_.process(scan));
    EXPECT_EQ(mapper_.last_rejection().counter, counter);
    EXPECT_THAT(mapper_.last_rejection().reason, HasSubstr(reason));
    EXPECT_EQ(mapper_.trajectory().size(), 5U);
    EXPECT_EQ(mapper_.map_snapshot()->version, view->version);
    expect_goes_on_as_if_nothing_came();
  }

  [[nodiscard]] static Scan scan_of(const Eigen::Vector3f& point) {
    Scan scan;
    scan.stamp_ns = 450'000'000;
    scan.points_lidar.assign(1000, point);
    scan.labels.assign(1000, SemanticClass::building);
    return scan;
  }

  const test::BoxSequence sequence_;
  Mapper mapper_;

 private:
  static Mapper new_mapper() {
    MapperConfig config;
    config.sensor = test::test_lidar();
    return {config, std::make_unique<PassthroughSegmenter>()};
  }

  void expect_goes_on_as_if_nothing_came() {
    const auto next = mapper_.process(sequence_.scans[5].scan);
    const auto expected = untouched_.process(sequence_.scans[5].scan);
    ASSERT_TRUE(next && expected);
    EXPECT_EQ(next->odometry.T_map_lidar.matrix(), expected->odometry.T_map_lidar.matrix());
    EXPECT_EQ(next->labelled.motion, expected->labelled.motion);
  }

  Mapper untouched_;
};

TEST_F(MapperRejection, EmptyScan) {
  Scan scan;
  scan.stamp_ns = 450'000'000;
  expect_refused(scan, "empty", "no points");
}

TEST_F(MapperRejection, OnlyNaN) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  expect_refused(scan_of({nan, nan, nan}), "too_few_points", "0 points are left");
}

TEST_F(MapperRejection, OnlyInfinity) {
  const float infinity = std::numeric_limits<float>::infinity();
  expect_refused(scan_of({infinity, -infinity, infinity}), "too_few_points", "0 points are left");
}

TEST_F(MapperRejection, AllAtTheOrigin) {
  expect_refused(scan_of(Eigen::Vector3f::Zero()), "too_few_points", "0 points are left");
}

TEST_F(MapperRejection, AllPointsEqual) {
  expect_refused(scan_of({5.0F, 1.0F, 0.3F}), "too_few_points", "one place");
}

TEST_F(MapperRejection, HandfulOfPoints) {
  Scan scan = sequence_.scans[5].scan;
  scan.points_lidar.resize(99);
  scan.ring.resize(99);
  scan.labels.resize(99);
  expect_refused(scan, "too_few_points", "at least 100 are needed");
}

TEST_F(MapperRejection, RepeatedStamp) {
  expect_refused(sequence_.scans[4].scan, "out_of_order", "400000000");
}

TEST_F(MapperRejection, StampOfThePast) {
  expect_refused(sequence_.scans[2].scan, "out_of_order", "200000000");
}

}  // namespace
}  // namespace stillmap
