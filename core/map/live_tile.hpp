#pragma once

#include <tsl/robin_map.h>

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/voxel_index.hpp"
#include "core/map/packed_voxels.hpp"
#include "core/map/position_index.hpp"
#include "core/map/scan_stamps.hpp"
#include "core/map/tile.hpp"
#include "core/map/tile_evidence.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {

/// A point on its way into a tile.
struct TilePoint {
  std::uint32_t voxel_key = 0;
  /// From the voxel's lowest corner, in parts of a voxel (`PackedVoxel::offset_steps`).
  std::array<std::uint8_t, 3> offset{};
  SemanticClass label = SemanticClass::unlabeled;
  /// Semi-static points add evidence to existing voxels and create none; of highly dynamic points
  /// only the place is recorded.
  Motion motion = Motion::stationary;
  /// One beam alone hit something thin there (RangeImageView).
  bool is_thin = false;
  float confidence = 0.0F;
};

/// When a voxel is shown.
struct VisibilityRule {
  /// Points that it was hit by.
  std::uint32_t min_points = 1;
  /// It is hidden once this many scans saw through it, and this many for each scan that hit it.
  std::uint32_t misses_to_clear = 1;
  double misses_per_hit = 0.1;
  /// Times as many of both for voxels that labels are sure of; of a building no more for each hit.
  std::uint32_t label_trust = 3;
};

/// Whether something is known to be thinner than beams are apart: labels are sure, or one beam
/// alone hit it (RangeImageView).
enum class Thin : std::uint8_t { no, by_labels, by_beam };

/// A place that scans may have seen through (map frame [m]). Of what is thin a ray must have gone
/// through the place itself: those on either side of it tell nothing.
struct PlaceToClear {
  /// So many are asked for at once, or fewer.
  static constexpr std::size_t max_at_once = 128;

  Eigen::Vector3f position_map;
  Thin thin = Thin::no;
};

/// Whether scans saw through places.
struct VisibilityTest {
  /// Answers for all of these places.
  using Ask =
      std::function<void(std::span<const PlaceToClear> places, std::span<std::uint32_t> answers)>;

  /// 1 where a ray of this scan passed it, else 0.
  Ask is_free;
  /// How many of the scans before it did, of those that are kept; empty: none are.
  Ask times_free_before;
  /// Voxels that no scan hit until this one are asked how often they were free before.
  std::uint32_t last_scan_cleared = 0;
  /// Of what is hidden already this scan counts no miss: looks that follow each other at once tell
  /// little more than one of them, and would keep hidden what is hit again.
  bool only_hides = false;
  /// Those of the tile's scans; null: what is hidden says nothing of what is beside it.
  const ScanStamps* stamps = nullptr;
  /// Of voxels that a scan from this time on has hit it counts no miss; needs `stamps`.
  std::optional<std::int64_t> only_hit_before_ns{};
};

/// Which voxels have been there for so long that a point beside one, within what ranges and poses
/// err by, is taken for one of it: see LiveTile::insert.
struct SettledVoxels {
  /// Those of the tile's scans.
  const ScanStamps& stamps;
  /// They were seen before this time.
  std::int64_t before_ns = 0;
  /// And are shown by this rule.
  VisibilityRule rule;
};

/// The mutable side of a tile: all evidence so far, also of voxels that no snapshot shows yet, in
/// some 38 bytes a voxel. Scans are named by their number in the map's `ScanStamps`, which must
/// outlive the tile.
class LiveTile {
 public:
  LiveTile(TileId id, const VoxelGrid& grid) : id_(id), grid_(grid) {}
  /// Restores a tile from its record; adds the stamps that its voxels name.
  LiveTile(TileId id, const TileRecord& record, const VoxelGrid& grid, ScanStamps& stamps);

  /// What is known so far is of earlier sessions of the map: it counts as that of `max_scans` scans
  /// at most, for or against a voxel. What is shown does not change by that.
  void begin_session(std::uint32_t max_scans, const VisibilityRule& rule);

  /// Points in voxels beyond the first 16,777,215 of a tile are left out. Where there is no voxel
  /// yet, a point within a quarter of a voxel, and 5 cm, of a settled one counts for that: surfaces
  /// that lie on a border of voxels would double with every visit. Not a point of another class, or
  /// of something thin.
  void insert(std::span<const TilePoint> points, std::uint32_t scan,
              const SettledVoxels* settled = nullptr);

  /// Counts a miss for each voxel that the scan saw through, and for each earlier scan that saw
  /// through a voxel which came after it; and hides what was a part of what is hidden. True when
  /// this hides a voxel.
  [[nodiscard]] bool clear_seen_through(const VisibilityTest& test, std::uint32_t scan,
                                        const VisibilityRule& rule);

  /// Of the voxel; no votes when there is no such voxel.
  [[nodiscard]] ClassEvidence evidence(std::uint32_t voxel_key) const;

  /// Publishes the voxels that the rule shows and whose class is not a movable one. False, and the
  /// published tile stays, when the content is the same as before.
  [[nodiscard]] bool publish(std::uint64_t revision, const VisibilityRule& rule,
                             const ScanStamps& stamps);

  /// What was hit and is not shown, in no order.
  [[nodiscard]] std::vector<RemovedVoxel> removed(const VisibilityRule& rule,
                                                  const ScanStamps& stamps) const;
  /// Shows the voxels that are hidden for this reason, whatever is seen of them later. Returns how
  /// many.
  std::size_t restore(RemovalReason reason, const Eigen::AlignedBox3d& box_map,
                      const VisibilityRule& rule, const ScanStamps& stamps);

  /// Whether what is published differs by more than a few voxels from what was stored last. A
  /// standing lidar finds a new voxel now and then, at the edge of its noise.
  [[nodiscard]] bool view_has_changed() const { return unrecorded_voxels_ >= min_changed_voxels; }
  /// A record of the tile is to be stored.
  void begin_recording() { recording_voxels_ = unrecorded_voxels_; }
  /// It is stored.
  void end_recording() { unrecorded_voxels_ -= std::exchange(recording_voxels_, 0); }

  /// The complete state. Requires that the tile did not change since `publish`.
  [[nodiscard]] TileRecord record(const VisibilityRule& rule, const ScanStamps& stamps) const;

  /// Memory in use, the published tile included.
  [[nodiscard]] std::size_t memory_bytes() const;

  [[nodiscard]] TileId id() const { return id_; }
  /// Shared by snapshots; null while no voxel is shown.
  [[nodiscard]] const std::shared_ptr<const Tile>& published() const { return published_; }

 private:
  /// Takes voxels out, and puts them elsewhere.
  friend class TileCorrection;

  static constexpr std::size_t min_changed_voxels = 16;
  static constexpr std::uint16_t max_misses = VoxelHistory::max_misses;
  static constexpr std::uint16_t misses_of_rest = VoxelHistory::misses_of_rest;

  struct LiveVoxel {
    PackedVoxel packed;
    /// Numbers of scans.
    std::uint32_t first_scan = 0;
    std::uint32_t last_scan = 0;
    std::uint16_t hits = 0;
    std::uint16_t misses : 13 = 0;
    /// One beam alone hit something thin in it.
    std::uint16_t is_thin : 1 = 0;
    std::uint16_t was_shown : 1 = 0;
    std::uint16_t is_restored : 1 = 0;
  };
  static_assert(sizeof(LiveVoxel) == 32);
  /// A voxel that only movable objects hit.
  struct Excluded {
    std::uint32_t last_scan = 0;
    SemanticClass label = SemanticClass::unlabeled;
    bool was_moving = false;
  };
  /// Positions of voxels and the stamps that these were seen at.
  class Selection;

  void add(const PackedVoxels& known, const std::function<VoxelHistory(std::size_t)>& history,
           ScanStamps& stamps);
  [[nodiscard]] std::size_t size() const { return sorted_.size() + fresh_.size(); }
  /// Positions count through both lists.
  [[nodiscard]] const LiveVoxel& at(std::uint32_t position) const {
    return position < sorted_.size() ? sorted_[position] : fresh_[position - sorted_.size()];
  }
  [[nodiscard]] LiveVoxel& at(std::uint32_t position) {
    return position < sorted_.size() ? sorted_[position] : fresh_[position - sorted_.size()];
  }
  [[nodiscard]] auto key_at() const {
    return [this](std::uint32_t position) { return at(position).packed.key; };
  }
  /// Null where there is no such voxel. It is looked for at its likely position first
  /// (PositionIndex), where there is one.
  [[nodiscard]] LiveVoxel* find(std::uint32_t key,
                                std::uint32_t likely_position = PositionIndex::none);
  /// The voxel of a point that there is none of yet; null where it makes none.
  [[nodiscard]] LiveVoxel* make(const TilePoint& point);
  LiveVoxel& add_fresh(std::uint32_t key);
  /// So many points are looked up before they are added: their voxels are on their way meanwhile.
  static constexpr std::size_t block_size = 64;
  using LikelyPositions = std::array<std::uint32_t, block_size>;
  void insert_block(std::span<const TilePoint> points, const LikelyPositions& positions,
                    std::uint32_t scan, const SettledVoxels* settled);
  /// Counts a point, of which there is no voxel yet, for a settled one beside it. False where there
  /// is none.
  [[nodiscard]] bool add_to_settled(const TilePoint& point, std::uint32_t scan,
                                    const SettledVoxels& settled);
  /// The voxel of this key, where a point may be of it; null where not.
  [[nodiscard]] LiveVoxel* find_settled(std::uint32_t key, const TilePoint& point,
                                        const SettledVoxels& settled);
  /// Asks for the memory of the voxels that these points hit. Returns their likely positions, one
  /// for all points that follow each other in a voxel.
  [[nodiscard]] LikelyPositions prefetch_voxels(std::span<const TilePoint> points) const;
  /// Counts points of a voxel that have one label and motion.
  static void hit(LiveVoxel& voxel, std::span<const TilePoint> alike, std::uint32_t scan);
  class Look;
  static void add_misses(LiveVoxel& voxel, std::uint32_t misses);
  /// Of objects that moved on, only those voxels are seen through that a ray happens to pass: hides
  /// the rest, from those that clearing has hidden on to all that touch. True when it hides one.
  [[nodiscard]] bool hide_rest_of_movers(const ScanStamps& stamps, std::int64_t now_ns,
                                         const VisibilityRule& rule);
  /// Whether the voxel, which touches one of a mover that was seen last at this time, is of the
  /// same.
  [[nodiscard]] bool is_of_mover(const LiveVoxel& voxel, std::int64_t mover_seen_ns,
                                 const ScanStamps& stamps, const VisibilityRule& rule) const;
  /// Calls `visit` with the position of each voxel that shares a side with this one.
  template <typename Visit>
  void for_each_neighbour(std::uint32_t key, Visit visit) const;
  static void forget_beyond(LiveVoxel& voxel, std::uint32_t max_scans, const VisibilityRule& rule);
  static void exclude(Excluded& voxel, const TilePoint& point, std::uint32_t scan);
  std::size_t restore_excluded(RemovalReason reason, const Eigen::AlignedBox3d& box_map,
                               const VisibilityRule& rule, const ScanStamps& stamps);
  [[nodiscard]] static VoxelHistory history(const LiveVoxel& voxel);
  [[nodiscard]] static Thin thin(const LiveVoxel& voxel);
  /// So many misses hide it, and so many for each hit.
  [[nodiscard]] static std::uint32_t misses_to_clear(const LiveVoxel& voxel,
                                                     const VisibilityRule& rule);
  [[nodiscard]] static double misses_per_hit(const LiveVoxel& voxel, const VisibilityRule& rule);
  [[nodiscard]] static bool is_seen_through(const LiveVoxel& voxel, const VisibilityRule& rule);
  [[nodiscard]] static bool is_shown(const LiveVoxel& voxel, const VisibilityRule& rule);
  /// Nothing for voxels that are shown, or were hit too rarely to be.
  [[nodiscard]] static std::optional<RemovalReason> removal(const LiveVoxel& voxel,
                                                            const VisibilityRule& rule);
  [[nodiscard]] Eigen::Vector3f mean_map(const LiveVoxel& live) const {
    return stillmap::mean_map(live.packed, id_, grid_);
  }
  [[nodiscard]] Eigen::Vector3f centre_map(std::uint32_t key) const;
  [[nodiscard]] static RemovalReason reason_of(const Excluded& excluded);
  /// Merges the fresh voxels with the sorted ones.
  void sort_fresh();
  [[nodiscard]] std::vector<PackedVoxel> packed(const Selection& selection) const;
  [[nodiscard]] SeenTimes seen_times(const Selection& selection, const ScanStamps& stamps) const;

  TileId id_;
  VoxelGrid grid_;
  /// By key; no larger than what it holds.
  std::vector<LiveVoxel> sorted_;
  /// Those that came since the last publication, in no order.
  std::vector<LiveVoxel> fresh_;
  PositionIndex index_;
  /// Keys of voxels that clearing has hidden, and beside which nothing was looked for yet.
  std::vector<std::uint32_t> hidden_;
  tsl::robin_map<std::uint32_t, Excluded, IndexHash> excluded_;
  std::shared_ptr<const Tile> published_;
  /// Before this there was no voxel: nothing is settled then.
  std::int64_t first_seen_ns_ = std::numeric_limits<std::int64_t>::max();
  /// Voxels that appeared, went or got another class since the last record.
  std::size_t unrecorded_voxels_ = 0;
  std::size_t recording_voxels_ = 0;
};

}  // namespace stillmap
