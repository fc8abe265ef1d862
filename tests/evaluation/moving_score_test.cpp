#include "core/evaluation/moving_score.hpp"

#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

namespace stillmap::evaluation {
namespace {

using enum Motion;
using Motions = std::vector<Motion>;
using Ids = std::vector<std::uint16_t>;

TEST(MovingScore, CountsAgainstTheMovingIds) {
  const Motions motion{highly_dynamic, semi_static, highly_dynamic, stationary, highly_dynamic};
  const Ids ids{252, 259, 10, 40, 254};
  const MovingScore score = moving_score(motion, ids);
  EXPECT_EQ(score.true_positives, 2U);
  EXPECT_EQ(score.false_negatives, 1U);
  EXPECT_EQ(score.false_positives, 1U);
  EXPECT_DOUBLE_EQ(score.precision().value(), 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(score.recall().value(), 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(score.iou().value(), 0.5);
}

TEST(MovingScore, LeavesUnknownTruthOut) {
  const MovingScore score = moving_score(Motions{highly_dynamic, highly_dynamic}, Ids{0, 1});
  EXPECT_EQ(score.false_positives, 0U);
  EXPECT_FALSE(score.precision().has_value());
  EXPECT_FALSE(score.recall().has_value());
  EXPECT_FALSE(score.iou().has_value());
}

TEST(MovingScore, AddsUpOverScans) {
  MovingScore sum = moving_score(Motions{highly_dynamic}, Ids{252});
  sum += moving_score(Motions{stationary, highly_dynamic}, Ids{252, 40});
  EXPECT_EQ(sum.true_positives, 1U);
  EXPECT_EQ(sum.false_negatives, 1U);
  EXPECT_EQ(sum.false_positives, 1U);
}

TEST(MovingScore, RefusesDifferentLengths) {
  EXPECT_THROW((void)moving_score(Motions{stationary}, Ids{}), std::invalid_argument);
}

}  // namespace
}  // namespace stillmap::evaluation
