#include "core/inertial/gyro_trust.hpp"

#include <algorithm>

namespace stillmap {
namespace {

/// Rotation that must have been foretold: 2 degrees in all, and the share that may be missed.
constexpr double proof_rad = 0.035;
constexpr double max_missed_share = 0.1;
/// Where a lidar shakes within its sweeps registration errs by more than that without the gyro.
/// Over more scans with a turn, and 4 degrees, its errors are like no turn: what is missed is less
/// than this share of what is registered and of what repetition misses, and has no more than this
/// in common with what the gyro tells. It has all where that is in other units, about other axes,
/// or late by half a swing.
constexpr double min_shaken_turns = 15.0;
constexpr double min_turn_rad = 0.01;
constexpr double proof_of_shaken_rad = 0.07;
constexpr double max_missed_share_of_shaken = 0.8;
constexpr double max_common_share = 0.15;
constexpr double shaken_memory = 0.98;
/// Older scans count this much less with each scan.
constexpr double proof_memory = 0.95;
constexpr double recent_memory = 0.7;
/// Registration itself errs by this much [rad].
constexpr double registration_error_rad = 0.0025;

constexpr double square(double x) { return x * x; }

}  // namespace

void GyroTrust::add(const Eigen::Vector3d& registered, const Eigen::Vector3d& missed_by_gyro,
                    const Eigen::Vector3d& missed_by_repetition) {
  const auto forget = [](double& sum, double memory, double squared) {
    sum = memory * sum + (1.0 - memory) * squared;
  };
  forget(recent_missed_, recent_memory, missed_by_gyro.squaredNorm());
  forget(recent_missed_by_repetition_, recent_memory, missed_by_repetition.squaredNorm());
  if (is_believed_) {
    const double bearable =
        std::max(square(registration_error_rad), 0.5 * recent_missed_by_repetition_);
    if (recent_missed_ > bearable) withdraw();
    return;
  }
  registered_ = proof_memory * registered_ + registered.squaredNorm();
  missed_ = proof_memory * missed_ + missed_by_gyro.squaredNorm();
  shaken_.add(registered, missed_by_gyro, missed_by_repetition);
  is_believed_ = registered_ > square(proof_rad) &&
                 (missed_ < square(max_missed_share) * registered_ || shaken_.is_foretold());
}

void GyroTrust::Shaken::add(const Eigen::Vector3d& registered,
                            const Eigen::Vector3d& missed_by_gyro,
                            const Eigen::Vector3d& missed_by_repetition) {
  const Eigen::Vector3d by_gyro = registered - missed_by_gyro;
  turns_ = shaken_memory * turns_ + (by_gyro.norm() > min_turn_rad ? 1.0 : 0.0);
  registered_ = shaken_memory * registered_ + registered.squaredNorm();
  missed_ = shaken_memory * missed_ + missed_by_gyro.squaredNorm();
  missed_by_repetition_ =
      shaken_memory * missed_by_repetition_ + missed_by_repetition.squaredNorm();
  by_gyro_ = shaken_memory * by_gyro_ + by_gyro * by_gyro.transpose();
  common_ = shaken_memory * common_ + missed_by_gyro * by_gyro.transpose();
}

bool GyroTrust::Shaken::is_foretold() const {
  const double bearable =
      square(max_missed_share_of_shaken) * std::min(registered_, missed_by_repetition_);
  return turns_ > min_shaken_turns && by_gyro_.trace() > square(proof_of_shaken_rad) &&
         missed_ < bearable && common_.norm() < max_common_share * by_gyro_.norm();
}

void GyroTrust::withdraw() {
  if (!is_believed_) return;
  is_believed_ = false;
  losses_ += 1;
  registered_ = missed_ = 0.0;
  shaken_ = {};
}

}  // namespace stillmap
