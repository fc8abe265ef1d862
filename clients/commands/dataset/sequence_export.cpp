#include "clients/commands/dataset/sequence_export.hpp"

#include <algorithm>
#include <deque>
#include <stdexcept>
#include <utility>

#include "clients/commands/dataset/drive_labels.hpp"
#include "clients/commands/mapping/scans_ahead.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/dataset/gnss_file.hpp"
#include "core/dataset/imu_file.hpp"
#include "core/lidar/label_kind.hpp"
#include "core/segmentation/segmenter.hpp"

namespace stillmap::cli {
namespace {

/// Those from a second before the first scan to a second after the last one: where the lidar was
/// before it, and through the last sweep.
template <class Sample>
std::vector<Sample> samples_around(std::vector<Sample> samples, std::int64_t first_ns,
                                   std::int64_t last_ns) {
  constexpr std::int64_t margin_ns = 1'000'000'000;
  std::erase_if(samples, [=](const Sample& sample) {
    return sample.stamp_ns < first_ns - margin_ns || sample.stamp_ns > last_ns + margin_ns;
  });
  return samples;
}

class SequenceExporter {
 public:
  SequenceExporter(const ScanDataset& dataset, bool strict, const MapperConfig& config,
                   std::unique_ptr<Segmenter> labels, bool drive_votes,
                   const std::filesystem::path& folder, const ScanSkipped& scan_skipped)
      : dataset_(dataset),
        strict_(strict),
        scan_skipped_(scan_skipped),
        prepare_(config.prepare),
        scans_(dataset, config, std::move(labels)),
        mapper_(config, scans_.segmenter()),
        labels_(drive_votes),
        folder_(folder),
        output_(folder) {}

  /// Before the first scan: which ones export_scan() will get, in their order.
  void expect(std::size_t first, std::size_t end) { scans_.start(first, end); }

  /// What was recorded beside these scans. Before them, so that it is there however the run ends.
  void export_samples(std::size_t first, std::size_t end) {
    if (first >= end) return;
    // A clock may have been set back meanwhile.
    std::int64_t first_ns = dataset_.stamp_ns(first), last_ns = first_ns;
    for (std::size_t index = first; index < end; ++index) {
      first_ns = std::min(first_ns, dataset_.stamp_ns(index));
      last_ns = std::max(last_ns, dataset_.stamp_ns(index));
    }
    const auto imu = samples_around(dataset_.imu(), first_ns, last_ns);
    const auto gnss = samples_around(dataset_.gnss(), first_ns, last_ns);
    if (!imu.empty()) write_imu_csv(folder_ / "imu.csv", imu);
    if (!gnss.empty()) write_gnss_csv(folder_ / "gnss.csv", gnss);
    imu_samples_ = imu.size();
    gnss_fixes_ = gnss.size();
  }

  void export_scan(std::size_t index) {
    std::optional<DatasetFrame> frame = read(index);
    if (!frame) return;
    const std::optional<MappedScan> mapped = mapper_.process(frame->scan);
    const bool has_own = std::ranges::any_of(
        frame->raw_labels, [](std::uint32_t raw) { return (raw & 0xFFFFU) != 0; });
    scans_with_labels_ += has_own ? 1U : 0U;
    if (mapped) {
      T_map_lidar_ = mapped->odometry.T_map_lidar;
      labels_.add(*mapped, has_own ? PointLabels{} : mapped->labelled.labels);
    } else {
      labels_.add_without_pose({});
      ++without_pose_;
      scan_skipped_({index, mapper_.last_rejection().counter,
                     dataset_.file(index).string() +
                         " takes the pose of the scan before: " + mapper_.last_rejection().reason});
    }
    waiting_.push_back({index, std::move(*frame), has_own, T_map_lidar_});
    write_labelled();
  }

  ExportSummary finish(bool stopped) {
    labels_.finish();
    write_labelled();
    ExportSummary summary = output_.finish();
    summary.label_source = label_source(summary.scans);
    summary.stopped = stopped;
    summary.imu_samples = imu_samples_;
    summary.gnss_fixes = gnss_fixes_;
    if (damaged_ > 0) summary.remarks.push_back({damaged_, "damaged files skipped"});
    if (without_pose_ > 0) {
      summary.remarks.push_back({without_pose_, "scans with the pose of the scan before them"});
    }
    return summary;
  }

 private:
  /// A scan whose labels are still voted on.
  struct Waiting {
    std::size_t index;
    DatasetFrame frame;
    bool has_own_labels;
    Eigen::Isometry3d T_map_lidar;
  };

  void write_labelled() {
    while (const auto labels = labels_.take()) {
      Waiting& oldest = waiting_.front();
      std::vector<std::uint32_t> raw_labels = std::move(oldest.frame.raw_labels);
      if (!oldest.has_own_labels && !labels->empty())
        raw_labels = labels_of_all_points(oldest.frame.scan, labels->classes, prepare_);
      // What reading corrects is corrected again when the export is read.
      const bool is_corrected = dataset_.kitti_lidar().has_value();
      output_.add(is_corrected ? dataset_.read_uncorrected(oldest.index).scan : oldest.frame.scan,
                  std::move(raw_labels), oldest.T_map_lidar);
      waiting_.pop_front();
    }
  }

  std::optional<DatasetFrame> read(std::size_t index) {
    try {
      return scans_.read();
    } catch (const DatasetError& error) {
      if (strict_) throw;
      ++damaged_;
      scan_skipped_({index, "unreadable", std::string("skipped: ") + error.what()});
      return std::nullopt;
    }
  }

  /// What comes with a scan is copied, whatever the segmenter.
  std::string label_source(std::size_t scans) const {
    const std::string own = PassthroughSegmenter().name(), other = mapper_.label_source();
    if (scans_with_labels_ == 0 || other.starts_with(own)) return other;
    return scans_with_labels_ < scans ? own + ", else " + other : own;
  }

  const ScanDataset& dataset_;
  bool strict_;
  const ScanSkipped& scan_skipped_;
  PrepareConfig prepare_;
  ScansAhead scans_;
  Mapper mapper_;
  DriveLabels labels_;
  std::deque<Waiting> waiting_;
  std::filesystem::path folder_;
  SequenceOutput output_;
  std::size_t imu_samples_ = 0;
  std::size_t gnss_fixes_ = 0;
  Eigen::Isometry3d T_map_lidar_ = Eigen::Isometry3d::Identity();
  std::size_t damaged_ = 0;
  std::size_t without_pose_ = 0;
  std::size_t scans_with_labels_ = 0;
};

/// Without links, "." and "..".
std::filesystem::path place_of(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::path place = std::filesystem::weakly_canonical(path, error);
  return error ? std::filesystem::absolute(path).lexically_normal() : place;
}

/// Whether it is this folder or file, or beneath it; both are places.
bool is_within(const std::filesystem::path& whole, const std::filesystem::path& above) {
  return std::mismatch(above.begin(), above.end(), whole.begin(), whole.end()).first == above.end();
}

}  // namespace

void prepare_sequence_folder(const std::filesystem::path& folder, bool force,
                             std::span<const std::filesystem::path> sources) {
  const std::filesystem::path present = part_of_sequence_in(folder);
  if (present.empty()) return;
  if (!force) {
    throw std::invalid_argument(
        folder.string() + " holds a sequence already (" + present.string() +
        "); name another folder, or replace it and its labels with --force");
  }
  std::vector<std::filesystem::path> replaced;
  for (const char* part : sequence_parts) replaced.push_back(place_of(folder / part));
  for (const std::filesystem::path& source : sources) {
    const std::filesystem::path place = place_of(source);
    if (std::ranges::none_of(replaced, [&](const auto& part) { return is_within(place, part); }))
      continue;
    throw std::invalid_argument(source.string() + " is a part of " + folder.string() +
                                ", which would be replaced: the source stays as it is; name "
                                "another folder");
  }
  for (const char* part : sequence_parts) std::filesystem::remove_all(folder / part);
}

std::vector<std::uint32_t> labels_of_all_points(const Scan& scan,
                                                std::span<const SemanticClass> classes_of_usable,
                                                const PrepareConfig& prepare) {
  std::vector<std::uint32_t> raw_labels(scan.size());
  const std::vector<std::uint32_t> usable = usable_points(scan, prepare);
  if (usable.size() != classes_of_usable.size()) return raw_labels;
  for (std::size_t i = 0; i < usable.size(); ++i) {
    raw_labels[usable[i]] = semantic_kitti_id(classes_of_usable[i]);
  }
  return raw_labels;
}

void SequenceOutput::add(const Scan& scan, std::vector<std::uint32_t> raw_labels,
                         const Eigen::Isometry3d& T_map_lidar) {
  raw_labels.resize(scan.size());
  writer_.add(scan, raw_labels, T_map_lidar);
  summary_.scans += 1;
  summary_.points += scan.size();
  const auto has_class = [](std::uint32_t raw) {
    return class_of_label(raw, LabelKind::semantic_kitti) != SemanticClass::unlabeled;
  };
  summary_.labelled_points +=
      static_cast<std::uint64_t>(std::ranges::count_if(raw_labels, has_class));
}

ExportSummary SequenceOutput::finish() const {
  writer_.finish();
  return summary_;
}

ExportSummary export_sequence(const ScanDataset& dataset, const ScanRange& range,
                              const MapperConfig& config, std::unique_ptr<Segmenter> labels,
                              bool drive_votes, const std::filesystem::path& folder,
                              const ScanDone& scan_done, const ScanSkipped& scan_skipped) {
  const std::size_t end = range.end(dataset);
  SequenceExporter run(dataset, range.strict, config, std::move(labels), drive_votes, folder,
                       scan_skipped);
  run.export_samples(range.first, end);
  run.expect(range.first, end);
  bool keep_running = true;
  for (std::size_t index = range.first; index < end && keep_running; ++index) {
    run.export_scan(index);
    keep_running = scan_done(index + 1 - range.first);
  }
  return run.finish(!keep_running);
}

}  // namespace stillmap::cli
