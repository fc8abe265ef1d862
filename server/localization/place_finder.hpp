#pragma once

#include <Eigen/Geometry>
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "config/loaders/server_config.hpp"
#include "core/localization/global_localization.hpp"
#include "core/localization/lost_lidar_search.hpp"
#include "core/localization/place_guess.hpp"
#include "core/map/query/tile_reader.hpp"
#include "core/mapper.hpp"
#include "idl/conversions/localization.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/threads/bounded_queue.hpp"
#include "server/threads/worker.hpp"

namespace stillmap::server {

/// The latest map made searchable, when somebody looks for a place in it, and kept while somebody
/// does. Thread-safe.
class SearchableMap {
 public:
  /// Both must outlive it.
  SearchableMap(const LatestMap& latest_map, TileReader& tiles)
      : latest_map_(latest_map), tiles_(tiles) {}

  [[nodiscard]] bool is_empty() const { return latest_map_.view()->tiles.empty(); }
  /// Of the map as it is, or was some seconds ago. Throws what the tiles' store throws.
  [[nodiscard]] std::shared_ptr<const Localizer> localizer();
  /// Frees it where nobody asked for it for a minute.
  void release_unused();
  /// Frees it: its tiles are not as they were.
  void discard();

 private:
  const LatestMap& latest_map_;
  TileReader& tiles_;
  std::mutex mutex_;
  std::shared_ptr<const Localizer> localizer_;
  std::uint64_t map_id_ = 0;
  std::uint64_t map_version_ = 0;
  std::uint64_t corrections_ = 0;
  std::chrono::steady_clock::time_point built_;
  std::chrono::steady_clock::time_point used_;
  ThrottledLog throttled_log_;
};

/// Of a mapper beside a place finder: its own wide searches take seconds, in which no live scan is
/// mapped, and are made once in ten seconds at most. Lossless scans wait.
[[nodiscard]] MapperConfig mapper_config_beside_finder(const ServerConfig& config);

/// Looks for a lidar that is lost in the whole map, or where somebody says it is, from the scans
/// that the mapper cannot place, on a thread of its own: mapping never waits for it. The functions
/// of the mapping thread are called by that one alone, the others by any.
class PlaceFinder {
 public:
  /// All must outlive it.
  PlaceFinder(const ServerConfig& config, const LatestMap& latest_map, TileReader& tiles,
              Statistics& statistics);

  /// Of the mapping thread, before a scan of this time: mapping goes on where the lidar was found
  /// since, at the pose that comes back. The mapper hands its scans out while they are wanted.
  [[nodiscard]] std::optional<Eigen::Isometry3d> relocate(Mapper& mapper, std::int64_t stamp_ns);
  /// Of the mapping thread: one more scan that the mapper handed out. The oldest give way where the
  /// search does not keep up.
  void add(const Scan& scan, const PointLabels& labels, const Eigen::Isometry3d& T_base_lidar,
           const Mapper& mapper);
  /// Of the mapping thread: what became of a scan. A lidar that stays lost, or whose place nothing
  /// confirms, for some seconds is looked for, and at once where the map has none of its scans yet.
  void update(std::int64_t stamp_ns, const OdometryResult& odometry, const Mapper& mapper);
  /// Of the mapping thread: another map began.
  void forget();
  /// Of the mapping thread: the map was corrected, and a place that was found in it may not be
  /// where it was. What was asked for is looked for again.
  void map_corrected();

  /// Of the mapping thread: the lidar is another than it was taken for; as map_corrected().
  void use_sensor(const SensorModel& sensor);

  /// The robot is looked for round this pose from the next scan on, and set there when it is found;
  /// otherwise the log says why not.
  void look_near(const PlaceGuess& guess);

  /// Of the mapping thread: the last scan that was mapped or lost; its labels are used where they
  /// are `own`, and not taken from the map.
  void keep_last(std::shared_ptr<const LabelledScan> scan, bool has_own_labels,
                 const Eigen::Isometry3d& T_base_lidar);
  /// Where the last scan is in the map, in the caller's thread; it changes nothing, unless it is to
  /// be applied. Throws std::runtime_error where there is no scan yet, and what the tiles' store
  /// throws.
  [[nodiscard]] LocalizationAnswer localize(const LocalizationQuestion& question);

 private:
  /// A scan of a search; searches are numbered.
  struct LostScan {
    std::uint64_t search = 0;
    Scan scan;
    PointLabels labels;
    Eigen::Isometry3d T_base_lidar = Eigen::Isometry3d::Identity();
    /// Where the map's path ended, until a scan of this run was registered in it.
    std::optional<Eigen::Isometry3d> T_map_lidar_expected{};
  };

  /// With `mutex_` locked.
  void begin_search(const std::optional<PlaceGuess>& guess);
  void end_search();

  // Of the worker.
  void handle(const LostScan& lost);
  void look_for(const LostScan& lost);
  /// Of a search that found nothing yet, and may not in this map: it does not keep a core busy.
  [[nodiscard]] bool is_due();
  [[nodiscard]] GlobalLocalization::Regions regions(const LostScan& lost) const;
  void report(GlobalLocalization::Outcome outcome, const LostScan& lost);
  /// Ends the search that goes on, if that is still this one.
  void take_place(const LostScan& lost);
  void give_up_guess(std::uint64_t search, const std::string& why);

  Statistics& statistics_;
  SearchableMap map_;
  /// Of the mapping thread.
  LostWatch watch_;

  mutable std::mutex mutex_;
  MapperConfig mapper_config_;
  /// The search that goes on; 0: none. Written with the mutex locked.
  std::atomic<std::uint64_t> search_ = 0;
  std::uint64_t searches_ = 0;
  std::optional<PlaceGuess> guess_;
  std::optional<GlobalLocalization::Place> found_;

  struct LastScan {
    std::shared_ptr<const LabelledScan> scan;
    bool has_own_labels = false;
    Eigen::Isometry3d T_base_lidar = Eigen::Isometry3d::Identity();
  };
  LastScan last_;

  // Of the worker.
  std::optional<GlobalLocalization> localization_;
  std::uint64_t localized_search_ = 0;
  std::chrono::steady_clock::time_point searched_;
  /// In a row, as the map could not be read.
  int failed_searches_ = 0;
  int followed_scans_ = 0;
  ThrottledLog throttled_log_;
  BoundedQueue<LostScan> scans_;
  // Last: stops before what it uses is gone.
  std::optional<Worker<LostScan>> worker_;
};

}  // namespace stillmap::server
