#include "core/dataset/kitti_sequence_writer.hpp"

#include <cstdio>
#include <fstream>
#include <string>
#include <system_error>

#include "core/dataset/binary_file.hpp"
#include "core/dataset/kitti_files.hpp"

namespace stillmap {
namespace {

/// A camera that looks forward from the lidar's place: x right, y down, z forward.
Eigen::Isometry3d forward_camera_from_lidar() {
  Eigen::Isometry3d T_camera_lidar = Eigen::Isometry3d::Identity();
  T_camera_lidar.linear() << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  return T_camera_lidar;
}

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw DatasetWriteError(folder, "cannot be made: " + error.message());
}

std::string running_number(std::size_t index) {
  std::string digits = std::to_string(index);
  return std::string(digits.size() < 6 ? 6 - digits.size() : 0, '0') + digits;
}

template <class T>
void write_side_file(const std::filesystem::path& folder, const std::string& name,
                     const std::vector<T>& values, std::size_t points) {
  if (values.empty()) return;
  if (values.size() != points) {
    throw DatasetError(folder / name, std::to_string(values.size()) + " values for a scan of " +
                                          std::to_string(points) + " points");
  }
  make_folder(folder);
  write_values<T>(folder / name, values);
}

}  // namespace

std::filesystem::path part_of_sequence_in(const std::filesystem::path& folder) {
  for (const char* part : sequence_parts) {
    if (std::filesystem::exists(folder / part)) return part;
  }
  return {};
}

KittiSequenceWriter::KittiSequenceWriter(const std::filesystem::path& folder) : folder_(folder) {
  if (const auto part = part_of_sequence_in(folder); !part.empty()) {
    throw DatasetError(folder, "holds a sequence already (" + part.string() +
                                   "); name another folder or remove this one");
  }
  make_folder(folder / "velodyne");
  std::ofstream axes(folder / axes_file_name);
  axes << "x ahead, y left, z up\n";
  if (!axes.flush()) throw DatasetWriteError(folder / axes_file_name, "cannot be written");
}

void KittiSequenceWriter::add(const Scan& scan, std::span<const std::uint32_t> raw_labels,
                              const Eigen::Isometry3d& T_map_lidar) {
  const std::string name = running_number(trajectory_.size());
  try {
    write_files(name, scan, raw_labels);
  } catch (const DatasetError&) {
    remove_files(name);
    finish_if_possible();
    throw;
  }
  trajectory_.push_back({scan.stamp_ns, T_map_lidar});
}

void KittiSequenceWriter::write_files(const std::string& name, const Scan& scan,
                                      std::span<const std::uint32_t> raw_labels) const {
  write_kitti_bin(folder_ / "velodyne" / (name + ".bin"), scan);
  write_side_file(folder_ / "labels", name + ".label",
                  std::vector<std::uint32_t>(raw_labels.begin(), raw_labels.end()), scan.size());
  write_side_file(folder_ / "time_offsets", name + ".bin", scan.time_offset_s, scan.size());
  write_side_file(folder_ / "rings", name + ".bin", scan.ring, scan.size());
}

void KittiSequenceWriter::remove_files(const std::string& name) const {
  std::error_code ignored;
  for (const char* folder : {"velodyne", "time_offsets", "rings"})
    std::filesystem::remove(folder_ / folder / (name + ".bin"), ignored);
  std::filesystem::remove(folder_ / "labels" / (name + ".label"), ignored);
}

void KittiSequenceWriter::finish_if_possible() const {
  try {
    finish();
  } catch (const DatasetError&) {
    // Whoever writes is told of the scan that could not be written.
    return;
  }
}

void KittiSequenceWriter::finish() const {
  std::vector<Eigen::Isometry3d> T_lidar0_lidar;
  std::vector<std::int64_t> times_ns;
  for (const StampedPose& pose : trajectory_) {
    T_lidar0_lidar.push_back(trajectory_.front().T_map_lidar.inverse() * pose.T_map_lidar);
    times_ns.push_back(pose.stamp_ns);
  }
  const Eigen::Isometry3d T_camera_lidar = forward_camera_from_lidar();
  write_kitti_calibration(folder_ / "calib.txt", T_camera_lidar);
  write_kitti_times_ns(folder_ / "times.txt", times_ns);
  write_poses(folder_ / "poses.txt", camera_poses_from_lidar(T_lidar0_lidar, T_camera_lidar));
}

}  // namespace stillmap
