#include "core/odometry/motion_trust.hpp"

#include <algorithm>
#include <utility>

namespace stillmap {
namespace {

/// What is borne of one motion of up to this time, and of longer ones in proportion: wheels slip a
/// little, and stamps differ [m, rad, s].
constexpr double borne_m = 0.1;
constexpr double borne_rad = 0.02;
constexpr double borne_s = 0.1;
/// Of older scans.
constexpr double memory = 0.8;
/// One scan says no more than this, however far off it is: it decides nothing alone.
constexpr double max_square = 4.5;
/// It is believed again where it misses clearly less than it may.
constexpr double regained_share = 0.5;
/// And where so many scans could not tell: they need it most.
constexpr int max_untold = 20;
/// Errors of poses that are no motion [m, rad].
constexpr double noise_m = 0.1;
constexpr double noise_rad = 0.02;

double square_of(const Eigen::Isometry3d& missed, double interval_s) {
  const double longer = std::max(1.0, interval_s / borne_s);
  const double shift = missed.translation().norm() / (longer * borne_m);
  const double turn = Eigen::AngleAxisd(missed.linear()).angle() / (longer * borne_rad);
  return std::min(max_square, shift * shift + turn * turn);
}

}  // namespace

bool MotionTrust::is_reachable(const Motion& last, const Eigen::Isometry3d& motion,
                               double interval_s) const {
  // Of a moment, the noise of two poses is no velocity.
  constexpr double min_share = 0.25;
  const double last_s = std::max(last.interval_s, min_share * interval_s);
  const double between_middles_s = 0.5 * (interval_s + last_s);
  const Eigen::Vector3d expected_m = last.T_before_after.translation() * (interval_s / last_s);
  return (motion.translation() - expected_m).norm() <=
         limits_.max_acceleration_m_s2 * between_middles_s * interval_s + noise_m;
}

void MotionTrust::forget_motion() {
  if (!std::exchange(foretold_, std::nullopt) || ++untold_ != max_untold || is_believed_) return;
  is_believed_ = true;
  missed_ = missed_by_repetition_ = 0.0;
}

bool MotionTrust::is_possible(const Eigen::Isometry3d& foretold, double interval_s) {
  forget_motion();
  if (!(interval_s > 0.0)) return true;
  const auto last_foretold = std::exchange(last_foretold_, Motion{foretold, interval_s});
  const bool is_known = registered_ || last_foretold;
  const bool is_within =
      foretold.translation().norm() <= limits_.max_speed_m_s * interval_s + noise_m &&
      Eigen::AngleAxisd(foretold.linear()).angle() <=
          limits_.max_turn_rate_rad_s * interval_s + noise_rad;
  const bool goes_on = !is_known ||
                       (registered_ && is_reachable(*registered_, foretold, interval_s)) ||
                       (last_foretold && is_reachable(*last_foretold, foretold, interval_s));
  if (!is_within || !goes_on) return false;
  foretold_ = foretold;
  return true;
}

void MotionTrust::learn(const Eigen::Isometry3d& registered, double interval_s) {
  if (!(interval_s > 0.0)) return;
  const auto last = std::exchange(registered_, Motion{registered, interval_s});
  const auto foretold = std::exchange(foretold_, std::nullopt);
  if (!foretold || !last) return;
  untold_ = 0;
  const auto forget = [](double& mean, double square) {
    mean = memory * mean + (1.0 - memory) * square;
  };
  Eigen::Isometry3d repeated = last->T_before_after;
  repeated.translation() *= interval_s / last->interval_s;
  forget(missed_, square_of(foretold->inverse() * registered, interval_s));
  forget(missed_by_repetition_, square_of(repeated.inverse() * registered, interval_s));
  const double borne = std::max(1.0, missed_by_repetition_);
  is_believed_ = missed_ <= (is_believed_ ? borne : regained_share * borne);
}

}  // namespace stillmap
