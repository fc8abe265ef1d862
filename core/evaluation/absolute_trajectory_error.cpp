#include "core/evaluation/absolute_trajectory_error.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace stillmap::evaluation {
namespace {

// Least squares over rotations, Umeyama eq. 40-41 with scale 1. Poses on one line leave a turn
// about that line open; any choice gives the same error.
Eigen::Isometry3d best_rigid_fit(const PosePairs& pairs) {
  Eigen::Vector3d truth_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d estimate_mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    truth_mean += pairs.truth[i].translation();
    estimate_mean += pairs.estimate[i].translation();
  }
  truth_mean /= static_cast<double>(pairs.size());
  estimate_mean /= static_cast<double>(pairs.size());

  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    covariance += (pairs.truth[i].translation() - truth_mean) *
                  (pairs.estimate[i].translation() - estimate_mean).transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double handedness = (svd.matrixU() * svd.matrixV().transpose()).determinant();

  Eigen::Isometry3d T_truth_estimate = Eigen::Isometry3d::Identity();
  T_truth_estimate.linear() =
      svd.matrixU() * Eigen::Vector3d(1.0, 1.0, handedness < 0.0 ? -1.0 : 1.0).asDiagonal() *
      svd.matrixV().transpose();
  T_truth_estimate.translation() = truth_mean - T_truth_estimate.linear() * estimate_mean;
  return T_truth_estimate;
}

}  // namespace

std::optional<Alignment> alignment_from_name(std::string_view alignment_name) {
  if (alignment_name == "none") return Alignment::none;
  if (alignment_name == "first") return Alignment::first_pose;
  if (alignment_name == "rigid") return Alignment::rigid;
  return std::nullopt;
}

Eigen::Isometry3d find_alignment(const PosePairs& pairs, Alignment alignment) {
  switch (alignment) {
    case Alignment::first_pose:
      return pairs.truth.front() * pairs.estimate.front().inverse();
    case Alignment::rigid:
      return best_rigid_fit(pairs);
    case Alignment::none:
      break;
  }
  return Eigen::Isometry3d::Identity();
}

AbsoluteTrajectoryError absolute_trajectory_error(const PosePairs& pairs, Alignment alignment) {
  AbsoluteTrajectoryError error;
  error.T_truth_estimate = find_alignment(pairs, alignment);
  error.per_pose_m.reserve(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Vector3d aligned = error.T_truth_estimate * pairs.estimate[i].translation();
    error.per_pose_m.push_back((aligned - pairs.truth[i].translation()).norm());
  }
  const std::vector<double>& all = error.per_pose_m;
  const auto count = static_cast<double>(all.size());
  error.rmse_m = std::sqrt(std::inner_product(all.begin(), all.end(), all.begin(), 0.0) / count);
  error.mean_m = std::accumulate(all.begin(), all.end(), 0.0) / count;
  error.max_m = *std::max_element(all.begin(), all.end());
  error.final_m = all.back();
  return error;
}

}  // namespace stillmap::evaluation
