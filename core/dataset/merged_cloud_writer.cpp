#include <cstring>
#include <sstream>
#include <system_error>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/merged_cloud.hpp"
#include "core/lidar/semantic_class.hpp"

namespace stillmap {
namespace {

/// Enough points at a time that a write costs little, few enough for hundreds of open clouds.
constexpr std::size_t buffer_bytes = std::size_t{1} << 18U;
/// The header is written with the count once that is known; remarks fill it up to this length.
constexpr std::size_t header_bytes = 1024;

template <class T>
void append(std::string& buffer, const T& value) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  buffer.append(bytes, sizeof value);
}

std::string header(std::uint64_t points, const Eigen::Vector3d& origin_map) {
  std::ostringstream out;
  out.precision(12);
  out << "ply\nformat binary_little_endian 1.0\n"
         "comment stillmap merged scans; map frame = lidar frame of the sequence's first pose\n"
         "comment origin_map_m "
      << origin_map.x() << ' ' << origin_map.y() << ' ' << origin_map.z()
      << "\ncomment x y z are metres from that origin; label and instance are SemanticKITTI's\n"
         "comment keep scan_index and point_index: they lead the labels back to the scans\n"
         "element vertex "
      << points
      << "\nproperty float x\nproperty float y\nproperty float z\nproperty float intensity\n"
         "property uchar red\nproperty uchar green\nproperty uchar blue\n"
         "property uint label\nproperty uint instance\n"
         "property uint scan_index\nproperty uint point_index\n";
  const std::string text = out.str();
  const std::string remark = "comment ";
  const std::string end = "\nend_header\n";
  return text + remark + std::string(header_bytes - text.size() - remark.size() - end.size(), '.') +
         end;
}

}  // namespace

MergedCloudWriter::MergedCloudWriter(const std::filesystem::path& file,
                                     const Eigen::Vector3d& origin_map, bool replace)
    : file_(file), unfinished_file_(file.string() + ".part"), origin_map_(origin_map) {
  if (!replace && std::filesystem::exists(file)) {
    throw DatasetError(file, "is there already; name another file, or replace it with --force");
  }
  std::ofstream out(unfinished_file_, std::ios::binary | std::ios::trunc);
  out << header(0, origin_map);
  out.close();
  if (!out) throw DatasetError(unfinished_file_, "cannot be written; check the folder");
}

MergedCloudWriter::~MergedCloudWriter() {
  std::error_code ignored;
  std::filesystem::remove(unfinished_file_, ignored);
}

void MergedCloudWriter::add(const MergedPoint& point) {
  const Rgb rgb =
      colour(class_from_semantic_kitti(static_cast<std::uint16_t>(point.raw_label & 0xFFFFU)));
  append(buffer_, point.position.x());
  append(buffer_, point.position.y());
  append(buffer_, point.position.z());
  append(buffer_, point.intensity);
  append(buffer_, rgb.r);
  append(buffer_, rgb.g);
  append(buffer_, rgb.b);
  append(buffer_, std::uint32_t{point.raw_label & 0xFFFFU});
  append(buffer_, std::uint32_t{point.raw_label >> 16U});
  append(buffer_, point.scan);
  append(buffer_, point.point);
  ++points_;
  if (buffer_.size() >= buffer_bytes) flush();
}

void MergedCloudWriter::flush() {
  // Not kept open: a long drive has more tiles than a process may have files.
  std::ofstream out(unfinished_file_, std::ios::binary | std::ios::app);
  out << buffer_;
  out.close();
  if (!out) throw DatasetError(unfinished_file_, "cannot be written; check the space left");
  buffer_.clear();
}

void MergedCloudWriter::finish() {
  flush();
  std::fstream out(unfinished_file_, std::ios::binary | std::ios::in | std::ios::out);
  out << header(points_, origin_map_);
  out.close();
  std::error_code error;
  if (out) std::filesystem::rename(unfinished_file_, file_, error);
  if (!out || error) throw DatasetError(file_, "cannot be written; check the folder");
}

}  // namespace stillmap
