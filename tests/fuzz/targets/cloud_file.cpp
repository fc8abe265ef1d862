// A number that says which kind of file, then the file: .bin, .label, .pcd, .ply, an edited cloud.

#include <array>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/kitti_files.hpp"
#include "core/dataset/merged_cloud.hpp"
#include "core/dataset/point_cloud_files.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/invariant.hpp"
#include "tests/fuzz/memory_folder.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace cloud_file_inputs {
namespace {

enum Kind : std::uint8_t { bin, label, pcd, ply, merged, kinds };
constexpr std::array<const char*, kinds> file_names = {"0.bin", "0.label", "0.pcd", "0.ply",
                                                       "merged.ply"};

void check_scan(const Scan& scan) {
  const auto fits = [&](const auto& values) {
    return values.empty() || values.size() == scan.size();
  };
  require(fits(scan.intensity) && fits(scan.time_offset_s) && fits(scan.ring) && fits(scan.labels),
          "every list of a scan is empty or as long as its points");
}

void read_merged(const std::filesystem::path& file) {
  MergedCloudReader reader(file);
  for (std::uint64_t i = 0; i < reader.size(); ++i) static_cast<void>(reader.next());
}

void read_cloud(const std::filesystem::path& file) {
  const CloudFile cloud = read_point_cloud(file, 1'700'000'000'000'000'000);
  check_scan(cloud.scan);
  static_cast<void>(reduced_classes(cloud.raw_labels));
}

void read(Kind kind, const std::filesystem::path& file) {
  if (kind == label) {
    static_cast<void>(reduced_classes(read_kitti_labels(file, 8)));
  } else if (kind == merged) {
    read_merged(file);
  } else if (kind != bin) {
    read_cloud(file);
  }
  if (kind == bin || kind == pcd || kind == ply) {
    check_scan(ScanDataset(file).read(0).scan);
  }
}

void run(Bytes bytes) {
  ByteSource source(bytes);
  const auto kind = static_cast<Kind>(source.byte() % kinds);
  const auto file = MemoryFolder::of_this_process().file(file_names.at(kind), source.rest());
  try {
    read(kind, file);
  } catch (const DatasetError&) {
  }
}

/// All class colours and probabilities, and a point that is not finite.
std::vector<ColouredPoint> coloured_points() {
  std::vector<ColouredPoint> points;
  for (int i = 0; i < 8; ++i) {
    points.push_back({Eigen::Vector3f(static_cast<float>(i), 2.0F, -1.0F),
                      static_cast<SemanticClass>(i), 0.1F * static_cast<float>(i)});
  }
  points.front().position.x() = std::numeric_limits<float>::quiet_NaN();
  return points;
}

std::string merged_cloud() {
  const auto file = MemoryFolder::of_this_process().path("seed_merged.ply");
  MergedCloudWriter writer(file, Eigen::Vector3d(100.0, 200.0, 0.0), true);
  for (std::uint32_t i = 0; i < 4; ++i) {
    writer.add({Eigen::Vector3f(1.0F, 2.0F, 3.0F), 0.5F, 40U + (i << 16U), i, 2 * i});
  }
  writer.finish();
  return content_of(file);
}

std::string text_pcd(const std::string& data) {
  return "# .PCD v.7\nVERSION .7\nFIELDS x y z intensity ring t label\nSIZE 4 4 4 4 2 4 4\n"
         "TYPE F F F F U U U\nCOUNT 1 1 1 1 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
         "POINTS 2\nDATA " +
         data;
}

std::string text_ply() {
  return "ply\nformat ascii 1.0\ncomment origin 1 2 3\nelement vertex 2\nproperty double x\n"
         "property float y\nproperty float z\nproperty uchar scalar_intensity\nproperty ushort "
         "ring\n"
         "property uint label\nproperty uint instance\nproperty uint scan_index\n"
         "property uint point_index\nend_header\n"
         "1 2 3 200 7 40 0 0 1\n4 5 6 100 8 252 3 1 2\n";
}

std::vector<Seed> seeds() {
  const auto& folder = MemoryFolder::of_this_process();
  Scan scan;
  for (int i = 0; i < 8; ++i) {
    scan.points_lidar.emplace_back(static_cast<float>(i), 1.0F, -1.5F);
    scan.intensity.push_back(0.1F * static_cast<float>(i));
  }
  write_kitti_bin(folder.path("seed.bin"), scan);
  write_kitti_labels(folder.path("seed.label"),
                     std::vector<std::uint32_t>{0, 10, 40, 252, 70, 81, 1U << 16U | 10U, 99});
  write_pcd(folder.path("seed.pcd"), coloured_points());
  write_ply(folder.path("seed.ply"), coloured_points());
  const auto written = [&](const char* name) { return content_of(folder.path(name)); };
  return {{"bin", with_choice(bin, written("seed.bin"))},
          {"label", with_choice(label, written("seed.label"))},
          {"pcd", with_choice(pcd, written("seed.pcd"))},
          {"pcd_text", with_choice(pcd, text_pcd("ascii\n1 2 3 50 1 100 40\n4 5 nan 7 2 9 252\n"))},
          {"pcd_binary", with_choice(pcd, text_pcd("binary\n") + std::string(56, 'a'))},
          {"pcd_packed", with_choice(pcd, text_pcd("binary_compressed\n") +
                                              std::string("\x05\0\0\0\x38\0\0\0", 8) +
                                              std::string("\x01\x41\x42\xe0\x2c", 5))},
          {"ply", with_choice(ply, written("seed.ply"))},
          {"ply_text", with_choice(ply, text_ply())},
          {"merged", with_choice(merged, merged_cloud())},
          {"merged_text", with_choice(merged, text_ply())}};
}

}  // namespace
}  // namespace cloud_file_inputs

const Target cloud_file_target{"cloud_file", cloud_file_inputs::run, cloud_file_inputs::seeds};

}  // namespace stillmap::fuzz
