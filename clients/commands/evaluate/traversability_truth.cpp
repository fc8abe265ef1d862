#include "clients/commands/evaluate/traversability_truth.hpp"

namespace stillmap::cli {
namespace {

evaluation::CellTruth true_cell(const simulation::TrueGround& ground, const RobotProfile& profile) {
  evaluation::CellTruth cell;
  cell.is_edge = ground.is_edge;
  const bool has_step = ground.is_edge && ground.step_m > profile.max_step_m;
  if (ground.standing == simulation::Standing::fixed) {
    cell.reason = BlockReason::obstacle;
  } else if (!profile.class_cost.at(static_cast<std::size_t>(ground.label))) {
    cell.reason = BlockReason::ground_class;
  } else if (has_step) {
    cell.reason = BlockReason::step;
  } else if (ground.standing == simulation::Standing::parked) {
    cell.reason = BlockReason::obstacle;
    cell.is_removed_vehicle = true;
  }
  return cell;
}

}  // namespace

evaluation::TraversabilityTruth simulated_traversability(const simulation::CityTruth& truth,
                                                         const RobotProfile& profile, double cell_m,
                                                         const Eigen::Isometry3d& T_city_map) {
  return [&truth, profile, cell_m, T_city_map](const Eigen::Vector3d& ground_map) {
    const Eigen::Vector3d ground_city = T_city_map * ground_map;
    return true_cell(
        truth.at(ground_city.head<2>(), cell_m, profile.obstacle_height_m(), profile.height_m),
        profile);
  };
}

}  // namespace stillmap::cli
