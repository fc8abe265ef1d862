#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/range_image.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/map/static_map.hpp"

namespace stillmap {

struct LabelPropagationConfig {
  /// A point takes the label of a point of the last labelled scan that is at most this far away,
  /// and this share of its range: rings lie far apart on distant ground.
  double max_distance_m = 1.0;
  double max_distance_share = 0.05;
  /// A movable thing within this distance counts more than what the map knows of the place.
  double movable_distance_m = 0.4;
  /// Factor on the confidence of labels that were not seen in this scan.
  float confidence_factor = 0.5F;
};

/// A scan with its labels, to be asked what was near a place.
class LabelledRangeImage {
 public:
  LabelledRangeImage(const Scan& scan, const PointLabels& labels,
                     const Eigen::Isometry3d& T_map_lidar, const SensorModel& sensor);

  struct Neighbour {
    SemanticClass label = SemanticClass::unlabeled;
    float confidence = 0.0F;
    float distance_m = 0.0F;
  };
  /// The nearest labelled point among those seen in about the direction of `point_map`, at most
  /// `max_distance_m` away.
  [[nodiscard]] std::optional<Neighbour> nearest(const Eigen::Vector3d& point_map,
                                                 double max_distance_m) const;

  /// False where nearest() finds no movable point.
  [[nodiscard]] bool may_be_near_movable(const Eigen::Vector3d& point_map) const;

 private:
  struct Pixel {
    Eigen::Vector3f point_lidar = Eigen::Vector3f::Zero();
    SemanticClass label = SemanticClass::unlabeled;
    /// A movable point is in the window round this pixel.
    bool near_movable = false;
    float confidence = 0.0F;
  };
  struct Direction {
    int row = 0;
    int column = 0;
    float range_m = 0.0F;
  };
  /// Calls `use` for each pixel at this distance, in pixels, round a direction.
  template <class Use>
  void for_ring(const Direction& centre, int ring, Use use) const;

  [[nodiscard]] Direction direction_of(const Eigen::Vector3f& point_lidar) const;
  void mark_near_movable();

  Eigen::Isometry3f T_lidar_map_;
  ProjectionModel projection_;
  std::vector<Pixel> pixels_;
};

/// Where the label of a point comes from.
enum class LabelOrigin : std::uint8_t { none, map, last_scan };

struct PropagatedLabels {
  PointLabels labels;
  /// One a point.
  std::vector<LabelOrigin> origin;
};

/// Labels for a scan that has none of its own: of the voxel that a point falls into, by the
/// evidence of all scans before; for points at places that the map does not know (movers, new
/// ground) and beside movable things, of the nearest point of the last labelled scan, where there
/// is one. `T_map_lidar` may be a prediction.
[[nodiscard]] PropagatedLabels propagate_labels(
    const Scan& scan, const Eigen::Isometry3d& T_map_lidar, const StaticMap& map,
    const std::optional<LabelledRangeImage>& last_labelled,
    const LabelPropagationConfig& config = {});

/// What the map may learn from propagated labels: not what it said itself. Confidence 0 there.
[[nodiscard]] PointLabels new_evidence(const PropagatedLabels& propagated);

}  // namespace stillmap
