#include <algorithm>
#include <chrono>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "clients/commands/arguments/mapper_arguments.hpp"
#include "clients/commands/arguments/mount_arguments.hpp"
#include "clients/commands/arguments/scan_range.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/dataset/recording.hpp"
#include "clients/commands/pose_report.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/lidar/ranked_value.hpp"
#include "core/lidar/rings.hpp"
#include "core/localization/localizer.hpp"
#include "core/localization/lone_scan.hpp"
#include "core/localization/scan_follower.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/picture/map_picture.hpp"

namespace stillmap::cli {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

struct LocalizeArguments {
  std::string map;
  std::string dataset;
  RecordingArguments recording;
  MapperArguments mapper;
  MountArguments mount;
  ScanRange range;
  int step = 1;
  std::string picture;
  bool json = false;
};

/// What became of one scan.
struct LocalizedScan {
  std::size_t index = 0;
  std::int64_t stamp_ns = 0;
  StampedLocalization found;
  double ms = 0.0;
};

struct SearchableMap {
  SavedMap saved;
  std::shared_ptr<const PlaceIndex> index;
  double load_ms = 0.0;
  double index_ms = 0.0;
};

SearchableMap load_map(const std::string& file) {
  SearchableMap map;
  const auto load_began = Clock::now();
  map.saved = read_map_file(file);
  map.load_ms = milliseconds_since(load_began);
  const auto index_began = Clock::now();
  map.index =
      std::make_shared<const PlaceIndex>(std::make_shared<const MapSnapshot>(map.saved.view),
                                         map.saved.trajectory, std::make_shared<TileReader>());
  map.index_ms = milliseconds_since(index_began);
  return map;
}

/// A place is told by its geometry: the network is not run unless it is asked for.
MapperArguments labels_of(MapperArguments arguments, const ScanDataset& dataset) {
  if (arguments.labels == "auto") arguments.labels = dataset.has_labels() ? "files" : "none";
  return arguments;
}

/// Looks for scans of a data set, each for itself.
class LocalizationRun {
 public:
  LocalizationRun(const ScanDataset& dataset, const LocalizeArguments& arguments,
                  const Localizer& localizer)
      : dataset_(dataset),
        localizer_(localizer),
        config_(mapper_config(arguments.mapper, dataset.suggested_sensor())),
        T_body_lidar_(body_of(arguments.mount, arguments.mapper.config_file).T_body_lidar),
        segmenter_(make_segmenter(labels_of(arguments.mapper, dataset), dataset, T_body_lidar_)),
        follower_(config_.odometry, config_.sensor,
                  [this](std::size_t index) { return read_beside(index); }),
        is_strict_(arguments.range.strict) {}

  /// Nothing for a scan that cannot be read; why is said.
  std::optional<LocalizedScan> localize(std::size_t index, Progress& progress) {
    try {
      const Scan scan = prepared(index);
      LocalizedScan localized{.index = index, .stamp_ns = scan.stamp_ns, .found = {}};
      const auto began = Clock::now();
      const PointLabels labels = segmenter_->segment(scan);
      const Eigen::Matrix3d R_body_lidar = T_body_lidar_.linear();
      if (const auto at_stamp = follower_.at_stamp(index, scan)) {
        localized.found = {localizer_.localize(*at_stamp, labels, R_body_lidar),
                           SweepMotionSource::scans_before};
      } else {
        localized.found =
            localize_lone_scan(localizer_, scan, labels, R_body_lidar, config_.sensor.period_s);
      }
      localized.ms = milliseconds_since(began);
      for (PlaceHypothesis& place : localized.found.result.places)
        place.T_map_lidar = place.T_map_lidar * T_body_lidar_.inverse();
      return localized;
    } catch (const DatasetError& error) {
      if (is_strict_) throw;
      ++skipped_;
      progress.say(std::string("stillmap: skipped: ") + error.what());
      return std::nullopt;
    }
  }

  [[nodiscard]] const SensorModel& sensor() const { return config_.sensor; }
  /// Scans that could not be read.
  [[nodiscard]] std::size_t skipped() const { return skipped_; }

 private:
  /// As the mapper does before it registers a scan. Throws DatasetError.
  [[nodiscard]] Scan prepared(std::size_t index) const {
    Scan raw = dataset_.read(index).scan;
    if (follower_.uses_rings()) raw.ring = assign_rings(raw, config_.sensor);
    Scan scan = drop_unusable_points(std::move(raw), config_.prepare);
    turn_up(scan, config_.sensor.elevation_offset);
    if (!config_.prepare.deskew) scan.time_offset_s.clear();
    return scan;
  }
  /// For the motion of the one that is looked for.
  [[nodiscard]] std::optional<Scan> read_beside(std::size_t index) const {
    if (index >= dataset_.size()) return std::nullopt;
    try {
      return prepared(index);
    } catch (const DatasetError&) {
      return std::nullopt;  // it is named where it is looked for itself
    }
  }

  const ScanDataset& dataset_;
  const Localizer& localizer_;
  MapperConfig config_;
  Eigen::Isometry3d T_body_lidar_;
  std::unique_ptr<Segmenter> segmenter_;
  ScanFollower follower_;
  bool is_strict_;
  std::size_t skipped_ = 0;
};

Json place_json(const Eigen::Isometry3d& T) {
  Json json = pose_json(T);
  json.set("matrix_3x4", rows_json(T));
  return json;
}

double score_of(const LocalizationResult& result, std::size_t place) {
  return place < result.places.size() ? result.places[place].evidence.score() : 0.0;
}

Json to_json(const LocalizedScan& scan) {
  const bool is_found = scan.found.result.status == LocalizationStatus::found;
  Json json{
      {"scan", scan.index},
      {"stamp_ns", scan.stamp_ns},
      {"status", name(scan.found.result.status)},
      {"pose", is_found ? place_json(scan.found.result.places.front().T_map_lidar) : Json(nullptr)},
      {"score", score_of(scan.found.result, 0)},
      {"runner_up_score", score_of(scan.found.result, 1)},
      {"sweep_motion", name(scan.found.motion)},
      {"ms", scan.ms}};
  return json;
}

double median_ms(const std::vector<LocalizedScan>& scans) {
  std::vector<double> times;
  for (const LocalizedScan& scan : scans) times.push_back(scan.ms);
  return times.empty() ? 0.0 : median_of(times);
}

Json to_json(const std::vector<LocalizedScan>& scans, std::size_t skipped,
             const SearchableMap& map) {
  Json list = Json::array();
  std::size_t found = 0;
  for (const LocalizedScan& scan : scans) {
    list.push_back(to_json(scan));
    if (scan.found.result.status == LocalizationStatus::found) ++found;
  }
  return {{"map",
           {{"map_id", map.saved.view.map_id},
            {"places", map.index->nodes().size()},
            {"load_ms", map.load_ms},
            {"index_ms", map.index_ms},
            {"index_bytes", map.index->memory_bytes()}}},
          {"scans", list},
          {"found", found},
          {"skipped", skipped},
          {"median_ms", median_ms(scans)}};
}

std::string describe(const std::vector<LocalizedScan>& scans, std::size_t skipped,
                     const SearchableMap& map) {
  Table table({"scan", "", "x", "y", "z", "heading", "score", "runner-up", "ms"});
  std::size_t found = 0;
  for (const LocalizedScan& scan : scans) {
    std::vector<std::string> row{std::to_string(scan.index), name(scan.found.result.status)};
    if (scan.found.result.status == LocalizationStatus::found) {
      ++found;
      const Eigen::Isometry3d& T = scan.found.result.places.front().T_map_lidar;
      for (int axis = 0; axis < 3; ++axis) row.push_back(fixed(T.translation()[axis], 2));
      row.push_back(fixed(heading_deg(T), 1));
    } else {
      row.insert(row.end(), 4, "-");
    }
    row.insert(row.end(), {fixed(score_of(scan.found.result, 0), 2),
                           fixed(score_of(scan.found.result, 1), 2), fixed(scan.ms, 0)});
    table.add(row);
  }
  return table.text() + std::to_string(found) + " of " + std::to_string(scans.size()) +
         " scans found, " + std::to_string(skipped) + " damaged ones skipped, " +
         fixed(median_ms(scans), 0) + " ms a scan (median); map read in " + fixed(map.load_ms, 0) +
         " ms, made searchable in " + fixed(map.index_ms, 0) + " ms\n";
}

/// Where the motion is not known, the pose may be as far off as the lidar moved in its sweep.
std::string motion_warning(const std::vector<LocalizedScan>& scans) {
  const auto count = std::ranges::count_if(scans, [](const LocalizedScan& scan) {
    return scan.found.result.status == LocalizationStatus::found &&
           scan.found.motion == SweepMotionSource::unknown;
  });
  if (count == 0) return {};
  return "stillmap: nothing tells how the lidar moved during the sweep of " +
         std::to_string(count) +
         " of the scans that were found (sweep_motion of --json): where it "
         "did, their poses are of some moment of it, not of their stamps\n";
}

/// The map with a mark for each pose that was found.
void write_picture(const std::string& file, const std::vector<LocalizedScan>& scans,
                   const SearchableMap& map) {
  Trajectory found;
  for (const LocalizedScan& scan : scans) {
    if (scan.found.result.status == LocalizationStatus::found)
      found.push_back({scan.stamp_ns, scan.found.result.places.front().T_map_lidar});
  }
  MapPictureOptions options;
  options.looked_for = scans.size();
  write_map_picture(file, map.saved.view, found, options);
}

ExitCode run(const LocalizeArguments& arguments) {
  StopSignal stop;
  const SearchableMap map = load_map(arguments.map);
  const ScanDataset dataset =
      open_recording(arguments.dataset, arguments.recording, arguments.mapper.config_file,
                     arguments.range.strict, !arguments.mount.xyz_rpy.empty())
          .dataset;
  const std::size_t end = arguments.range.end(dataset);
  const Localizer localizer(map.index);
  LocalizationRun run(dataset, arguments, localizer);
  std::cerr << describe_sensor_mismatch(dataset, run.sensor());
  const auto step = static_cast<std::size_t>(arguments.step);
  Progress progress("localize", "scans", (end - arguments.range.first + step - 1) / step);
  std::vector<LocalizedScan> scans;
  for (std::size_t index = arguments.range.first; index < end && !stop.requested(); index += step) {
    if (auto scan = run.localize(index, progress)) scans.push_back(*std::move(scan));
    progress.update((index - arguments.range.first) / step + 1);
  }
  std::cerr << motion_warning(scans);
  if (!arguments.picture.empty()) write_picture(arguments.picture, scans, map);
  std::cout << (arguments.json ? to_json(scans, run.skipped(), map).dump(2) + "\n"
                               : describe(scans, run.skipped(), map));
  if (scans.empty() && !stop.requested()) {
    std::cerr << "stillmap: no scan of " << arguments.dataset << " could be looked for\n";
    return ExitCode::bad_input;
  }
  return stop.requested() ? ExitCode::failed : ExitCode::ok;
}

}  // namespace

void add_localize_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<LocalizeArguments>();
  CommandHandle command = program.command(
      "localize", "Find scans in a map with no prior pose, each in the whole of it");
  command.option("MAP,--map", arguments->map, "A map file; it is only read").required();
  command.option("DATASET", arguments->dataset, dataset_kinds).required();
  add_recording_options(command, arguments->recording);
  add_mapper_options(command, arguments->mapper);
  add_mount_option(
      command, arguments->mount,
      "Poses of the robot, in a map that was made with the same --mount (or --config)");
  add_range_options(command, arguments->range);
  command.option("--step", arguments->step, "Every so many scans").above_zero().with_default();
  command
      .option("--picture", arguments->picture,
              "Draw the map, and a mark for each pose that was found, to FILE.png")
      .ends_in(".png");
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap localize city_map/map.stillmap city_next_day --start 120 --scans 5\n"
      "  stillmap localize city.stillmap drive --step 10 --json | jq '.scans[] | {scan, pose}'\n"
      "A scan is found, or several places fit it (ambiguous), or none does (not_found), or it or "
      "the map shows too little to tell (no_evidence). A pose is given only where it is found: the "
      "map explains the scan, the scan sees what the map has there, and no other place comes near "
      "that. With --labels auto scans without labels are looked for by their geometry alone, and "
      "no network runs. Where points have times, the pose is that at the scan's stamp: the scans "
      "before it tell how the lidar moved during its sweep, else the map does; sweep_motion of "
      "--json says which, or that none did (unknown). The score is the product of both shares; "
      "runner-up is that of the next best place.\n"
      "Exit code 0 however many are found: 'found' of --json tells.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
