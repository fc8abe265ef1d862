#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace stillmap {

// What drivers write into the fields of a point: their names, and the numbers in them.

/// Names under which the fields of a point may appear, in files and in PointCloud2 alike; the first
/// one that is there is taken. The defaults are those of the drivers of Velodyne, Ouster, Hesai,
/// Livox, RoboSense and Nebula. An Ouster's `intensity` counts photons while its `reflectivity` is
/// calibrated, so that comes first; a Livox's `line` is no ring, as its beams do not keep their
/// elevation.
///
/// A coordinate's name with "-" in front is the negative of that field: the points are to be in a
/// right-handed frame with x ahead, y to the left and z up, and simulators have others (CARLA: y to
/// the right; AirSim: y to the right and z down; Unity: y up, z ahead).
struct PointFieldNames {
  std::vector<std::string> x = {"x"};
  std::vector<std::string> y = {"y"};
  std::vector<std::string> z = {"z"};
  std::vector<std::string> intensity = {"reflectivity", "intensity", "i", "remission"};
  std::vector<std::string> ring = {"ring", "channel"};
  std::vector<std::string> time = {"time",       "t",           "timestamp",
                                   "time_stamp", "offset_time", "time_offset"};
  std::vector<std::string> label = {"label"};
};

/// A field that a coordinate is read from.
struct CoordinateField {
  std::string name;
  /// 1, or -1 where its negative is meant.
  float sign = 1.0F;
};
[[nodiscard]] CoordinateField coordinate_field(const std::string& name);

/// What takes points whose coordinates have no names but their order to the axes that `names` say:
/// each from the first name that is x, y or z, with or without "-". Names that take one of these
/// twice make no axes (are_axes()).
[[nodiscard]] Eigen::Matrix3f axes_by(const PointFieldNames& names);
[[nodiscard]] bool are_axes(const Eigen::Matrix3f& axes);

/// The motion T of a lidar along other axes, which may be mirrored: `axes` takes points from its
/// own to these.
[[nodiscard]] Eigen::Isometry3d about_other_axes(const Eigen::Isometry3d& T,
                                                 const Eigen::Matrix3d& axes);

/// "x from z, y from -x, z from y, ", or nothing where each is its own.
[[nodiscard]] std::string axes_in_words(const PointFieldNames& names);

/// Number type of a time field.
enum class TimeType { integer, float32, float64 };

/// Per-point times as `Scan::time_offset_s` has them, and how they were understood.
struct PointTimes {
  /// Seconds relative to the scan's stamp; not finite for points without a time of their own, and
  /// empty when the numbers cannot be times of one revolution.
  std::vector<float> offsets_s;
  /// For people: "ns from the stamp", "s since 1970", or why there are none.
  std::string remark;
};

/// Per-point times as drivers write them, converted to seconds relative to the scan's stamp.
///
/// Drivers write offsets (Velodyne, Ouster) or absolute times (Hesai, RoboSense, Livox), in s, ms,
/// us or ns. Integers are nanoseconds and others seconds, unless a scan would then take less than
/// 1 ms or more than 5 s and another unit makes it a revolution (5 ms to 5 s). The points' median
/// decides what is meant: those more than 10 s from it have no time (drivers write 0 where a packet
/// was lost), and are not moved. Offsets within 1 s of zero are kept as they are. Larger values are
/// absolute: the offset is then the distance to `stamp_ns` where that is the same clock (within
/// 1 s), else to the earliest point. A counter of 32 bits may begin anew within the scan. Absolute
/// times in 32-bit floats are 128 s apart and therefore none.
[[nodiscard]] PointTimes point_times(std::span<const double> times, TimeType type,
                                     std::int64_t stamp_ns);

/// Full scale of the intensities of a scan in the sensor's own numbers: 1, 255 or 65535, the
/// smallest that a few bright or broken values do not decide. Nothing finite gives 1.
[[nodiscard]] float intensity_full_scale(std::span<const float> intensity);

/// The factor that scales a sensor's intensity to 0..1, kept for a whole run, as single scans may
/// be dark, or broken.
class IntensityScale {
 public:
  /// As the sensor's description has it.
  explicit IntensityScale(float stated) : factor_(stated) {}

  /// Scales the values of one scan to 0..1. Scans that are brighter than the description allows
  /// for are scaled by a full scale of their own (255 or 65535), and so are the first ones with
  /// nothing but fractions up to 1. Five of them in a row correct the description for the rest of
  /// the run. Returns in words what is corrected, once for scans in a row, else nothing.
  [[nodiscard]] std::string apply(std::span<float> intensity);

 private:
  /// The full scale that the scan shows; nothing where it fits the factor.
  [[nodiscard]] std::optional<float> contradiction(std::vector<float>& sample) const;

  float factor_;
  /// No scan has fitted the description yet.
  bool is_first_ = true;
  /// Of the last scans, which contradict the description alike.
  float shown_full_scale_ = 0.0F;
  int scans_in_a_row_ = 0;
};

}  // namespace stillmap
