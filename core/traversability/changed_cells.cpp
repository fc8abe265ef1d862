#include "core/traversability/changed_cells.hpp"

#include <algorithm>
#include <optional>

namespace stillmap {
namespace {

bool is_same(Column a, Column b) { return std::ranges::equal(a, b); }
bool is_same(const SurfaceTile::View& a, const SurfaceTile::View& b) {
  return *a.cell == *b.cell && std::ranges::equal(a.object_heights_m, b.object_heights_m);
}

template <typename TileT>
std::optional<CellBox> difference(const TileT& before, const TileT& after) {
  std::optional<CellBox> box;
  for (int y = 0; y < after.side; ++y) {
    for (int x = 0; x < after.side; ++x) {
      if (is_same(before.at(x, y), after.at(x, y))) continue;
      if (!box) box = CellBox{x, y, x, y};
      box->min_x = std::min(box->min_x, x);
      box->max_x = std::max(box->max_x, x);
      box->max_y = y;
    }
  }
  return box;
}

template <typename TileT>
void note(ChangedCells& changes, TileId id, const TileT* before, const TileT* after) {
  if (before != nullptr && after != nullptr) {
    if (const auto box = difference(*before, *after)) changes[id] = *box;
  } else if (before != nullptr || after != nullptr) {
    const int last = (before != nullptr ? before : after)->side - 1;
    changes[id] = {0, 0, last, last};
  }
}

/// Whether a change between `first` and `last` reaches the tile `offset` (-1, 0, 1) tiles on.
bool reaches(int first, int last, int offset, int side, int margin) {
  if (offset < 0) return first < margin;
  if (offset > 0) return last >= side - margin;
  return true;
}

}  // namespace

void note_change(ChangedCells& changes, TileId id, const ColumnTile* before,
                 const ColumnTile* after) {
  note(changes, id, before, after);
}

void note_change(ChangedCells& changes, TileId id, const SurfaceTile* before,
                 const SurfaceTile* after) {
  note(changes, id, before, after);
}

std::set<TileId> affected_tiles(const ChangedCells& changes, int side, int margin) {
  std::set<TileId> affected;
  for (const auto& [id, box] : changes) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        if (reaches(box.min_x, box.max_x, dx, side, margin) &&
            reaches(box.min_y, box.max_y, dy, side, margin)) {
          affected.insert({id.x + dx, id.y + dy});
        }
      }
    }
  }
  return affected;
}

}  // namespace stillmap
