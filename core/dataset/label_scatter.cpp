#include "core/dataset/label_scatter.hpp"

#include <algorithm>
#include <map>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "core/dataset/binary_file.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/dataset/kitti_files.hpp"
#include "core/dataset/merged_cloud.hpp"
#include "core/dataset/scan_merge.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t progress_points = 1U << 18U;
constexpr std::size_t bin_point_bytes = 16;

std::uint32_t class_of(std::uint32_t raw_label) { return raw_label & 0xFFFFU; }
std::uint32_t instance_of(std::uint32_t raw_label) { return raw_label >> 16U; }

/// The labels of one scan before and after.
struct ScanLabels {
  fs::path file;
  std::vector<std::uint32_t> before;
  std::vector<std::uint32_t> after;
  std::vector<bool> in_cloud;
};

ScanLabels load_labels(const fs::path& scan_file) {
  const std::uintmax_t bytes = scan_file_size(scan_file);
  if (bytes % bin_point_bytes != 0) throw_truncated(scan_file, bytes, bin_point_bytes);
  const std::size_t points = bytes / bin_point_bytes;
  ScanLabels labels{.file = label_file(scan_file), .before = {}, .after = {}, .in_cloud = {}};
  labels.before = fs::exists(labels.file) ? read_kitti_labels(labels.file, points)
                                          : std::vector<std::uint32_t>(points);
  labels.after = labels.before;
  labels.in_cloud.resize(points);
  return labels;
}

/// The sequence's labels as the cloud edits them, in memory until all are checked.
class Edits {
 public:
  Edits(fs::path cloud, const fs::path& sequence)
      : cloud_(std::move(cloud)), dataset_(sequence), scans_(numbered_scans(dataset_)) {}

  void take(const EditedPoint& edited) {
    ScanLabels& labels = labels_of(edited.scan);
    if (edited.point >= labels.after.size()) {
      fail(edited, "the scan has only " + std::to_string(labels.after.size()) +
                       " points; the cloud belongs to another sequence");
    }
    const std::uint32_t after = new_label(edited, labels.before[edited.point]);
    if (labels.in_cloud[edited.point] && labels.after[edited.point] != after) {
      fail(edited, "it is in the cloud twice with different labels; remove one of the two");
    }
    labels.in_cloud[edited.point] = true;
    labels.after[edited.point] = after;
    ++result_.points_in_cloud;
  }

  ScatterResult write() {
    for (const auto& [number, labels] : labels_) {
      count(labels);
      if (labels.after != labels.before) replace(labels);
    }
    return result_;
  }

 private:
  [[noreturn]] void fail(const EditedPoint& edited, const std::string& fault) const {
    throw DatasetError(cloud_, "point " + std::to_string(edited.point) + " of scan " +
                                   std::to_string(edited.scan) + ": " + fault +
                                   ". No label was changed");
  }

  ScanLabels& labels_of(const std::uint32_t number) {
    const auto known = labels_.find(number);
    if (known != labels_.end()) return known->second;
    const auto scan = scans_.find(number);
    if (scan == scans_.end()) {
      throw DatasetError(cloud_, "has points of scan " + std::to_string(number) +
                                     ", which the sequence does not have; it belongs to another "
                                     "sequence. No label was changed");
    }
    return labels_.emplace(number, load_labels(dataset_.file(scan->second))).first->second;
  }

  static std::uint32_t new_label(const EditedPoint& edited, std::uint32_t before) {
    if (edited.instance) return edited.label | (*edited.instance << 16U);
    const bool keeps_instance = edited.label == class_of(before);
    return keeps_instance ? before : edited.label;
  }

  void count(const ScanLabels& labels) {
    ++result_.scans_in_cloud;
    result_.points_missing +=
        static_cast<std::uint64_t>(std::ranges::count(labels.in_cloud, false));
    result_.scans_changed += labels.after != labels.before ? 1U : 0U;
    for (std::size_t i = 0; i < labels.after.size(); ++i) {
      if (labels.after[i] == labels.before[i]) continue;
      ++result_.labels_changed;
      if (instance_of(labels.before[i]) != 0 && instance_of(labels.after[i]) == 0) {
        ++result_.instances_dropped;
      }
    }
  }

  static void replace(const ScanLabels& labels) {
    const fs::path backup =
        labels.file.parent_path().parent_path() / "labels.bak" / labels.file.filename();
    std::error_code error;
    fs::create_directories(labels.file.parent_path(), error);
    if (fs::exists(labels.file) && !fs::exists(backup)) {
      fs::create_directories(backup.parent_path(), error);
      // A backup that was cut off would be taken for the whole one by the next call.
      const fs::path whole = backup.string() + ".new";
      fs::copy_file(labels.file, whole, fs::copy_options::overwrite_existing, error);
      if (!error) fs::rename(whole, backup, error);
      if (error) throw DatasetWriteError(backup, "cannot be written: " + error.message());
    }
    const fs::path fresh = labels.file.string() + ".new";
    write_kitti_labels(fresh, labels.after);
    fs::rename(fresh, labels.file, error);
    if (error) throw DatasetWriteError(labels.file, "cannot be replaced: " + error.message());
  }

  fs::path cloud_;
  ScanDataset dataset_;
  std::map<std::uint32_t, std::size_t> scans_;
  std::map<std::uint32_t, ScanLabels> labels_;
  ScatterResult result_;
};

}  // namespace

ScatterResult scatter_labels(const fs::path& cloud, const fs::path& sequence,
                             const std::function<void(std::uint64_t, std::uint64_t)>& points_read) {
  MergedCloudReader reader(cloud);
  Edits edits(cloud, sequence);
  for (std::uint64_t i = 0; i < reader.size(); ++i) {
    edits.take(reader.next());
    if (points_read && i % progress_points == 0) points_read(i, reader.size());
  }
  return edits.write();
}

}  // namespace stillmap
