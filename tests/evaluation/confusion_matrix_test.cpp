#include "core/evaluation/confusion_matrix.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <vector>

namespace stillmap::evaluation {
namespace {

using enum SemanticClass;
using Classes = std::vector<SemanticClass>;

TEST(ConfusionMatrix, PerfectPredictionHasIouOne) {
  ConfusionMatrix matrix;
  matrix.add(Classes{car, road, road}, Classes{car, road, road});
  EXPECT_DOUBLE_EQ(matrix.iou(car).value(), 1.0);
  EXPECT_DOUBLE_EQ(matrix.mean_iou_of_present().value(), 1.0);
  EXPECT_DOUBLE_EQ(matrix.accuracy().value(), 1.0);
}

TEST(ConfusionMatrix, CountsHitsMissesAndFalseAlarms) {
  ConfusionMatrix matrix;
  matrix.add(Classes{car, car, car, road}, Classes{car, car, road, car});
  EXPECT_EQ(matrix.count(car, road), 1U);
  EXPECT_EQ(matrix.count(road, car), 1U);
  EXPECT_DOUBLE_EQ(matrix.iou(car).value(), 2.0 / 4.0);
  EXPECT_DOUBLE_EQ(matrix.iou(road).value(), 0.0);
  EXPECT_DOUBLE_EQ(matrix.accuracy().value(), 0.5);
}

TEST(ConfusionMatrix, TakesTheClassesOfAGroupForOne) {
  ConfusionMatrix matrix;
  matrix.add(Classes{car, truck, car, road}, Classes{truck, car, road, car});
  const std::array vehicles{car, truck};
  EXPECT_DOUBLE_EQ(matrix.iou(vehicles).value(), 2.0 / 4.0);
}

TEST(CoarseGroups, HoldEveryClassOnce) {
  std::array<int, semantic_class_count> times{};
  for (const ClassGroup& group : coarse_groups()) {
    for (const SemanticClass label : group.classes) times[static_cast<std::size_t>(label)] += 1;
  }
  EXPECT_EQ(times[0], 0);
  EXPECT_EQ(std::count(times.begin() + 1, times.end(), 1), 19);
}

TEST(ConfusionMatrix, LeavesUnlabeledTruthOutButCountsUnlabeledPredictionsAsMisses) {
  ConfusionMatrix matrix;
  matrix.add(Classes{unlabeled, unlabeled, car, car}, Classes{car, road, car, unlabeled});
  EXPECT_EQ(matrix.total(), 2U);
  EXPECT_DOUBLE_EQ(matrix.iou(car).value(), 0.5);
  EXPECT_FALSE(matrix.iou(road).has_value());
}

TEST(ConfusionMatrix, MeansOverAllClassesAndOverThosePresentDiffer) {
  ConfusionMatrix matrix;
  matrix.add(Classes{car, road}, Classes{car, road});
  EXPECT_DOUBLE_EQ(matrix.mean_iou(), 2.0 / 19.0);
  EXPECT_DOUBLE_EQ(matrix.mean_iou_of_present().value(), 1.0);
}

TEST(ConfusionMatrix, HasNoFiguresWithoutPoints) {
  ConfusionMatrix matrix;
  matrix.add({}, {});
  EXPECT_DOUBLE_EQ(matrix.mean_iou(), 0.0);
  EXPECT_FALSE(matrix.mean_iou_of_present().has_value());
  EXPECT_FALSE(matrix.accuracy().has_value());
}

TEST(ConfusionMatrix, RefusesDifferentLengths) {
  ConfusionMatrix matrix;
  EXPECT_THROW(matrix.add(Classes{car}, Classes{car, car}), std::invalid_argument);
}

}  // namespace
}  // namespace stillmap::evaluation
