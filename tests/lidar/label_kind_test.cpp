#include "core/lidar/label_kind.hpp"

#include <gtest/gtest.h>

#include <initializer_list>

namespace stillmap {
namespace {

LabelCensus census_of(std::initializer_list<std::uint32_t> labels) {
  LabelCensus census;
  for (const std::uint32_t label : labels) census.add(label);
  return census;
}

TEST(LabelKind, SaysWhatANumberMeans) {
  EXPECT_EQ(class_of_label(15, LabelKind::semantic_kitti), SemanticClass::motorcycle);
  EXPECT_EQ(class_of_label(15, LabelKind::classes), SemanticClass::vegetation);
  EXPECT_EQ(class_of_label((7U << 16U) | 252U, LabelKind::semantic_kitti), SemanticClass::car);
  EXPECT_EQ(class_of_label(20, LabelKind::classes), SemanticClass::unlabeled);
}

TEST(LabelCensus, KnowsClassesFromIds) {
  EXPECT_TRUE(census_of({0, 1, 9, 13, 15, 17}).look_like_classes());
  EXPECT_FALSE(census_of({0, 1, 9, 13, 15, 40}).look_like_classes()) << "40 is no class";
  EXPECT_FALSE(census_of({9, (1U << 16U) | 10U}).look_like_classes()) << "instances are no classes";
  EXPECT_FALSE(census_of({0, 1, 10, 13, 15}).look_like_classes()) << "all of them are ids, too";
  EXPECT_FALSE(census_of({}).look_like_classes());
}

TEST(LabelCensus, CountsIdsThatSemanticKittiDoesNotHave) {
  const LabelCensus census = census_of({0, 1, 52, 99, 252, 259, 33, 260, 65535, (5U << 16U) | 10U});
  EXPECT_EQ(census.labels(), 10U);
  EXPECT_EQ(census.unknown(), 3U);
}

TEST(LabelCensus, KnowsAllIdsThatHaveAClass) {
  LabelCensus census;
  for (std::uint32_t id = 0; id < 1000; ++id) {
    if (class_of_label(id, LabelKind::semantic_kitti) != SemanticClass::unlabeled) census.add(id);
  }
  EXPECT_GT(census.labels(), 20U);
  EXPECT_EQ(census.unknown(), 0U);
}

}  // namespace
}  // namespace stillmap
