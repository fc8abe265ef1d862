#include <gtest/gtest.h>

#include <limits>

#include "idl/conversions/occupancy.hpp"

namespace stillmap::wire {
namespace {

TEST(OctomapConversion, KeepsEveryByte) {
  OctomapData data{.encoding = OctomapEncoding::full, .resolution_m = 0.05, .bytes = {}};
  for (int byte = 0; byte < 256; ++byte) data.bytes.push_back(static_cast<char>(byte));
  const auto message = to_octomap(data, 1'500'000'000, "map");
  EXPECT_EQ(message.id(), "OcTree");
  EXPECT_EQ(message.header().frame_id(), "map");
  EXPECT_EQ(message.header().stamp().sec(), 1);
  const auto back = from_octomap(message);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->encoding, data.encoding);
  EXPECT_EQ(back->resolution_m, data.resolution_m);
  EXPECT_EQ(back->bytes, data.bytes);
}

TEST(OctomapConversion, RefusesOtherTreesAndResolutions) {
  auto message =
      to_octomap({.encoding = OctomapEncoding::binary, .resolution_m = 0.2, .bytes = {}}, 0, "map");
  message.id("ColorOcTree");
  EXPECT_FALSE(from_octomap(message));
  message.id("OcTree");
  for (const double resolution_m : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    message.resolution(resolution_m);
    EXPECT_FALSE(from_octomap(message));
  }
}

TEST(OccupancyConversion, KeepsTheQuestions) {
  OccupancyQuery query;
  query.points_map = {{1, 2, 3}};
  // What is no box is told, not repaired.
  Eigen::AlignedBox3d& box = query.boxes_map.emplace_back();
  box.min() = {4, 5, 6};
  box.max() = {-4, -5, -6};
  query.rays = {{.origin_map = {7, 8, 9},
                 .direction_map = {1, 0, 2},
                 .max_range_m = 33.0,
                 .ignore_unknown = true}};
  query.max_voxels = 77;
  const OccupancyQuery back = from_request(to_request(query));
  EXPECT_EQ(back.points_map, query.points_map);
  ASSERT_EQ(back.boxes_map.size(), 1U);
  EXPECT_EQ(back.boxes_map[0].min(), box.min());
  EXPECT_EQ(back.boxes_map[0].max(), box.max());
  ASSERT_EQ(back.rays.size(), 1U);
  EXPECT_EQ(back.rays[0].origin_map, query.rays[0].origin_map);
  EXPECT_EQ(back.rays[0].direction_map, query.rays[0].direction_map);
  EXPECT_EQ(back.rays[0].max_range_m, 33.0);
  EXPECT_TRUE(back.rays[0].ignore_unknown);
  EXPECT_EQ(back.max_voxels, 77U);
}

OccupancyAnswers some_answers() {
  OccupancyAnswers answers;
  answers.resolution_m = 0.2;
  answers.points = {{.occupancy = Occupancy::occupied, .probability = 0.9F, .fault = "p"}};
  answers.boxes = {
      {.occupied = 1, .free = 2, .unknown = 3, .occupied_map = {{1, 2, 3}}, .fault = "b"}};
  answers.rays = {{.end = Occupancy::free, .end_map = {4, 5, 6}, .length_m = 7.0, .fault = "r"}};
  return answers;
}

TEST(OccupancyConversion, KeepsTheAnswers) {
  const OccupancyAnswers answers = some_answers();
  stillmap_msgs::srv::QueryOccupancy_Response response;
  write_answers(answers, response);
  const auto back = from_response(response);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->resolution_m, 0.2);
  EXPECT_EQ(back->points.at(0).occupancy, Occupancy::occupied);
  EXPECT_EQ(back->points.at(0).probability, 0.9F);
  EXPECT_EQ(back->points.at(0).fault, "p");
  EXPECT_EQ(back->boxes.at(0).unknown, 3U);
  EXPECT_EQ(back->boxes.at(0).occupied_map, answers.boxes[0].occupied_map);
  EXPECT_EQ(back->rays.at(0).end, Occupancy::free);
  EXPECT_EQ(back->rays.at(0).end_map, answers.rays[0].end_map);
  EXPECT_EQ(back->rays.at(0).length_m, 7.0);
}

TEST(OccupancyConversion, RefusesAnswersThatMakeNoSense) {
  stillmap_msgs::srv::QueryOccupancy_Response response;
  write_answers(some_answers(), response);
  auto bad = response;
  bad.points().at(0).occupancy(3);
  EXPECT_FALSE(from_response(bad));
  bad = response;
  bad.rays().at(0).end(200);
  EXPECT_FALSE(from_response(bad));
  bad = response;
  bad.boxes().at(0).z().clear();
  EXPECT_FALSE(from_response(bad));
}

}  // namespace
}  // namespace stillmap::wire
