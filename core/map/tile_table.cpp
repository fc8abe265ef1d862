#include "core/map/tile_table.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

#include "core/map/tile.hpp"

namespace stillmap {
namespace {

/// A smaller piece that is written anew is joined with the next one.
constexpr std::size_t min_piece_tiles = TileTable::max_piece_tiles / 4;

TileId id_of(const TileTable::SharedTile& tile) { return tile->info.id; }

}  // namespace

struct TileTable::Piece {
  std::vector<SharedTile> tiles;
  std::uint64_t voxel_count = 0;
  std::size_t non_resident = 0;
  std::uint64_t newest_revision = 0;
};

/// Never without a piece.
struct TileTable::Index {
  std::vector<std::shared_ptr<const Piece>> pieces;
  /// Of each piece, the id of its first tile and that tile's position.
  std::vector<TileId> first_ids;
  std::vector<std::size_t> starts;
  std::size_t size = 0;
  std::uint64_t voxel_count = 0;
  std::size_t non_resident = 0;

  /// The piece that has the id, if any has.
  [[nodiscard]] std::size_t piece_of(TileId id) const {
    const auto after = std::ranges::upper_bound(first_ids, id);
    return after == first_ids.begin() ? 0 : static_cast<std::size_t>(after - first_ids.begin()) - 1;
  }
};

/// Puts an index together, from pieces that stay and tiles that are new to theirs.
class TileTable::Builder {
 public:
  explicit Builder(std::size_t pieces) : index_(std::make_shared<Index>()) {
    index_->pieces.reserve(pieces);
    index_->first_ids.reserve(pieces);
    index_->starts.reserve(pieces);
  }

  /// A piece without edits.
  void add(const std::shared_ptr<const Piece>& piece) {
    if (tiles_.empty() || tiles_.size() >= min_piece_tiles) {
      flush();
      append(piece);
    } else {
      tiles_.insert(tiles_.end(), piece->tiles.begin(), piece->tiles.end());
    }
  }
  void add(SharedTile tile) { tiles_.push_back(std::move(tile)); }

  [[nodiscard]] std::shared_ptr<const Index> take() {
    flush();
    return index_->pieces.empty() ? nullptr : std::move(index_);
  }

 private:
  void append(const std::shared_ptr<const Piece>& piece) {
    index_->first_ids.push_back(id_of(piece->tiles.front()));
    index_->starts.push_back(index_->size);
    index_->size += piece->tiles.size();
    index_->voxel_count += piece->voxel_count;
    index_->non_resident += piece->non_resident;
    index_->pieces.push_back(piece);
  }

  /// Writes the new tiles as pieces of about the same size.
  void flush() {
    const std::size_t pieces = (tiles_.size() + max_piece_tiles - 1) / max_piece_tiles;
    for (std::size_t i = 0; i < pieces; ++i) {
      const auto cut = [&](std::size_t n) {
        return tiles_.begin() + static_cast<std::ptrdiff_t>(tiles_.size() * n / pieces);
      };
      auto piece = std::make_shared<Piece>();
      piece->tiles.assign(std::make_move_iterator(cut(i)), std::make_move_iterator(cut(i + 1)));
      for (const SharedTile& tile : piece->tiles) {
        piece->voxel_count += tile->info.voxel_count;
        piece->non_resident += is_non_resident(*tile) ? 1 : 0;
        piece->newest_revision = std::max(piece->newest_revision, tile->info.revision);
      }
      append(piece);
    }
    tiles_.clear();
  }

  std::shared_ptr<Index> index_;
  std::vector<SharedTile> tiles_;
};

TileTable::TileTable(std::initializer_list<SharedTile> tiles)
    : TileTable(std::vector<SharedTile>(tiles)) {}

TileTable::TileTable(std::vector<SharedTile> tiles) {
  std::ranges::sort(tiles, {}, id_of);
  Builder builder(tiles.size() / min_piece_tiles + 1);
  for (SharedTile& tile : tiles) builder.add(std::move(tile));
  index_ = builder.take();
}

TileTable TileTable::with(std::span<const Edit> edits) const {
  assert(std::ranges::is_sorted(edits, {}, &Edit::id));
  if (edits.empty()) return *this;
  const std::size_t pieces = index_ ? index_->pieces.size() : 0;
  Builder builder(pieces + edits.size() / min_piece_tiles + 2);
  auto edit = edits.begin();
  const auto add_edit = [&] {
    if (edit->tile) builder.add(edit->tile);
    ++edit;
  };
  for (std::size_t p = 0; p < pieces; ++p) {
    const auto& piece = index_->pieces[p];
    const bool is_last = p + 1 == pieces;
    const auto is_of_piece = [&] {
      return edit != edits.end() && (is_last || edit->id < index_->first_ids[p + 1]);
    };
    if (!is_of_piece()) {
      builder.add(piece);
      continue;
    }
    for (const SharedTile& tile : piece->tiles) {
      while (is_of_piece() && edit->id < id_of(tile)) add_edit();
      if (is_of_piece() && edit->id == id_of(tile)) {
        add_edit();
      } else {
        builder.add(tile);
      }
    }
    while (is_of_piece()) add_edit();
  }
  while (edit != edits.end()) add_edit();
  TileTable edited;
  edited.index_ = builder.take();
  return edited;
}

void TileTable::set(const SharedTile& tile) {
  const Edit edit{id_of(tile), tile};
  *this = with({&edit, 1});
}

void TileTable::erase(TileId id) {
  const Edit edit{id, nullptr};
  *this = with({&edit, 1});
}

std::size_t TileTable::size() const { return index_ ? index_->size : 0; }
std::uint64_t TileTable::voxel_count() const { return index_ ? index_->voxel_count : 0; }
std::size_t TileTable::non_resident_count() const { return index_ ? index_->non_resident : 0; }

TileTable::Iterator TileTable::begin() const { return {index_.get(), 0, 0}; }
TileTable::Iterator TileTable::end() const {
  return {index_.get(), index_ ? index_->pieces.size() : 0, 0};
}

const TileTable::SharedTile& TileTable::operator[](std::size_t position) const {
  assert(position < size());
  const auto after = std::ranges::upper_bound(index_->starts, position);
  const auto piece = static_cast<std::size_t>(after - index_->starts.begin()) - 1;
  return index_->pieces[piece]->tiles[position - index_->starts[piece]];
}

TileTable::SharedTile TileTable::find(TileId id) const {
  const Iterator found = lower_bound(id);
  return found != end() && id_of(*found) == id ? *found : nullptr;
}

TileTable::Iterator TileTable::lower_bound(TileId id) const {
  if (!index_) return end();
  const std::size_t piece = index_->piece_of(id);
  const auto& tiles = index_->pieces[piece]->tiles;
  const auto found = std::ranges::lower_bound(tiles, id, {}, id_of);
  if (found == tiles.end()) return {index_.get(), piece + 1, 0};
  return {index_.get(), piece, static_cast<std::size_t>(found - tiles.begin())};
}

void TileTable::for_each_newer(std::uint64_t revision,
                               const std::function<void(const SharedTile& tile)>& visit) const {
  if (!index_) return;
  for (const auto& piece : index_->pieces) {
    if (piece->newest_revision <= revision) continue;
    for (const SharedTile& tile : piece->tiles) {
      if (tile->info.revision > revision) visit(tile);
    }
  }
}

void TileTable::for_each_difference(
    const TileTable& before, const TileTable& after,
    const std::function<void(const SharedTile& before, const SharedTile& after)>& visit) {
  if (before.index_ == after.index_) return;
  Iterator a = before.begin();
  Iterator b = after.begin();
  const Iterator a_end = before.end();
  const Iterator b_end = after.end();
  while (a != a_end && b != b_end) {
    // Whole pieces: both stand at the begin of the same one.
    if (a.offset_ == 0 && b.offset_ == 0 &&
        a.index_->pieces[a.piece_] == b.index_->pieces[b.piece_]) {
      a.skip_piece();
      b.skip_piece();
    } else if (id_of(*a) < id_of(*b)) {
      visit(*a++, nullptr);
    } else if (id_of(*b) < id_of(*a)) {
      visit(nullptr, *b++);
    } else {
      if (*a != *b) visit(*a, *b);
      ++a;
      ++b;
    }
  }
  for (; a != a_end; ++a) visit(*a, nullptr);
  for (; b != b_end; ++b) visit(nullptr, *b);
}

bool operator==(const TileTable& a, const TileTable& b) {
  return a.index_ == b.index_ || std::ranges::equal(a, b);
}

TileTable::Iterator::reference TileTable::Iterator::operator*() const {
  return index_->pieces[piece_]->tiles[offset_];
}

TileTable::Iterator& TileTable::Iterator::operator++() {
  if (++offset_ == index_->pieces[piece_]->tiles.size()) skip_piece();
  return *this;
}

void TileTable::Iterator::skip_piece() {
  ++piece_;
  offset_ = 0;
}

std::size_t TileTable::Iterator::position() const {
  if (index_ == nullptr) return 0;
  return piece_ == index_->pieces.size() ? index_->size : index_->starts[piece_] + offset_;
}

}  // namespace stillmap
