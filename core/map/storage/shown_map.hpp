#pragma once

#include <filesystem>
#include <functional>

#include "core/map/storage/map_file.hpp"

namespace stillmap {

/// What a map file shows, without the tiles' evidence, which is the larger half: for readers of
/// voxels.
struct ShownMap {
  SavedMap map;
  /// The evidence of the same state. Throws MapFileError where the file is not there any more, has
  /// been changed, or is open in a server by now; one that a server had open when it was read was
  /// copied, and its evidence is read from the copy.
  std::function<TileEvidenceMap()> read_evidence;
};

/// The file stays as it is, byte for byte. It is read where it lies if no program has it open for
/// writing, and held meanwhile (ReadLease); else from a copy, which is its last save. Throws
/// MapFileError as MapFileCopy does.
[[nodiscard]] ShownMap read_shown_map(const std::filesystem::path& file);

}  // namespace stillmap
