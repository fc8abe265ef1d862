#include "core/evaluation/traversability_score.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "tests/traversability/voxel_world.hpp"

namespace stillmap::evaluation {
namespace {

using enum SemanticClass;

/// A road with a pole; the truth is given by each test.
std::shared_ptr<const TraversabilityView> area() {
  test::VoxelWorld world;
  world.ground(-4, -4, 4, 4, road);
  world.block(0, 0, 0.2, 0.2, 0.3, 2.0, pole);
  world.clear(2.0, 2.0, 2.4, 2.4);  // inferred
  return test::traversability_of(world.view(), test::square_robot());
}

bool is_pole(const Eigen::Vector3d& p_map) {
  return p_map.x() > 0.0 && p_map.x() < 0.2 && p_map.y() > 0.0 && p_map.y() < 0.2;
}

CellTruth truly(BlockReason reason) { return {reason, false, false}; }

TEST(TraversabilityScore, IsPerfectWhereTheTruthIsTheSame) {
  const TraversabilityScore score = score_traversability(*area(), [](const Eigen::Vector3d& p_map) {
    return truly(is_pole(p_map) ? BlockReason::obstacle : BlockReason::none);
  });
  EXPECT_EQ(score.lethal_and_truly_lethal, 1U);
  EXPECT_EQ(score.free_and_truly_free, 40U * 40U - 1U);
  EXPECT_EQ(score.precision(false), 1.0);
  EXPECT_EQ(score.recall(), 1.0);
}

TEST(TraversabilityScore, EveryFalseFreeCellHasOneCause) {
  const TraversabilityScore score = score_traversability(*area(), [](const Eigen::Vector3d& p_map) {
    if (p_map.y() > 3.0) return CellTruth{BlockReason::obstacle, true, false};
    if (p_map.y() > 2.0) return truly(BlockReason::obstacle);
    if (p_map.y() > 1.0) return CellTruth{BlockReason::ground_class, false, true};
    if (p_map.y() > 0.2) return truly(BlockReason::ground_class);
    return truly(BlockReason::none);
  });
  const auto cells = [&](FalseFree cause) {
    return score.false_free.at(static_cast<std::size_t>(cause));
  };
  EXPECT_EQ(cells(FalseFree::removed_vehicle), 200U);
  EXPECT_EQ(cells(FalseFree::inferred), 4U);
  EXPECT_EQ(cells(FalseFree::obstacle), 196U);
  EXPECT_EQ(cells(FalseFree::edge), 200U);
  EXPECT_EQ(cells(FalseFree::ground_class), 160U);
  EXPECT_EQ(score.all_false_free(), 760U);
  EXPECT_EQ(score.false_lethal.at(static_cast<std::size_t>(BlockReason::obstacle)), 1U);
  const double free = static_cast<double>(score.free_and_truly_free);
  EXPECT_DOUBLE_EQ(*score.precision(false), free / (free + 760.0));
  EXPECT_DOUBLE_EQ(*score.precision(true), (free + 200.0) / (free + 760.0));
  EXPECT_DOUBLE_EQ(*score.recall(), free / (free + 1.0));
}

TEST(TraversabilityScore, NothingSeenHasNoScore) {
  const auto nothing = test::traversability_of(MapSnapshot{}, test::square_robot());
  const TraversabilityScore score = score_traversability(
      *nothing, [](const Eigen::Vector3d&) { return truly(BlockReason::none); });
  EXPECT_EQ(score.precision(true), std::nullopt);
  EXPECT_EQ(score.recall(), std::nullopt);
}

}  // namespace
}  // namespace stillmap::evaluation
