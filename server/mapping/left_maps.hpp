#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "server/mapping/map_folder.hpp"

namespace stillmap::server {

/// Maps that killed servers were writing under the name of a map file, or beside it: each may be
/// the only copy of a map whose file had been removed. Whole ones are given their name, or where a
/// file has that, one with the time; parts, and what cannot be read now, stay where they are until
/// somebody removes them. Told in the log.
class LeftMaps {
 public:
  LeftMaps() = default;
  /// Of a file whose lock the caller has just taken; it is not open yet, and may not be there.
  LeftMaps(const std::filesystem::path& file, const MapFolder& folder);

  /// What an operator should know of those that are still there, and do; empty where there are
  /// none.
  [[nodiscard]] std::string in_words();
  /// This map runs by now: nobody need be told of it any more.
  void forget(const std::filesystem::path& file);
  [[nodiscard]] bool empty() const {
    return kept_beside_.empty() && unfinished_.empty() && unreadable_.empty();
  }

 private:
  std::vector<std::filesystem::path> kept_beside_;
  std::vector<std::filesystem::path> unfinished_;
  std::vector<std::filesystem::path> unreadable_;
};

}  // namespace stillmap::server
