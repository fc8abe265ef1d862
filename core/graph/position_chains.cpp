#include "core/graph/position_chains.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>

#include "core/lidar/ranked_value.hpp"

namespace stillmap {
namespace {

/// Odometry errs by less, as a share of the way, and where it could not confirm scans on it.
constexpr double odometry_share_of_way = 0.15;
constexpr double unconfirmed_share_of_way = 0.5;
constexpr double unconfirmed_m = 2.0;
/// On so little way odometry errs by less than that, as a share of it.
constexpr double short_way_m = 40.0;
constexpr double share_of_short_way = 0.02;
/// So many positions tell how odometry lies on the earth, and so many which direction is up.
constexpr std::size_t min_foretelling = 6;
constexpr std::size_t max_foretelling = 10;
constexpr std::size_t levelling_count = 60;
/// Of a level frame against so few: on flat ground their noise would have it upside down.
constexpr double level_weight_of_few = 1.0;
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

/// By how much heights of both may differ [m].
double allowed_of_heights_m(const PositionOnWay& last, const PositionOnWay& next) {
  return max_sigmas *
         std::sqrt(height_variance_m2(last.measured) + height_variance_m2(next.measured));
}

/// How far the one height may be off the other and the way between them [m].
double allowed_height_m(const PositionOnWay& last, const PositionOnWay& next) {
  return allowed_of_heights_m(last, next) + allowed_of_way_m(last, next);
}

/// The direction in which the heights rise from one position to the next, in odometry's frame.
/// Steps between them are few: least squares, reweighted by Cauchy's kernel. What the way does not
/// show of it is that of a level frame.
Eigen::Vector3d up_by_heights(std::span<const PositionOnWay> positions,
                              double level_weight = 1e-3) {
  constexpr int iterations = 10;
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

/// Where the newest positions of a chain have a point of odometry in plan: least squares,
/// reweighted by Cauchy's kernel, since of them some may be reflections, too.
Eigen::Vector2d foretold(std::span<const PositionOnWay> newest, const Eigen::Matrix3d& level,
                         const Eigen::Vector3d& point_odom) {
  constexpr int iterations = 10;
  std::vector<double> weights(newest.size(), 1.0);
  Eigen::Isometry2d enu_from_odom = Eigen::Isometry2d::Identity();
  for (int iteration = 0; iteration < iterations; ++iteration) {
    double sum = 0.0, along = 0.0, across = 0.0;
    Eigen::Vector2d mean_odom = Eigen::Vector2d::Zero(), mean_enu = mean_odom;
    for (std::size_t k = 0; k < newest.size(); ++k) {
      sum += weights[k];
      mean_odom += weights[k] * (level * newest[k].point_odom).head<2>();
      mean_enu += weights[k] * newest[k].measured.position_enu.head<2>();
    }
    mean_odom /= sum;
    mean_enu /= sum;
    for (std::size_t k = 0; k < newest.size(); ++k) {
      const Eigen::Vector2d odom = (level * newest[k].point_odom).head<2>() - mean_odom;
      const Eigen::Vector2d enu = newest[k].measured.position_enu.head<2>() - mean_enu;
      along += weights[k] * odom.dot(enu);
      across += weights[k] * (odom.x() * enu.y() - odom.y() * enu.x());
    }
    enu_from_odom.linear() = Eigen::Rotation2Dd(std::atan2(across, along)).toRotationMatrix();
    enu_from_odom.translation() = mean_enu - enu_from_odom.linear() * mean_odom;
    for (std::size_t k = 0; k < newest.size(); ++k) {
      const Eigen::Vector2d odom = (level * newest[k].point_odom).head<2>();
      const double off = (enu_from_odom * odom - newest[k].measured.position_enu.head<2>()).norm() /
                         (max_sigmas * sigma_m(newest[k].measured));
      weights[k] = 1.0 / (1.0 + off * off);
    }
  }
  return enu_from_odom * (level * point_odom).head<2>();
}

/// Whether the newest positions of a chain foretell the next one in plan, after not more way than
/// this: far more closely than the distance from the last one alone, and to each side as well.
bool foretells(std::span<const PositionOnWay> chain, const PositionOnWay& next, double max_way_m) {
  const PositionOnWay& last = chain.back();
  const double way_m = next.way_m - last.way_m;
  if (chain.size() < min_foretelling || way_m > max_way_m) return false;
  const Eigen::Vector3d up_odom =
      up_by_heights(chain.last(std::min(chain.size(), levelling_count)), level_weight_of_few);
  const Eigen::Matrix3d level =
      Eigen::Quaterniond::FromTwoVectors(up_odom, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Vector2d expected =
      foretold(chain.last(std::min(chain.size(), max_foretelling)), level, next.point_odom);
  return (next.measured.position_enu.head<2>() - expected).norm() <=
         max_sigmas * std::hypot(sigma_m(last.measured), sigma_m(next.measured)) +
             share_of_short_way * way_m;
}

/// How much higher the receiver has a position than odometry, in the one's frame [m].
double height_off_m(const PositionOnWay& position, const Eigen::Vector3d& up_odom) {
  return position.measured.position_enu.z() - up_odom.dot(position.point_odom);
}

/// Numbers of positions whose heights follow each other, as PositionChains has them.
using HeightChains = std::vector<std::vector<std::size_t>>;

/// The chain that the height of position i goes on; the end of them where it begins one. The newest
/// one is the last. A larger one has it where that foretells it: as in plan, what an outlier or a
/// reflection took along comes back.
HeightChains::iterator height_chain_before(HeightChains& chains,
                                           std::span<const PositionOnWay> positions, std::size_t i,
                                           const Eigen::Vector3d& up_odom) {
  const PositionOnWay& next = positions[i];
  const auto off_m = [&](const std::vector<std::size_t>& chain) {
    return std::abs(height_off_m(next, up_odom) - height_off_m(positions[chain.back()], up_odom));
  };
  const auto newest =
      std::find_if(chains.rbegin(), chains.rend(), [&](const std::vector<std::size_t>& chain) {
        return off_m(chain) <= allowed_height_m(positions[chain.back()], next);
      });
  if (newest == chains.rend()) return chains.end();
  auto best = std::prev(newest.base());
  const double max_way_m = short_way_m + (i > 0 ? next.way_m - positions[i - 1].way_m : 0.0);
  for (auto chain = chains.begin(); chain != chains.end(); ++chain) {
    const PositionOnWay& last = positions[chain->back()];
    const double way_m = next.way_m - last.way_m;
    if (chain->size() > best->size() && way_m <= max_way_m &&
        off_m(*chain) <= allowed_of_heights_m(last, next) + share_of_short_way * way_m)
      best = chain;
  }
  return best;
}

/// The position with a height that says nothing, and lies where odometry has it, so much higher.
PositionMeasurement without_height(const PositionOnWay& position, double off_m,
                                   const Eigen::Vector3d& up_odom) {
  PositionMeasurement measured = position.measured;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  covariance.topLeftCorner<2, 2>() = measured.information.inverse().topLeftCorner<2, 2>();
  covariance(2, 2) = unknown_sigma_m * unknown_sigma_m;
  measured.information = covariance.inverse();
  measured.position_enu.z() = off_m + up_odom.dot(position.point_odom);
  return measured;
}

/// The middle one of all positions, of which one alone may be far off [m]. They are not none.
double median_height_off_m(std::span<const PositionOnWay> positions,
                           const Eigen::Vector3d& up_odom) {
  std::vector<double> off_m;
  off_m.reserve(positions.size());
  for (const PositionOnWay& position : positions) off_m.push_back(height_off_m(position, up_odom));
  return median_of(off_m);
}

}  // namespace

double horizontal_sigma_m(const Eigen::Matrix3d& covariance_enu) {
  return std::sqrt(0.5 * covariance_enu.topLeftCorner<2, 2>().trace());
}

std::vector<bool> believed_heights(std::span<const PositionOnWay> positions) {
  const Eigen::Vector3d up_odom = up_by_heights(positions);
  HeightChains chains;
  std::size_t jumps = 0;
  bool has_just_jumped = false;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const auto chain = height_chain_before(chains, positions, i, up_odom);
    // There and back at once, as a single height that is off, is one jump.
    const bool is_newest = chain != chains.end() && std::next(chain) == chains.end();
    has_just_jumped = !is_newest && !chains.empty() && !has_just_jumped;
    if (has_just_jumped) ++jumps;
    if (chain == chains.end()) {
      if (chains.size() >= max_chains)
        chains.erase(std::ranges::min_element(chains, {}, &std::vector<std::size_t>::size));
      chains.push_back({i});
      continue;
    }
    chain->push_back(i);
    std::rotate(chain, std::next(chain), chains.end());
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
  // What an outlier or a reflection took along, as it set in at once and faded, comes back. The
  // first one is the largest.
  const std::size_t count = newest == chains_.end() ? 0 : newest->positions.size();
  const double max_way_m =
      short_way_m + std::max(spacing_m_, spacing_sigmas_ * sigma_m(position.measured));
  const auto larger = std::ranges::find_if(chains_, [&](const Chain& chain) {
    return chain.positions.size() > count && foretells(chain.positions, position, max_way_m);
  });
  return larger == chains_.end() ? newest : larger;
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
  const Eigen::Vector3d up_odom = up_by_heights(positions);
  // What a height that is not believed is to be instead follows from the one before it.
  double off_m =
      first == has_height.end()
          ? median_height_off_m(positions, up_odom)
          : height_off_m(positions[static_cast<std::size_t>(first - has_height.begin())], up_odom);
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (has_height[i]) off_m = height_off_m(positions[i], up_odom);
    believed_.push_back(has_height[i] ? positions[i].measured
                                      : without_height(positions[i], off_m, up_odom));
  }
  return believed_;
}

std::size_t PositionChains::disbelieved() const {
  std::size_t count = dropped_;
  for (std::size_t i = 1; i < chains_.size(); ++i) count += chains_[i].positions.size();
  return count;
}

}  // namespace stillmap
