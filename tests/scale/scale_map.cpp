// A map file of any number of tiles: the hall of room_scans in the middle, mapped and driven round
// once, and made-up ground as far as it takes.
//
//   scale_map FILE TILES
//
// Tiles are of 40 voxels, as a sparse lidar leaves them.

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Statement.h>
#include <SQLiteCpp/Transaction.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <random>
#include <set>
#include <vector>

#include "core/map/static_map.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/map/storage/tile_codec.hpp"
#include "core/map/voxel_grid.hpp"
#include "tests/scale/scale_drive.hpp"

namespace stillmap::test {
namespace {

constexpr std::size_t voxels_a_tile = 40;
constexpr std::int64_t seen_ns = 1'600'000'000'000'000'000;
/// Made-up tiles keep this far from the hall, in tiles: what is near it is as it was mapped.
constexpr int hall_tiles = 3;
constexpr std::size_t batch = 4096;

LabelledScan labelled(Scan scan) {
  LabelledScan labelled;
  labelled.labels.classes = scan.labels;
  labelled.labels.confidence.assign(scan.size(), 1.0F);
  labelled.motion.assign(scan.size(), Motion::stationary);
  labelled.scan = std::move(scan);
  return labelled;
}

/// The hall after one round.
SavedMap hall() {
  StaticMap map{StaticMapConfig{}};
  SharedTrajectory path;
  for (int i = 0; i < scans_a_round; ++i) {
    const StampedPose pose = round_pose(i);
    map.insert(labelled(seen_in_room(pose)), pose.T_map_lidar);
    path.push_back(pose);
  }
  SavedMap saved = to_saved_map(map.checkpoint(CheckpointScope::everything));
  saved.view.map_id = 1;
  saved.trajectory = path;
  saved.metadata = {{map_ended_key, "yes"}, {"software", "scale_map"}};
  return saved;
}

/// Ids in a square round the hall, from within.
std::vector<TileId> ids_round_hall(std::size_t count) {
  std::vector<TileId> ids;
  for (int ring = hall_tiles; ids.size() < count; ++ring) {
    for (int i = -ring; i < ring; ++i) {
      for (const TileId id : {TileId{i, -ring}, {ring, i}, {-i, ring}, {-ring, -i}}) {
        if (ids.size() < count) ids.push_back(id);
      }
    }
  }
  return ids;
}

Tile made_up_tile(TileId id, const VoxelGrid& grid) {
  std::mt19937 random(static_cast<std::uint32_t>(id.x * 7919 + id.y));
  std::uniform_int_distribution<int> column(0, 99);
  std::set<VoxelIndex> places;
  while (places.size() < voxels_a_tile) {
    places.insert({static_cast<std::uint16_t>(column(random)),
                   static_cast<std::uint16_t>(column(random)), -8});
  }
  std::vector<Voxel> voxels;
  for (const VoxelIndex place : places) {
    Voxel voxel;
    voxel.index = place;
    voxel.point_count = 3;
    voxel.mean_map = (grid.corner_map(id, place).array() + 0.1).cast<float>();
    voxel.evidence.add(SemanticClass::road, 0.9F);
    voxel.first_seen_ns = voxel.last_seen_ns = seen_ns;
    voxels.push_back(voxel);
  }
  return make_tile(id, 1, std::move(voxels), grid);
}

struct Rows {
  Tile tile;
  std::vector<std::uint8_t> encoded;
  std::vector<std::uint8_t> evidence;
};

Rows rows_of(TileId id, const VoxelGrid& grid) {
  Rows rows{made_up_tile(id, grid), {}, {}};
  rows.encoded = encode_tile(rows.tile);
  TileEvidence evidence;
  evidence.id = id;
  evidence.shown.assign(rows.tile.voxels.size(), {.hits = 3, .was_shown = true});
  rows.evidence = encode_evidence(evidence);
  return rows;
}

void write(SQLite::Database& database, const std::vector<Rows>& all) {
  SQLite::Transaction transaction(database);
  SQLite::Statement tile(database, "INSERT INTO tiles VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  SQLite::Statement evidence(database, "INSERT INTO memories VALUES (?, ?, ?)");
  for (const Rows& rows : all) {
    const TileInfo& info = rows.tile.info;
    tile.bind(1, info.id.x);
    tile.bind(2, info.id.y);
    tile.bind(3, static_cast<std::int64_t>(info.revision));
    tile.bind(4, static_cast<std::int64_t>(info.content_hash));
    tile.bindNoCopy(5, rows.encoded.data(), static_cast<int>(rows.encoded.size()));
    tile.bind(6, info.voxel_count);
    for (int axis = 0; axis < 3; ++axis) {
      tile.bind(7 + axis, static_cast<double>(info.bounds_map.min()[axis]));
      tile.bind(10 + axis, static_cast<double>(info.bounds_map.max()[axis]));
    }
    tile.exec();
    tile.reset();
    evidence.bind(1, info.id.x);
    evidence.bind(2, info.id.y);
    evidence.bindNoCopy(3, rows.evidence.data(), static_cast<int>(rows.evidence.size()));
    evidence.exec();
    evidence.reset();
  }
  transaction.commit();
}

void make(const std::filesystem::path& file, std::size_t tiles) {
  const SavedMap saved = hall();
  open_map_file(file)->save(saved);
  const VoxelGrid grid(saved.view.voxel_size_m, saved.view.tile_size_m);
  SQLite::Database database(file.string(), SQLite::OPEN_READWRITE);
  database.exec("PRAGMA synchronous = OFF");
  std::vector<TileId> ids = ids_round_hall(tiles - std::min(tiles, saved.view.tiles.size()));
  // In the order of the index, which then grows at its end.
  std::ranges::sort(ids);
  for (std::size_t begin = 0; begin < ids.size(); begin += batch) {
    std::vector<Rows> rows(std::min(batch, ids.size() - begin));
    tbb::parallel_for(std::size_t{0}, rows.size(),
                      [&](std::size_t i) { rows[i] = rows_of(ids[begin + i], grid); });
    write(database, rows);
  }
  database.exec("PRAGMA wal_checkpoint(TRUNCATE)");
}

}  // namespace
}  // namespace stillmap::test

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: %s FILE TILES\n", argv[0]);
    return 2;
  }
  try {
    stillmap::test::make(argv[1], static_cast<std::size_t>(std::atoll(argv[2])));
  } catch (const std::exception& fault) {
    std::fprintf(stderr, "scale_map: %s\n", fault.what());
    return 1;
  }
}
