#include <array>
#include <cstring>
#include <fstream>
#include <string>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/point_cloud_files.hpp"

namespace stillmap {
namespace {

constexpr std::size_t pcd_point_bytes = 24;
constexpr std::size_t ply_point_bytes = 23;

/// Puts values behind one another without padding.
class Packer {
 public:
  explicit Packer(char* to) : to_(to) {}

  template <class T>
  Packer& operator<<(const T& value) {
    std::memcpy(to_, &value, sizeof value);
    to_ += sizeof value;
    return *this;
  }

 private:
  char* to_;
};

std::uint32_t label_of(const ColouredPoint& point) { return semantic_kitti_id(point.label); }

void pack_pcd(const ColouredPoint& point, char* to) {
  const Rgb rgb = colour(point.label);
  const std::uint32_t packed_rgb =
      (std::uint32_t{rgb.r} << 16U) | (std::uint32_t{rgb.g} << 8U) | rgb.b;
  Packer(to) << point.position.x() << point.position.y() << point.position.z() << packed_rgb
             << label_of(point) << point.confidence;
}

void pack_ply(const ColouredPoint& point, char* to) {
  const Rgb rgb = colour(point.label);
  Packer(to) << point.position.x() << point.position.y() << point.position.z() << rgb.r << rgb.g
             << rgb.b << label_of(point) << point.confidence;
}

template <std::size_t point_bytes, class Pack>
void write_cloud(const std::filesystem::path& file, const std::string& header,
                 std::span<const ColouredPoint> points, Pack pack) {
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out << header;
  std::array<char, point_bytes> bytes{};
  for (const ColouredPoint& point : points) {
    pack(point, bytes.data());
    out.write(bytes.data(), point_bytes);
  }
  out.close();
  if (!out) throw DatasetError(file, "cannot be written; check the folder and the space left");
}

}  // namespace

void write_pcd(const std::filesystem::path& file, std::span<const ColouredPoint> points) {
  const std::string count = std::to_string(points.size());
  // By convention the bits of a colour stand in a field of type float.
  write_cloud<pcd_point_bytes>(file,
                               "# .PCD v0.7 - Point Cloud Data file format\n"
                               "VERSION 0.7\n"
                               "FIELDS x y z rgb label confidence\n"
                               "SIZE 4 4 4 4 4 4\n"
                               "TYPE F F F F U F\n"
                               "COUNT 1 1 1 1 1 1\n"
                               "WIDTH " +
                                   count +
                                   "\nHEIGHT 1\n"
                                   "VIEWPOINT 0 0 0 1 0 0 0\n"
                                   "POINTS " +
                                   count + "\nDATA binary\n",
                               points, pack_pcd);
}

void write_ply(const std::filesystem::path& file, std::span<const ColouredPoint> points) {
  write_cloud<ply_point_bytes>(file,
                               "ply\n"
                               "format binary_little_endian 1.0\n"
                               "element vertex " +
                                   std::to_string(points.size()) +
                                   "\n"
                                   "property float x\n"
                                   "property float y\n"
                                   "property float z\n"
                                   "property uchar red\n"
                                   "property uchar green\n"
                                   "property uchar blue\n"
                                   "property uint label\n"
                                   "property float confidence\n"
                                   "end_header\n",
                               points, pack_ply);
}

}  // namespace stillmap
