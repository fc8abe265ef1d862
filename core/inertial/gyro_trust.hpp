#pragma once

#include <Eigen/Core>

namespace stillmap {

/// Decides whether a gyro is believed: once it has foretold rotations that were then registered,
/// and only as long as it foretells them better than the last rate of turn does. So one in other
/// units, about other axes, or of another machine does no harm.
class GyroTrust {
 public:
  /// Rotation vectors from one scan to the next [rad]: as registered, what the gyro missed of it,
  /// and what the rotation before it, repeated, would have missed.
  void add(const Eigen::Vector3d& registered, const Eigen::Vector3d& missed_by_gyro,
           const Eigen::Vector3d& missed_by_repetition);

  /// Scans that it helped to register cannot be registered: it may be why.
  void withdraw();

  [[nodiscard]] bool is_believed() const { return is_believed_; }
  /// How often the gyro was no longer believed.
  [[nodiscard]] int losses() const { return losses_; }

 private:
  bool is_believed_ = false;
  int losses_ = 0;
  /// Sums of squares since the gyro is not believed, the older the less [rad^2].
  double registered_ = 0.0;
  double missed_ = 0.0;
  /// Whether turns are foretold of which registration errs by much.
  class Shaken {
   public:
    void add(const Eigen::Vector3d& registered, const Eigen::Vector3d& missed_by_gyro,
             const Eigen::Vector3d& missed_by_repetition);
    [[nodiscard]] bool is_foretold() const;

   private:
    /// Scans in which the gyro tells a turn, the older the less.
    double turns_ = 0.0;
    double registered_ = 0.0;
    double missed_ = 0.0;
    double missed_by_repetition_ = 0.0;
    /// Sums of products of what the gyro tells, and of what it misses, with what it tells.
    Eigen::Matrix3d by_gyro_ = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d common_ = Eigen::Matrix3d::Zero();
  };
  Shaken shaken_;
  /// Means of squares over the last scans [rad^2].
  double recent_missed_ = 0.0;
  double recent_missed_by_repetition_ = 0.0;
};

}  // namespace stillmap
