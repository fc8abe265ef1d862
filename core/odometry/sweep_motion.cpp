#include "core/odometry/sweep_motion.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

/// Between neighbours, which are a degree apart at most, matrices are interpolated as numbers.
Eigen::Matrix3f interpolated(const std::vector<Eigen::Matrix3f>& R_middle_at, double part) {
  const auto last = static_cast<double>(R_middle_at.size() - 1);
  const double position = std::clamp((part + 0.5) * last, 0.0, last);
  const auto before = static_cast<std::size_t>(std::min(std::floor(position), last - 1.0));
  const auto share = static_cast<float>(position - static_cast<double>(before));
  return (1.0F - share) * R_middle_at[before] + share * R_middle_at[before + 1];
}

}  // namespace

SweepMotion::SweepMotion(const Eigen::Isometry3d& T_start_end) : twist_(twist_of(T_start_end)) {}

SweepMotion::SweepMotion(const Eigen::Vector3d& translation,
                         std::vector<Eigen::Matrix3d> R_middle_at) {
  twist_ << translation, Eigen::Vector3d::Zero();
  if (R_middle_at.size() < 2) return;
  twist_.tail<3>() = so3_log(R_middle_at.front().transpose() * R_middle_at.back());
  for (const Eigen::Matrix3d& R : R_middle_at) R_middle_at_.push_back(R.cast<float>());
}

Eigen::Isometry3d SweepMotion::T_middle_at(double part) const {
  if (!rotation_is_measured()) return motion_of(part * twist_);
  const Eigen::Quaterniond R(interpolated(R_middle_at_, part).cast<double>());
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = part * twist_.head<3>();
  T.linear() = R.normalized().toRotationMatrix();
  return T;
}

void SweepMotion::move_to_middle(Scan& scan, const SweepTimes& sweep) const {
  if (sweep.duration_s <= 0.0) return;
  if (!rotation_is_measured()) return deskew_to_middle(scan, sweep, motion_of(twist_));
  const Eigen::Vector3f translation = twist_.head<3>().cast<float>();
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, scan.size(), 4096), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const double part = sweep.part(scan.time_offset_s[i]);
      scan.points_lidar[i] = interpolated(R_middle_at_, part) * scan.points_lidar[i] +
                             static_cast<float>(part) * translation;
    }
  });
}

Eigen::Isometry3d T_middle_at(const SweepCorrection& motion, double part) {
  Eigen::Isometry3d T = motion_of(part * motion.twist);
  T.rotate(so3_exp(part * part * motion.bend));
  return T;
}

void move_to_middle(Scan& scan, const SweepTimes& sweep, const SweepCorrection& motion) {
  if (sweep.duration_s <= 0.0) return;
  if (!motion.bend.isZero()) {
    const Eigen::Vector3f bend = motion.bend.cast<float>();
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, scan.size(), 4096), [&](const auto& some) {
      for (std::size_t i = some.begin(); i < some.end(); ++i) {
        Eigen::Vector3f& point = scan.points_lidar[i];
        const auto part = static_cast<float>(sweep.part(scan.time_offset_s[i]));
        const Eigen::Vector3f r = part * part * bend;
        const Eigen::Vector3f moved = r.cross(point);
        point += moved + 0.5F * r.cross(moved);
      }
    });
  }
  deskew_to_middle(scan, sweep, motion_of(motion.twist));
}

}  // namespace stillmap
