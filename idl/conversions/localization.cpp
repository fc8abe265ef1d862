#include "idl/conversions/localization.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "core/frames/rigid_motion.hpp"
#include "core/map/voxel_grid.hpp"
#include "idl/conversions/pose.hpp"
#include "idl/interface/topics.hpp"
#include "initial_pose.h"
#include "localize.h"

namespace stillmap::wire {

using stillmap_msgs::srv::Localize_Request;
using stillmap_msgs::srv::Localize_Response;

namespace {

/// A hand that points on a map is no better, and a larger part of it is no place.
constexpr double min_radius_m = 5.0;
constexpr double max_radius_m = 50.0;
constexpr double min_turn_rad = 20.0 * std::numbers::pi / 180.0;
/// Of what is asked of a service.
constexpr double max_asked_radius_m = 10'000.0;
/// A pose is looked for within so many standard deviations.
constexpr double deviations = 3.0;

void require(bool holds, const char* field, double value, const std::string& must) {
  if (holds) return;
  std::ostringstream text;
  text << field << " is " << value << ": it must be " << must;
  throw std::invalid_argument(text.str());
}

bool is_on_map(double coordinate_m) {
  return std::abs(coordinate_m) <= VoxelGrid::max_coordinate_m;
}

}  // namespace

Localize_Request to_request(const LocalizationQuestion& question) {
  Localize_Request request;
  request.format_version(dds::wire_format_version);
  request.apply(question.apply);
  if (!question.guess) return request;
  const PlaceGuess& guess = *question.guess;
  // On the wire 0 means that there is no guess, and any turn.
  require(guess.radius_m > 0.0, "radius_m", guess.radius_m, "above 0");
  require(guess.max_turn_rad > 0.0, "max_turn_rad", guess.max_turn_rad, "above 0");
  request.x(guess.T_map_base.translation().x());
  request.y(guess.T_map_base.translation().y());
  request.heading_rad(heading_rad(guess.T_map_base));
  request.radius_m(guess.radius_m);
  request.max_turn_rad(guess.max_turn_rad);
  return request;
}

LocalizationQuestion from_request(const Localize_Request& request) {
  require(is_on_map(request.x()), "x", request.x(), "a place on the map [m]");
  require(is_on_map(request.y()), "y", request.y(), "a place on the map [m]");
  require(std::isfinite(request.heading_rad()), "heading_rad", request.heading_rad(), "finite");
  require(request.radius_m() >= 0.0 && request.radius_m() <= max_asked_radius_m, "radius_m",
          request.radius_m(), "within 0..10000");
  require(request.max_turn_rad() >= 0.0 && std::isfinite(request.max_turn_rad()), "max_turn_rad",
          request.max_turn_rad(), "0 or more");
  LocalizationQuestion question{.guess = std::nullopt, .apply = request.apply()};
  if (request.radius_m() == 0.0) return question;
  const bool is_any_turn = request.max_turn_rad() == 0.0;
  question.guess =
      PlaceGuess{.T_map_base = Eigen::Translation3d(request.x(), request.y(), 0.0) *
                               Eigen::AngleAxisd(request.heading_rad(), Eigen::Vector3d::UnitZ()),
                 .radius_m = request.radius_m(),
                 .max_turn_rad = is_any_turn ? std::numbers::pi
                                             : std::min(request.max_turn_rad(), std::numbers::pi)};
  return question;
}

void write_answer(const LocalizationAnswer& answer, Localize_Response& response) {
  const Eigen::Vector3d p = answer.T_map_base.translation();
  const Eigen::Quaterniond q(answer.T_map_base.rotation());
  response.outcome(static_cast<std::uint8_t>(answer.outcome));
  response.stamp_ns(answer.stamp_ns);
  response.x(p.x());
  response.y(p.y());
  response.z(p.z());
  response.qx(q.x());
  response.qy(q.y());
  response.qz(q.z());
  response.qw(q.w());
  response.score(answer.score);
  response.runner_up_score(answer.runner_up_score);
  response.milliseconds(answer.milliseconds);
  response.applied(answer.applied);
}

std::optional<LocalizationAnswer> from_response(const Localize_Response& response) {
  const Eigen::Vector3d p(response.x(), response.y(), response.z());
  const Eigen::Quaterniond q(response.qw(), response.qx(), response.qy(), response.qz());
  constexpr auto last = static_cast<std::uint8_t>(LocalizationStatus::no_evidence);
  const bool is_pose = p.allFinite() && q.coeffs().allFinite() && q.norm() > 1e-6;
  const bool are_shares = response.score() >= 0.0 && response.score() <= 1.0 &&
                          response.runner_up_score() >= 0.0 && response.runner_up_score() <= 1.0;
  if (response.outcome() > last || !is_pose || !are_shares ||
      !std::isfinite(response.milliseconds()))
    return std::nullopt;
  return LocalizationAnswer{.outcome = static_cast<LocalizationStatus>(response.outcome()),
                            .stamp_ns = response.stamp_ns(),
                            .T_map_base = Eigen::Translation3d(p) * q.normalized(),
                            .score = response.score(),
                            .runner_up_score = response.runner_up_score(),
                            .milliseconds = response.milliseconds(),
                            .applied = response.applied()};
}

InitialPose from_message(const geometry_msgs::msg::PoseWithCovarianceStamped& message) {
  InitialPose initial;
  initial.frame = message.header().frame_id();
  if (initial.frame.starts_with('/')) initial.frame.erase(0, 1);
  const auto T = to_isometry(message.pose().pose());
  if (!T) {
    initial.fault = "its position is not finite, or its orientation is none";
    return initial;
  }
  if (!is_on_map(T->translation().x()) || !is_on_map(T->translation().y())) {
    initial.fault = "its position is beyond all maps";
    return initial;
  }
  const std::array<double, 36>& covariance = message.pose().covariance();
  // Of x, y and the heading; 0 where nobody says.
  for (const std::size_t k : {0U, 7U, 35U}) {
    if (std::isfinite(covariance.at(k)) && covariance.at(k) >= 0.0) continue;
    initial.fault = "its covariance is not finite, or negative on the diagonal";
    return initial;
  }
  const double deviation_m = std::sqrt(std::max(covariance[0], covariance[7]));
  initial.guess =
      PlaceGuess{.T_map_base = *T,
                 .radius_m = std::clamp(deviations * deviation_m, min_radius_m, max_radius_m),
                 .max_turn_rad = std::clamp(deviations * std::sqrt(covariance[35]), min_turn_rad,
                                            std::numbers::pi)};
  return initial;
}

}  // namespace stillmap::wire
