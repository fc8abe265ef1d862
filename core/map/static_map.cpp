#include "core/map/static_map.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/map/live_tile.hpp"
#include "core/map/map_tiles.hpp"
#include "core/map/scan_sorter.hpp"
#include "core/map/tile_correction.hpp"
#include "core/map/tile_evidence.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

const StaticMapConfig& checked(const StaticMapConfig& config) {
  if (const std::string faults = config.faults(); !faults.empty()) {
    throw std::invalid_argument("static map: " + faults);
  }
  return config;
}

/// What was there before the session, or for so long, is settled: a lidar that drives by has a
/// place in sight for less.
constexpr std::int64_t settled_ns = 60'000'000'000;

/// In a session a scan clears what earlier ones have left where the lidar has come so far since one
/// did [m]: rays from the same place tell the same once more.
constexpr float session_step_m = 1.0F;

/// Of a map that begins each of so many scans clears.
constexpr std::uint64_t first_scans = 16;

}  // namespace

struct StaticMap::State {
  explicit State(const StaticMapConfig& map_config)
      : config(checked(map_config)), tiles(config), sorter(tiles.grid(), map_config.max_range_m) {}

  [[nodiscard]] VisibilityRule rule() const {
    return {config.min_points, config.misses_to_clear, config.misses_per_hit, config.label_trust};
  }
  /// Whether a ray of the view passed this position.
  [[nodiscard]] bool sees_through(const RangeImageView& view, const Eigen::Vector3f& position_map,
                                  Thin thin) const;
  /// The same of many: 1 or 0 each.
  void find_seen_through(const RangeImageView& view, std::span<const PlaceToClear> places,
                         std::span<std::uint32_t> is_free) const;
  /// How many of the views that are kept saw through each of these.
  void count_times_free(std::span<const PlaceToClear> places, std::span<std::uint32_t> times) const;
  /// Whether the map begins: there is hardly a view yet that tells what was free before.
  [[nodiscard]] bool begins() const {
    return !max_earlier_scans && !is_resumed && config.clearing_interval > 1 &&
           inserted <= std::min<std::uint64_t>(config.free_space_history, first_scans);
  }
  /// Keeps the view of a scan that cleared.
  void keep(RangeImageView view, std::uint32_t scan);
  void forget_views();
  /// To be called before these tiles change, null or not. A tile that was evicted and reloaded is
  /// in the session as it was.
  void enter_session(std::span<LiveTile* const> changing);
  /// Scans from a position reach tiles that are this near, with a margin of two tiles [m].
  /// Non-resident tiles with voxels that the correction may move.
  [[nodiscard]] std::set<TileId> to_reload(const MapCorrection& correction) const;
  [[nodiscard]] double reach_m() const { return config.max_range_m + 2.0 * config.tile_size_m; }

  /// To be called with each scan of a session.
  [[nodiscard]] std::int64_t settled_before_ns(std::int64_t stamp_ns);

  StaticMapConfig config;
  /// Of the poses that it was made by.
  std::uint64_t corrections = 0;
  MapTiles tiles;
  ScanSorter sorter;
  bool is_frozen = false;
  /// What scans of earlier sessions count at most; nothing in the first one.
  std::optional<std::uint32_t> max_earlier_scans;
  /// Of the first scan of a later one.
  std::optional<std::int64_t> session_begin_ns;
  /// From where the scan was taken that cleared last.
  Eigen::Vector3f last_origin_map = Eigen::Vector3f::Constant(std::numeric_limits<float>::max());
  /// Tiles that the session has changed.
  std::set<TileId> in_session;
  /// Scans so far.
  std::uint64_t inserted = 0;
  /// The map had voxels before its first scan.
  bool is_resumed = false;
  /// Views of the last scans that cleared, newest last, and the number of the newest one.
  std::deque<RangeImageView> past_views;
  std::uint32_t last_scan_cleared = 0;
  /// Tiles of the checkpoint that was taken last.
  std::vector<TileId> in_checkpoint;
};

bool StaticMap::State::sees_through(const RangeImageView& view, const Eigen::Vector3f& position_map,
                                    Thin thin) const {
  const double range_m = (position_map - view.origin_map()).norm();
  if (range_m > config.clearing_range_m) return false;
  const auto observation = view.observe(position_map);
  const double margin_m = std::max(config.clearing_margin_m, config.voxel_size_m);
  const double beyond_m = range_m + margin_m + config.clearing_margin_share * range_m;
  if (!observation || !view.sees_past(*observation, static_cast<float>(beyond_m))) return false;
  if (!view.has_beam_beside(*observation)) return false;
  // A rail lies between two beams most of the time, and fills less than half of its voxel. A beam
  // above or below it may be that near, too: where labels are sure it takes more than one.
  const double near_voxels = thin == Thin::by_labels ? 0.25 : 0.2;
  return thin == Thin::no ||
         view.has_beam_near(*observation, static_cast<float>(near_voxels * config.voxel_size_m));
}

void StaticMap::State::find_seen_through(const RangeImageView& view,
                                         std::span<const PlaceToClear> places,
                                         std::span<std::uint32_t> is_free) const {
  // Most are settled by what was measured in their own direction.
  const RangeImageView::Behind behind{
      .distance_m = static_cast<float>(std::max(config.clearing_margin_m, config.voxel_size_m)),
      .share = static_cast<float>(config.clearing_margin_share),
      .max_range_m = static_cast<float>(config.clearing_range_m)};
  std::array<Eigen::Vector3f, PlaceToClear::max_at_once> positions_map;
  std::array<std::uint8_t, PlaceToClear::max_at_once> is_measured;
  for (std::size_t k = 0; k < places.size(); ++k) positions_map[k] = places[k].position_map;
  view.mark_measured_behind(std::span(positions_map).first(places.size()), behind, is_measured);
  for (std::size_t k = 0; k < places.size(); ++k)
    is_free[k] =
        is_measured[k] != 0 && sees_through(view, places[k].position_map, places[k].thin) ? 1 : 0;
}

void StaticMap::State::count_times_free(std::span<const PlaceToClear> places,
                                        std::span<std::uint32_t> times) const {
  std::ranges::fill(times, 0U);
  std::array<std::uint32_t, PlaceToClear::max_at_once> is_free;
  for (const RangeImageView& view : past_views) {
    find_seen_through(view, places, is_free);
    for (std::size_t k = 0; k < places.size(); ++k) times[k] += is_free[k];
  }
}

void StaticMap::State::enter_session(std::span<LiveTile* const> changing) {
  if (!max_earlier_scans) return;
  std::vector<LiveTile*> entering;
  for (LiveTile* const tile : changing)
    if (tile != nullptr && in_session.insert(tile->id()).second) entering.push_back(tile);
  tbb::parallel_for(std::size_t{0}, entering.size(),
                    [&](std::size_t i) { entering[i]->begin_session(*max_earlier_scans, rule()); });
}

std::int64_t StaticMap::State::settled_before_ns(std::int64_t stamp_ns) {
  if (max_earlier_scans && !session_begin_ns) session_begin_ns = stamp_ns;
  return std::max(session_begin_ns.value_or(stamp_ns - settled_ns), stamp_ns - settled_ns);
}

void StaticMap::State::keep(RangeImageView view, std::uint32_t scan) {
  past_views.push_back(std::move(view));
  if (past_views.size() > config.free_space_history) past_views.pop_front();
  last_scan_cleared = scan;
}

void StaticMap::State::forget_views() {
  past_views.clear();
  last_scan_cleared = 0;
}

StaticMap::StaticMap(const StaticMapConfig& config) : state_(std::make_unique<State>(config)) {}
StaticMap::~StaticMap() = default;
StaticMap::StaticMap(StaticMap&&) noexcept = default;
StaticMap& StaticMap::operator=(StaticMap&&) noexcept = default;

void StaticMap::insert(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar,
                       std::span<const std::uint8_t> is_thin) {
  assert(is_thin.empty() || is_thin.size() == scan.scan.size());
  assert(scan.motion.size() == scan.scan.size());
  assert(scan.labels.empty() || scan.labels.classes.size() == scan.scan.size());
  if (state_->is_frozen) return;
  MapTiles& tiles = state_->tiles;
  const auto batches = state_->sorter.sort(scan, T_map_lidar, is_thin);
  const std::uint32_t number = tiles.stamps().add(scan.scan.stamp_ns);
  std::vector<LiveTile*> hit(batches.size());
  std::ranges::transform(batches, hit.begin(),
                         [&](const auto& batch) { return tiles.tile(batch.tile); });
  state_->enter_session(hit);
  const SettledVoxels settled{tiles.stamps(), state_->settled_before_ns(scan.scan.stamp_ns),
                              state_->rule()};
  // A tile belongs to one task, which takes its points in the order of the scan: the map does not
  // depend on how many threads there are.
  tbb::parallel_for(std::size_t{0}, hit.size(), [&](std::size_t i) {
    if (hit[i] == nullptr) return;
    hit[i]->insert(batches[i].points, number, &settled);
  });
  tiles.begin_step();
  for (LiveTile* const tile : hit) {
    if (tile != nullptr) tiles.touch(*tile);
  }
  ++state_->inserted;
}

void StaticMap::begin_session(std::uint32_t max_scans) {
  state_->max_earlier_scans = max_scans;
  state_->session_begin_ns.reset();
  state_->in_session.clear();
  state_->forget_views();
}

void StaticMap::set_frozen(bool is_frozen) { state_->is_frozen = is_frozen; }

bool StaticMap::is_clearing() const {
  return !state_->is_frozen && state_->config.clearing_range_m > 0.0;
}

Clearing StaticMap::clearing_due(const Eigen::Vector3f& origin_map) const {
  if (!is_clearing()) return Clearing::none;
  if (state_->begins() || state_->inserted % state_->config.clearing_interval == 0)
    return Clearing::all;
  const bool has_moved_on = (origin_map - state_->last_origin_map).norm() >= session_step_m;
  return state_->session_begin_ns && has_moved_on ? Clearing::of_earlier_sessions : Clearing::none;
}

void StaticMap::clear_seen_through(RangeImageView view, std::int64_t stamp_ns, Clearing what) {
  if (state_->is_frozen || what == Clearing::none) return;
  const StaticMapConfig& config = state_->config;
  MapTiles& tiles = state_->tiles;
  const std::vector<LiveTile*> near = tiles.near(view.origin_map(), config.clearing_range_m);
  const std::uint32_t scan = tiles.stamps().add(stamp_ns);
  const bool clears_all = what == Clearing::all;
  state_->last_origin_map = view.origin_map();
  const VisibilityTest test{
      .is_free =
          [&](std::span<const PlaceToClear> places, std::span<std::uint32_t> is_free) {
            state_->find_seen_through(view, places, is_free);
          },
      .times_free_before =
          [&](std::span<const PlaceToClear> places, std::span<std::uint32_t> times) {
            state_->count_times_free(places, times);
          },
      .last_scan_cleared = state_->last_scan_cleared,
      .only_hides = state_->begins(),
      .stamps = &tiles.stamps(),
      .only_hit_before_ns = clears_all ? std::nullopt : state_->session_begin_ns};
  std::vector<std::uint8_t> hides(near.size());
  state_->enter_session(near);
  tbb::parallel_for(std::size_t{0}, near.size(), [&](std::size_t i) {
    hides[i] = near[i]->clear_seen_through(test, scan, state_->rule()) ? 1 : 0;
  });
  if (clears_all) state_->keep(std::move(view), scan);
  tiles.begin_step();
  for (std::size_t i = 0; i < near.size(); ++i) {
    // Counts changed in all of them; only tiles with a voxel to hide are published again.
    tiles.touch(*near[i], hides[i] != 0);
  }
}

std::set<TileId> StaticMap::State::to_reload(const MapCorrection& correction) const {
  std::set<TileId> wanted;
  std::optional<Eigen::Vector3d> last_map;
  for (const MapCorrection::Pose& pose : correction.poses()) {
    const bool is_near = last_map && (pose.position_map - *last_map).norm() < config.tile_size_m;
    if (is_near || MapCorrection::max_shift_m(pose, config.max_range_m) < 0.5 * config.voxel_size_m)
      continue;
    last_map = pose.position_map;
    const Eigen::Vector3d corrected_map = pose.T_new_old * pose.position_map;
    for (const Eigen::Vector3d& position_map : {pose.position_map, corrected_map}) {
      const auto near =
          tiles.non_resident_near(position_map, config.max_range_m + config.tile_size_m);
      wanted.insert(near.begin(), near.end());
    }
  }
  return wanted;
}

std::optional<CorrectedMap> StaticMap::correct(const MapCorrection& correction,
                                               std::size_t limit_bytes) {
  MapTiles& tiles = state_->tiles;
  const std::set<TileId> stored = state_->to_reload(correction);
  std::size_t bytes = stored.empty() ? 0 : tiles.memory_use().bytes;
  for (const TileId id : stored) bytes += tiles.expected_bytes(id);
  if (bytes > limit_bytes) return std::nullopt;
  for (const TileId id : stored) static_cast<void>(tiles.reload(id));

  const TileCorrection mover(
      correction, tiles.grid(), tiles.stamps(),
      [&tiles](TileId id) { return !tiles.is_known_non_resident(id); }, ++state_->corrections);
  const std::vector<LiveTile*> sources = tiles.residents();
  std::vector<TileCorrection::Moved> taken(sources.size());
  tbb::parallel_for(std::size_t{0}, sources.size(),
                    [&](std::size_t i) { taken[i] = mover.take(*sources[i]); });
  CorrectedMap corrected;
  // To the voxel: of a map that moves as a whole, these are as large as itself.
  std::map<TileId, std::size_t> sizes;
  for (const TileCorrection::Moved& moved : taken)
    for (const TileCorrection::Voxel& voxel : moved.voxels) ++sizes[voxel.tile];
  std::map<TileId, TileCorrection::Moved> parts;
  for (const auto& [id, size] : sizes) parts[id].voxels.reserve(size);
  std::set<TileId> changed;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (taken[i].voxels.empty() && taken[i].places.empty()) continue;
    changed.insert(sources[i]->id());
    corrected.moved_voxels += taken[i].voxels.size();
    for (auto& voxel : taken[i].voxels) parts[voxel.tile].voxels.push_back(voxel);
    for (auto& place : taken[i].places) parts[place.tile].places.push_back(place);
    taken[i] = {};
  }
  std::vector<std::pair<LiveTile*, TileCorrection::Moved*>> targets;
  for (auto& [id, moved] : parts) {
    targets.emplace_back(tiles.tile(id), &moved);
    changed.insert(id);
  }
  std::vector<LiveTile*> changing(targets.size());
  std::ranges::transform(targets, changing.begin(),
                         [](const auto& target) { return target.first; });
  state_->enter_session(changing);
  tbb::parallel_for(std::size_t{0}, targets.size(), [&](std::size_t i) {
    mover.put(*targets[i].first, std::move(*targets[i].second));
  });
  tiles.begin_step();
  for (const TileId id : changed) tiles.touch(*tiles.resident(id));
  corrected.changed_tiles = changed.size();
  state_->forget_views();
  return corrected;
}

ClassEvidence StaticMap::evidence_at(const Eigen::Vector3d& position_map) const {
  const MapTiles& tiles = state_->tiles;
  if (!tiles.grid().holds(position_map)) return {};
  const VoxelGrid::Index index = tiles.grid().index(position_map);
  const LiveTile* const tile = tiles.resident(index.tile);
  return tile == nullptr ? ClassEvidence() : tile->evidence(voxel_key(index.voxel));
}

std::shared_ptr<const MapSnapshot> StaticMap::view() { return state_->tiles.view(state_->rule()); }

void StaticMap::reset(std::uint64_t map_id) {
  state_->tiles.clear(map_id);
  state_->in_checkpoint.clear();
  state_->inserted = 0;
  state_->is_resumed = false;
  state_->max_earlier_scans.reset();
  state_->session_begin_ns.reset();
  state_->in_session.clear();
  state_->forget_views();
}

const StaticMapConfig& StaticMap::config() const { return state_->config; }

void StaticMap::use_tile_store(std::shared_ptr<TileStore> tile_store) {
  state_->tiles.use_store(std::move(tile_store));
}

MapCheckpoint StaticMap::checkpoint(CheckpointScope scope) {
  MapTiles& tiles = state_->tiles;
  // Published first, so that the record agrees with the view even where only another rule, or a
  // mean rounded in the file, changed the tile.
  for (LiveTile* const tile :
       tiles.to_store(scope == CheckpointScope::everything ? scope : CheckpointScope::changed)) {
    tiles.publish_again(*tile);
  }
  MapCheckpoint checkpoint{view(), tiles.begin_step(), {}};
  const std::vector<LiveTile*> wanted = tiles.to_store(scope);
  std::vector<TileRecord> records(wanted.size());
  tbb::parallel_for(std::size_t{0}, wanted.size(), [&](std::size_t i) {
    records[i] = wanted[i]->record(state_->rule(), tiles.stamps());
  });
  state_->in_checkpoint.clear();
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    wanted[i]->begin_recording();
    state_->in_checkpoint.push_back(wanted[i]->id());
    checkpoint.records.emplace(wanted[i]->id(), std::move(records[i]));
  }
  return checkpoint;
}

void StaticMap::checkpoint_stored(std::uint64_t step) {
  for (const TileId id : std::exchange(state_->in_checkpoint, {})) state_->tiles.stored(id, step);
}

void StaticMap::keep_in_memory() { state_->tiles.keep_in_memory(); }

std::size_t StaticMap::forget_lost() { return state_->tiles.forget_stored(state_->in_checkpoint); }

MemoryUse StaticMap::memory_use() const { return state_->tiles.memory_use(); }

std::size_t StaticMap::evict(const Eigen::Vector3d& position_map, std::size_t limit_bytes) {
  return state_->tiles.evict(position_map.head<2>(), state_->reach_m(), limit_bytes);
}

std::vector<std::string> StaticMap::unreadable_tiles() const {
  std::vector<std::string> faults;
  for (const auto& [id, fault] : state_->tiles.unreadable()) {
    faults.push_back("tile (" + std::to_string(id.x) + ", " + std::to_string(id.y) +
                     "): " + fault.text());
  }
  return faults;
}

std::vector<TileId> StaticMap::tiles_in(const Eigen::AlignedBox3d& box_map,
                                        std::size_t max_shown) const {
  return state_->tiles.in(box_map, max_shown);
}

std::size_t StaticMap::non_resident_among(std::span<const TileId> tiles) const {
  const auto is_away = [this](TileId id) { return state_->tiles.is_known_non_resident(id); };
  return static_cast<std::size_t>(std::ranges::count_if(tiles, is_away));
}

StaticMap::RemovedVoxels StaticMap::removed(const Eigen::AlignedBox3d& box_map,
                                            std::span<const TileId> tiles) const {
  RemovedVoxels all;
  for (const TileId id : tiles) {
    const LiveTile* const tile = state_->tiles.resident(id);
    if (tile == nullptr) {
      if (state_->tiles.is_known_non_resident(id)) all.non_resident.push_back(id);
      continue;
    }
    std::ranges::copy_if(tile->removed(state_->rule(), state_->tiles.stamps()),
                         std::back_inserter(all.voxels), [&](const RemovedVoxel& voxel) {
                           return box_map.contains(voxel.position_map.cast<double>());
                         });
  }
  return all;
}

StaticMap::RestoredVoxels StaticMap::restore_removed(RemovalReason reason,
                                                     const Eigen::AlignedBox3d& box_map,
                                                     std::span<const TileId> tiles) {
  state_->tiles.begin_step();
  RestoredVoxels restored;
  for (const TileId id : tiles) {
    if (state_->tiles.is_known_non_resident(id) && !state_->tiles.reload_now(id)) {
      restored.unreadable.push_back(id);
    }
    LiveTile* const tile = state_->tiles.resident(id);
    if (tile == nullptr) continue;
    const std::size_t voxels =
        tile->restore(reason, box_map, state_->rule(), state_->tiles.stamps());
    if (voxels > 0) state_->tiles.touch(*tile);
    restored.count += voxels;
  }
  return restored;
}

std::string StaticMap::RestoredVoxels::unreadable_text() const {
  std::ostringstream text;
  text << count << " voxels are shown again, but " << unreadable.size()
       << " tiles of the region cannot be read, the first of them (" << unreadable.front().x << ", "
       << unreadable.front().y << "); the status says why. Ask again when their disk can be read";
  return text.str();
}

void StaticMap::resume(const MapSnapshot& view, const TileEvidenceMap& tile_evidence) {
  check_sizes(view, state_->config);
  reset(view.map_id);
  state_->is_resumed = true;
  state_->tiles.resume(view, tile_evidence);
}

void StaticMap::reload_near(const Eigen::Vector3d& position_map) {
  state_->tiles.reload_near(position_map, state_->reach_m());
}

}  // namespace stillmap
