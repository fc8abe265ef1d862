#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/lidar/imu_mount.hpp"

namespace stillmap {

/// How the ring of a point is found when the scan does not carry it.
enum class RingSource { field, order, elevation };

/// How a lidar's points lie: on rings that beams turn along, anywhere (Livox), or as those of
/// several lidars that make one scan.
enum class ScanPattern { rings, irregular, merged };

/// What carries the lidar never exceeds. Poses beyond these are not believed; the defaults are
/// beyond any vehicle or hand.
struct MotionLimits {
  double max_speed_m_s = 100.0;
  double max_acceleration_m_s2 = 60.0;
  double max_turn_rate_rad_s = 12.566370614359172;  // 720 deg/s
};

/// Geometry of a lidar. Angles in radians, elevation positive upwards.
struct SensorModel {
  std::string name;
  int rings = 64;
  /// Upper and lower edge of the vertical field of view [rad], fov_down < fov_up. The beams lie
  /// inside, so that each falls into the middle of its row of the range image where the sensor
  /// allows it.
  double fov_up = 0.0;
  double fov_down = 0.0;
  /// Elevation of each beam from the highest to the lowest [rad]; empty: evenly spaced, each in
  /// the middle of its share of the field of view.
  std::vector<double> beam_elevations;
  /// What every elevation that it measures is too low by [rad].
  double elevation_offset = 0.0;
  /// Range image of this sensor: columns over 360 degrees (rows = rings).
  int columns = 1024;
  double min_range_m = 0.5;
  double max_range_m = 120.0;
  /// Seconds a revolution takes.
  double period_s = 0.1;
  ScanPattern pattern = ScanPattern::rings;
  /// What to use when a scan has no ring field; `field` then means elevation.
  RingSource ring_source = RingSource::elevation;
  /// Factor that brings the intensity of a live cloud to 0..1 (1/255 for a Velodyne's PointCloud2).
  /// Files read through ScanDataset are 0..1 already.
  float intensity_scale = 1.0F;
  /// Of the IMU whose samples come beside the scans. Where it is not known, the IMU is taken to
  /// have the lidar's axes as far as that proves true, and tells nothing of gravity.
  std::optional<ImuMount> imu;
  MotionLimits motion_limits;

  /// Every fault in words, one a line; empty when the model can be used.
  [[nodiscard]] std::string faults() const;

  /// Elevation of a beam [rad], 0 <= ring < rings.
  [[nodiscard]] double beam_elevation(int ring) const;
};

/// Velodyne HDL-64E as KITTI used it: field of view +3..-25 degrees (real scans reach +2.9, and the
/// published RangeNet++ weights are trained with these edges), intensity 0..1, points of a file
/// stored ring after ring.
[[nodiscard]] SensorModel hdl_64e();
/// Velodyne HDL-32E: beams from +10.67 to -30.67 degrees, 4/3 degrees apart.
[[nodiscard]] SensorModel hdl_32e();
/// Velodyne VLP-16: beams from +15 to -15 degrees, 2 degrees apart.
[[nodiscard]] SensorModel vlp_16();

}  // namespace stillmap
