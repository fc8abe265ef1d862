#include "core/geodesy/gnss_delay.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/lidar/ranked_value.hpp"

namespace stillmap {
namespace {

using Matrix23 = Eigen::Matrix<double, 2, 3>;

/// Of a stretch: long enough for a turn, short enough for odometry not to drift [m].
constexpr double min_stretch_m = 100.0;
constexpr std::size_t min_stretch_fixes = 12;
/// Of its fixes, where they are put by a delay, so many lie on the way: of half of a stretch
/// anything fits better than of all of it.
constexpr double min_known_share = 0.9;
/// Fixes of a stretch lie so far apart at least, and so many standard deviations [m].
constexpr double min_spacing_m = 1.0;
constexpr double spacing_sigmas = 1.0;
/// Where a robot stands tells as much as where it drives, but not more the longer it does.
constexpr std::int64_t standing_apart_ns = 1'000'000'000;
constexpr int max_standing = 5;
/// Where the kernel begins to take a fix for a reflection: odometry errs, too [m].
constexpr double min_kernel_m = 0.3;
constexpr double coarse_step_s = 0.5;
/// Speed is that over so long: from scan to scan the noise of odometry is taken for changes of it,
/// and for knowledge of a delay on a way that has none.
constexpr double velocity_window_s = 1.0;
constexpr double fine_step_s = 0.05;
/// Errors of so many neighbouring fixes are the same.
constexpr double correlated_fixes = 10.0;
/// Of a delay of seconds, in all, for each fix, and as a share of what there is to gain: it puts
/// what turns off the way by tens of metres. What lies on the way without it denies it; who seldom
/// turns shows it in few stretches.
constexpr double min_gain = 5.0;
constexpr double min_gain_of_fix = 0.02;
constexpr double min_gain_share = 0.1;
/// Of delays that gain so much of what the best one does, the shortest is the one: a way that goes
/// on as it went fits itself a bend later, too.
constexpr double as_good_share = 0.95;
/// One stretch alone could be a fault of the receiver.
constexpr double min_stretches = 2.0;

/// A delay, or an antenna, is another one by so much, and so many standard deviations. One that is
/// known to be there is found out better.
constexpr double min_delay_s = 0.02;
constexpr double min_antenna_m = 0.3;
constexpr double sigmas_of_another = 4.0;
constexpr double sigmas_of_better = 2.0;

/// Of the way at one time.
struct Place {
  Eigen::Vector2d antenna_odom = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity_odom = Eigen::Vector2d::Zero();
  Eigen::Matrix2d axes_odom = Eigen::Matrix2d::Identity();
  bool is_known = false;
};

/// Where one stretch of the way lies, and how well that fits.
struct StretchFit {
  Eigen::Matrix2d R_enu_odom = Eigen::Matrix2d::Identity();
  Eigen::Vector2d t_enu_odom = Eigen::Vector2d::Zero();
};

Place place_at(std::span<const PlanPose> way, std::int64_t stamp_ns) {
  const auto after = std::ranges::lower_bound(way, stamp_ns, {}, &PlanPose::stamp_ns);
  if (after == way.end() || after == way.begin()) return {};
  const PlanPose& before = *std::prev(after);
  const Eigen::Vector2d step = after->antenna_odom - before.antenna_odom;
  const std::int64_t gap_ns = after->stamp_ns - before.stamp_ns;
  if (is_gap(gap_ns, step.norm())) return {};
  const double share =
      static_cast<double>(stamp_ns - before.stamp_ns) / static_cast<double>(gap_ns);
  return {before.antenna_odom + share * step, Eigen::Vector2d::Zero(),
          share < 0.5 ? before.axes_odom : after->axes_odom, true};
}

/// The fixes by stretches, and what is asked of them.
class Stretches {
 public:
  Stretches(std::span<const PlanPose> way, std::span<const PlanFix> fixes,
            const GnssDelayConfig& config)
      : way_(way), config_(config) {
    double way_m = 0.0;
    std::size_t begun = 0;
    int standing = 0;
    for (const PlanFix& fix : fixes) {
      if (!fixes_.empty()) {
        const double step_m = (fix.position_enu - fixes_.back().position_enu).norm();
        if (step_m < std::max(min_spacing_m, spacing_sigmas * fix.sigma_m)) {
          if (fix.stamp_ns - fixes_.back().stamp_ns < standing_apart_ns) continue;
          if (++standing > max_standing) continue;
        } else {
          standing = 0;
          way_m += step_m;
        }
      }
      fixes_.push_back(fix);
      if (way_m < min_stretch_m || fixes_.size() - begun < min_stretch_fixes) continue;
      ends_.push_back(fixes_.size());
      begun = fixes_.size();
      way_m = 0.0;
    }
    std::vector<double> sigmas;
    for (const PlanFix& fix : fixes_) sigmas.push_back(fix.sigma_m);
    kernel_m_ = sigmas.empty() ? min_kernel_m : std::max(min_kernel_m, median_of(sigmas));
  }

  [[nodiscard]] std::size_t size() const { return ends_.size(); }

  /// Cost of each fix under the best place of its stretch; NaN of those off the way.
  [[nodiscard]] std::vector<double> costs(double delay_s) const {
    std::vector<double> costs(fixes_.size(), std::nan(""));
    const auto places = places_at(delay_s);
    for (std::size_t k = 0; k < ends_.size(); ++k) {
      const auto stretch = fit(places, k, Eigen::Vector2d::Zero());
      if (!stretch) continue;
      for (std::size_t i = begin(k); i < ends_[k]; ++i) {
        if (!places[i].is_known) continue;
        costs[i] =
            std::log1p(residual(*stretch, places[i], i, Eigen::Vector2d::Zero()).squaredNorm() /
                       (kernel_m_ * kernel_m_));
      }
    }
    return costs;
  }

  /// From there to the best delay, and the best antenna.
  [[nodiscard]] std::optional<GnssDelay> refined(double delay_s) const {
    constexpr int steps = 12;
    constexpr double max_step_s = 0.1;
    GnssDelay found{.delay_s = delay_s};
    for (int step = 0; step < steps; ++step) {
      const auto equations = normal_equations(found);
      if (!equations) return std::nullopt;
      const Eigen::Vector3d by = equations->solution;
      found.delay_s += std::clamp(by[0], -max_step_s, max_step_s);
      if (config_.antenna_sigma_m > 0.0) found.antenna_lidar += by.tail<2>();
      found.sigma_s = equations->sigmas[0];
      if (config_.antenna_sigma_m > 0.0) found.antenna_sigma_m = equations->sigmas.tail<2>().norm();
    }
    if (!(std::abs(found.delay_s - delay_s) <= 2.0 * coarse_step_s)) return std::nullopt;
    return found;
  }

 private:
  struct Equations {
    Eigen::Vector3d solution = Eigen::Vector3d::Zero();
    /// Standard deviations.
    Eigen::Vector3d sigmas = Eigen::Vector3d::Zero();
  };
  /// What fixes say of delay and antenna, the place being eliminated.
  struct Reduced {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    /// Sums over the fixes: of weighted squared residuals, and of the weights.
    double squared_m2 = 0.0;
    double weights = 0.0;
  };

  [[nodiscard]] std::size_t begin(std::size_t stretch) const {
    return stretch == 0 ? 0 : ends_[stretch - 1];
  }

  [[nodiscard]] std::vector<Place> places_at(double delay_s) const {
    const std::int64_t delay_ns = std::llround(delay_s * 1e9);
    std::vector<Place> places;
    places.reserve(fixes_.size());
    for (const PlanFix& fix : fixes_) places.push_back(place_at(way_, fix.stamp_ns - delay_ns));
    return places;
  }

  /// The same with their velocities.
  [[nodiscard]] std::vector<Place> moving_places_at(double delay_s) const {
    std::vector<Place> places = places_at(delay_s);
    const std::vector<Place> before = places_at(delay_s + 0.5 * velocity_window_s);
    const std::vector<Place> after = places_at(delay_s - 0.5 * velocity_window_s);
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (!before[i].is_known || !after[i].is_known) continue;
      places[i].velocity_odom =
          (after[i].antenna_odom - before[i].antenna_odom) / velocity_window_s;
    }
    return places;
  }

  [[nodiscard]] Eigen::Vector2d residual(const StretchFit& stretch, const Place& place,
                                         std::size_t fix,
                                         const Eigen::Vector2d& antenna_lidar) const {
    return fixes_[fix].position_enu -
           stretch.R_enu_odom * (place.antenna_odom + place.axes_odom * antenna_lidar) -
           stretch.t_enu_odom;
  }

  [[nodiscard]] double weight(const Eigen::Vector2d& residual_m) const {
    return 1.0 / (1.0 + residual_m.squaredNorm() / (kernel_m_ * kernel_m_));
  }

  /// Closed form in the plane, reweighted. Nothing where fixes are off the way.
  [[nodiscard]] std::optional<StretchFit> fit(const std::vector<Place>& places, std::size_t stretch,
                                              const Eigen::Vector2d& antenna_lidar) const {
    constexpr int iterations = 4;
    std::vector<std::size_t> known;
    for (std::size_t i = begin(stretch); i < ends_[stretch]; ++i)
      if (places[i].is_known) known.push_back(i);
    if (static_cast<double>(known.size()) <
        min_known_share * static_cast<double>(ends_[stretch] - begin(stretch)))
      return std::nullopt;
    std::vector<double> weights(known.size(), 1.0);
    StretchFit found;
    for (int iteration = 0; iteration < iterations; ++iteration) {
      Eigen::Vector2d middle_odom = Eigen::Vector2d::Zero(), middle_enu = Eigen::Vector2d::Zero();
      double sum = 0.0, along = 0.0, across = 0.0;
      const auto point_odom = [&](std::size_t i) -> Eigen::Vector2d {
        return places[i].antenna_odom + places[i].axes_odom * antenna_lidar;
      };
      for (std::size_t k = 0; k < known.size(); ++k) {
        middle_odom += weights[k] * point_odom(known[k]);
        middle_enu += weights[k] * fixes_[known[k]].position_enu;
        sum += weights[k];
      }
      middle_odom /= sum;
      middle_enu /= sum;
      for (std::size_t k = 0; k < known.size(); ++k) {
        const Eigen::Vector2d a = point_odom(known[k]) - middle_odom;
        const Eigen::Vector2d b = fixes_[known[k]].position_enu - middle_enu;
        along += weights[k] * a.dot(b);
        across += weights[k] * (a.x() * b.y() - a.y() * b.x());
      }
      found.R_enu_odom = Eigen::Rotation2D<double>(std::atan2(across, along)).toRotationMatrix();
      found.t_enu_odom = middle_enu - found.R_enu_odom * middle_odom;
      for (std::size_t k = 0; k < known.size(); ++k)
        weights[k] = weight(residual(found, places[known[k]], known[k], antenna_lidar));
    }
    return found;
  }

  /// What one stretch says that lies there.
  [[nodiscard]] Reduced reduced(const std::vector<Place>& places, std::size_t stretch,
                                const StretchFit& lies, const Eigen::Vector2d& antenna_lidar) const;
  /// Adds what is known of the antenna.
  void restrain_antenna(Reduced& all, double variance_m2,
                        const Eigen::Vector2d& antenna_lidar) const;
  /// By what the stretches contradict each other; nothing where one alone tells.
  [[nodiscard]] static std::optional<Eigen::Vector3d> variance_between(
      const std::vector<Reduced>& stretches, const Eigen::Matrix3d& covariance,
      const Eigen::Vector3d& solution);
  /// Of delay and antenna, the place of every stretch being eliminated. The delay's variance is
  /// the larger of what the residuals and of what the differences between stretches say.
  [[nodiscard]] std::optional<Equations> normal_equations(const GnssDelay& at) const;

  std::span<const PlanPose> way_;
  GnssDelayConfig config_;
  std::vector<PlanFix> fixes_;
  /// After the last fix of each stretch.
  std::vector<std::size_t> ends_;
  double kernel_m_ = min_kernel_m;
};

Stretches::Reduced Stretches::reduced(const std::vector<Place>& places, std::size_t stretch,
                                      const StretchFit& lies,
                                      const Eigen::Vector2d& antenna_lidar) const {
  Reduced reduced;
  Eigen::Matrix3d H_place = Eigen::Matrix3d::Zero(), H_both = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b_place = Eigen::Vector3d::Zero();
  for (std::size_t i = begin(stretch); i < ends_[stretch]; ++i) {
    if (!places[i].is_known) continue;
    const Eigen::Vector2d r = residual(lies, places[i], i, antenna_lidar);
    const double w = weight(r);
    const Eigen::Vector2d turned = fixes_[i].position_enu - r - lies.t_enu_odom;
    Matrix23 J_own, J_place;
    J_own << -lies.R_enu_odom * places[i].velocity_odom, lies.R_enu_odom * places[i].axes_odom;
    J_place << Eigen::Vector2d(-turned.y(), turned.x()), Eigen::Matrix2d::Identity();
    reduced.information += w * J_own.transpose() * J_own;
    reduced.gradient += w * J_own.transpose() * r;
    H_both += w * J_own.transpose() * J_place;
    H_place += w * J_place.transpose() * J_place;
    b_place += w * J_place.transpose() * r;
    reduced.squared_m2 += w * r.squaredNorm();
    reduced.weights += w;
  }
  const Eigen::Matrix3d eliminated = H_place.ldlt().solve(H_both.transpose()).transpose();
  reduced.information -= eliminated * H_both.transpose();
  reduced.gradient -= eliminated * b_place;
  return reduced;
}

void Stretches::restrain_antenna(Reduced& all, double variance_m2,
                                 const Eigen::Vector2d& antenna_lidar) const {
  if (config_.antenna_sigma_m > 0.0) {
    const double prior =
        correlated_fixes * variance_m2 / (config_.antenna_sigma_m * config_.antenna_sigma_m);
    all.information.diagonal().tail<2>().array() += prior;
    all.gradient.tail<2>() -= prior * antenna_lidar;
    return;
  }
  Eigen::Matrix3d& H = all.information;
  H.row(1).setZero(), H.col(1).setZero(), H.row(2).setZero(), H.col(2).setZero();
  H(1, 1) = H(2, 2) = 1.0;
  all.gradient.tail<2>().setZero();
}

std::optional<Eigen::Vector3d> Stretches::variance_between(const std::vector<Reduced>& stretches,
                                                           const Eigen::Matrix3d& covariance,
                                                           const Eigen::Vector3d& solution) {
  Eigen::Vector3d between = Eigen::Vector3d::Zero();
  double sum = 0.0, sum_of_squares = 0.0;
  const Eigen::Vector3d row = covariance.row(0);
  for (const Reduced& one : stretches) {
    between += (covariance * (one.gradient - one.information * solution)).cwiseAbs2();
    const double share = row.dot(one.information * row) / covariance(0, 0);
    sum += share;
    sum_of_squares += share * share;
  }
  const double count = sum * sum / sum_of_squares;
  if (count < min_stretches) return std::nullopt;
  return between * count / (count - 1.0);
}

std::optional<Stretches::Equations> Stretches::normal_equations(const GnssDelay& at) const {
  const auto places = moving_places_at(at.delay_s);
  std::vector<Reduced> stretches;
  Reduced all;
  for (std::size_t k = 0; k < ends_.size(); ++k) {
    const auto lies = fit(places, k, at.antenna_lidar);
    if (!lies) continue;
    const Reduced& one = stretches.emplace_back(reduced(places, k, *lies, at.antenna_lidar));
    all.information += one.information;
    all.gradient += one.gradient;
    all.squared_m2 += one.squared_m2;
    all.weights += one.weights;
  }
  if (stretches.empty()) return std::nullopt;
  const double variance_m2 = all.squared_m2 / all.weights;
  restrain_antenna(all, variance_m2, at.antenna_lidar);
  // Too little information to divide by, as on one straight way.
  constexpr double least_m2_per_s2 = 1e-6;
  const Eigen::Matrix3d covariance = all.information.inverse();
  if (!covariance.allFinite() || !(covariance(0, 0) * least_m2_per_s2 < 1.0)) return std::nullopt;
  Equations equations{.solution = covariance * all.gradient};
  const auto between = variance_between(stretches, covariance, equations.solution);
  if (!between) return std::nullopt;
  const Eigen::Vector3d within = correlated_fixes * variance_m2 * covariance.diagonal();
  equations.sigmas = between->cwiseMax(within).cwiseSqrt();
  return equations;
}

/// What the fixes cost less by the one than by the other, of those that lie on the way by both.
double gain(const std::vector<double>& from, const std::vector<double>& to) {
  double sum = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i)
    if (!std::isnan(from[i]) && !std::isnan(to[i])) sum += from[i] - to[i];
  return sum;
}

struct Candidate {
  double delay_s = 0.0;
  double gain = 0.0;
};

template <typename GainOf>
Candidate best_near(double about_s, const GainOf& gain_of) {
  const auto steps = static_cast<int>(coarse_step_s / fine_step_s);
  Candidate best{about_s, gain_of(about_s)};
  for (int k = -steps; k <= steps; ++k) {
    const double delay_s = about_s + k * fine_step_s;
    const double gained = gain_of(delay_s);
    if (gained > best.gain) best = {delay_s, gained};
  }
  return best;
}

}  // namespace

std::optional<GnssDelay> estimate_delay(std::span<const PlanPose> way,
                                        std::span<const PlanFix> fixes,
                                        const GnssDelayConfig& config) {
  const Stretches stretches(way, fixes, config);
  if (stretches.size() < 2) return std::nullopt;
  const std::vector<double> without = stretches.costs(0.0);
  const auto gain_of = [&](double delay_s) { return gain(without, stretches.costs(delay_s)); };
  const auto coarse = static_cast<int>(config.max_delay_s / coarse_step_s);
  std::vector<double> gains;
  for (int k = -coarse; k <= coarse; ++k) gains.push_back(gain_of(k * coarse_step_s));
  // Who drives the same round again and again fits about as well a round later.
  const double total = gain(without, std::vector<double>(without.size(), 0.0));
  const double least = std::max({min_gain, min_gain_of_fix * static_cast<double>(without.size()),
                                 min_gain_share * total, 0.5 * *std::ranges::max_element(gains)});
  std::vector<Candidate> candidates{best_near(0.0, gain_of)};
  for (std::size_t k = 1; k + 1 < gains.size(); ++k) {
    if (gains[k] < least || gains[k] < gains[k - 1] || gains[k] < gains[k + 1]) continue;
    candidates.push_back(best_near((static_cast<double>(k) - coarse) * coarse_step_s, gain_of));
  }
  const double most = std::ranges::max(candidates, {}, &Candidate::gain).gain;
  double best_s = std::numeric_limits<double>::infinity();
  for (const Candidate& candidate : candidates) {
    if (candidate.gain >= as_good_share * most && std::abs(candidate.delay_s) < std::abs(best_s))
      best_s = candidate.delay_s;
  }
  return stretches.refined(best_s);
}

std::optional<GnssDelay> revised(const GnssDelay& known, GnssDelay found) {
  const auto is_another = [](double by, double least, double sigma, bool is_known) {
    return by > std::max(least, (is_known ? sigmas_of_better : sigmas_of_another) * sigma);
  };
  const bool knows_delay = known.delay_s != 0.0, knows_antenna = !known.antenna_lidar.isZero();
  const bool is_other_delay =
      is_another(std::abs(found.delay_s - known.delay_s), min_delay_s, found.sigma_s, knows_delay);
  const bool is_other_antenna = is_another((found.antenna_lidar - known.antenna_lidar).norm(),
                                           min_antenna_m, found.antenna_sigma_m, knows_antenna);
  if (!is_other_delay && !is_other_antenna) return std::nullopt;
  if ((is_other_delay || !knows_delay) &&
      !is_another(std::abs(found.delay_s), min_delay_s, found.sigma_s, false))
    found.delay_s = 0.0;
  if ((is_other_antenna || !knows_antenna) &&
      !is_another(found.antenna_lidar.norm(), min_antenna_m, found.antenna_sigma_m, false))
    found.antenna_lidar.setZero();
  return found;
}

}  // namespace stillmap
