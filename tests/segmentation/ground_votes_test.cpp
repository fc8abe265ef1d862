#include "core/segmentation/ground_votes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <vector>

namespace stillmap {
namespace {

struct Street {
  std::vector<Eigen::Vector3f> points;
  PointLabels labels;

  void add(const Eigen::Vector3f& p, SemanticClass label, float confidence = 0.8F) {
    points.push_back(p);
    labels.classes.push_back(label);
    labels.confidence.push_back(confidence);
  }
  /// Ground of 8 m x 6 m, points 0.25 m apart, of which what lies under a car of 4 m x 2 m, and
  /// 0.25 m around, is called a car, too. The car is 0.6 m high and stands 0.2 m above the ground
  /// on its four wheels.
  explicit Street(const std::function<float(float, float)>& ground_m) {
    for (float x = 4.0F; x <= 12.0F; x += 0.25F) {
      for (float y = -3.0F; y <= 3.0F; y += 0.25F) {
        const bool is_below = x > 5.7F && x < 10.3F && std::abs(y) < 1.3F;
        add({x, y, ground_m(x, y)}, is_below ? SemanticClass::car : SemanticClass::road);
      }
    }
    ground_ = points.size();
    for (float x = 6.0F; x <= 10.0F; x += 0.25F) {
      for (float z = 0.2F; z < 0.8F; z += 0.1F) {
        for (const float y : {-1.0F, 1.0F}) add({x, y, ground_m(x, y) + z}, SemanticClass::car);
      }
    }
  }

  [[nodiscard]] std::size_t count(SemanticClass label, std::size_t from, std::size_t to) const {
    std::size_t found = 0;
    for (std::size_t i = from; i < to; ++i) found += labels.classes[i] == label ? 1 : 0;
    return found;
  }
  [[nodiscard]] std::size_t ground() const { return ground_; }

 private:
  std::size_t ground_ = 0;
};

TEST(GroundVotes, GiveTheGroundBesideAVehicleToTheGround) {
  for (const float slope : {0.0F, 0.15F}) {
    Street street([slope](float x, float) { return -1.7F + slope * x; });
    const std::size_t of_car = street.count(SemanticClass::car, 0, street.ground());
    vote_below_vehicles(street.points, street.labels);
    // What lies more than a metre and a half from any other ground stays.
    EXPECT_LE(street.count(SemanticClass::car, 0, street.ground()), of_car / 20);
    EXPECT_EQ(street.count(SemanticClass::car, street.ground(), street.points.size()),
              street.points.size() - street.ground());
    for (const float confidence : street.labels.confidence) EXPECT_NEAR(confidence, 0.8F, 1e-4F);
  }
}

TEST(GroundVotes, TakeTheClassOfMostGroundThere) {
  Street street([](float, float) { return -1.7F; });
  for (std::size_t i = 0; i < street.ground(); ++i) {
    if (street.labels.classes[i] == SemanticClass::road && street.points[i].y() < -2.0F)
      street.labels.classes[i] = SemanticClass::sidewalk;
  }
  vote_below_vehicles(street.points, street.labels);
  EXPECT_EQ(street.count(SemanticClass::unlabeled, 0, street.points.size()), 0U);
  for (std::size_t i = 0; i < street.ground(); ++i) {
    if (street.points[i].y() >= 1.0F) {
      EXPECT_EQ(street.labels.classes[i], SemanticClass::road);
    }
  }
}

TEST(GroundVotes, LeaveVehiclesUnderAnotherRoad) {
  Street street([](float, float) { return -1.7F; });
  const std::vector<SemanticClass> before = street.labels.classes;
  // A bridge: no plane goes through both.
  const std::size_t below = street.points.size();
  for (std::size_t i = 0; i < street.ground(); ++i)
    street.add(street.points[i] + Eigen::Vector3f(0.0F, 0.0F, 5.0F), SemanticClass::road);
  vote_below_vehicles(street.points, street.labels);
  for (std::size_t i = 0; i < below; ++i) EXPECT_EQ(street.labels.classes[i], before[i]);
}

TEST(GroundVotes, LeaveWhatHasNoGroundAround) {
  Street street([](float, float) { return -1.7F; });
  for (SemanticClass& label : street.labels.classes)
    if (label == SemanticClass::road) label = SemanticClass::vegetation;
  const std::vector<SemanticClass> before = street.labels.classes;
  vote_below_vehicles(street.points, street.labels);
  EXPECT_EQ(street.labels.classes, before);
}

TEST(GroundVotes, EndurePointsThatAreNoneOrFarAway) {
  Street street([](float, float) { return -1.7F; });
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr float infinite = std::numeric_limits<float>::infinity();
  const std::size_t first = street.points.size();
  for (const SemanticClass label : {SemanticClass::car, SemanticClass::road}) {
    street.add({nan, 0.0F, 0.0F}, label);
    street.add({6.0F, nan, 0.0F}, label);
    street.add({6.0F, 0.0F, nan}, label);
    street.add({infinite, 0.0F, 0.0F}, label);
    street.add({6.0F, 0.0F, -infinite}, label);
    street.add({3e6F, 0.0F, 0.0F}, label);
  }
  const std::vector<SemanticClass> before = street.labels.classes;
  vote_below_vehicles(street.points, street.labels);
  for (std::size_t i = first; i < street.points.size(); ++i)
    EXPECT_EQ(street.labels.classes[i], before[i]);
  EXPECT_LT(street.count(SemanticClass::car, 0, street.ground()), 10U);

  std::vector<Eigen::Vector3f> none;
  PointLabels no_labels;
  vote_below_vehicles(none, no_labels);
  EXPECT_TRUE(no_labels.empty());
}

}  // namespace
}  // namespace stillmap
