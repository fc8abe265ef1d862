#include "clients/library/region_subscription.hpp"

#include <chrono>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include "core/map/voxel_grid.hpp"
#include "idl/conversions/status.hpp"
#include "idl/conversions/tile.hpp"
#include "idl/dds/dds_error.hpp"
#include "idl/dds/reader.hpp"

namespace stillmap {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// A view that is published sends its changed tiles one after the other: they become one request.
constexpr auto batch_gap = 20ms;
constexpr auto max_batch_duration = 200ms;

/// Which entries of the tile index a region may be interested in.
dds::ContentFilter filter_for(const Region& region, double tile_size_m) {
  const TileRange range = tile_range(RegionShape(region).bounds_map(), tile_size_m);
  return {.expression = "tile_x BETWEEN %0 AND %1 AND tile_y BETWEEN %2 AND %3",
          .parameters = {std::to_string(range.first.x), std::to_string(range.last.x),
                         std::to_string(range.first.y), std::to_string(range.last.y)}};
}

RegionTracker tracker_of(const Region& region, const TileVersions& present) {
  RegionTracker tracker(region, present.map.tile_size_m);
  tracker.add_present(present);
  return tracker;
}

/// The readers of a region's part of the index and of the status, and the thread that turns what
/// they bring into updates.
class RegionReceiver final : public Subscription::Receiver {
 public:
  RegionReceiver(dds::Participant& participant, const dds::Topics& topics, const Region& region,
                 const TileVersions& present, ListTiles list, FetchTiles fetch,
                 std::function<void(const RegionUpdate&)> update_arrived)
      : participant_(participant),
        topic_(topics.tile_index),
        region_(region),
        tracker_(tracker_of(region, present)),
        list_(std::move(list)),
        fetch_(std::move(fetch)),
        update_arrived_(std::move(update_arrived)),
        index_tile_size_m_(tracker_.tile_size_m()),
        index_(open_index()),
        status_(participant, topics.status.dds_name, topics.status.reader),
        thread_([this](const std::stop_token& stop) { receive(stop); }) {}

 private:
  using IndexReader = dds::Reader<stillmap_msgs::msg::TileInfo>;

  void receive(const std::stop_token& stop) {
    // What is there already first; later what the index tells.
    if (tracker_.has_update()) deliver_update();
    while (!stop.stop_requested()) {
      collect_entries(stop);
      note_map(stop);
      if (tracker_.lacks_present() && !stop.stop_requested()) list_present();
      follow_tile_size();
      if (tracker_.has_update() && !stop.stop_requested()) deliver_update();
    }
  }

  [[nodiscard]] std::unique_ptr<IndexReader> open_index() const {
    return std::make_unique<IndexReader>(participant_, topic_.dds_name, topic_.reader,
                                         filter_for(region_, tracker_.tile_size_m()));
  }

  void note_map(const std::stop_token& stop) {
    while (status_.take(status_sample_, stop, 0ms)) {
      if (const auto status = wire::from_wire(status_sample_)) tracker_.note_map(status->map_id);
    }
  }

  /// The filter tells tiles by their indices, which mean other places where tiles have another
  /// edge.
  void follow_tile_size() {
    if (tracker_.tile_size_m() == index_tile_size_m_) return;
    try {
      index_ = open_index();
      index_tile_size_m_ = tracker_.tile_size_m();
    } catch (const dds::DdsError&) {
      // The one of before stays until the next attempt.
    }
  }

  /// Waits for an entry, and for those that follow it closely.
  void collect_entries(const std::stop_token& stop) {
    auto pause = std::chrono::milliseconds(1s);
    std::optional<Clock::time_point> first;
    while (index_->take(entry_, stop, pause)) {
      if (const auto info = wire::from_wire(entry_)) {
        tracker_.add_index_entry(wire::from_wire(entry_.identity()), *info);
      }
      if (!first) first = Clock::now();
      if (Clock::now() - *first > max_batch_duration) return;
      pause = batch_gap;
    }
  }

  void list_present() {
    try {
      tracker_.add_present(list_());
    } catch (const ServiceError&) {
      // The server is gone or busy: once more after the next entries, or a second.
    }
  }

  void deliver_update() {
    // What is gone is told also while nothing can be fetched.
    const RegionUpdate update = tracker_.take_update(fetch_pending().value_or(TileSet()));
    if (!update.appeared.empty() || !update.changed.empty() || !update.removed.empty()) {
      update_arrived_(update);
    }
  }

  std::optional<TileSet> fetch_pending() {
    try {
      return fetch_(tracker_.pending());
    } catch (const ServiceError&) {
      // The server is gone or busy. The tiles stay pending and are fetched later.
      return std::nullopt;
    }
  }

  dds::Participant& participant_;
  dds::TopicSpec<stillmap_msgs::msg::TileInfo> topic_;
  Region region_;
  RegionTracker tracker_;
  ListTiles list_;
  FetchTiles fetch_;
  std::function<void(const RegionUpdate&)> update_arrived_;
  /// That of the index's filter [m].
  double index_tile_size_m_;
  stillmap_msgs::msg::TileInfo entry_;
  std::unique_ptr<IndexReader> index_;
  stillmap_msgs::msg::Status status_sample_;
  dds::Reader<stillmap_msgs::msg::Status> status_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace

void RegionTracker::add_index_entry(const dds::MapIdentity& map, const TileInfo& info) {
  begin_map(map);
  if (!region_.may_intersect(tile_footprint(info.id, tile_size_m_))) return;
  if (info.voxel_count == 0) return remove(info.id);
  const auto known = known_.find(info.id);
  if (known == known_.end() || known->second < info.revision) pending_.insert(info.id);
}

void RegionTracker::add_present(const TileVersions& present) {
  begin_map(present.map);
  listed_map_id_ = present.map.map_id;
  is_other_map_noted_ = false;
  for (const TileInfo& info : present.tiles) add_index_entry(present.map, info);
}

void RegionTracker::note_map(std::uint64_t map_id) {
  // Each counts once: the status that is kept for late joiners may be older than the list.
  if (std::exchange(noted_map_id_, map_id) == map_id) return;
  is_other_map_noted_ = map_id != listed_map_id_;
}

void RegionTracker::begin_map(const dds::MapIdentity& map) {
  if (map.map_id != map_.map_id) {
    for (const auto& [id, revision] : known_) removed_.insert(id);
    known_.clear();
    pending_.clear();
    // Also not where it is no number.
    if (map.tile_size_m > 0.0) tile_size_m_ = map.tile_size_m;
  }
  map_ = map;
}

void RegionTracker::remove(TileId id) {
  pending_.erase(id);
  if (known_.erase(id) > 0) removed_.insert(id);
}

RegionUpdate RegionTracker::take_update(TileSet fetched) {
  RegionUpdate update{.map = map_, .appeared = {}, .changed = {}, .removed = {}};
  if (fetched.map.map_id == map_.map_id) {
    for (const TileId id : fetched.missing) remove(id);
    for (Tile& tile : fetched.tiles) {
      pending_.erase(tile.info.id);
      const bool is_replaced = removed_.erase(tile.info.id) > 0;
      const bool is_known =
          !known_.insert_or_assign(tile.info.id, tile.info.revision).second || is_replaced;
      (is_known ? update.changed : update.appeared).push_back(std::move(tile));
    }
  }
  update.removed.assign(removed_.begin(), removed_.end());
  removed_.clear();
  return update;
}

Subscription make_region_subscription(dds::Participant& participant, const dds::Topics& topics,
                                      const Region& region, ListTiles list, FetchTiles fetch,
                                      std::function<void(const RegionUpdate&)> update_arrived) {
  const TileVersions present = list();
  return Subscription(std::make_unique<RegionReceiver>(participant, topics, region, present,
                                                       std::move(list), std::move(fetch),
                                                       std::move(update_arrived)));
}

}  // namespace stillmap
