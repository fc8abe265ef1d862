#include "core/evaluation/segmentation_score.hpp"

#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

namespace stillmap::evaluation {
namespace {

using enum SemanticClass;
using Classes = std::vector<SemanticClass>;

std::vector<Eigen::Vector3f> points_at(const std::vector<float>& ranges_m) {
  std::vector<Eigen::Vector3f> points;
  for (const float m : ranges_m) points.push_back(m * Eigen::Vector3f(0.6F, -0.8F, 0.0F));
  return points;
}

TEST(SegmentationScore, CountsEachPointInItsBandOfRange) {
  SegmentationScore score;
  score.add(points_at({0, 9.9F, 10.1F, 39, 41, 500}), Classes{car, car, car, road, road, road},
            Classes{car, road, car, road, car, road});
  EXPECT_EQ(score.band(0).total(), 2U);
  EXPECT_DOUBLE_EQ(score.band(0).accuracy().value(), 0.5);
  EXPECT_EQ(score.band(1).count(car, car), 1U);
  EXPECT_EQ(score.band(2).count(road, road), 1U);
  EXPECT_EQ(score.band(3).total(), 2U);
  EXPECT_EQ(score.all().total(), 6U);
}

TEST(SegmentationScore, OfTwoSequencesIsThatOfAllTheirScans) {
  SegmentationScore one, other, both;
  for (SegmentationScore* score : {&one, &both}) {
    score->add(points_at({5, 30}), Classes{car, fence}, Classes{car, building});
  }
  for (SegmentationScore* score : {&other, &both}) {
    score->add(points_at({5, 15}), Classes{fence, fence}, Classes{fence, unlabeled});
  }
  one.add(other);
  EXPECT_EQ(one.all().total(), both.all().total());
  EXPECT_DOUBLE_EQ(one.all().iou(fence).value(), both.all().iou(fence).value());
  for (std::size_t band = 0; band < SegmentationScore::band_count; ++band) {
    EXPECT_EQ(one.band(band).total(), both.band(band).total());
  }
}

TEST(SegmentationScore, CountsInNoBandWithoutPoints) {
  SegmentationScore score;
  score.add({}, Classes{car, road}, Classes{car, car});
  EXPECT_EQ(score.all().total(), 2U);
  for (std::size_t band = 0; band < SegmentationScore::band_count; ++band) {
    EXPECT_EQ(score.band(band).total(), 0U);
  }
}

TEST(SegmentationScore, RefusesLabelsOfAnotherScan) {
  SegmentationScore score;
  EXPECT_THROW(score.add(points_at({5}), Classes{car, car}, Classes{car, car}),
               std::invalid_argument);
  EXPECT_THROW(score.add(points_at({5}), Classes{car}, Classes{}), std::invalid_argument);
}

TEST(MeanIouOfGroups, ForgivesConfusionsWithinAGroupAndLeavesAbsentGroupsOut) {
  ConfusionMatrix matrix;
  EXPECT_FALSE(mean_iou_of_groups(matrix).has_value());
  matrix.add(Classes{car, truck, road, road}, Classes{truck, truck, road, car});
  // Vehicle 2 of 3, drivable 1 of 2.
  EXPECT_DOUBLE_EQ(mean_iou_of_groups(matrix).value(), (2.0 / 3.0 + 0.5) / 2.0);
}

}  // namespace
}  // namespace stillmap::evaluation
