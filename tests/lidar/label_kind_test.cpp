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
  EXPECT_EQ(class_of_label((7U << 16U) | 15U, LabelKind::classes), SemanticClass::vegetation);
  EXPECT_EQ(class_of_label(20, LabelKind::classes), SemanticClass::unlabeled);
  EXPECT_EQ(class_of_label(0xFFFFFFFFU, LabelKind::classes), SemanticClass::unlabeled);
}

TEST(LabelCensus, KnowsClassesFromIds) {
  EXPECT_TRUE(census_of({0, 1, 9, 13, 15, 17}).look_like_classes());
  EXPECT_FALSE(census_of({0, 1, 9, 13, 15, 40}).look_like_classes()) << "40 is no class";
  EXPECT_FALSE(census_of({0, 1, 10, 13, 15}).look_like_classes()) << "all of them are ids, too";
  EXPECT_FALSE(census_of({}).look_like_classes());
}

TEST(LabelCensus, KnowsClassesBesideNumbersForNone) {
  EXPECT_TRUE(census_of({255, 255, 1, 9, 255, 15}).look_like_classes()) << "255 is 'ignore'";
  EXPECT_TRUE(census_of({0xFFFFFFFFU, 1, 9}).look_like_classes()) << "-1";
  EXPECT_TRUE(census_of({65535, 65535, 9}).look_like_classes());
  EXPECT_TRUE(census_of({(7U << 16U) | 1U, (8U << 16U) | 4U, 9}).look_like_classes())
      << "the upper half is the instance";
  EXPECT_TRUE(census_of({1, 9, 9, 15, 17, 100}).look_like_classes()) << "a few of something else";
}

TEST(LabelCensus, DoubtsNoIds) {
  EXPECT_EQ(census_of({}).doubt(), "");
  EXPECT_EQ(census_of({0, 1, 10, 11, (3U << 16U) | 18U}).doubt(), "") << "of few classes";
  EXPECT_EQ(census_of({255, (2U << 16U) | 255U, 10, 0}).doubt(), "") << "moving motorcyclists";
  EXPECT_EQ(census_of({0, 65535, 65535, 40}).doubt(), "") << "no label";
  EXPECT_EQ(census_of({40, 40, 48, 50, 33}).doubt(), "") << "a few are unknown";
}

TEST(LabelCensus, SaysWhatIsWrong) {
  EXPECT_EQ(census_of({0, 1, 9, 13, 17, 255}).doubt(),
            "look like classes 0 to 19: 2 of 5 labels are no ids of SemanticKITTI, and none "
            "beyond 19");
  EXPECT_EQ(census_of({9, 17, 100}).doubt(),
            "look like classes 0 to 19: 3 of 3 labels are no ids of SemanticKITTI, and only 1 "
            "beyond 19");
  EXPECT_EQ(census_of({0, 24, 25, 26, 30, 5}).doubt(),
            "are mostly something else: 4 of 5 labels are no ids of SemanticKITTI");
}

TEST(LabelCensus, CountsIdsThatSemanticKittiDoesNotHave) {
  const LabelCensus census = census_of({0, 1, 52, 99, 252, 259, 33, 260, 65535, (5U << 16U) | 10U});
  EXPECT_EQ(census.labels(), 8U) << "0 and 65535 are none";
  EXPECT_EQ(census.unknown(), 2U);
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
