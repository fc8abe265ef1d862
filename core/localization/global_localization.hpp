#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/localization/localizer.hpp"
#include "core/odometry/odometry.hpp"

namespace stillmap {

struct GlobalLocalizationConfig {
  /// Scans whose evidence is put together where one alone does not tell.
  std::size_t max_scans = 5;
  /// A scan is evidence of its own from so far away on [m]; nearer, it takes the last one's place.
  double step_m = 1.0;
  /// Scans after the place was found that must come to it, before three deny it.
  int confirming_scans = 3;
  int contradicting_scans = 3;
  /// What they come to it within [m, rad].
  double same_m = 0.5;
  double same_rad = 0.035;
};

/// Finds a lidar in a map with no prior pose, from the scans that come (the kidnapped robot
/// problem): follows it by an odometry of its own, looks for single scans, puts the evidence of
/// several together where one is ambiguous, and lets the scans that follow confirm what was found.
class GlobalLocalization {
 public:
  GlobalLocalization(const OdometryConfig& odometry, const SensorModel& sensor,
                     const GlobalLocalizationConfig& config = {});

  /// Follows the lidar by one more scan; costs what odometry does. The scan is prepared and has its
  /// rings and times, if any. Where its motion cannot be told, all begins anew.
  void follow(const Scan& scan, const PointLabels& labels);

  enum class Outcome {
    /// No scan came since the last search.
    nothing_new,
    no_evidence,
    not_found,
    ambiguous,
    /// Found; the scans after it are to confirm it.
    found,
    confirming,
    /// They came to the same place: it is known.
    confirmed,
    /// They deny it: it is looked for anew.
    refused,
  };
  struct Regions {
    /// What is searched, instead of the whole map.
    std::optional<SearchRegion> searched{};
    /// Where the lidar most likely is: of several places that fit, the only one there is taken.
    std::optional<SearchRegion> expected{};
  };
  /// Looks for the last scan that was followed; or, where a place was found, whether that scan is
  /// there. Throws what the localizer does.
  Outcome search(const Localizer& localizer, const Eigen::Matrix3d& R_body_lidar,
                 const Regions& regions);
  Outcome search(const Localizer& localizer, const Eigen::Matrix3d& R_body_lidar) {
    return search(localizer, R_body_lidar, Regions{});
  }

  /// Scans that were looked for.
  [[nodiscard]] int scans_tried() const { return scans_tried_; }
  /// Score of the best place and of the next best, in the last search.
  [[nodiscard]] double best_score() const { return best_score_; }
  [[nodiscard]] double runner_up_score() const { return runner_up_score_; }

  /// A lidar whose place is known: where its odometry's frame is in the map, and that odometry.
  struct Place {
    Eigen::Isometry3d T_map_odom = Eigen::Isometry3d::Identity();
    Odometry odometry;
  };
  /// After `confirmed`; the search has ended with that.
  [[nodiscard]] Place take_place();

 private:
  /// Where the odometry's frame may be in the map, and what each scan of the window says of it.
  struct Hypothesis {
    Eigen::Isometry3d T_map_odom = Eigen::Isometry3d::Identity();
    std::vector<PoseEvidence> evidence;
    /// No scan of the window pins it.
    bool may_slide = false;
  };

  void forget_evidence();
  Outcome look_for(const Localizer& localizer, const LocalizationQuery& query,
                   const Regions& regions);
  /// Whether the last scan lies where it was found.
  Outcome confirm(const Localizer& localizer, const LocalizationQuery& query);
  /// The last scan enters the window.
  void move_window();
  void add_evidence(const Localizer& localizer, const LocalizationQuery& query,
                    std::vector<PlaceHypothesis> places);
  /// The window's hypotheses for the last scan, with mean evidence, the best first.
  [[nodiscard]] std::vector<PlaceHypothesis> mean_places() const;
  Outcome take_found(const Eigen::Isometry3d& T_map_lidar);

  SensorModel sensor_;
  GlobalLocalizationConfig config_;
  Odometry odometry_;
  /// The last scan, as if measured at its stamp.
  Scan scan_;
  PointLabels labels_;
  Eigen::Isometry3d T_odom_lidar_ = Eigen::Isometry3d::Identity();
  bool is_new_ = false;
  int scans_tried_ = 0;
  double best_score_ = 0.0;
  double runner_up_score_ = 0.0;
  /// Where the scans of the window were taken, and the hypotheses that they were asked of.
  std::vector<Eigen::Isometry3d> window_;
  std::vector<Hypothesis> hypotheses_;
  /// What was found, and who agrees.
  std::optional<Eigen::Isometry3d> T_map_odom_;
  int agreeing_scans_ = 0;
  int denying_scans_ = 0;
};

/// "found", "ambiguous", ...
[[nodiscard]] const char* name(GlobalLocalization::Outcome outcome);

}  // namespace stillmap
