#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "core/lidar/scan.hpp"

namespace stillmap {

// All functions that take a file throw DatasetError.

/// A KITTI .bin: x, y, z, remission (0..1) as float32 for each point. Points are taken as they
/// are, finite or not; an empty file is an empty scan.
[[nodiscard]] Scan read_kitti_bin(const std::filesystem::path& file);
void write_kitti_bin(const std::filesystem::path& file, const Scan& scan);

/// A SemanticKITTI .label: class in the low 16 bits, instance in the high 16 bits of each point.
/// Must have `points` entries.
[[nodiscard]] std::vector<std::uint32_t> read_kitti_labels(const std::filesystem::path& file,
                                                           std::size_t points);
void write_kitti_labels(const std::filesystem::path& file, std::span<const std::uint32_t> labels);

/// The network's class of each raw label.
[[nodiscard]] std::vector<SemanticClass> reduced_classes(std::span<const std::uint32_t> raw_labels);

/// `T_camera_lidar`: entry "Tr:" of KITTI's calib.txt. Throws CameraUnknownError without one.
[[nodiscard]] Eigen::Isometry3d read_kitti_calibration(const std::filesystem::path& file);
void write_kitti_calibration(const std::filesystem::path& file,
                             const Eigen::Isometry3d& T_camera_lidar);

/// What the numbers in a times.txt are: seconds in KITTI's, but users write what their drivers say.
/// `none`: they do not grow from line to line, as where all are 0, and are no times of the scans.
enum class TimesUnit : std::uint8_t { seconds, milliseconds, microseconds, nanoseconds, none };

struct KittiTimes {
  std::vector<std::int64_t> times_ns;
  TimesUnit unit = TimesUnit::seconds;
};

/// times.txt, a number a line: seconds, unless scans would then be 40 s apart or more (the median),
/// and 0.02 to 2 s by another unit. Throws DatasetError.
[[nodiscard]] KittiTimes read_kitti_times(const std::filesystem::path& file);
/// In seconds.
void write_kitti_times_ns(const std::filesystem::path& file,
                          std::span<const std::int64_t> times_ns);

/// A pose file, twelve numbers (3x4, row by row) a line, in whatever frame it is in. Rotations that
/// are off by rounding are made exact; matrices that are no rotation are an error.
[[nodiscard]] std::vector<Eigen::Isometry3d> read_poses(const std::filesystem::path& file);
void write_poses(const std::filesystem::path& file, std::span<const Eigen::Isometry3d> poses);

/// KITTI's poses.txt holds `T_camera0_camerak`. As lidar poses: Tr^-1 T Tr.
[[nodiscard]] std::vector<Eigen::Isometry3d> lidar_poses_from_camera(
    std::span<const Eigen::Isometry3d> T_camera0_camera, const Eigen::Isometry3d& T_camera_lidar);

/// The reverse: Tr T Tr^-1.
[[nodiscard]] std::vector<Eigen::Isometry3d> camera_poses_from_lidar(
    std::span<const Eigen::Isometry3d> T_lidar0_lidar, const Eigen::Isometry3d& T_camera_lidar);

}  // namespace stillmap
