#include "core/dataset/scan_merge.hpp"

#include <charconv>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/merged_cloud.hpp"
#include "core/lidar/prepare.hpp"

namespace stillmap {
namespace {

struct NumberedScan {
  std::uint32_t number = 0;
  std::size_t index = 0;
};

std::vector<NumberedScan> chosen_scans(const ScanDataset& sequence, const MergeOptions& options) {
  std::vector<NumberedScan> chosen;
  std::uint32_t in_range = 0;
  for (const auto& [number, index] : numbered_scans(sequence)) {
    if (number < options.first || number > options.last) continue;
    if (in_range++ % options.every == 0) chosen.push_back({number, index});
  }
  if (chosen.empty()) {
    throw DatasetError(sequence.file(0).parent_path(), "has no scan with a number from " +
                                                           std::to_string(options.first) + " to " +
                                                           std::to_string(options.last));
  }
  return chosen;
}

Trajectory poses_of(const ScanDataset& sequence) {
  if (auto poses = sequence.truth()) return *std::move(poses);
  throw DatasetError(sequence.file(0).parent_path().parent_path() / "poses.txt",
                     "no such file: scans cannot be merged without poses. Make a sequence with "
                     "them with 'stillmap dataset export'");
}

/// The clouds that the points go to, one a tile.
class Tiles {
 public:
  Tiles(const std::filesystem::path& cloud, const MergeOptions& options,
        const Eigen::Vector3d& origin_map)
      : cloud_(cloud), options_(options), origin_map_(origin_map) {}

  /// `point.position` is filled in here.
  void add(const Eigen::Vector3d& position_map, MergedPoint point) {
    point.position = (position_map - origin_map_).cast<float>();
    writer_at(position_map).add(point);
  }

  [[nodiscard]] std::vector<std::filesystem::path> finish() {
    std::vector<std::filesystem::path> files;
    for (const auto& [tile, writer] : writers_) {
      writer->finish();
      files.push_back(writer->file());
    }
    return files;
  }

 private:
  using TileNumber = std::pair<long, long>;

  MergedCloudWriter& writer_at(const Eigen::Vector3d& position_map) {
    const TileNumber tile =
        options_.tile_m > 0.0
            ? TileNumber{std::lround(std::floor(position_map.x() / options_.tile_m)),
                         std::lround(std::floor(position_map.y() / options_.tile_m))}
            : TileNumber{};
    std::unique_ptr<MergedCloudWriter>& writer = writers_[tile];
    if (!writer) {
      writer = std::make_unique<MergedCloudWriter>(file_of(tile), origin_map_, options_.replace);
    }
    return *writer;
  }

  [[nodiscard]] std::filesystem::path file_of(const TileNumber& tile) const {
    if (options_.tile_m <= 0.0) return cloud_;
    const std::string name = cloud_.stem().string() + "_x" + std::to_string(tile.first) + "_y" +
                             std::to_string(tile.second) + cloud_.extension().string();
    return cloud_.parent_path() / name;
  }

  std::filesystem::path cloud_;
  const MergeOptions& options_;
  Eigen::Vector3d origin_map_;
  std::map<TileNumber, std::unique_ptr<MergedCloudWriter>> writers_;
};

void add_scan(const DatasetFrame& frame, std::uint32_t number, const Eigen::Isometry3d& T_map_lidar,
              Tiles& tiles, MergedClouds& merged) {
  const Scan& scan = frame.scan;
  for (std::size_t i = 0; i < scan.size(); ++i) {
    if (!scan.points_lidar[i].allFinite()) {
      ++merged.left_out;
      continue;
    }
    tiles.add(T_map_lidar * scan.points_lidar[i].cast<double>(),
              {.position = {},
               .intensity = scan.intensity.empty() ? 0.0F : scan.intensity[i],
               .raw_label = frame.raw_labels.empty() ? 0U : frame.raw_labels[i],
               .scan = number,
               .point = static_cast<std::uint32_t>(i)});
    ++merged.points;
  }
  ++merged.scans;
}

}  // namespace

Scan at_one_instant(Scan scan, const Trajectory& poses, std::size_t index) {
  if (scan.time_offset_s.empty() || poses.size() < 2) return scan;
  const std::size_t from = std::min(index, poses.size() - 2);
  const auto& [start_ns, T_map_start] = poses[from];
  const auto& [end_ns, T_map_end] = poses[from + 1];
  if (end_ns <= start_ns) return scan;
  return deskew(std::move(scan), T_map_start.inverse() * T_map_end,
                static_cast<double>(end_ns - start_ns) / 1e9);
}

std::map<std::uint32_t, std::size_t> numbered_scans(const ScanDataset& dataset) {
  std::map<std::uint32_t, std::size_t> index_of;
  for (std::size_t i = 0; i < dataset.size(); ++i) {
    const std::filesystem::path& file = dataset.file(i);
    const std::string stem = file.stem().string();
    std::uint32_t number = 0;
    const auto [end, error] = std::from_chars(stem.data(), stem.data() + stem.size(), number);
    const bool numbered = error == std::errc{} && end == stem.data() + stem.size();
    if (!numbered || file.extension() != ".bin" || file.parent_path().filename() != "velodyne" ||
        !index_of.emplace(number, i).second) {
      throw DatasetError(file,
                         "is not a scan of a SemanticKITTI sequence (velodyne/NNNNNN.bin); make "
                         "one of this dataset with 'stillmap dataset export'");
    }
  }
  return index_of;
}

std::filesystem::path label_file(const std::filesystem::path& scan_file) {
  return scan_file.parent_path().parent_path() / "labels" / (scan_file.stem().string() + ".label");
}

std::string MergeOptions::faults() const {
  std::ostringstream faults;
  if (first > last) faults << "the first scan's number is above the last one's\n";
  if (every == 0) faults << "every 0th scan cannot be taken; 1 takes all\n";
  if (!(tile_m >= 0.0 && std::isfinite(tile_m))) faults << "the tile's edge must be 0 or more\n";
  return faults.str();
}

MergedClouds merge_scans(const ScanDataset& sequence, const std::filesystem::path& cloud,
                         const MergeOptions& options,
                         const std::function<bool(std::size_t, std::size_t)>& scan_done) {
  if (const std::string faults = options.faults(); !faults.empty()) {
    throw std::invalid_argument(faults);
  }
  const std::vector<NumberedScan> chosen = chosen_scans(sequence, options);
  const Trajectory poses = poses_of(sequence);
  MergedClouds merged;
  merged.origin_map =
      poses[chosen.front().index].T_map_lidar.translation().array().round().matrix();
  Tiles tiles(cloud, options, merged.origin_map);
  for (const auto& [number, index] : chosen) {
    DatasetFrame frame = sequence.read(index);
    frame.scan = at_one_instant(std::move(frame.scan), poses, index);
    add_scan(frame, number, poses[index].T_map_lidar, tiles, merged);
    if (scan_done && !scan_done(merged.scans, chosen.size())) return merged;
  }
  merged.files = tiles.finish();
  return merged;
}

}  // namespace stillmap
