#include <algorithm>
#include <deque>
#include <iostream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "clients/commands/arguments/mapper_arguments.hpp"
#include "clients/commands/arguments/mount_arguments.hpp"
#include "clients/commands/arguments/scan_range.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/dataset/drive_labels.hpp"
#include "clients/commands/dataset/recording.hpp"
#include "clients/commands/evaluate/segmentation_report.hpp"
#include "clients/commands/stage_stopwatch.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/table.hpp"
#include "core/dataset/binary_file.hpp"
#include "core/dataset/kitti_files.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "core/evaluation/segmentation_score.hpp"
#include "core/picture/segmentation_picture.hpp"
#include "core/segmentation/segmenter.hpp"

namespace stillmap::cli {
namespace {

struct SegmentationResult {
  evaluation::SegmentationScore score;
  std::size_t scans = 0;
  /// From scan to the class of every point.
  double median_ms = 0.0;
  double p99_ms = 0.0;
};

/// Compares the labels that were found for scans with the true ones, in the order of the scans.
class Comparison {
 public:
  explicit Comparison(evaluation::SegmentationScore& score) : score_(score) {}

  void expect(DatasetFrame frame) { expected_.push_back(std::move(frame)); }
  void add(const PointLabels& found) {
    const DatasetFrame& frame = expected_.front();
    score_.add(frame.scan.points_lidar, reduced_classes(frame.raw_labels), found.classes);
    expected_.pop_front();
  }

 private:
  evaluation::SegmentationScore& score_;
  std::deque<DatasetFrame> expected_;
};

/// Which scans have truth. Each is looked at once: of clouds in files of their own all is read.
class Truths {
 public:
  Truths(const ScanDataset& dataset, std::size_t end) : dataset_(dataset), end_(end) {}

  /// Whether one of those from `first` on, and before `last`, has; `first` never decreases.
  [[nodiscard]] bool any(std::size_t first, std::size_t last) {
    if (next_ < first) {
      next_ = first;
      is_found_ = false;
    }
    while (!is_found_ && next_ < std::min(last, end_)) {
      is_found_ = dataset_.has_labels(next_);
      if (!is_found_) ++next_;
    }
    return is_found_ && next_ < last;
  }

 private:
  const ScanDataset& dataset_;
  std::size_t end_;
  std::size_t next_ = 0;
  bool is_found_ = false;
};

/// A scan without truth: between scans with truth it tells how these lie to each other.
void follow(const ScanDataset& dataset, std::size_t index, Truths& truths, DriveScans& drive) {
  constexpr std::size_t soon = 20;
  if (!drive.is_begun()) return;
  if (!truths.any(index + 1, index + soon)) return drive.leave();
  try {
    DatasetFrame frame = dataset.read(index);
    frame.scan.labels.clear();
    drive.add(frame.scan, std::nullopt);
  } catch (const DatasetError&) {
    // Nothing of it is compared.
  }
}

/// Segments the scans of a labelled sequence and compares with its labels. Scans without labels
/// are skipped; with `drive` they tell how the others lie to each other. Throws DatasetError for a
/// damaged file with labels.
SegmentationResult segment_dataset(const ScanDataset& dataset, const ScanRange& range,
                                   Segmenter& labels, std::optional<DriveScans>& drive,
                                   const ScanDone& scan_done) {
  SegmentationResult result;
  StageStopwatch times;
  Comparison comparison(result.score);
  const auto compare_voted = [&] {
    while (const auto voted = drive->take()) comparison.add(*voted);
  };
  const std::size_t end = range.end(dataset);
  Truths truths(dataset, end);
  for (std::size_t index = range.first; index < end; ++index) {
    if (truths.any(index, index + 1)) {
      DatasetFrame frame = dataset.read(index);
      frame.scan.labels.clear();
      times.begin();
      PointLabels found = labels.segment(frame.scan);
      times.end();
      result.scans += 1;
      if (drive) {
        drive->add(frame.scan, std::move(found));
        comparison.expect(std::move(frame));
      } else {
        comparison.expect(std::move(frame));
        comparison.add(found);
      }
    } else if (drive) {
      follow(dataset, index, truths, *drive);
    }
    if (drive) compare_voted();
    if (scan_done && !scan_done(index + 1 - range.first)) break;
  }
  if (drive) {
    drive->finish();
    compare_voted();
  }
  result.median_ms = times.total().quantile(0.5);
  result.p99_ms = times.total().quantile(0.99);
  return result;
}

struct EvaluateSegmentationArguments {
  std::vector<std::string> truth;
  std::string predictions, picture, drive_votes;
  MapperArguments mapper;
  MountArguments mount;
  ScanRange range;
  bool json = false;
};

// The .label files of the folder itself, or of the subfolder that the data set's layout has.
std::vector<std::filesystem::path> label_files(const std::filesystem::path& folder,
                                               const char* subfolder) {
  const std::filesystem::path inner = folder / subfolder;
  const std::filesystem::path& place = std::filesystem::is_directory(inner) ? inner : folder;
  if (!std::filesystem::is_directory(place)) throw DatasetError(place, "is not a folder");
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(place)) {
    if (entry.path().extension() == ".label") files.push_back(entry.path());
  }
  if (files.empty()) throw DatasetError(place, "holds no .label files");
  std::sort(files.begin(), files.end());
  return files;
}

/// Throws std::invalid_argument where they look like something else than SemanticKITTI's ids.
void require_semantic_kitti_ids(const LabelCensus& census, const std::filesystem::path& folder) {
  const std::string doubt = census.doubt();
  if (doubt.empty()) return;
  throw std::invalid_argument("the labels in " + folder.string() +
                              " are read as SemanticKITTI ids and " + doubt +
                              ". Write them as ids first: remap_semantic_labels.py --inverse of "
                              "SemanticKITTI's tools does");
}

SequenceScore compare_files(const EvaluateSegmentationArguments& arguments) {
  const std::string& truth = arguments.truth.front();
  auto predictions = label_files(arguments.predictions, "predictions");
  if (arguments.range.first >= predictions.size() || arguments.range.count == 0) {
    throw std::invalid_argument("--start and --scans leave none of the " +
                                std::to_string(predictions.size()) + " predictions");
  }
  predictions.erase(predictions.begin(),
                    predictions.begin() + static_cast<std::ptrdiff_t>(arguments.range.first));
  if (arguments.range.count < predictions.size()) predictions.resize(arguments.range.count);
  const std::filesystem::path truth_folder = label_files(truth, "labels").front().parent_path();
  Progress progress("compare", "scans", predictions.size());
  SequenceScore compared{.sequence = truth, .score = {}};
  LabelCensus predicted, known;
  std::uint64_t done = 0;
  for (const std::filesystem::path& prediction : predictions) {
    const auto classes = read_values<std::uint32_t>(prediction);
    const std::filesystem::path file = truth_folder / prediction.filename();
    if (!std::filesystem::exists(file)) {
      throw DatasetError(file, "is missing: there is a prediction for it");
    }
    const auto true_classes = read_values<std::uint32_t>(file);
    if (true_classes.size() != classes.size()) {
      throw DatasetError(prediction, "holds " + std::to_string(classes.size()) + " labels, and " +
                                         file.string() + " has " +
                                         std::to_string(true_classes.size()));
    }
    for (const std::uint32_t label : classes) predicted.add(label);
    for (const std::uint32_t label : true_classes) known.add(label);
    compared.score.add({}, reduced_classes(true_classes), reduced_classes(classes));
    progress.update(++done);
  }
  require_semantic_kitti_ids(predicted, predictions.front().parent_path());
  require_semantic_kitti_ids(known, truth_folder);
  return compared;
}

// Truth above prediction, of the first scan that was taken.
void write_picture(const EvaluateSegmentationArguments& arguments, const ScanDataset& dataset,
                   Segmenter& labels) {
  DatasetFrame frame = dataset.read(arguments.range.first);
  const std::vector<SemanticClass> truth = reduced_classes(frame.raw_labels);
  frame.scan.labels.clear();
  const std::vector<SemanticClass> found = labels.segment(frame.scan).classes;
  const RangeImage image(frame.scan.points_lidar, projection_model(dataset.suggested_sensor()));
  std::vector<std::span<const SemanticClass>> strips;
  if (!truth.empty()) strips.emplace_back(truth);
  if (!found.empty()) strips.emplace_back(found);
  write_segmentation_picture(arguments.picture, image, strips);
}

SequenceScore run_model(const EvaluateSegmentationArguments& arguments, std::size_t number) {
  const std::string& sequence = arguments.truth[number];
  ScanDataset dataset(sequence);
  dataset.join_turns();
  require_semantic_kitti_labels(dataset);
  const std::size_t scans = arguments.range.end(dataset) - arguments.range.first;
  const std::unique_ptr<Segmenter> labels =
      make_segmenter(arguments.mapper, dataset,
                     arguments.mount.T_base_lidar().value_or(Eigen::Isometry3d::Identity()));
  Progress progress("segment " + sequence, "scans", scans);
  std::optional<DriveScans> drive;
  if (arguments.drive_votes != "off")
    drive.emplace(mapper_config(arguments.mapper, dataset.suggested_sensor()));
  const SegmentationResult result =
      segment_dataset(dataset, arguments.range, *labels, drive, [&](std::size_t seen) {
        progress.update(seen);
        return true;
      });
  if (result.scans == 0) throw DatasetError(dataset.file(arguments.range.first), "has no labels");
  if (!arguments.picture.empty() && number == 0) write_picture(arguments, dataset, *labels);
  std::cerr << labels->name() << ": " << result.scans << " scans, from scan to classes "
            << fixed(result.median_ms, 1) << " ms (median), " << fixed(result.p99_ms, 1)
            << " ms (p99)\n";
  return {sequence, result.score};
}

/// Files were predicted as whoever made them took the lidar to stand, and let a model see it.
void refuse_view(const EvaluateSegmentationArguments& arguments) {
  for (const auto& [option, is_given] :
       {std::pair("--mount", !arguments.mount.xyz_rpy.empty()),
        std::pair("--stance", !arguments.mapper.stance.empty()),
        std::pair("--mirrored", !arguments.mapper.mirrored.empty())}) {
    if (is_given)
      throw std::invalid_argument(std::string(option) +
                                  " is for a model that runs, not for --predictions");
  }
}

Json json_of(const EvaluateSegmentationArguments& arguments,
             const std::vector<SequenceScore>& sequences) {
  Json json = segmentation_json(sequences);
  if (arguments.predictions.empty()) {
    json.set("drive_votes", arguments.drive_votes != "off");
    json.set("mirrored", arguments.mapper.mirrored == "on");
  }
  return json;
}

ExitCode run(EvaluateSegmentationArguments arguments) {
  std::vector<SequenceScore> sequences;
  if (!arguments.predictions.empty()) refuse_view(arguments);
  if (arguments.predictions.empty()) {
    mirror_with_drive_votes(arguments.drive_votes, arguments.mapper);
    for (std::size_t number = 0; number < arguments.truth.size(); ++number) {
      sequences.push_back(run_model(arguments, number));
    }
  } else if (arguments.truth.size() == 1) {
    sequences.push_back(compare_files(arguments));
  } else {
    throw std::invalid_argument("--predictions are those of one sequence, --truth names " +
                                std::to_string(arguments.truth.size()));
  }
  std::cout << (arguments.json ? json_of(arguments, sequences).dump(2) + "\n"
                               : segmentation_text(sequences));
  return ExitCode::ok;
}

}  // namespace

void add_evaluate_segmentation_command(CommandHandle evaluate, Action& action) {
  auto arguments = std::make_shared<EvaluateSegmentationArguments>();
  arguments->mapper.labels = "model";
  CommandHandle command =
      evaluate.command("segmentation", "IoU of every class and their mean, near and far");
  command
      .option("--truth", arguments->truth,
              "Sequences with labels, or a folder with true .label files")
      .required();
  const OptionHandle predictions =
      command.option("--predictions", arguments->predictions,
                     "Folder with predicted .label files (original ids); without it a model runs");
  command
      .option("--model", arguments->mapper.labels,
              "Name or folder of the model to run; 'model' is the default one")
      .with_default()
      .excludes(predictions);
  command
      .option("--sensor", arguments->mapper.sensor,
              "hdl_64e, hdl_32e, vlp_16 or a sensor file; default: as the data set suggests")
      .excludes(predictions);
  add_mount_option(
      command, arguments->mount,
      "How the lidar leans, and its height above the ground; default: upright, not known");
  add_segmentation_options(command, arguments->mapper);
  add_drive_votes_option(command, arguments->drive_votes).excludes(predictions);
  command.option("--start", arguments->range.first, "Number of the first scan, or prediction");
  command.option("--scans,--count", arguments->range.count, "Take as many scans at most");
  command
      .option("--picture", arguments->picture,
              "PNG of the first scan's range image: true classes above those that the model found "
              "in it alone")
      .ends_in(".png")
      .excludes(predictions);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap evaluate segmentation --truth sequences/08 --predictions my_net/08\n"
      "  stillmap evaluate segmentation --truth city --picture city.png\n"
      "  stillmap evaluate segmentation --model kitti --truth sequences/05 sequences/10\n"
      "  stillmap evaluate segmentation --truth tilted --mount 1.2,0,1.4,0,15,0\n"
      "Predictions pair with the truth by name, and every one needs its truth; scans without a\n"
      "prediction do not count. A model gets scans as they were recorded, points that a server\n"
      "would leave out (prepare) included; votes of the neighbours and of the drive's other scans\n"
      "are, too.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
