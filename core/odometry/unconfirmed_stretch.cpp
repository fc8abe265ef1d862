#include "core/odometry/unconfirmed_stretch.hpp"

#include <algorithm>
#include <numbers>

#include "core/odometry/prior_map.hpp"
#include "core/odometry/relocalization.hpp"

namespace stillmap {
namespace {

/// Less of a scan than this in the trusted map neither confirms nor contradicts.
constexpr double min_confirming_overlap = 0.3;
constexpr double min_contradicting_overlap = 0.5;
/// So many scans in a row contradict: one alone may be hidden by traffic.
constexpr int contradicting_scans = 5;
/// A pose that was followed is confirmed by the first scan that lies so near it in the trusted map
/// [m, rad]: what it has slid since. Where most of it lies in unknown space, by several in a row of
/// which what stands up comes to the same place.
constexpr double followed_distance_m = 1.0;
constexpr double followed_angle_rad = 0.1;
/// Those that were followed are where they seemed to be where the one that ends the doubt has slid
/// no farther [m].
constexpr double max_slide_m = 0.2;
/// One that was looked for is confirmed by scans that each come to the place where the others have
/// it [m, rad].
constexpr double same_distance_m = 0.1;
constexpr double same_angle_rad = 0.02;
/// No farther off than this [m], a scan that fits as well as scans usually do is enough. Else it
/// takes several in a row, while so much is driven [m]: facades repeat themselves, and eleven scans
/// within 2 m have agreed on a wrong one.
constexpr double near_jump_m = 3.0;
constexpr int confirming_scans = 5;
constexpr double confirming_path_m = 5.0;
/// What agrees with nothing by then is looked for again.
constexpr int scans_to_agree_in = 20;
/// A lidar that was followed through a tunnel does not come back to its other end: it has seen all
/// of its motion for so long [m] that nothing of the trusted map can be in sight.
constexpr double settling_path_m = 100.0;

/// Deviations of a pose that nothing older confirms [m, rad] grow with the time since one was
/// confirmed: by this share of the way at the speed of then, or at this one, and by this rate.
constexpr double min_unconfirmed_speed_m_s = 1.0;
constexpr double unconfirmed_turn_rate_rad_s = 0.2;
/// It may have braked or turned off since, or have been found where it is not; where it was
/// followed, or what carries it says how it moves, it has only slid.
constexpr double guessed_share_of_way = 0.5;
constexpr double followed_share_of_way = 0.05;
/// Beyond these, nothing is known: of a direction, that it is one of all.
constexpr double max_unconfirmed_m = 1000.0;
constexpr double max_unconfirmed_rad = std::numbers::pi / std::numbers::sqrt3;

}  // namespace

Eigen::Matrix<double, 6, 6> drift_covariance(const RegisteredScan& known, double since_s,
                                             bool is_followed) {
  const double gone_s =
      (is_followed ? followed_share_of_way : guessed_share_of_way) * std::max(0.0, since_s);
  PoseTangent sigma;
  sigma.head<3>().setConstant(
      std::min(gone_s * std::max(min_unconfirmed_speed_m_s, known.speed_m_s()), max_unconfirmed_m));
  sigma.tail<3>().setConstant(std::min(gone_s * unconfirmed_turn_rate_rad_s, max_unconfirmed_rad));
  return sigma.cwiseAbs2().asDiagonal();
}

Eigen::Matrix<double, 6, 6> unknown_pose_covariance() {
  PoseTangent sigma;
  sigma.head<3>().setConstant(max_unconfirmed_m);
  sigma.tail<3>().setConstant(max_unconfirmed_rad);
  return sigma.cwiseAbs2().asDiagonal();
}

void UnconfirmedStretch::jump(const Eigen::Isometry3d& T_map_lidar_expected,
                              const Eigen::Isometry3d& T_map_lidar_found) {
  has_jumped_ = true;
  has_jumped_far_ |=
      (T_map_lidar_found.translation() - T_map_lidar_expected.translation()).norm() > near_jump_m;
  T_led_found_ = T_led_found_ * T_map_lidar_expected * T_map_lidar_found.inverse();
  scans_since_jump_ = 0;
  has_agreed_ = false;
}

void UnconfirmedStretch::count_good(const OdometryResult& found) {
  const bool is_good = found.health == OdometryHealth::good;
  const Eigen::Vector3d position_map = found.T_map_lidar.translation();
  if (is_good && good_at_map_) good_path_m_ += (position_map - *good_at_map_).norm();
  good_at_map_ = is_good ? std::optional(position_map) : std::nullopt;
}

void UnconfirmedStretch::add_prior_map(std::span<const LabelledPoint> points_map) {
  insert_prior_map(points_map, trusted_.map);
}

UnconfirmedStretch::Decision UnconfirmedStretch::evaluate(const FeatureSets& features,
                                                          const OdometryConfig& config,
                                                          OdometryResult& found) {
  ++scans_since_jump_;
  count_good(found);
  if (found.health != OdometryHealth::good) {
    count_agreeing(false, found.T_map_lidar.translation());
    count_contradicting(false);
    found.map_entry = entry_of_open();
    return is_overdue(found.T_map_lidar) ? Decision::contradicted : Decision::open;
  }
  OdometryResult in_trusted_map =
      register_features(features, trusted_.map, found.T_map_lidar, config, found.sweep_correction);
  if (in_trusted_map.health == OdometryHealth::good)
    in_trusted_map = confirmed_by_points(in_trusted_map, features, trusted_.map, config);
  const Decision decision = decide(in_trusted_map, found);
  const Eigen::Vector3d followed_to_map = found.T_map_lidar.translation();
  if (decision == Decision::confirmed) found = in_trusted_map;
  if (decision == Decision::confirmed || decision == Decision::settled) {
    const double slid_m = (found.T_map_lidar.translation() - followed_to_map).norm();
    found.map_entry =
        !has_jumped_ && slid_m < max_slide_m ? MapEntry::enters_with_waiting : MapEntry::enters;
  } else {
    found.map_entry = entry_of_open();
  }
  return decision;
}

MapEntry UnconfirmedStretch::entry_of_open() const {
  return has_jumped_ ? MapEntry::stays_out_with_waiting : MapEntry::waits;
}

double UnconfirmedStretch::distance_from_trusted_m(const Eigen::Isometry3d& T_map_lidar) const {
  return (where_motion_led(T_map_lidar).translation() - trusted_.last.T_map_lidar.translation())
      .norm();
}

bool UnconfirmedStretch::is_in_reach(const Eigen::Isometry3d& T_map_lidar, double driven_m) const {
  return distance_from_trusted_m(T_map_lidar) <= relocalization_reach_m + driven_m;
}

bool UnconfirmedStretch::is_overdue(const Eigen::Isometry3d& T_map_lidar) const {
  if (!has_jumped_ || has_agreed_ || scans_since_jump_ < scans_to_agree_in) return false;
  // From what is out of sight, or of reach of one that is near its place, nothing can agree.
  return has_jumped_far_ ? distance_from_trusted_m(T_map_lidar) <= settling_path_m
                         : is_in_reach(T_map_lidar, 0.0);
}

bool UnconfirmedStretch::stands_on_trusted_map(const OdometryResult& in_trusted_map) const {
  return in_trusted_map.health == OdometryHealth::good &&
         in_trusted_map.overlap >= min_confirming_overlap &&
         trusted_.fits.believes_relocalized(in_trusted_map);
}

void UnconfirmedStretch::count_agreeing(bool agrees, const Eigen::Vector3d& position_map) {
  agreeing_path_m_ = agrees && agreeing_scans_ > 0
                         ? agreeing_path_m_ + (position_map - agreed_at_map_).norm()
                         : 0.0;
  agreeing_scans_ = agrees ? agreeing_scans_ + 1 : 0;
  has_agreed_ |= agrees;
  agreed_at_map_ = position_map;
}

UnconfirmedStretch::Decision UnconfirmedStretch::decide(const OdometryResult& in_trusted_map,
                                                        const OdometryResult& found) {
  const PoseTangent off = boxminus(in_trusted_map.T_map_lidar, found.T_map_lidar);
  const auto is_within = [&off](double distance_m, double angle_rad) {
    return off.head<3>().norm() < distance_m && off.tail<3>().norm() < angle_rad;
  };
  const bool stands = stands_on_trusted_map(in_trusted_map);
  const bool agrees = stands && trusted_.fits.confirms(in_trusted_map);
  if (agrees && !has_jumped_ && is_within(followed_distance_m, followed_angle_rad))
    return Decision::confirmed;
  const bool is_same =
      (has_jumped_ ? agrees : stands) && is_within(same_distance_m, same_angle_rad);
  if (agrees && is_same && !has_jumped_far_ && trusted_.fits.fits(in_trusted_map))
    return Decision::confirmed;
  count_agreeing(is_same, found.T_map_lidar.translation());
  if (agreeing_scans_ >= confirming_scans &&
      (!has_jumped_ || agreeing_path_m_ >= confirming_path_m))
    return Decision::confirmed;
  // One that drives out of the trusted map fits it less and less, and stays where it puts it.
  const bool stays =
      in_trusted_map.health == OdometryHealth::good && is_within(same_distance_m, same_angle_rad);
  // Where little of a place stands out of traffic, what was seen since does not fit either.
  const bool is_elsewhere = has_jumped_ || (!trusted_.fits.believes(in_trusted_map) &&
                                            trusted_.fits.believes_relocalized(found));
  count_contradicting(!stays && in_trusted_map.overlap >= min_contradicting_overlap &&
                      is_elsewhere);
  if (is_overdue(found.T_map_lidar) || contradicting_scans_ >= contradicting_scans)
    return Decision::contradicted;
  return !has_jumped_ && good_path_m_ >= settling_path_m ? Decision::settled : Decision::open;
}

}  // namespace stillmap
