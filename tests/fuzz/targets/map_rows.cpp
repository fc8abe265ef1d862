// Rows of a map file whose database is sound: sizes of the map, poses, and tiles and their evidence
// by what is inside their frames, with the content hash that fits where there is one.

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/Statement.h>

#include <cstring>

#include "core/map/storage/tile_codec.hpp"
#include "core/map/storage/tile_frame.hpp"
#include "core/map/tile.hpp"
#include "core/map/tools/map_check.hpp"
#include "core/map/voxel_grid.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/loaded_map.hpp"
#include "tests/fuzz/memory_folder.hpp"
#include "tests/fuzz/street_map.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace map_rows_inputs {
namespace {

enum Row : std::uint8_t { sizes, pose, tile, memory, metadata, rows };

/// Added to a row whose content is of the newest format; without it, of the first one.
constexpr std::uint8_t newest_format = rows * (tile_formats.size() - 1);

/// Bytes of a row that is as long as it says: a length of 16 bits before them.
Bytes sized_bytes(ByteSource& source) { return source.take(source.value<std::uint16_t>()); }

void bind_blob(SQLite::Statement& statement, int index, const std::vector<std::uint8_t>& blob) {
  statement.bind(index, blob.data(), static_cast<int>(blob.size()));
}

void write_sizes(SQLite::Database& database, ByteSource& source) {
  SQLite::Statement update(database,
                           "UPDATE map SET version = ?, tile_size_m = ?, voxel_size_m = ?");
  update.bind(1, source.value<std::int64_t>());
  update.bind(2, source.value<double>());
  update.bind(3, source.value<double>());
  update.exec();
}

void write_pose(SQLite::Database& database, ByteSource& source) {
  SQLite::Statement insert(database,
                           "INSERT OR REPLACE INTO trajectory VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
  insert.bind(1, source.byte());
  insert.bind(2, source.value<std::int64_t>());
  for (int column = 3; column <= 9; ++column) insert.bind(column, source.value<double>());
  insert.exec();
}

/// The tile encoded with the hash of its voxels; as it stands where it is none.
std::vector<std::uint8_t> with_hash(std::vector<std::uint8_t> encoded, TileInfo& info) {
  try {
    const StaticMapConfig config = street_config();
    Tile decoded = decode_tile(encoded, {config.voxel_size_m, config.tile_size_m});
    decoded.info.content_hash = content_hash(decoded.voxels.packed());
    info = decoded.info;
    return encode_tile(decoded);
  } catch (const TileCodecError&) {
    return encoded;
  }
}

void write_tile(SQLite::Database& database, std::uint8_t format, ByteSource& source) {
  TileInfo info;
  const auto encoded = with_hash(to_frame(format, {bytes_of(sized_bytes(source)), {}}), info);
  SQLite::Statement insert(
      database,
      "INSERT OR REPLACE INTO tiles (x, y, revision, content_hash, encoded, voxel_count, min_x, "
      "min_y, min_z, max_x, max_y, max_z) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  insert.bind(1, info.id.x);
  insert.bind(2, info.id.y);
  insert.bind(3, static_cast<std::int64_t>(info.revision));
  insert.bind(4, static_cast<std::int64_t>(info.content_hash));
  bind_blob(insert, 5, encoded);
  insert.bind(6, info.voxel_count);
  for (int axis = 0; axis < 3; ++axis) {
    insert.bind(7 + axis, static_cast<double>(info.bounds_map.min()[axis]));
    insert.bind(10 + axis, static_cast<double>(info.bounds_map.max()[axis]));
  }
  insert.exec();
}

void write_memory(SQLite::Database& database, std::uint8_t format, ByteSource& source) {
  const Bytes content = sized_bytes(source);
  TileId id;
  if (content.size() >= sizeof(id)) std::memcpy(&id, content.data(), sizeof(id));
  SQLite::Statement insert(database, "INSERT OR REPLACE INTO memories VALUES (?, ?, ?)");
  insert.bind(1, id.x);
  insert.bind(2, id.y);
  bind_blob(insert, 3, to_frame(format, {bytes_of(content), {}}));
  insert.exec();
}

void write_metadata(SQLite::Database& database, ByteSource& source) {
  SQLite::Statement insert(database, "INSERT OR REPLACE INTO metadata VALUES (?, ?)");
  insert.bind(1, text_of(source.take(source.byte())));
  insert.bind(2, text_of(source.take(source.byte())));
  insert.exec();
}

/// What the tables themselves refuse, as NaN where they want a number, is in no file.
void write_row(SQLite::Database& database, ByteSource& source) try {
  const std::uint8_t choice = source.byte();
  const auto row = static_cast<Row>(choice % rows);
  const std::uint8_t format = tile_formats.at(choice / rows % tile_formats.size());
  if (row == sizes) write_sizes(database, source);
  if (row == pose) write_pose(database, source);
  if (row == tile) write_tile(database, format, source);
  if (row == memory) write_memory(database, format, source);
  if (row == metadata) write_metadata(database, source);
} catch (const SQLite::Exception&) {
}

/// An empty map of the street's sizes, as bytes of a file.
const std::string& template_file() {
  static const std::string bytes = [] {
    const auto& folder = MemoryFolder::of_this_process();
    folder.remove("template.stillmap");
    const auto file = folder.path("template.stillmap");
    SavedMap empty = small_street();
    empty.view.tiles = {};
    empty.tile_evidence.clear();
    empty.trajectory = {};
    open_map_file(file)->save(empty);
    return content_of(file);
  }();
  return bytes;
}

void run(Bytes bytes) {
  const auto& folder = MemoryFolder::of_this_process();
  folder.remove("rows.stillmap");
  const auto file = folder.file("rows.stillmap", template_file());
  {
    SQLite::Database database(file.string(), SQLite::OPEN_READWRITE);
    database.exec("PRAGMA synchronous = OFF; PRAGMA journal_mode = DELETE");
    ByteSource source(bytes);
    while (!source.empty()) write_row(database, source);
    database.exec("PRAGMA journal_mode = WAL");
  }
  static_cast<void>(check_map_file(file));
  load_and_resume_map(file);
}

void append_row(std::string& bytes, Row row, const std::vector<std::uint8_t>& encoded) {
  const std::vector<std::uint8_t> content = from_frame(encoded, 1);
  bytes.push_back(static_cast<char>(newest_format + row));
  append_value(bytes, static_cast<std::uint16_t>(content.size()));
  bytes.append(content.begin(), content.end());
}

/// Only as many voxels as an input may have bytes for.
Tile first_voxels(const Tile& whole) {
  constexpr std::size_t count = 20;
  Tile tile = whole;
  tile.voxels = tile.voxels.first(std::min(count, tile.voxels.size()));
  tile.info.voxel_count = static_cast<std::uint32_t>(tile.voxels.size());
  return tile;
}

std::vector<Seed> seeds() {
  const SavedMap street = small_street();
  const Tile shown = first_voxels(*street.view.tiles.front());
  TileEvidence known = *street.tile_evidence.at(shown.info.id);
  known.shown.resize(shown.voxels.size());
  std::string all;
  append_row(all, tile, encode_tile(shown));
  append_row(all, memory, encode_evidence(known));
  std::string numbers(1, static_cast<char>(pose));
  numbers.push_back(0);
  append_value(numbers, std::int64_t{1'700'000'000'000'000'000});
  for (const double value : {1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0}) append_value(numbers, value);
  numbers.push_back(static_cast<char>(sizes));
  append_value(numbers, std::int64_t{5});
  append_value(numbers, 4.0);
  append_value(numbers, 0.2);
  numbers.push_back(static_cast<char>(metadata));
  numbers.append("\x03keg\x02vw");
  return {{"tile", all}, {"numbers", numbers}, {"both", numbers + all}};
}

}  // namespace
}  // namespace map_rows_inputs

const Target map_rows_target{"map_rows", map_rows_inputs::run, map_rows_inputs::seeds};

}  // namespace stillmap::fuzz
