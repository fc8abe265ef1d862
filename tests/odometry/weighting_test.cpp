#include <gtest/gtest.h>

#include <vector>

#include "core/odometry/correspondence.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;

struct InconsistencyCase {
  SemanticClass label;
  std::vector<SemanticClass> neighbours;
  double inconsistency;
};

TEST(SemanticInconsistency, IsTheShareOfLabelledNeighboursWithAnotherClass) {
  const std::vector<InconsistencyCase> cases{
      {car, {car, car, car, car, car}, 0.0},
      {car, {road, road, building, road, pole}, 1.0},
      {car, {car, road, car, road, car}, 0.4},
      {car, {truck, truck, truck, truck, car}, 0.8},
      {car, {unlabeled, unlabeled, road, car, unlabeled}, 0.5},
      {road, {road}, 0.0},
      {car, {unlabeled, unlabeled}, 0.0},
      {unlabeled, {car, road, building, car, car}, 0.0},
      {car, {}, 0.0},
  };
  for (std::size_t k = 0; k < cases.size(); ++k) {
    Neighbours neighbours;
    for (const SemanticClass label : cases[k].neighbours)
      neighbours.points[static_cast<std::size_t>(neighbours.count++)].label = label;
    EXPECT_DOUBLE_EQ(semantic_inconsistency(neighbours, cases[k].label), cases[k].inconsistency)
        << "case " << k;
  }
}

/// Calls check(alpha, distance, inconsistency) over the whole range of each.
template <typename Check>
void for_each_argument(Check check) {
  for (int a = 0; a <= 4; ++a)
    for (int d = 0; d <= 10; ++d)
      for (int c = 0; c <= 5; ++c) check(0.25 * a, 0.1 * d, 0.2 * c);
}

TEST(Weight, NoneCountsAllAlike) {
  for_each_argument([](double alpha, double d, double c) {
    EXPECT_EQ(weight(Weighting::none, alpha, d, c), 1.0);
  });
}

TEST(Weight, GeometricFallsWithTheDistanceOnly) {
  for_each_argument([](double alpha, double d, double c) {
    EXPECT_DOUBLE_EQ(weight(Weighting::geometric, alpha, d, c), 1.0 - d);
  });
}

TEST(Weight, SemanticIsEquation10) {
  for_each_argument([](double alpha, double d, double c) {
    EXPECT_NEAR(weight(Weighting::semantic, alpha, d, c), 1.0 - alpha * d - (1.0 - alpha) * c,
                1e-12);
  });
}

TEST(Weight, AlphaMovesFromSemanticsToGeometry) {
  EXPECT_DOUBLE_EQ(weight(Weighting::semantic, 1.0, 0.3, 1.0), 0.7);
  EXPECT_DOUBLE_EQ(weight(Weighting::semantic, 0.0, 0.3, 1.0), 0.0);
  EXPECT_DOUBLE_EQ(weight(Weighting::semantic, 0.0, 1.0, 0.25), 0.75);
}

TEST(Weight, IsNeverNegativeOrAboveOne) {
  for (const Weighting mode : {Weighting::none, Weighting::geometric, Weighting::semantic}) {
    for_each_argument([mode](double alpha, double d, double c) {
      // Residuals farther than a metre never get here, but rounding may.
      const double w = weight(mode, alpha, d + 1e-9, c);
      EXPECT_GE(w, 0.0);
      EXPECT_LE(w, 1.0);
    });
  }
}

}  // namespace
}  // namespace stillmap
