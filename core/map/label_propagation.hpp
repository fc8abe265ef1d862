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
  /// A point takes the label of a point of the last labelled scan at most this far away, plus this
  /// share of its range: rings lie far apart on distant ground.
  double max_distance_m = 1.0;
  double max_distance_share = 0.05;
  /// A movable point of the last labelled scan within this distance overrules the class of the map.
  double movable_distance_m = 0.4;
  /// Factor on the confidence of labels that were not seen in this scan.
  float confidence_factor = 0.5F;
};

/// A labelled scan as a range image, for look-ups of the nearest labelled point.
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

/// Labels for a scan without labels of its own. A point takes the class of its voxel in the map.
/// Where the map has none (moving objects, new ground), or beside movable points, it takes the
/// label of the nearest point of the last labelled scan, if there is one. `map` may be null,
/// `T_map_lidar` a prediction.
[[nodiscard]] PropagatedLabels propagate_labels(
    const Scan& scan, const Eigen::Isometry3d& T_map_lidar, const StaticMap* map,
    const std::optional<LabelledRangeImage>& last_labelled,
    const LabelPropagationConfig& config = {});

/// The labels as evidence for the map: confidence 0 for labels that came from the map itself, so
/// that it does not confirm itself.
[[nodiscard]] PointLabels new_evidence(const PropagatedLabels& propagated);

}  // namespace stillmap
