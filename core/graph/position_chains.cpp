#include "core/graph/position_chains.hpp"

#include <algorithm>
#include <cmath>

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

double sigma_m(const PositionMeasurement& measured) {
  return horizontal_sigma_m(measured.information.inverse());
}

/// In plan, since heights say less. Odometry's z may not be up: then its plan is shorter, and its
/// whole length is no less.
bool goes_on(const PositionOnWay& last, const PositionOnWay& next) {
  const double measured_m =
      (next.measured.position_enu - last.measured.position_enu).head<2>().norm();
  const Eigen::Vector3d driven = next.point_odom - last.point_odom;
  const double way_m = next.way_m - last.way_m;
  double allowed_m = max_sigmas * std::hypot(sigma_m(last.measured), sigma_m(next.measured)) +
                     odometry_share_of_way * way_m;
  if (next.unconfirmed_scans > last.unconfirmed_scans)
    allowed_m += unconfirmed_m + unconfirmed_share_of_way * way_m;
  return measured_m >= driven.head<2>().norm() - allowed_m &&
         measured_m <= driven.norm() + allowed_m;
}

}  // namespace

double horizontal_sigma_m(const Eigen::Matrix3d& covariance_enu) {
  return std::sqrt(0.5 * covariance_enu.topLeftCorner<2, 2>().trace());
}

void PositionChains::extend(Chain& chain, const PositionOnWay& position) const {
  const double sigma = sigma_m(position.measured);
  const double spacing_m = std::max(spacing_m_, spacing_sigmas_ * sigma);
  if (position.way_m - chain.last.way_m >= spacing_m) {
    chain.positions.push_back(position.measured);
    chain.last = position;
    return;
  }
  // A receiver that has just got better is not bound by what it said before.
  constexpr double clearly_better = 0.5;
  const bool is_in_use = &chain == chains_.data() && chain.positions.size() <= used_;
  if (is_in_use || sigma >= clearly_better * sigma_m(chain.last.measured)) return;
  chain.positions.back() = position.measured;
  chain.last = position;
}

void PositionChains::add(const PositionOnWay& position) {
  const auto chain = std::ranges::find_if(
      chains_, [&](const Chain& known) { return goes_on(known.last, position); });
  if (chain == chains_.end()) {
    if (chains_.size() >= max_chains) {
      // The first one is the largest.
      const auto least = std::min_element(
          chains_.begin() + 1, chains_.end(),
          [](const Chain& a, const Chain& b) { return a.positions.size() < b.positions.size(); });
      dropped_ += least->positions.size();
      chains_.erase(least);
    }
    chains_.push_back({{position.measured}, position});
    return;
  }
  extend(*chain, position);
  if (chain->positions.size() <= chains_.front().positions.size()) return;
  std::iter_swap(chains_.begin(), chain);
  used_ = 0;
}

void PositionChains::clear() {
  chains_.clear();
  dropped_ = used_ = 0;
}

std::span<const PositionMeasurement> PositionChains::believed() {
  if (chains_.empty()) return {};
  used_ = chains_.front().positions.size();
  return chains_.front().positions;
}

std::size_t PositionChains::disbelieved() const {
  std::size_t count = dropped_;
  for (std::size_t i = 1; i < chains_.size(); ++i) count += chains_[i].positions.size();
  return count;
}

}  // namespace stillmap
