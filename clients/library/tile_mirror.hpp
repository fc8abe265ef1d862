#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "clients/library/client.hpp"

namespace stillmap {

/// A client's own copy of a map, or of a region of it: updates of a region subscription in,
/// immutable views out. Safe to use from any thread.
class TileMirror {
 public:
  TileMirror();

  /// Applies the update. Another map replaces what there was; a tile that is older than the one
  /// held is left out.
  void apply(const RegionUpdate& update);

  /// The tiles as they are now; never null.
  [[nodiscard]] std::shared_ptr<const MapSnapshot> snapshot() const;

  /// Waits until the mirror holds another view than `known`, at most `timeout`; returns the view.
  [[nodiscard]] std::shared_ptr<const MapSnapshot> wait_for_change(
      const std::shared_ptr<const MapSnapshot>& known, std::chrono::milliseconds timeout) const;

  /// Whether it holds all these tiles, as new or newer.
  [[nodiscard]] bool holds(const TileVersions& versions) const { return lacks(versions).empty(); }
  /// Those of them that it does not hold so.
  [[nodiscard]] std::vector<TileId> lacks(const TileVersions& versions) const;

 private:
  [[nodiscard]] std::shared_ptr<const MapSnapshot> make_snapshot(const dds::MapIdentity& map) const;

  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::map<TileId, std::shared_ptr<const Tile>> tiles_;
  std::shared_ptr<const MapSnapshot> snapshot_;
};

/// Returns when the mirror holds all tiles that the server's map has, but for those that the server
/// itself cannot read, which are in the answer. Throws ServiceTimeout saying how many are missing.
[[nodiscard]] std::vector<TileId> wait_for_whole_map(Client& client, const TileMirror& mirror,
                                                     std::chrono::milliseconds timeout);

}  // namespace stillmap
