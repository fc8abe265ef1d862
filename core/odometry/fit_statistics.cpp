#include "core/odometry/fit_statistics.hpp"

#include <algorithm>

namespace stillmap {
namespace {

/// The first scans find less of the map with every step: nothing is judged by fewer than these.
constexpr int min_fits_seen = 8;
/// With this share of the usual fit of all its features a scan is believed where little stands up.
constexpr double clear_fit_share = 0.85;
/// A scan of which a smaller share than this lies in known space could lie anywhere.
constexpr double min_believed_overlap = 0.1;
/// A pose whose OdometryResult::upright_fit is a smaller share than this of what they have lately
/// been is not believed. Simulated drives with hard turns fall to 0.58; scans of another city, or
/// of the wrong place in this one, reach 0.32.
constexpr double min_believed_fit_share = 0.5;
/// The same, and the share of the scan in known space, where the motion foretold the place.
constexpr double min_foretold_fit_share = 0.35;
constexpr double min_foretold_overlap = 0.5;
/// The same, where nothing told the place: streets look alike. A street 3 m off reaches 0.54, the
/// right place across a gap of 33 m 0.77.
constexpr double min_relocalized_fit_share = 0.65;
/// Share of the usual fit of all features with which a scan tells a place. Scans across a gap of
/// 20 m have 0.65 to 0.89, those at the end of one of 65 m 0.15.
constexpr double min_confirming_fit_share = 0.5;
/// Share of the running mean of fits below which other starts are tried.
constexpr double min_fit_share = 0.95;
/// Weight of the newest fit in the running mean.
constexpr double fit_mean_gain = 0.1;
/// Weight of the newest deviation of the points in the running mean, its length above which they
/// contradict, and as much as one counts for at most: one alone does not contradict [m].
constexpr double deviation_mean_gain = 0.25;
constexpr double max_mean_deviation_m = 0.05;
constexpr double max_counted_deviation_m = 0.2;

}  // namespace

void FitStatistics::add(const OdometryResult& result) {
  if (result.health == OdometryHealth::lost || result.health == OdometryHealth::initialised) return;
  ++count_;
  const double gain = std::max(fit_mean_gain, 1.0 / count_);
  mean_fit_ += gain * (result.fit - mean_fit_);
  mean_upright_fit_ += gain * (result.upright_fit - mean_upright_fit_);
  mean_point_deviation_m_ = mean_point_deviation_with(result);
}

bool FitStatistics::are_known() const { return count_ >= min_fits_seen; }

bool FitStatistics::fits(const OdometryResult& result) const {
  return result.health != OdometryHealth::lost && result.fit >= min_fit_share * mean_fit_;
}

bool FitStatistics::fits_poorly(const OdometryResult& result) const {
  return result.health == OdometryHealth::lost ||
         (are_known() && result.fit < clear_fit_share * mean_fit_);
}

bool FitStatistics::believes(const OdometryResult& result) const {
  if (!are_known()) return true;
  const bool stands_well = result.upright_fit >= min_believed_fit_share * mean_upright_fit_;
  return (stands_well || result.fit >= clear_fit_share * mean_fit_) &&
         result.overlap >= min_believed_overlap;
}

bool FitStatistics::believes_foretold(const OdometryResult& result) const {
  return result.upright_fit >= min_foretold_fit_share * mean_upright_fit_ &&
         result.overlap >= min_foretold_overlap;
}

bool FitStatistics::believes_relocalized(const OdometryResult& result) const {
  return result.upright_fit >= min_relocalized_fit_share * mean_upright_fit_;
}

bool FitStatistics::confirms(const OdometryResult& result) const {
  return result.fit >= min_confirming_fit_share * mean_fit_;
}

bool FitStatistics::is_contradicted_by_points(const OdometryResult& result) const {
  return are_known() && mean_point_deviation_with(result).norm() > max_mean_deviation_m;
}

void FitStatistics::forget_point_deviation() { mean_point_deviation_m_.setZero(); }

Eigen::Vector2d FitStatistics::mean_point_deviation_with(const OdometryResult& result) const {
  Eigen::Vector2d deviation_m = result.point_deviation_m.head<2>();
  const double length_m = deviation_m.norm();
  if (length_m > max_counted_deviation_m) deviation_m *= max_counted_deviation_m / length_m;
  return mean_point_deviation_m_ + deviation_mean_gain * (deviation_m - mean_point_deviation_m_);
}

}  // namespace stillmap
