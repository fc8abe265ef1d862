#include "core/segmentation/drive_votes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace stillmap {
namespace {

constexpr std::size_t wall_points = 400;

/// A piece of wall of 4 m x 2 m at x = 10 m in the map.
std::vector<Eigen::Vector3f> wall_seen_from(const Eigen::Isometry3d& T_map_lidar) {
  std::vector<Eigen::Vector3f> points_lidar;
  for (int k = 0; k < static_cast<int>(wall_points); ++k) {
    const Eigen::Vector3d point_map(10.05, 0.1 * (k % 40) + 0.05, 0.2 * (k / 40) + 0.05);
    points_lidar.push_back((T_map_lidar.inverse() * point_map).cast<float>());
  }
  return points_lidar;
}

PointLabels all_of(SemanticClass label, float confidence, std::size_t points = wall_points) {
  return {.classes = std::vector(points, label), .confidence = std::vector(points, confidence)};
}

/// So far ahead, turned by as many rad / 10.
Eigen::Isometry3d pose_at(double ahead_m) {
  return Eigen::Translation3d(ahead_m, 0.0, 0.0) *
         Eigen::AngleAxisd(0.1 * ahead_m, Eigen::Vector3d::UnitZ());
}

std::size_t count(const PointLabels& labels, SemanticClass label) {
  return static_cast<std::size_t>(std::ranges::count(labels.classes, label));
}

/// A drive towards the wall, with one class and one confidence a scan.
struct Sight {
  SemanticClass label;
  float confidence;
  bool has_pose = true;
};
std::vector<PointLabels> drive(const std::vector<Sight>& sights, const DriveVoteConfig& config) {
  DriveVotes votes(config);
  std::vector<PointLabels> found;
  const auto take_all = [&] {
    while (auto labels = votes.take()) found.push_back(std::move(*labels));
  };
  for (std::size_t k = 0; k < sights.size(); ++k) {
    const Eigen::Isometry3d T_map_lidar = pose_at(static_cast<double>(k));
    votes.add(wall_seen_from(T_map_lidar), all_of(sights[k].label, sights[k].confidence),
              sights[k].has_pose ? std::optional(T_map_lidar) : std::nullopt);
    take_all();
  }
  votes.finish();
  take_all();
  return found;
}

constexpr Sight wrong{SemanticClass::vegetation, 0.4F};
constexpr Sight sure{SemanticClass::building, 0.9F};

TEST(DriveVotesTest, SureScansDecideForThoseBeforeAndAfter) {
  const auto found = drive({wrong, wrong, sure, wrong}, {});
  ASSERT_EQ(found.size(), 4U);
  for (const PointLabels& labels : found) {
    EXPECT_EQ(count(labels, SemanticClass::building), wall_points);
  }
  EXPECT_NEAR(found[0].confidence[0], 0.81 / (0.81 + 3 * 0.16), 0.01);
  EXPECT_FLOAT_EQ(found[2].confidence[0], 0.9F);
}

TEST(DriveVotesTest, OnlyScansWithinReachVoteAndLeaveNothingBehind) {
  DriveVoteConfig config;
  config.scans_each_way = 2;
  const auto found = drive({wrong, wrong, wrong, sure, wrong, wrong, wrong}, config);
  ASSERT_EQ(found.size(), 7U);
  for (const std::size_t apart : {0U, 6U})
    EXPECT_EQ(count(found[apart], SemanticClass::vegetation), wall_points) << apart;
  for (const std::size_t near : {1U, 2U, 3U, 4U, 5U})
    EXPECT_EQ(count(found[near], SemanticClass::building), wall_points) << near;
}

TEST(DriveVotesTest, LabelsComeAsSoonAsTheirVotersAreThere) {
  DriveVoteConfig config;
  config.scans_each_way = 1;
  DriveVotes votes(config);
  const auto points = wall_seen_from(Eigen::Isometry3d::Identity());
  votes.add(points, all_of(SemanticClass::fence, 0.5F), Eigen::Isometry3d::Identity());
  EXPECT_FALSE(votes.take());
  votes.add(points, all_of(SemanticClass::fence, 0.5F), Eigen::Isometry3d::Identity());
  EXPECT_TRUE(votes.take());
  EXPECT_FALSE(votes.take());
  votes.finish();
  EXPECT_TRUE(votes.take());
  EXPECT_FALSE(votes.take());
}

TEST(DriveVotesTest, WithoutPoseLabelsStayAndPartWhatWasBefore) {
  const auto found = drive({wrong, {SemanticClass::trunk, 0.2F, false}, sure}, {});
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(count(found[0], SemanticClass::vegetation), wall_points);
  EXPECT_EQ(count(found[1], SemanticClass::trunk), wall_points);
  EXPECT_EQ(count(found[2], SemanticClass::building), wall_points);
}

TEST(DriveVotesTest, AScanAloneKeepsItsLabels) {
  DriveVotes votes;
  PointLabels labels = all_of(SemanticClass::building, 0.9F);
  labels.classes[41] = SemanticClass::vegetation;
  labels.confidence[41] = 0.1F;
  votes.add(wall_seen_from(Eigen::Isometry3d::Identity()), labels, Eigen::Isometry3d::Identity());
  votes.finish();
  const auto found = votes.take();
  ASSERT_TRUE(found);
  EXPECT_EQ(found->classes, labels.classes);
}

TEST(DriveVotesTest, PointsWithoutClassAndScansWithoutLabelsDoNotVote) {
  DriveVotes votes;
  auto points = wall_seen_from(Eigen::Isometry3d::Identity());
  PointLabels labels = all_of(SemanticClass::car, 0.5F);
  labels.classes[3] = SemanticClass::unlabeled;
  points[4].x() = std::numeric_limits<float>::quiet_NaN();
  labels.classes[4] = SemanticClass::pole;
  votes.add(points, labels, Eigen::Isometry3d::Identity());
  votes.add(points, {}, Eigen::Isometry3d::Identity());
  votes.finish();
  const auto first = votes.take(), second = votes.take();
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->classes, labels.classes);
  EXPECT_TRUE(second->empty());
}

TEST(DriveVotesTest, WhatMovesOnKeepsItsClass) {
  // A sure car that is 2 m on in every scan, each time on ground that the others see bare.
  DriveVotes votes;
  const auto car_at = [](int k) {
    std::vector<Eigen::Vector3f> points;
    for (int i = 0; i < 200; ++i)
      points.emplace_back(2.0F * static_cast<float>(k) + 0.1F * static_cast<float>(i % 20), 3.0F,
                          0.35F + 0.1F * static_cast<float>(i / 20));
    return points;
  };
  for (int k = 0; k < 6; ++k) {
    auto points = car_at(k);
    PointLabels labels = all_of(SemanticClass::car, 0.8F, points.size());
    for (int i = 0; i < 200; ++i) {
      points.emplace_back(0.1F * static_cast<float>(i), 3.0F, 0.05F);
      labels.classes.push_back(SemanticClass::road);
      labels.confidence.push_back(0.9F);
    }
    votes.add(points, std::move(labels), Eigen::Isometry3d::Identity());
  }
  votes.finish();
  for (int k = 0; k < 6; ++k) {
    const auto labels = votes.take();
    ASSERT_TRUE(labels);
    EXPECT_EQ(count(*labels, SemanticClass::car), 200U) << k;
    EXPECT_EQ(count(*labels, SemanticClass::road), 200U) << k;
  }
}

TEST(DriveVotesTest, FaultyConfigurationsAreRefused) {
  DriveVoteConfig config;
  EXPECT_EQ(config.faults(), "");
  config.edge_m = 0.0;
  config.neighbour_weight = 2.0;
  EXPECT_NE(config.faults().find("edge_m"), std::string::npos);
  EXPECT_NE(config.faults().find("neighbour_weight"), std::string::npos);
  EXPECT_THROW(DriveVotes{config}, std::invalid_argument);
}

TEST(DriveVotesTest, AScanAmongScansWithoutLabelsKeepsItsOwn) {
  DriveVotes votes;
  const auto points = wall_seen_from(Eigen::Isometry3d::Identity());
  PointLabels labels = all_of(SemanticClass::building, 0.9F);
  labels.classes[41] = SemanticClass::vegetation;
  labels.confidence[41] = 0.1F;
  votes.add(points, {}, Eigen::Isometry3d::Identity());
  votes.add(points, labels, Eigen::Isometry3d::Identity());
  votes.add(points, {}, Eigen::Isometry3d::Identity());
  votes.finish();
  ASSERT_TRUE(votes.take());
  const auto found = votes.take();
  ASSERT_TRUE(found);
  EXPECT_EQ(found->classes, labels.classes);
}

}  // namespace
}  // namespace stillmap
