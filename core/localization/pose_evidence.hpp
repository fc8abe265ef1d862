#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <utility>

#include "core/localization/localization_query.hpp"
#include "core/odometry/registration.hpp"

namespace stillmap {

/// What a scan and a map say of a pose, each of the other.
struct PoseEvidence {
  /// Share of what stands up in the scan that lies on the map: of all of it, or of what is too high
  /// to be traffic, whichever is more, as without labels traffic hides in it.
  double explained = 0.0;
  /// Of what stands up in the map and would be seen from there, the share that the scan shows; the
  /// rest it looks through.
  double confirmed = 0.0;
  /// Share of the scan's level points that lie on the map in height.
  double level = 0.0;
  /// Points that each share is of.
  int scan_points = 0;
  int map_points = 0;
  int level_points = 0;
  /// Share of what stands up in the scan that lies close to points of the map. Places that look
  /// alike fit roughly, the right one closely.
  double close = 0.0;
  /// What is too high to be traffic: of the map's, the share that the scan shows; times, of the
  /// scan's that has any of the map beside it, the share that lies on it. 1 where little is so
  /// high. Parked vehicles that came change neither, nor does the end of the map; of lorries that
  /// left, what was high counts as seen through.
  double high_agreed = 1.0;

  /// 0..1; low where any of them is.
  [[nodiscard]] double score() const { return explained * confirmed; }
  /// The same, of what is close. It tells more apart, but is low wherever the map is blurred or
  /// thin.
  [[nodiscard]] double close_score() const { return close * confirmed; }
};

/// Where a scan lies on the map's surfaces.
struct SurfacePose {
  Eigen::Isometry3d T_map_upright = Eigen::Isometry3d::Identity();
  /// It lies about as well some way on, in a direction that little of it shows.
  bool may_slide = false;
  /// Points aligned elsewhere, or tilted: one of both is wrong.
  bool is_elsewhere = false;
};

/// The map round a pose, to register a scan in.
class MapSurroundings {
 public:
  explicit MapSurroundings(std::span<const LabelledPoint> points_map);

  /// The pose that points align at, from a start near it; wherever they end where they do not.
  [[nodiscard]] Eigen::Isometry3d align(const LocalizationQuery& query,
                                        const Eigen::Isometry3d& T_map_upright) const;
  /// The pose that the scan's points lie on the map's surfaces at, from where points aligned. Those
  /// of two scans do not meet: on smooth walls the rings of a lidar lie best on those of the one
  /// that mapped them, and draw it to where that was. Nothing where the scan shows too few.
  [[nodiscard]] std::optional<SurfacePose> align_surfaces(
      const LocalizationQuery& query, const Eigen::Isometry3d& T_map_upright) const;
  [[nodiscard]] PoseEvidence evidence(const LocalizationQuery& query,
                                      const Eigen::Isometry3d& T_map_upright) const;
  /// Points of the scan that the map explains at the one pose and not at the other, and the other
  /// way round.
  [[nodiscard]] std::pair<int, int> explained_by_one(
      const LocalizationQuery& query, const Eigen::Isometry3d& T_map_upright_a,
      const Eigen::Isometry3d& T_map_upright_b) const;

 private:
  /// Each fills in its part; `T` is T_map_upright.
  void ask_map(const LocalizationQuery& query, const Eigen::Isometry3f& T,
               PoseEvidence& evidence) const;
  void ask_ground(const LocalizationQuery& query, const Eigen::Isometry3f& T,
                  PoseEvidence& evidence) const;
  /// Whether a point that the map does not explain lies level beside something of it: above its
  /// upper end, or between two of its rings, it says nothing.
  [[nodiscard]] bool is_beside(const Eigen::Vector3f& point_map) const;
  void ask_scan(const LocalizationQuery& query, const Eigen::Isometry3f& T,
                PoseEvidence& evidence) const;

  std::span<const LabelledPoint> points_map_;
  /// As `planes` of it.
  LocalMap map_;
};

}  // namespace stillmap
