#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <span>
#include <vector>

namespace stillmap {

struct Tile;

/// A square column of the map frame: [x, x+1) * tile_size_m by [y, y+1) * tile_size_m, all heights.
struct TileId {
  std::int32_t x = 0;
  std::int32_t y = 0;
  friend auto operator<=>(const TileId&, const TileId&) = default;
};

/// Immutable tiles sorted by id, in pieces that tables share: a copy costs one pointer, and a table
/// with some tiles changed costs their pieces, however large the map is. Safe to read from any
/// thread.
class TileTable {
 public:
  using SharedTile = std::shared_ptr<const Tile>;
  /// Tiles of a piece, at most.
  static constexpr std::size_t max_piece_tiles = 256;

  /// A tile of this id from now on, or none.
  struct Edit {
    TileId id;
    SharedTile tile;
  };

  class Iterator;
  using iterator = Iterator;
  using const_iterator = Iterator;
  using value_type = SharedTile;

  TileTable() = default;
  /// In any order; of one id only one.
  TileTable(std::initializer_list<SharedTile> tiles);
  explicit TileTable(std::vector<SharedTile> tiles);

  /// This table after the edits, which are sorted by id, of each id one.
  [[nodiscard]] TileTable with(std::span<const Edit> edits) const;
  /// The same for one tile, in place.
  void set(const SharedTile& tile);
  void erase(TileId id);

  [[nodiscard]] bool empty() const { return index_ == nullptr; }
  [[nodiscard]] std::size_t size() const;
  /// Of all tiles, resident or not.
  [[nodiscard]] std::uint64_t voxel_count() const;
  /// How many tiles have their voxels elsewhere (`is_non_resident`).
  [[nodiscard]] std::size_t non_resident_count() const;

  [[nodiscard]] Iterator begin() const;
  [[nodiscard]] Iterator end() const;
  /// By position in the order of ids.
  [[nodiscard]] const SharedTile& operator[](std::size_t position) const;
  [[nodiscard]] const SharedTile& front() const { return (*this)[0]; }
  [[nodiscard]] const SharedTile& back() const { return (*this)[size() - 1]; }

  /// The tile of this id; null when there is none.
  [[nodiscard]] SharedTile find(TileId id) const;
  /// The first tile whose id is not less.
  [[nodiscard]] Iterator lower_bound(TileId id) const;

  /// Calls `visit` with each tile whose revision is above this, ascending; pieces without one are
  /// passed over.
  void for_each_newer(std::uint64_t revision,
                      const std::function<void(const SharedTile& tile)>& visit) const;
  /// Calls `visit` for each id that has another tile (by pointer) in `after` than in `before`,
  /// ascending; null where there is none. Pieces that both share are passed over.
  static void for_each_difference(
      const TileTable& before, const TileTable& after,
      const std::function<void(const SharedTile& before, const SharedTile& after)>& visit);

  /// Whether they hold the same tiles, by pointer.
  friend bool operator==(const TileTable& a, const TileTable& b);

 private:
  struct Piece;
  struct Index;
  class Builder;

  std::shared_ptr<const Index> index_;
};

/// Walks through a table in the order of ids; the table must outlive it.
class TileTable::Iterator {
 public:
  using iterator_category = std::forward_iterator_tag;
  using value_type = SharedTile;
  using difference_type = std::ptrdiff_t;
  using pointer = const SharedTile*;
  using reference = const SharedTile&;

  Iterator() = default;
  [[nodiscard]] reference operator*() const;
  [[nodiscard]] pointer operator->() const { return &**this; }
  Iterator& operator++();
  Iterator operator++(int) {
    Iterator before = *this;
    ++*this;
    return before;
  }
  friend bool operator==(const Iterator&, const Iterator&) = default;

  /// Of the tile in the order of ids.
  [[nodiscard]] std::size_t position() const;

 private:
  friend class TileTable;
  Iterator(const Index* index, std::size_t piece, std::size_t offset)
      : index_(index), piece_(piece), offset_(offset) {}
  /// The tiles from here to the end of the piece are passed over.
  void skip_piece();

  const Index* index_ = nullptr;
  std::size_t piece_ = 0;
  std::size_t offset_ = 0;
};

}  // namespace stillmap
