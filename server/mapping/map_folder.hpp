#pragma once

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace stillmap::server {

/// What was asked for is well said, but cannot be done as things are.
class RefusedNow : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// How much clients may have the server save beside its map file.
struct SavedMapsLimit {
  std::uint32_t max_maps = 100;
  std::uintmax_t max_bytes = std::uintmax_t{50} << 30;
};

/// The folder of the map file and of the maps saved beside it. Names come over the network: each
/// means a file in this folder, and no other.
class MapFolder {
 public:
  /// Of this map file; the current folder when it is empty.
  MapFolder(const std::filesystem::path& map_file, const SavedMapsLimit& limit);

  /// The folder of another map file, with the same limit.
  [[nodiscard]] MapFolder of(const std::filesystem::path& map_file) const {
    return {map_file, limit_};
  }

  /// Absolute. Throws std::invalid_argument for what is no plain name, or is a link that leads
  /// elsewhere.
  [[nodiscard]] std::filesystem::path file_named(const std::string& name) const;

  /// For a map that is kept when another one begins: a name that no file has, with the time. Throws
  /// MapFileError where names cannot be looked up.
  [[nodiscard]] std::filesystem::path unused_file_for(const std::filesystem::path& map_file) const;

  /// Throws RefusedNow when one more map of so many bytes goes beyond the limit. The
  /// running map's file and the one to be replaced do not count.
  void check_room(const std::filesystem::path& running, const std::filesystem::path& replaced,
                  std::uintmax_t bytes) const;

 private:
  std::filesystem::path folder_;
  SavedMapsLimit limit_;
};

}  // namespace stillmap::server
