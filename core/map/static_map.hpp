#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/range_image_view.hpp"
#include "core/map/map_correction.hpp"
#include "core/map/tile.hpp"
#include "core/map/tile_evidence.hpp"

namespace stillmap {

struct StaticMapConfig {
  double voxel_size_m = 0.2;
  /// A whole number of voxels, at most 256.
  double tile_size_m = 20.0;
  /// Points farther from the lidar than this are not mapped.
  double max_range_m = 60.0;
  /// A voxel enters the view once it was hit this often.
  std::uint32_t min_points = 1;
  /// Visibility clearing runs on every n-th scan: consecutive scans see through the same voxels. Of
  /// a new map it runs on each of the first 16, and of as many as `free_space_history` at most.
  std::uint32_t clearing_interval = 3;
  /// A voxel is hidden once this many of those scans saw through it, and this many for each scan
  /// that hit it.
  std::uint32_t misses_to_clear = 1;
  double misses_per_hit = 0.1;
  /// Times as many of both for voxels that have a class with a mean confidence of 0.7: of one that
  /// cannot move, else they were not shown. Of a building not as many for each hit: networks take
  /// the sides of trams and buses for one, and are sure of it.
  std::uint32_t label_trust = 3;
  /// So many of those scans are kept: those that saw free space where a voxel is now, before it was
  /// hit for the first time, count as well.
  std::uint32_t free_space_history = 16;
  /// Range of clearing round the lidar; 0 turns clearing off.
  double clearing_range_m = 60.0;
  /// A ray passes through a voxel when it ends at least this far behind it (a voxel, where those
  /// are larger), plus this share of the range.
  double clearing_margin_m = 0.3;
  double clearing_margin_share = 0.01;

  /// Every fault in words, one a line; empty when the configuration can be used.
  [[nodiscard]] std::string faults() const;
};

/// Throws std::invalid_argument when the voxel or tile size of a stored map is not the configured
/// one.
void check_sizes(const MapSnapshot& stored, const StaticMapConfig& config);

/// Evidence of tiles beyond the voxels that they show. Null: the whole tile is in the tile store.
using TileEvidenceMap = std::map<TileId, std::shared_ptr<const TileEvidence>>;

/// A state of the map to be stored.
struct MapCheckpoint {
  std::shared_ptr<const MapSnapshot> view;
  /// To be passed to `checkpoint_stored` once it is written.
  std::uint64_t step = 0;
  /// Complete records of tiles that changed since they were stored last.
  std::map<TileId, TileRecord> records;
};

/// Which tiles go into a checkpoint.
enum class CheckpointScope {
  /// Those whose view changed by more than a few voxels since they were stored.
  changed_views,
  /// Those that changed in any way, if only in counts and times.
  changed,
  /// All that are in memory.
  everything,
};

struct MemoryUse {
  std::size_t bytes = 0;
  /// Tiles in memory, and in the tile store.
  std::size_t resident_tiles = 0;
  std::size_t non_resident_tiles = 0;
};

/// Which voxels visibility clearing looks at.
enum class Clearing : std::uint8_t {
  none,
  /// Those that no scan of this session has hit. What has gone since is in sight of few scans, and
  /// each that has moved on looks through its place elsewhere.
  of_earlier_sessions,
  all,
};

/// The planning map: stationary points only, as labelled voxels in tiles (paper II-C.2). One
/// thread writes; views are immutable and may be read from any thread.
class StaticMap {
 public:
  /// Throws std::invalid_argument with `config.faults()`.
  explicit StaticMap(const StaticMapConfig& config);
  ~StaticMap();
  StaticMap(StaticMap&&) noexcept;
  StaticMap& operator=(StaticMap&&) noexcept;

  /// Adds the stationary points of the scan. Semi-static points add evidence to existing voxels and
  /// create none; of highly dynamic points only the place is recorded. Points that are not
  /// finite, beyond `max_range_m`, or farther than 100 km from the map's origin are left out.
  /// `scan.motion` is as long as the scan. The result does not depend on the number of threads.
  /// `is_thin` tells of each point whether one beam alone hit something thin there
  /// (RangeImageView): rays beside it clear no voxel of it then. Empty: of no point.
  void insert(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar,
              std::span<const std::uint8_t> is_thin = {});

  /// What scans of earlier sessions say of a place is worth that of two seconds: the rest would
  /// outvote what is seen when passing by.
  static constexpr std::uint32_t default_earlier_scans = 20;
  /// What follows is another session of this map. Scans of those before count as `max_scans` at
  /// most, for or against a voxel, so that what is gone goes, however often it was seen before;
  /// what is shown stays until a scan says otherwise. Tiles that no scan of the session reaches
  /// stay as they are.
  void begin_session(std::uint32_t max_scans = default_earlier_scans);

  /// Whether scans clear at all, some of them.
  [[nodiscard]] bool is_clearing() const;
  /// What visibility clearing is due for with the scan inserted last, which was taken from there.
  [[nodiscard]] Clearing clearing_due(const Eigen::Vector3f& origin_map) const;
  /// Visibility clearing: counts a miss for each voxel that this scan saw through, and for each
  /// voxel that is new as many as earlier scans saw through its place. What stood there is not part
  /// of the static world, whatever its class.
  void clear_seen_through(RangeImageView view, std::int64_t stamp_ns,
                          Clearing what = Clearing::all);

  /// Moves what was seen from poses that were wrong, by TileCorrection. Non-resident tiles that
  /// change are reloaded: nothing, and the map stays as it is, where it would then take more than
  /// `limit_bytes`. What cannot be read, or would go where a tile cannot be, stays where it is.
  std::optional<CorrectedMap> correct(
      const MapCorrection& correction,
      std::size_t limit_bytes = std::numeric_limits<std::size_t>::max());

  /// The tiles whose footprint meets the box (map frame [m]), resident or not, also those that show
  /// nothing; sorted. Of those that show something, the first `max_shown`.
  [[nodiscard]] std::vector<TileId> tiles_in(
      const Eigen::AlignedBox3d& box_map,
      std::size_t max_shown = std::numeric_limits<std::size_t>::max()) const;
  /// How many of these tiles are in the tile store alone.
  [[nodiscard]] std::size_t non_resident_among(std::span<const TileId> tiles) const;
  /// What of tiles is kept out of the planning view.
  struct RemovedVoxels {
    /// In no order.
    std::vector<RemovedVoxel> voxels;
    /// Those of the tiles that are not in memory: what they hold is in the tile store.
    std::vector<TileId> non_resident;
  };
  /// Voxels in the box (map frame [m]) that are removed from the planning view, with the reason, in
  /// these tiles.
  [[nodiscard]] RemovedVoxels removed(const Eigen::AlignedBox3d& box_map,
                                      std::span<const TileId> tiles) const;
  /// What was shown again.
  struct RestoredVoxels {
    std::size_t count = 0;
    /// Those of the tiles that could not be read.
    std::vector<TileId> unreadable;
    /// Why it is not complete, where any could not.
    [[nodiscard]] std::string unreadable_text() const;
  };
  /// Shows again what was removed for this reason in this part of these tiles; it stays until a
  /// reset. Non-resident ones are reloaded.
  RestoredVoxels restore_removed(RemovalReason reason, const Eigen::AlignedBox3d& box_map,
                                 std::span<const TileId> tiles);

  /// Evidence of the voxel at a position (map frame [m]), shown in a view or not; no votes where
  /// nothing was seen. May be called from several threads, but not beside a change of the map.
  [[nodiscard]] ClassEvidence evidence_at(const Eigen::Vector3d& position_map) const;

  /// The planning view as it is now: voxels hit `min_points` times whose class is not a movable
  /// one. Tiles whose content (`content_hash`) did not change since the last view are shared
  /// with it, with their counts and times of then; where nothing changed, so is the whole view.
  [[nodiscard]] std::shared_ptr<const MapSnapshot> view();

  /// Takes over a stored map; later scans extend it. Tiles without their voxels are taken to be in
  /// the tile store. Give it a new `map_id`: the map may have been at a later version than the one
  /// stored. Throws std::invalid_argument when its voxel or tile size is not the configured one.
  void resume(const MapSnapshot& view, const TileEvidenceMap& tile_evidence = {});

  /// Backing store of evicted tiles. It must hold what the checkpoints of this map wrote.
  void use_tile_store(std::shared_ptr<TileStore> tile_store);
  /// The map as it is now, with the records of the tiles that are to be stored.
  [[nodiscard]] MapCheckpoint checkpoint(CheckpointScope scope = CheckpointScope::changed);
  /// To be called when the checkpoint of this step, the last one taken, is in the tile store.
  void checkpoint_stored(std::uint64_t step);
  /// To be called before that where the tile store lost what it had: tiles that were evicted before
  /// the last checkpoint was taken are gone, as those that show nothing any more, and the others
  /// stay in memory until it is stored. It must be one of everything. Returns how many are gone.
  std::size_t forget_lost();
  /// What the tile store had is gone: nothing that is in memory is evicted before it is stored.
  void keep_in_memory();
  /// Evicts tiles that are stored and out of the reach of the lidar, farthest first, until the map
  /// takes no more than this. Returns how many. They are reloaded when they are needed.
  std::size_t evict(const Eigen::Vector3d& position_map, std::size_t limit_bytes);
  /// Reloads the tiles that scans from here reach, from the tile store.
  void reload_near(const Eigen::Vector3d& position_map);
  /// Memory of the tiles, published ones included.
  [[nodiscard]] MemoryUse memory_use() const;
  /// Tiles that could not be read from the tile store, with the reason; they stay as they are
  /// stored.
  [[nodiscard]] std::vector<std::string> unreadable_tiles() const;

  /// While frozen, scans are neither inserted nor cleared with: the map keeps what it has and takes
  /// no more memory.
  void set_frozen(bool is_frozen);

  /// Empties the map; `map_id` tells clients that it is another one now.
  void reset(std::uint64_t map_id);

  [[nodiscard]] const StaticMapConfig& config() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stillmap
