#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/graph/earlier_map.hpp"
#include "core/graph/loop_closer.hpp"
#include "core/localization/localizer.hpp"

namespace stillmap {

/// A drive, or a map, that no earlier map was recognised by. The text says what was tried.
class MapNotRecognized : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct MapAlignmentConfig {
  /// Way between scans that are looked for in the whole map [m], and how many are at most.
  double localization_spacing_m = 10.0;
  std::size_t max_localizations = 100;
  /// So many of those that are found must agree on where the drive lies, to this, along with what
  /// the odometry may drift between them [m, rad]; they must be the most of those found.
  std::size_t min_agreeing = 2;
  double agreement_m = 0.8;
  double agreement_rad = 0.035;
  /// How submaps are looked for in the map; and what else odometry may have drifted by.
  EarlierMapConfig earlier;
  /// A closure that is farther than this from where the last one and odometry have it needs a
  /// second one that agrees to `second_agreement_m` and `second_agreement_rad`, among so many
  /// before it that jumped.
  double max_single_jump_m = 1.0;
  double second_agreement_m = 0.6;
  double second_agreement_rad = 0.02;
  std::size_t agreement_closures = 4;
  /// One that is higher or lower than this needs some, each of which agrees with the next, on so
  /// much of the plan: see LoopClosingConfig [m].
  double max_height_jump_m = 1.0;
  double level_extent_m = 80.0;
  /// The drive lies in the map when so many of its submaps do.
  std::size_t min_closures = 2;
  /// The graph may deny this share of the closures; where it denies more, odometry is trusted less.
  double max_denied = 0.2;
  /// Cauchy kernel, and the squared error above which the graph denies a closure: see
  /// LoopClosingConfig.
  double loop_scale = 2.5;
  double max_squared_error = 60.0;
};

/// A place of a drive that was found in an earlier map.
struct MapClosure {
  /// Number of the scan in the drive.
  std::size_t scan = 0;
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  /// As of a LoopClosure; the jump is against the closure that is nearest along the way.
  double fit = 0.0;
  double upright_fit = 0.0;
  double overlap = 0.0;
  double runner_up = 0.0;
  double jump_m = 0.0;
  /// Why it was not believed; empty where it was.
  std::string refusal;
};

/// Where a drive lies in an earlier map.
struct MapAlignment {
  /// Scans that were looked for in the whole map, and those of them that were found.
  std::size_t localized = 0;
  std::size_t found = 0;
  /// The most of those found that agree.
  std::size_t agreeing = 0;
  std::vector<MapClosure> closures;
  std::vector<MapClosure> refused;
  /// In the earlier map's frame, of all scans of the drive; empty where it was not recognised.
  std::vector<Eigen::Isometry3d> T_map_lidar;

  [[nodiscard]] bool is_recognized() const { return !T_map_lidar.empty(); }
  /// What was tried and found, for an error.
  [[nodiscard]] std::string in_words() const;
};

/// Finds a whole drive in an earlier map. Its scans are looked for in all of the map until some
/// agree; from there on, submap by submap, the drive is registered in what the map has near where
/// it is expected; and a pose graph joins both, with the map's frame as its fixed node. The map
/// stays as it is. The same drive and map give the same result. NOT thread safe.
class MapAligner {
 public:
  /// A scan of the drive, by its number, as it is looked for in the map.
  using ScanSource = std::function<LabelledScan(std::size_t scan)>;

  explicit MapAligner(std::shared_ptr<const PlaceIndex> map, const MapAlignmentConfig& config = {})
      : localizer_(map),
        map_([map](const Eigen::Vector2d& position_map,
                   double radius_m) { return map->points_near(position_map, radius_m); },
             config.earlier),
        config_(config) {}

  /// `drive` is finished. Throws what `scan_at` and the map's tiles throw.
  [[nodiscard]] MapAlignment align(const LoopCloser& drive, const ScanSource& scan_at,
                                   const Eigen::Matrix3d& R_body_lidar) const;

 private:
  /// A node of the drive whose pose in the map is known.
  struct Anchor {
    std::size_t node = 0;
    Eigen::Isometry3d T_map_node = Eigen::Isometry3d::Identity();
  };
  struct Found {
    MapClosure closure;
    Anchor anchor;
    PoseEdge edge;
    /// How much higher it is than where it was expected [m].
    double height_jump_m = 0.0;
  };
  /// Those that agree; none where these are too few, or as many say something else.
  [[nodiscard]] std::vector<Anchor> localize(const LoopCloser& drive, const ScanSource& scan_at,
                                             const Eigen::Matrix3d& R_body_lidar,
                                             MapAlignment& alignment) const;
  [[nodiscard]] bool agree(const LoopCloser& drive, const Anchor& a, const Anchor& b) const;
  /// The largest set with the last one in it that agree with it.
  [[nodiscard]] std::vector<Anchor> agreeing(const LoopCloser& drive,
                                             const std::vector<Anchor>& found) const;
  /// Registers the drive's submaps, from the anchors on, each from the nearest place that is known.
  [[nodiscard]] std::vector<Found> close(const LoopCloser& drive, std::vector<Anchor> anchors,
                                         MapAlignment& alignment) const;
  /// A submap that is to be looked for from a place that is known.
  struct NextSubmap {
    std::size_t submap = 0;
    Anchor nearest;
  };
  /// That of `open` which is the least way from any of the anchors; it is taken out.
  [[nodiscard]] static NextSubmap take_nearest(const LoopCloser& drive,
                                               const std::vector<Anchor>& anchors,
                                               std::vector<std::size_t>& open);
  [[nodiscard]] bool jumps(const Found& found) const {
    return found.closure.jump_m > config_.max_single_jump_m;
  }
  [[nodiscard]] bool leads_to_other_level(const Found& found) const {
    return std::abs(found.height_jump_m) > config_.max_height_jump_m;
  }
  /// Places in `waiting` of those that it is believed with, the last one first; none where they are
  /// too few.
  [[nodiscard]] std::vector<std::size_t> confirmed_by(const LoopCloser& drive, const Found& found,
                                                      const std::vector<Found>& waiting) const;
  /// Whether both put the drive at the same place.
  [[nodiscard]] bool confirm(const LoopCloser& drive, const Found& a, const Found& b) const;
  [[nodiscard]] std::optional<Found> match(const LoopCloser& drive, std::size_t submap,
                                           const Anchor& nearest) const;
  /// Poses of the drive's nodes, and the closures that the graph denies.
  struct Solution {
    std::vector<Eigen::Isometry3d> T_map_node;
    std::vector<Found> believed;
    std::vector<Found> denied;
  };
  /// With standard deviations of the odometry that are so many times larger.
  [[nodiscard]] Solution solve(const LoopCloser& drive, const std::vector<Found>& closures,
                               double odometry_scale) const;

  Localizer localizer_;
  EarlierMap map_;
  MapAlignmentConfig config_;
};

}  // namespace stillmap
