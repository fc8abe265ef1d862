#include "core/traversability/footprint.hpp"

#include <cassert>
#include <cmath>

namespace stillmap {

void visit_footprint(const TraversabilityView& view, const PlanarPose& pose,
                     const std::function<void(CellIndex)>& visit) {
  const RobotProfile& profile = view.profile;
  const Eigen::Vector2d ahead(std::cos(pose.heading_rad), std::sin(pose.heading_rad));
  const Eigen::Vector2d left(-ahead.y(), ahead.x());
  const Eigen::Vector2d centre_map = pose.position_map + profile.centre_ahead_m * ahead;
  const double half_length_m = 0.5 * (profile.length_m + view.cell_m);
  const double half_width_m = 0.5 * (profile.width_m + view.cell_m);
  const Eigen::Vector2d reach_m = half_length_m * ahead.cwiseAbs() + half_width_m * left.cwiseAbs();
  const Eigen::Vector2d low = ((centre_map - reach_m) / view.cell_m).array().floor();
  const Eigen::Vector2d high = ((centre_map + reach_m) / view.cell_m).array().floor();
  for (auto y = static_cast<std::int32_t>(low.y()); y <= static_cast<std::int32_t>(high.y()); ++y) {
    for (auto x = static_cast<std::int32_t>(low.x()); x <= static_cast<std::int32_t>(high.x());
         ++x) {
      const Eigen::Vector2d offset_m = view.centre_of({x, y}) - centre_map;
      if (std::abs(offset_m.dot(ahead)) <= half_length_m &&
          std::abs(offset_m.dot(left)) <= half_width_m) {
        visit({x, y});
      }
    }
  }
}

}  // namespace stillmap
