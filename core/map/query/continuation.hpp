#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace stillmap {

/// Where a page of an answer ended, and of which answer.
struct Continuation {
  std::uint64_t map_id = 0;
  std::uint64_t map_version = 0;
  /// Hash of everything that the query asks for; the page size may change from page to page.
  std::uint64_t query_fingerprint = 0;
  /// Voxels of the whole answer.
  std::uint64_t total_voxels = 0;
  /// First voxel of the next page: its tile's position in the view and its own in the tile; in a
  /// coarser answer, tile 0 and the cell's position.
  std::uint64_t tile = 0;
  std::uint64_t voxel = 0;
  friend bool operator==(const Continuation&, const Continuation&) = default;
};

/// As text: hexadecimal words and a checksum against damage on the way.
[[nodiscard]] std::string to_token(const Continuation& continuation);

/// Nothing when the token is not one that to_token made.
[[nodiscard]] std::optional<Continuation> from_token(const std::string& token);

}  // namespace stillmap
