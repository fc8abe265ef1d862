#include "core/inertial/gyro_trust.hpp"

#include <algorithm>

namespace stillmap {
namespace {

/// Rotation that must have been foretold: 2 degrees in all, and the share that may be missed.
constexpr double proof_rad = 0.035;
constexpr double max_missed_share = 0.1;
/// Where a lidar shakes within its sweeps registration errs by more than that without the gyro:
/// this share may be missed where it is no more than this of what repetition misses, too. One that
/// says nothing, or of other axes, misses half of that at least.
constexpr double max_missed_share_of_shaken = 0.3;
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
  missed_by_repetition_ = proof_memory * missed_by_repetition_ + missed_by_repetition.squaredNorm();
  const double shaken = std::min(registered_, missed_by_repetition_);
  is_believed_ =
      registered_ > square(proof_rad) && (missed_ < square(max_missed_share) * registered_ ||
                                          missed_ < square(max_missed_share_of_shaken) * shaken);
}

void GyroTrust::withdraw() {
  if (!is_believed_) return;
  is_believed_ = false;
  losses_ += 1;
  registered_ = missed_ = missed_by_repetition_ = 0.0;
}

}  // namespace stillmap
