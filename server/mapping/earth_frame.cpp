#include "server/mapping/earth_frame.hpp"

#include <spdlog/spdlog.h>

#include <utility>

#include "idl/conversions/pose.hpp"

namespace stillmap::server {
namespace {

/// Half a voxel, and that at 50 m.
constexpr double min_shift_m = 0.1;
constexpr double min_turn_rad = 0.002;

bool differ(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return (a.translation() - b.translation()).norm() >= min_shift_m ||
         Eigen::AngleAxisd(a.linear().transpose() * b.linear()).angle() >= min_turn_rad;
}

}  // namespace

EarthFrame::EarthFrame(dds::Participant& participant, const dds::Topics& topics,
                       std::string map_frame)
    : participant_(participant), topic_(topics.tf_static), map_frame_(std::move(map_frame)) {}

void EarthFrame::publish(std::int64_t stamp_ns, const MapOnEarth& place) {
  if (place_ && !differ(place_->T_earth_map, place.T_earth_map)) return;
  if (!place_) spdlog::info("the map's place on the earth is known: {}", to_text(place.datum));
  place_ = place;
  if (!tf_static_) tf_static_.emplace(participant_, topic_.dds_name, topic_.writer);
  // A keep-last writer always has room.
  static_cast<void>(
      tf_static_->write(wire::to_tf(stamp_ns, {{"earth", map_frame_, place.T_earth_map}})));
}

}  // namespace stillmap::server
