#include "core/lidar/semantic_class.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <tuple>
#include <utility>

namespace stillmap {
namespace {

SemanticClass class_of(std::size_t index) { return static_cast<SemanticClass>(index); }

TEST(SemanticClass, NamesAndOriginalIdsLeadBackToTheClass) {
  for (std::size_t i = 0; i < semantic_class_count; ++i) {
    EXPECT_EQ(class_from_name(name(class_of(i))), class_of(i));
    EXPECT_EQ(class_from_semantic_kitti(semantic_kitti_id(class_of(i))), class_of(i));
  }
}

TEST(SemanticClass, EveryClassHasItsOwnNameColourAndId) {
  std::set<std::string_view> names;
  std::set<std::tuple<int, int, int>> colours;
  std::set<int> ids;
  for (std::size_t i = 0; i < semantic_class_count; ++i) {
    const Rgb rgb = colour(class_of(i));
    names.insert(name(class_of(i)));
    colours.insert({rgb.r, rgb.g, rgb.b});
    ids.insert(semantic_kitti_id(class_of(i)));
  }
  EXPECT_EQ(names.size(), semantic_class_count);
  EXPECT_EQ(colours.size(), semantic_class_count);
  EXPECT_EQ(ids.size(), semantic_class_count);
}

TEST(SemanticClass, MovingObjectsBecomeTheirStandingClass) {
  const std::vector<std::pair<std::uint16_t, SemanticClass>> learning_map{
      {252, SemanticClass::car},           {253, SemanticClass::bicyclist},
      {254, SemanticClass::person},        {255, SemanticClass::motorcyclist},
      {256, SemanticClass::other_vehicle}, {257, SemanticClass::other_vehicle},
      {258, SemanticClass::truck},         {259, SemanticClass::other_vehicle}};
  for (const auto& [id, expected] : learning_map) {
    EXPECT_EQ(class_from_semantic_kitti(id), expected) << id;
    EXPECT_TRUE(is_moving_semantic_kitti(id)) << id;
    EXPECT_TRUE(is_movable(expected)) << id;
  }
  EXPECT_FALSE(is_moving_semantic_kitti(251));
  EXPECT_FALSE(is_moving_semantic_kitti(260));
}

TEST(SemanticClass, IdsWithoutAClassOfTheirOwnAreReducedAsTheDataSetSays) {
  EXPECT_EQ(class_from_semantic_kitti(60), SemanticClass::road);           // lane-marking
  EXPECT_EQ(class_from_semantic_kitti(13), SemanticClass::other_vehicle);  // bus
  EXPECT_EQ(class_from_semantic_kitti(52), SemanticClass::unlabeled);      // other-structure
  EXPECT_EQ(class_from_semantic_kitti(1), SemanticClass::unlabeled);       // outlier
  EXPECT_EQ(class_from_semantic_kitti(65535), SemanticClass::unlabeled);
}

TEST(SemanticClass, UnknownNamesAndValuesAreSafe) {
  EXPECT_EQ(class_from_name("tram"), std::nullopt);
  EXPECT_EQ(class_from_name(""), std::nullopt);
  EXPECT_EQ(name(class_of(200)), "unlabeled");
}

TEST(SemanticClass, GroundAndMovableDoNotOverlap) {
  int ground = 0, movable = 0;
  for (std::size_t i = 0; i < semantic_class_count; ++i) {
    EXPECT_FALSE(is_ground(class_of(i)) && is_movable(class_of(i))) << i;
    ground += is_ground(class_of(i)) ? 1 : 0;
    movable += is_movable(class_of(i)) ? 1 : 0;
  }
  EXPECT_EQ(ground, 5);
  EXPECT_EQ(movable, 8);
}

}  // namespace
}  // namespace stillmap
