#include <gtest/gtest.h>

#include <limits>
#include <numbers>
#include <stdexcept>

#include "idl/conversions/localization.hpp"
#include "initial_pose.h"
#include "localize.h"

namespace stillmap::wire {
namespace {

using geometry_msgs::msg::PoseWithCovarianceStamped;
using stillmap_msgs::srv::Localize_Request;
using stillmap_msgs::srv::Localize_Response;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

Eigen::Isometry3d level_pose() {
  return Eigen::Translation3d(12.0, -3.5, 0.0) * Eigen::AngleAxisd(-2.0, Eigen::Vector3d::UnitZ());
}

TEST(LocalizationOnTheWire, QuestionsComeBackAsTheyWere) {
  const LocalizationQuestion near{
      .guess = PlaceGuess{.T_map_base = level_pose(), .radius_m = 20.0, .max_turn_rad = 0.5},
      .apply = true};
  const LocalizationQuestion read = from_request(to_request(near));
  ASSERT_TRUE(read.guess);
  EXPECT_TRUE(read.guess->T_map_base.isApprox(level_pose()));
  EXPECT_EQ(read.guess->radius_m, 20.0);
  EXPECT_EQ(read.guess->max_turn_rad, 0.5);
  EXPECT_TRUE(read.apply);
  EXPECT_FALSE(from_request(to_request(LocalizationQuestion{})).guess);
  EXPECT_FALSE(from_request(to_request(LocalizationQuestion{})).apply);
}

TEST(LocalizationOnTheWire, ATurnThatNobodySaysIsAny) {
  Localize_Request request;
  request.radius_m(3.0);
  EXPECT_EQ(from_request(request).guess->max_turn_rad, std::numbers::pi);
}

TEST(LocalizationOnTheWire, RefusesQuestionsThatMakeNoSense) {
  const auto refused = [](auto change) {
    Localize_Request request;
    request.radius_m(3.0);
    change(request);
    try {
      static_cast<void>(from_request(request));
      FAIL() << "taken";
    } catch (const std::invalid_argument& fault) {
      EXPECT_LT(std::string(fault.what()).size(), 80U) << fault.what();
    }
  };
  refused([](Localize_Request& request) { request.x(nan); });
  refused([](Localize_Request& request) { request.radius_m(1e300); });
  refused([](Localize_Request& request) { request.y(1e12); });
  refused([](Localize_Request& request) { request.heading_rad(nan); });
  refused([](Localize_Request& request) { request.radius_m(-1.0); });
  refused([](Localize_Request& request) { request.radius_m(nan); });
  refused([](Localize_Request& request) { request.max_turn_rad(-0.1); });
}

TEST(LocalizationOnTheWire, AnswersComeBackAsTheyWere) {
  const LocalizationAnswer answer{.outcome = LocalizationStatus::ambiguous,
                                  .stamp_ns = 77,
                                  .T_map_base = level_pose(),
                                  .score = 0.8,
                                  .runner_up_score = 0.7,
                                  .milliseconds = 120.0,
                                  .applied = true};
  Localize_Response response;
  write_answer(answer, response);
  const auto read = from_response(response);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->outcome, LocalizationStatus::ambiguous);
  EXPECT_EQ(read->stamp_ns, 77);
  EXPECT_TRUE(read->T_map_base.isApprox(level_pose()));
  EXPECT_EQ(read->score, 0.8);
  EXPECT_EQ(read->runner_up_score, 0.7);
  EXPECT_EQ(read->milliseconds, 120.0);
  EXPECT_TRUE(read->applied);

  response.outcome(4);
  EXPECT_FALSE(from_response(response));
  response.outcome(0);
  response.qw(nan);
  EXPECT_FALSE(from_response(response));
  EXPECT_FALSE(from_response(Localize_Response()));
}

PoseWithCovarianceStamped as_rviz() {
  PoseWithCovarianceStamped message;
  message.header().frame_id("map");
  message.pose().pose().position().x(10.0);
  message.pose().pose().orientation().w(1.0);
  message.pose().covariance()[0] = 0.25;
  message.pose().covariance()[7] = 0.25;
  message.pose().covariance()[35] = 0.0685;
  return message;
}

TEST(InitialPoseFromTheWire, IsLookedForAsFarAsItsCovarianceSays) {
  PoseWithCovarianceStamped message = as_rviz();
  const InitialPose as_drawn = from_message(message);
  ASSERT_TRUE(as_drawn.guess) << as_drawn.fault;
  EXPECT_EQ(as_drawn.frame, "map");
  EXPECT_EQ(as_drawn.guess->T_map_base.translation(), Eigen::Vector3d(10.0, 0.0, 0.0));
  EXPECT_EQ(as_drawn.guess->radius_m, 5.0);
  EXPECT_NEAR(as_drawn.guess->max_turn_rad, 3.0 * std::sqrt(0.0685), 1e-9);
  message.header().frame_id("/map");
  message.pose().covariance()[7] = 36.0;
  message.pose().covariance()[35] = 0.0;
  const InitialPose vague = from_message(message);
  EXPECT_EQ(vague.frame, "map");
  EXPECT_EQ(vague.guess->radius_m, 18.0);
  EXPECT_GT(vague.guess->max_turn_rad, 0.3);
  message.pose().covariance()[0] = 1e300;
  message.pose().covariance()[35] = 1e300;
  EXPECT_EQ(from_message(message).guess->radius_m, 50.0);
  EXPECT_EQ(from_message(message).guess->max_turn_rad, std::numbers::pi);
}

TEST(InitialPoseFromTheWire, SaysWhatIsWrong) {
  const auto refused = [](auto change) {
    PoseWithCovarianceStamped message = as_rviz();
    change(message.pose());
    const InitialPose initial = from_message(message);
    EXPECT_FALSE(initial.guess);
    EXPECT_FALSE(initial.fault.empty());
  };
  refused([](auto& pose) { pose.pose().position().y(nan); });
  refused([](auto& pose) { pose.pose().position().x(1e12); });
  refused([](auto& pose) { pose.pose().orientation().w(0.0); });
  refused([](auto& pose) { pose.covariance()[0] = nan; });
  refused([](auto& pose) { pose.covariance()[35] = -1.0; });
}

TEST(LocalizationOnTheWire, AGuessOfNoRadiusOrNoTurnIsNotSent) {
  const auto fault_of_guess = [](double radius_m, double max_turn_rad) -> std::string {
    try {
      const PlaceGuess guess{
          .T_map_base = level_pose(), .radius_m = radius_m, .max_turn_rad = max_turn_rad};
      static_cast<void>(to_request(LocalizationQuestion{.guess = guess}));
      return {};
    } catch (const std::invalid_argument& fault) {
      return fault.what();
    }
  };
  for (const double none : {0.0, -1.0, nan}) {
    EXPECT_TRUE(fault_of_guess(none, 0.5).starts_with("radius_m is")) << none;
    EXPECT_TRUE(fault_of_guess(3.0, none).starts_with("max_turn_rad is")) << none;
  }
  EXPECT_EQ(fault_of_guess(3.0, 0.5), "");
}

}  // namespace
}  // namespace stillmap::wire
