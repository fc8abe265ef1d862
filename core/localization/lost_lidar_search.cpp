#include "core/localization/lost_lidar_search.hpp"

#include <cstdlib>
#include <utility>

#include "core/localization/place_index.hpp"
#include "core/map/query/tile_reader.hpp"

namespace stillmap {
namespace {

using Outcome = GlobalLocalization::Outcome;

/// A lidar that was placed is looked for when it has been lost for so long.
constexpr std::int64_t patience_ns = 3'000'000'000;
/// Searches of the whole map are so far apart in the recording's time: the first ones, those after
/// them, and those of a lidar that is most likely where the map has nothing.
constexpr int eager_searches = 20;
constexpr std::int64_t eager_pause_ns = 250'000'000;
constexpr int steady_searches = 80;
constexpr std::int64_t steady_pause_ns = 1'000'000'000;
constexpr std::int64_t long_pause_ns = 5'000'000'000;
/// A map that grew is made searchable again after so long.
constexpr std::int64_t max_age_ns = 10'000'000'000;

}  // namespace

bool LostWatch::is_due(std::int64_t stamp_ns, const OdometryResult& odometry, bool is_placed) {
  if (knows_place(odometry)) {
    lost_since_ns_.reset();
    return false;
  }
  // A clock may have been set back.
  if (!lost_since_ns_ || *lost_since_ns_ > stamp_ns) lost_since_ns_ = stamp_ns;
  return !is_placed || stamp_ns - *lost_since_ns_ >= patience_ns;
}

LostLidarSearch::LostLidarSearch(const OdometryConfig& odometry, const SensorModel& sensor,
                                 const Eigen::Isometry3d& T_body_lidar, MapView map)
    : odometry_(odometry), sensor_(sensor), T_body_lidar_(T_body_lidar), map_(std::move(map)) {}

void LostLidarSearch::add_path(const Trajectory& path) {
  for (const StampedPose& pose : path) path_.push_back(pose);
}

void LostLidarSearch::update(std::int64_t stamp_ns, const OdometryResult& odometry,
                             bool is_placed) {
  // What waits may enter the map.
  const bool has_place = odometry.health != OdometryHealth::lost &&
                         odometry.map_entry != MapEntry::stays_out_with_waiting;
  if (has_place) path_.push_back({stamp_ns, odometry.T_map_lidar * T_body_lidar_.inverse()});
  const bool is_due = watch_.is_due(stamp_ns, odometry, is_placed);
  if (LostWatch::knows_place(odometry)) {
    localization_.reset();
    // It holds all tiles as they were, which would be in memory twice as the map goes on.
    if (std::abs(stamp_ns - indexed_ns_) >= max_age_ns) localizer_.reset();
  }
  if (!is_due || is_on() || found_ || map_()->tiles.empty()) return;
  index_map(stamp_ns);
  localization_.emplace(odometry_, sensor_);
  outcome_ = Outcome::nothing_new;
}

void LostLidarSearch::index_map(std::int64_t stamp_ns) {
  const auto map = map_();
  const bool is_recent = std::abs(stamp_ns - indexed_ns_) < max_age_ns;
  if (localizer_ && (is_recent || map->version == indexed_version_)) return;
  localizer_.emplace(
      std::make_shared<const PlaceIndex>(map, path_, std::make_shared<TileReader>()));
  indexed_ns_ = stamp_ns;
  indexed_version_ = map->version;
}

bool LostLidarSearch::is_due(std::int64_t stamp_ns) const {
  // Whether a scan is where it was found costs little.
  if (outcome_ == Outcome::found || outcome_ == Outcome::confirming) return true;
  const int tried = localization_->scans_tried();
  const std::int64_t pause_ns = tried < eager_searches    ? eager_pause_ns
                                : tried < steady_searches ? steady_pause_ns
                                                          : long_pause_ns;
  return tried == 0 || std::abs(stamp_ns - searched_ns_) >= pause_ns;
}

void LostLidarSearch::follow(const Scan& scan, const PointLabels& labels) {
  if (!is_on()) return;
  localization_->follow(scan, labels);
  if (!is_due(scan.stamp_ns)) return;
  outcome_ = localization_->search(*localizer_, T_body_lidar_.linear());
  searched_ns_ = scan.stamp_ns;
  if (outcome_ != Outcome::confirmed) return;
  found_ = localization_->take_place();
  localization_.reset();
}

std::optional<GlobalLocalization::Place> LostLidarSearch::take_place() {
  if (found_) watch_.forget();
  return std::exchange(found_, std::nullopt);
}

}  // namespace stillmap
