#include "core/segmentation/island_votes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace stillmap {
namespace {

struct LabelledCloud {
  std::vector<Eigen::Vector3f> points;
  PointLabels labels;

  /// A box of points 0.2 m apart.
  void add_box(const Eigen::Vector3f& from, const Eigen::Vector3f& to, SemanticClass label,
               float confidence = 0.6F) {
    constexpr float step_m = 0.2F;
    for (float x = from.x(); x <= to.x(); x += step_m)
      for (float y = from.y(); y <= to.y(); y += step_m)
        for (float z = from.z(); z <= to.z(); z += step_m) {
          points.emplace_back(x, y, z);
          labels.classes.push_back(label);
          labels.confidence.push_back(confidence);
        }
  }

  [[nodiscard]] std::size_t count(SemanticClass label) const {
    return static_cast<std::size_t>(std::ranges::count(labels.classes, label));
  }
};

/// A hedge of 6 m x 1 m, 2 m high, of which a piece is called a car, on grass.
LabelledCloud hedge_with_a_car_in_it() {
  LabelledCloud cloud;
  cloud.add_box({0.0F, 5.0F, -1.7F}, {2.4F, 6.0F, 0.3F}, SemanticClass::vegetation);
  cloud.add_box({2.6F, 5.0F, -1.1F}, {3.4F, 6.0F, -0.3F}, SemanticClass::car);
  cloud.add_box({2.6F, 5.0F, -0.1F}, {3.4F, 6.0F, 0.3F}, SemanticClass::vegetation);
  cloud.add_box({3.6F, 5.0F, -1.7F}, {6.0F, 6.0F, 0.3F}, SemanticClass::vegetation);
  cloud.add_box({-2.0F, 2.0F, -1.9F}, {8.0F, 8.0F, -1.9F}, SemanticClass::terrain);
  return cloud;
}

TEST(IslandVotes, GiveWhatIsCalledAVehicleInAHedgeToTheHedge) {
  LabelledCloud cloud = hedge_with_a_car_in_it();
  const std::size_t ground = cloud.count(SemanticClass::terrain);
  vote_on_islands(cloud.points, {}, cloud.labels);
  EXPECT_EQ(cloud.count(SemanticClass::car), 0U);
  EXPECT_EQ(cloud.count(SemanticClass::terrain), ground);
  EXPECT_EQ(cloud.count(SemanticClass::vegetation) + ground, cloud.points.size());
  for (const float confidence : cloud.labels.confidence) {
    EXPECT_GT(confidence, 0.1F);
    EXPECT_LE(confidence, 0.6F);
  }
}

TEST(IslandVotes, LeaveACarThatStandsApartOrTouchesAWall) {
  LabelledCloud cloud;
  cloud.add_box({0.0F, 5.0F, -1.5F}, {4.2F, 6.8F, -0.2F}, SemanticClass::car);
  // A wall along one of its sides, and the road below it.
  cloud.add_box({-3.0F, 7.0F, -1.5F}, {7.0F, 7.0F, 3.0F}, SemanticClass::building, 0.9F);
  cloud.add_box({-3.0F, 2.0F, -1.7F}, {7.0F, 6.8F, -1.7F}, SemanticClass::road, 0.9F);
  const PointLabels before = cloud.labels;
  vote_on_islands(cloud.points, {}, cloud.labels);
  EXPECT_EQ(cloud.labels.classes, before.classes);
  EXPECT_EQ(cloud.labels.confidence, before.confidence);
}

TEST(IslandVotes, LeaveABicycleThatLeansOnAWall) {
  for (const SemanticClass label : {SemanticClass::bicycle, SemanticClass::motorcycle}) {
    LabelledCloud cloud;
    cloud.add_box({0.0F, 5.0F, -1.6F}, {1.8F, 5.0F, -0.7F}, label);
    cloud.add_box({-3.0F, 5.1F, -1.7F}, {5.0F, 5.1F, 1.0F}, SemanticClass::building, 0.9F);
    const PointLabels before = cloud.labels;
    vote_on_islands(cloud.points, {}, cloud.labels);
    EXPECT_EQ(cloud.labels.classes, before.classes);
  }
}

TEST(IslandVotes, LeaveACarBehindAMesh) {
  LabelledCloud cloud;
  cloud.add_box({-2.2F, 8.0F, -1.5F}, {2.2F, 8.0F, -0.2F}, SemanticClass::car);
  cloud.add_box({-6.0F, 7.8F, -1.7F}, {6.0F, 7.8F, 0.3F}, SemanticClass::fence, 0.8F);
  const PointLabels before = cloud.labels;
  vote_on_islands(cloud.points, {}, cloud.labels);
  EXPECT_EQ(cloud.labels.classes, before.classes);
  // Where nearly as many lie behind it, it is a part of both.
  cloud.add_box({-6.0F, 8.2F, -1.7F}, {6.0F, 8.2F, 0.3F}, SemanticClass::fence, 0.8F);
  vote_on_islands(cloud.points, {}, cloud.labels);
  EXPECT_EQ(cloud.count(SemanticClass::car), 0U);
}

TEST(IslandVotes, WeighConfidences) {
  LabelledCloud cloud = hedge_with_a_car_in_it();
  for (std::size_t i = 0; i < cloud.points.size(); ++i)
    if (cloud.labels.classes[i] == SemanticClass::vegetation) cloud.labels.confidence[i] = 0.1F;
  const std::size_t car = cloud.count(SemanticClass::car);
  vote_on_islands(cloud.points, {}, cloud.labels);
  EXPECT_EQ(cloud.count(SemanticClass::car), car);
  vote_on_islands(cloud.points, {.share = 0.05}, cloud.labels);
  EXPECT_EQ(cloud.count(SemanticClass::car), 0U);
}

TEST(IslandVotes, TakeVehiclesThatTouchForOne) {
  LabelledCloud cloud = hedge_with_a_car_in_it();
  // The rest of it, seen in front of the hedge.
  cloud.add_box({0.6F, 2.6F, -1.7F}, {5.0F, 4.8F, -0.3F}, SemanticClass::truck);
  const std::size_t car = cloud.count(SemanticClass::car);
  vote_on_islands(cloud.points, {}, cloud.labels);
  EXPECT_EQ(cloud.count(SemanticClass::car), car);
}

TEST(IslandVotes, AreUsedToAnyPoints) {
  LabelledCloud cloud = hedge_with_a_car_in_it();
  const auto nan = std::numeric_limits<float>::quiet_NaN();
  for (const Eigen::Vector3f& p :
       {Eigen::Vector3f(nan, nan, nan), Eigen::Vector3f(3.0F, nan, -0.7F),
        Eigen::Vector3f(1e9F, 0.0F, 0.0F),
        Eigen::Vector3f(0.0F, -std::numeric_limits<float>::infinity(), 0.0F)}) {
    for (const SemanticClass label : {SemanticClass::car, SemanticClass::vegetation}) {
      cloud.points.push_back(p);
      cloud.labels.classes.push_back(label);
      cloud.labels.confidence.push_back(0.5F);
    }
  }
  vote_on_islands(cloud.points, {}, cloud.labels);
  EXPECT_EQ(cloud.count(SemanticClass::car), 4U);
  PointLabels none;
  vote_on_islands({}, {}, none);
  EXPECT_TRUE(none.classes.empty());
}

TEST(IslandVotes, NameTheFaultsOfTheirConfiguration) {
  EXPECT_EQ(IslandVoteConfig{}.faults(), "");
  EXPECT_EQ((IslandVoteConfig{.edge_m = 0.0, .share = -1.0}.faults()),
            "edge_m = 0; must be above 0\nshare = -1; must be above 0\n");
}

}  // namespace
}  // namespace stillmap
