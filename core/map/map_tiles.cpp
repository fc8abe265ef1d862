#include "core/map/map_tiles.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <functional>
#include <iterator>
#include <stdexcept>
#include <string>
#include <utility>

namespace stillmap {
namespace {

/// Memory of a non-resident tile in snapshots and indices.
constexpr std::size_t non_resident_tile_bytes = sizeof(Tile) + 64;

TileRange range_round(const Eigen::Vector3d& position_map, double reach_m, double tile_size_m) {
  const Eigen::Vector3d reach = Eigen::Vector3d::Constant(reach_m);
  return tile_range({position_map - reach, position_map + reach}, tile_size_m);
}

/// Whether a stored tile is that which was evicted: somebody may have put another file in the map's
/// place.
bool is_of(const std::shared_ptr<const Tile>& stand_in, const std::shared_ptr<const Tile>& stored) {
  if (!stored) return true;
  return stand_in && stored->info.revision == stand_in->info.revision &&
         stored->info.content_hash == stand_in->info.content_hash;
}

}  // namespace

MapTiles::MapTiles(const StaticMapConfig& config)
    : grid_(config.voxel_size_m, config.tile_size_m), tile_size_m_(config.tile_size_m) {
  clear(0);
}

void MapTiles::clear(std::uint64_t map_id) {
  residents_.clear();
  stamps_.clear();
  hidden_non_resident_.clear();
  non_resident_count_ = 0;
  unreadable_.clear();
  touched_.clear();
  edits_.clear();
  unsaved_.clear();
  ++step_;
  MapSnapshot empty;
  empty.map_id = map_id;
  empty.tile_size_m = tile_size_m_;
  empty.voxel_size_m = grid_.voxel_size_m();
  current_ = std::make_shared<const MapSnapshot>(std::move(empty));
}

void MapTiles::resume(const MapSnapshot& view, const TileEvidenceMap& tile_evidence) {
  clear(view.map_id);
  if (view.tiles.empty() && tile_evidence.empty()) return;
  non_resident_count_ = view.tiles.non_resident_count();
  if (non_resident_count_ < view.tiles.size()) {
    for (const auto& tile : view.tiles) {
      if (is_non_resident(*tile)) continue;
      const auto evidence = tile_evidence.find(tile->info.id);
      add(tile->info.id, {tile, evidence == tile_evidence.end() ? nullptr : evidence->second});
    }
  }
  for (const auto& [id, evidence] : tile_evidence) {
    if (view.tiles.find(id) != nullptr) continue;
    if (evidence == nullptr) {
      hidden_non_resident_.insert(id);
      ++non_resident_count_;
    } else {
      add(id, {nullptr, evidence});
    }
  }
  MapSnapshot current = view;
  current.voxel_size_m = grid_.voxel_size_m();
  current.tile_size_m = tile_size_m_;
  current_ = std::make_shared<const MapSnapshot>(std::move(current));
}

LiveTile* MapTiles::resident(TileId id) const {
  const auto known = residents_.find(id);
  return known == residents_.end() ? nullptr : known->second.live.get();
}

LiveTile* MapTiles::tile(TileId id) {
  if (LiveTile* const known = resident(id)) return known;
  if (is_known_non_resident(id)) return reload(id) ? resident(id) : nullptr;
  Resident fresh{std::make_unique<LiveTile>(id, grid_), step_};
  return residents_.emplace(id, std::move(fresh)).first->second.live.get();
}

std::shared_ptr<const Tile> MapTiles::shown(TileId id) const {
  const auto edited = edits_.find(id);
  return edited != edits_.end() ? edited->second : current_->tiles.find(id);
}

bool MapTiles::is_known_non_resident(TileId id) const {
  return !residents_.contains(id) && (hidden_non_resident_.contains(id) || shown(id) != nullptr);
}

double MapTiles::distance_m(TileId id, const Eigen::Vector2d& position_map) const {
  const Eigen::Vector2d low = Eigen::Vector2d(id.x, id.y) * grid_.tile_size_m();
  const Eigen::AlignedBox2d footprint(low, low.array() + grid_.tile_size_m());
  return footprint.exteriorDistance(position_map);
}

std::vector<LiveTile*> MapTiles::residents() const {
  std::vector<LiveTile*> all;
  all.reserve(residents_.size());
  for (const auto& [id, resident] : residents_) all.push_back(resident.live.get());
  std::ranges::sort(all, {}, &LiveTile::id);
  return all;
}

std::vector<TileId> MapTiles::non_resident_near(const Eigen::Vector3d& position_map,
                                                double range_m) const {
  std::vector<TileId> found;
  const TileRange range = range_round(position_map, range_m, grid_.tile_size_m());
  for (TileId id = range.first; id.x <= range.last.x; ++id.x) {
    for (id.y = range.first.y; id.y <= range.last.y; ++id.y) {
      if (distance_m(id, position_map.head<2>()) <= range_m && is_known_non_resident(id))
        found.push_back(id);
    }
  }
  return found;
}

std::size_t MapTiles::expected_bytes(TileId id) const {
  // Shown and not, live and published.
  constexpr std::size_t voxel_bytes = 80;
  const auto tile = shown(id);
  return voxel_bytes * (tile ? tile->info.voxel_count : 100);
}

std::vector<LiveTile*> MapTiles::near(const Eigen::Vector3f& position_map, double range_m) const {
  const Eigen::Vector2d position = position_map.head<2>().cast<double>();
  std::vector<LiveTile*> found;
  const TileRange range = range_round(position_map.cast<double>(), range_m, grid_.tile_size_m());
  for (TileId id = range.first; id.x <= range.last.x; ++id.x) {
    for (id.y = range.first.y; id.y <= range.last.y; ++id.y) {
      LiveTile* const known = resident(id);
      if (known != nullptr && distance_m(id, position) <= range_m) found.push_back(known);
    }
  }
  return found;
}

std::vector<TileId> MapTiles::in(const Eigen::AlignedBox3d& box_map, std::size_t max_shown) const {
  const TileRange range = tile_range(box_map, grid_.tile_size_m());
  const auto is_in = [&](TileId id) {
    return id.x >= range.first.x && id.x <= range.last.x && id.y >= range.first.y &&
           id.y <= range.last.y;
  };
  std::vector<TileId> ids;
  for (const auto& tile : tiles_in_range(current_->tiles, range, max_shown)) {
    ids.push_back(tile->info.id);
  }
  for (const auto& [id, resident] : residents_) {
    if (is_in(id)) ids.push_back(id);
  }
  std::ranges::copy_if(hidden_non_resident_, std::back_inserter(ids), is_in);
  std::ranges::sort(ids);
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

void MapTiles::touch(LiveTile& live, bool is_published) {
  if (is_published) touched_.push_back(&live);
  residents_.find(live.id()).value().changed_at = step_;
  unsaved_.insert(live.id());
}

std::shared_ptr<const MapSnapshot> MapTiles::view(const VisibilityRule& rule) {
  std::vector<LiveTile*> touched = std::exchange(touched_, {});
  std::ranges::sort(touched);
  touched.erase(std::unique(touched.begin(), touched.end()), touched.end());

  const std::uint64_t version = current_->version + 1;
  std::vector<std::uint8_t> changed(touched.size());
  tbb::parallel_for(std::size_t{0}, touched.size(), [&](std::size_t i) {
    changed[i] = touched[i]->publish(version, rule, stamps_) ? 1 : 0;
  });
  for (std::size_t i = 0; i < touched.size(); ++i) {
    if (changed[i] != 0) edits_[touched[i]->id()] = touched[i]->published();
  }
  if (edits_.empty()) return current_;

  const bool has_changed =
      std::ranges::find(changed, 1) != changed.end() ||
      std::ranges::any_of(edits_, [](const auto& edit) { return edit.second == nullptr; });
  std::vector<TileTable::Edit> edits;
  edits.reserve(edits_.size());
  for (auto& [id, tile] : edits_) edits.push_back({id, std::move(tile)});
  edits_.clear();
  current_ = std::make_shared<const MapSnapshot>(
      MapSnapshot{has_changed ? version : current_->version, current_->map_id, tile_size_m_,
                  grid_.voxel_size_m(), current_->tiles.with(edits)});
  return current_;
}

void MapTiles::add(TileId id, const TileRecord& record) {
  residents_.emplace(id, Resident{std::make_unique<LiveTile>(id, record, grid_, stamps_), 0});
}

bool MapTiles::reload(TileId id) {
  const auto fault = unreadable_.find(id);
  if (fault != unreadable_.end() && !fault->second.is_next_attempt_due()) return false;
  return reload_now(id);
}

bool MapTiles::reload_now(TileId id) {
  if (store_ == nullptr) return false;
  const std::shared_ptr<const Tile> stand_in = shown(id);
  try {
    TileRecord record = store_->load(id);
    if (!is_of(stand_in, record.tile)) {
      throw std::runtime_error("tile (" + std::to_string(id.x) + ", " + std::to_string(id.y) +
                               ") of the map's file is another one than was stored there");
    }
    if (record.tile && stand_in && stand_in->info.appeared_in != 0) {
      // The file does not know it.
      auto tile = std::make_shared<Tile>(*record.tile);
      tile->info.appeared_in = stand_in->info.appeared_in;
      record.tile = std::move(tile);
    }
    add(id, record);
  } catch (const std::runtime_error& fault) {
    // The tile is not mapped from now on: a new tile would replace the stored one.
    unreadable_[id].set_text(fault.what());
    return false;
  }
  unreadable_.erase(id);
  --non_resident_count_;
  hidden_non_resident_.erase(id);
  const auto& published = resident(id)->published();
  if (stand_in || published) edits_[id] = published;
  return true;
}

void MapTiles::reload_near(const Eigen::Vector3d& position_map, double range_m) {
  const TileRange range = range_round(position_map, range_m, grid_.tile_size_m());
  for (TileId id = range.first; id.x <= range.last.x; ++id.x) {
    for (id.y = range.first.y; id.y <= range.last.y; ++id.y) {
      if (distance_m(id, position_map.head<2>()) > range_m) continue;
      if (is_known_non_resident(id)) reload(id);
    }
  }
}

void MapTiles::evict(TileId id) {
  const auto resident = residents_.find(id);
  const LiveTile& live = *resident->second.live;
  if (live.published()) {
    edits_[id] = without_voxels(*live.published());
  } else {
    hidden_non_resident_.insert(id);
  }
  ++non_resident_count_;
  std::erase(touched_, &live);
  residents_.erase(resident);
}

std::size_t MapTiles::evict(const Eigen::Vector2d& position_map, double range_m,
                            std::size_t limit_bytes) {
  std::size_t bytes = memory_bytes();
  // Begins below the limit: the map grows on until the next checkpoint.
  if (store_ == nullptr || bytes <= limit_bytes - limit_bytes / 8) return 0;
  std::vector<std::pair<double, TileId>> candidates;
  for (const auto& [id, resident] : residents_) {
    const double tile_distance_m = distance_m(id, position_map);
    if (tile_distance_m > range_m && !unsaved_.contains(id)) {
      candidates.emplace_back(tile_distance_m, id);
    }
  }
  std::ranges::sort(candidates, std::greater<>());
  // More than needed, so that not every scan has to evict a tile.
  const std::size_t wanted_bytes = limit_bytes - limit_bytes / 4;
  std::size_t evicted_tiles = 0;
  for (const auto& [tile_distance_m, id] : candidates) {
    if (bytes <= wanted_bytes) break;
    bytes -= std::min(bytes, resident(id)->memory_bytes());
    evict(id);
    ++evicted_tiles;
  }
  return evicted_tiles;
}

std::size_t MapTiles::memory_bytes() const {
  std::size_t bytes = non_resident_count_ * non_resident_tile_bytes + stamps_.memory_bytes();
  for (const auto& [id, resident] : residents_) bytes += resident.live->memory_bytes();
  return bytes;
}

MemoryUse MapTiles::memory_use() const {
  return {memory_bytes(), residents_.size(), non_resident_count_};
}

std::vector<LiveTile*> MapTiles::to_store(CheckpointScope scope) const {
  std::vector<LiveTile*> wanted;
  if (scope == CheckpointScope::everything) {
    for (const auto& [id, resident] : residents_) wanted.push_back(resident.live.get());
    return wanted;
  }
  for (const TileId id : unsaved_) {
    LiveTile* const live = resident(id);
    if (scope == CheckpointScope::changed || live->view_has_changed()) wanted.push_back(live);
  }
  return wanted;
}

std::size_t MapTiles::forget_stored(std::span<const TileId> kept) {
  std::set<TileId> gone = hidden_non_resident_;
  for (const auto& tile : current_->tiles) gone.insert(tile->info.id);
  for (const auto& [id, tile] : edits_) gone.insert(id);
  std::erase_if(gone, [this](TileId id) { return !is_known_non_resident(id); });
  for (const TileId id : kept) gone.erase(id);
  for (const TileId id : gone) {
    if (shown(id) != nullptr) edits_[id] = nullptr;
    hidden_non_resident_.erase(id);
    unreadable_.erase(id);
    --non_resident_count_;
  }
  keep_in_memory();
  return gone.size();
}

void MapTiles::keep_in_memory() {
  for (const auto& [id, resident] : residents_) unsaved_.insert(id);
}

void MapTiles::stored(TileId id, std::uint64_t step) {
  const auto resident = residents_.find(id);
  if (resident == residents_.end()) return;
  resident->second.live->end_recording();
  if (resident->second.changed_at <= step) unsaved_.erase(id);
}

}  // namespace stillmap
