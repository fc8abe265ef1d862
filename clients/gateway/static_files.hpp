#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace stillmap::gateway {

/// A file of the page.
struct StaticFile {
  std::string body;
  std::string content_type;
  /// In quotes.
  std::string etag;
  /// Its name has a hash of its content: it never changes.
  bool is_immutable = false;
};

/// The page's files, read once: a request can reach no others, whatever its path.
class StaticFiles {
 public:
  /// None.
  StaticFiles() = default;
  /// All files of the folder and below it. Throws std::invalid_argument where there is no
  /// index.html.
  explicit StaticFiles(const std::filesystem::path& folder);

  /// `path` as in a request: "/" is the index. Null where there is none.
  [[nodiscard]] const StaticFile* find(std::string_view path) const;

 private:
  std::map<std::string, StaticFile, std::less<>> files_;
};

}  // namespace stillmap::gateway
