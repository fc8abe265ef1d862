#include "core/graph/position_chains.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>

namespace stillmap {
namespace {

/// Odometry errs by less, as a share of the way, and where it could not confirm scans on it.
constexpr double odometry_share_of_way = 0.15;
constexpr double unconfirmed_share_of_way = 0.5;
constexpr double unconfirmed_m = 2.0;
/// Standard deviations that a distance may be off.
constexpr double max_sigmas = 3.0;
/// A receiver that says nothing useful makes a chain of nearly every position.
constexpr std::size_t max_chains = 16;
/// Heights are believed where so large a share of them agrees.
constexpr double min_height_share = 0.5;
/// Of a receiver whose height jumps more often than so, as a share of its positions, none is.
constexpr double max_height_jumps_share = 0.1;
constexpr std::size_t few_height_jumps = 2;
/// Of a height that is not believed [m].
constexpr double unknown_sigma_m = 1e4;

double sigma_m(const PositionMeasurement& measured) {
  return horizontal_sigma_m(measured.information.inverse());
}

double allowed_of_way_m(const PositionOnWay& last, const PositionOnWay& next) {
  const double way_m = next.way_m - last.way_m;
  const double allowed_m = odometry_share_of_way * way_m;
  if (next.unconfirmed_scans == last.unconfirmed_scans) return allowed_m;
  return allowed_m + unconfirmed_m + unconfirmed_share_of_way * way_m;
}

/// In plan; heights are judged apart. Odometry's z may not be up: then its plan is shorter, and its
/// whole length is no less.
bool goes_on(const PositionOnWay& last, const PositionOnWay& next) {
  const double measured_m =
      (next.measured.position_enu - last.measured.position_enu).head<2>().norm();
  const Eigen::Vector3d driven = next.point_odom - last.point_odom;
  const double allowed_m = max_sigmas * std::hypot(sigma_m(last.measured), sigma_m(next.measured)) +
                           allowed_of_way_m(last, next);
  return measured_m >= driven.head<2>().norm() - allowed_m &&
         measured_m <= driven.norm() + allowed_m;
}

double height_variance_m2(const PositionMeasurement& measured) {
  return measured.information.inverse()(2, 2);
}

/// How far the one height may be off the other and the way between them [m].
double allowed_height_m(const PositionOnWay& last, const PositionOnWay& next) {
  return max_sigmas *
             std::sqrt(height_variance_m2(last.measured) + height_variance_m2(next.measured)) +
         allowed_of_way_m(last, next);
}

/// The direction in which the heights rise from one position to the next, in odometry's frame.
/// Steps between them are few: least squares, reweighted by Cauchy's kernel. What the way does not
/// show of it is that of a level frame.
Eigen::Vector3d up_by_heights(std::span<const PositionOnWay> positions) {
  constexpr int iterations = 10;
  constexpr double level_weight = 1e-3;
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Eigen::Matrix3d H = level_weight * Eigen::Matrix3d::Identity();
    Eigen::Vector3d b = level_weight * Eigen::Vector3d::UnitZ();
    for (std::size_t i = 1; i < positions.size(); ++i) {
      const Eigen::Vector3d driven = positions[i].point_odom - positions[i - 1].point_odom;
      const double rise_m =
          positions[i].measured.position_enu.z() - positions[i - 1].measured.position_enu.z();
      const double allowed_m = allowed_height_m(positions[i - 1], positions[i]);
      const double off = (rise_m - up.dot(driven)) / allowed_m;
      const double weight = 1.0 / (allowed_m * allowed_m * (1.0 + off * off));
      H += weight * driven * driven.transpose();
      b += weight * rise_m * driven;
    }
    up = H.llt().solve(b);
  }
  return up;
}

/// The position with a height that says nothing, and lies where odometry has it after `known`.
PositionMeasurement without_height(const PositionOnWay& position, const PositionOnWay& known,
                                   const Eigen::Vector3d& up_odom) {
  PositionMeasurement measured = position.measured;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  covariance.topLeftCorner<2, 2>() = measured.information.inverse().topLeftCorner<2, 2>();
  covariance(2, 2) = unknown_sigma_m * unknown_sigma_m;
  measured.information = covariance.inverse();
  measured.position_enu.z() =
      known.measured.position_enu.z() + up_odom.dot(position.point_odom - known.point_odom);
  return measured;
}

}  // namespace

double horizontal_sigma_m(const Eigen::Matrix3d& covariance_enu) {
  return std::sqrt(0.5 * covariance_enu.topLeftCorner<2, 2>().trace());
}

std::vector<bool> believed_heights(std::span<const PositionOnWay> positions) {
  const Eigen::Vector3d up_odom = up_by_heights(positions);
  // Numbers of positions, as PositionChains has them.
  std::vector<std::vector<std::size_t>> chains;
  std::size_t jumps = 0;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const auto goes_on_from = [&](const std::vector<std::size_t>& chain) {
      const PositionOnWay& last = positions[chain.back()];
      const double rise_m = positions[i].measured.position_enu.z() - last.measured.position_enu.z();
      const double driven_m = up_odom.dot(positions[i].point_odom - last.point_odom);
      return std::abs(rise_m - driven_m) <= allowed_height_m(last, positions[i]);
    };
    // The newest one is the last.
    const auto chain = std::ranges::find_if(chains.rbegin(), chains.rend(), goes_on_from);
    if (chain != chains.rbegin()) ++jumps;
    if (chain == chains.rend()) {
      if (chains.size() >= max_chains)
        chains.erase(std::ranges::min_element(chains, {}, &std::vector<std::size_t>::size));
      chains.push_back({i});
      continue;
    }
    chain->push_back(i);
    std::rotate(std::prev(chain.base()), chain.base(), chains.end());
  }
  std::vector<bool> believed(positions.size(), false);
  const auto largest = std::ranges::max_element(chains, {}, &std::vector<std::size_t>::size);
  const auto count = static_cast<double>(positions.size());
  const bool jumps_often =
      jumps > few_height_jumps && static_cast<double>(jumps) > max_height_jumps_share * count;
  if (largest == chains.end() || jumps_often ||
      static_cast<double>(largest->size()) < min_height_share * count)
    return believed;
  for (const std::size_t i : *largest) believed[i] = true;
  return believed;
}

void PositionChains::extend(Chain& chain, const PositionOnWay& position) const {
  const double sigma = sigma_m(position.measured);
  const double spacing_m = std::max(spacing_m_, spacing_sigmas_ * sigma);
  if (position.way_m - chain.last().way_m >= spacing_m) {
    chain.positions.push_back(position);
    return;
  }
  // A receiver that has just got better is not bound by what it said before.
  constexpr double clearly_better = 0.5;
  const bool is_in_use = &chain == chains_.data() && chain.positions.size() <= used_;
  if (is_in_use || sigma >= clearly_better * sigma_m(chain.last().measured)) return;
  chain.positions.back() = position;
}

std::vector<PositionChains::Chain>::iterator PositionChains::chain_before(
    const PositionOnWay& position) {
  auto newest = chains_.end();
  for (auto chain = chains_.begin(); chain != chains_.end(); ++chain) {
    const bool is_newer = newest == chains_.end() || chain->last().way_m > newest->last().way_m;
    if (is_newer && goes_on(chain->last(), position)) newest = chain;
  }
  return newest;
}

void PositionChains::add(const PositionOnWay& position) {
  const auto chain = chain_before(position);
  if (chain == chains_.end()) {
    if (chains_.size() >= max_chains) {
      // The first one is the largest.
      const auto least = std::min_element(
          chains_.begin() + 1, chains_.end(),
          [](const Chain& a, const Chain& b) { return a.positions.size() < b.positions.size(); });
      dropped_ += least->positions.size();
      chains_.erase(least);
    }
    chains_.push_back({{position}});
    return;
  }
  extend(*chain, position);
  if (chain->positions.size() <= chains_.front().positions.size()) return;
  std::iter_swap(chains_.begin(), chain);
  used_ = 0;
}

void PositionChains::clear() {
  chains_.clear();
  believed_.clear();
  dropped_ = used_ = 0;
}

std::span<const PositionMeasurement> PositionChains::believed() {
  believed_.clear();
  if (chains_.empty()) return {};
  const std::vector<PositionOnWay>& positions = chains_.front().positions;
  used_ = positions.size();
  const std::vector<bool> has_height = believed_heights(positions);
  const auto first = std::ranges::find(has_height, true);
  // What a height that is not believed is to be instead follows from the one before it.
  std::size_t known =
      first == has_height.end() ? 0 : static_cast<std::size_t>(first - has_height.begin());
  const Eigen::Vector3d up_odom = up_by_heights(positions);
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (has_height[i]) known = i;
    believed_.push_back(has_height[i] ? positions[i].measured
                                      : without_height(positions[i], positions[known], up_odom));
  }
  return believed_;
}

std::size_t PositionChains::disbelieved() const {
  std::size_t count = dropped_;
  for (std::size_t i = 1; i < chains_.size(); ++i) count += chains_[i].positions.size();
  return count;
}

}  // namespace stillmap
