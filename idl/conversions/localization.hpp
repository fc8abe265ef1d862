#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>

#include "core/localization/localizer.hpp"
#include "core/localization/place_guess.hpp"

namespace geometry_msgs::msg {
class PoseWithCovarianceStamped;
}
namespace stillmap_msgs::srv {
class Localize_Request;
class Localize_Response;
}  // namespace stillmap_msgs::srv

namespace stillmap {

/// Where is the robot, by the last scan of a server?
struct LocalizationQuestion {
  /// Empty: anywhere in the map.
  std::optional<PlaceGuess> guess;
  /// Have the server go on where it is found.
  bool apply = false;
};

struct LocalizationAnswer {
  LocalizationStatus outcome = LocalizationStatus::no_evidence;
  /// Of the scan.
  std::int64_t stamp_ns = 0;
  /// Of the best place; to be believed where it was found.
  Eigen::Isometry3d T_map_base = Eigen::Isometry3d::Identity();
  /// PoseEvidence::score() of the best place and of the next best.
  double score = 0.0;
  double runner_up_score = 0.0;
  /// What the search took.
  double milliseconds = 0.0;
  /// The server looks there from now on.
  bool applied = false;
};

namespace wire {

/// Throws std::invalid_argument where the guess has a radius or a turn that is not above 0.
[[nodiscard]] stillmap_msgs::srv::Localize_Request to_request(const LocalizationQuestion& question);
/// Throws std::invalid_argument that names the field which makes no sense.
[[nodiscard]] LocalizationQuestion from_request(
    const stillmap_msgs::srv::Localize_Request& request);

/// All but the status.
void write_answer(const LocalizationAnswer& answer,
                  stillmap_msgs::srv::Localize_Response& response);
/// Nothing for what no server says.
[[nodiscard]] std::optional<LocalizationAnswer> from_response(
    const stillmap_msgs::srv::Localize_Response& response);

/// A pose that an operator sets, as RViz2 and Nav2 send it, or what is wrong with it.
struct InitialPose {
  /// header.frame_id without a leading '/'.
  std::string frame;
  /// In that frame. Looked for within three standard deviations of the covariance, but 5 to 50 m,
  /// and 20 degrees to all round.
  std::optional<PlaceGuess> guess;
  std::string fault;
};
[[nodiscard]] InitialPose from_message(
    const geometry_msgs::msg::PoseWithCovarianceStamped& message);

}  // namespace wire
}  // namespace stillmap
