#pragma once

#include <filesystem>

namespace stillmap {

/// A folder of a name that nothing had before, removed with all that is in it when the object goes.
class TemporaryFolder {
 public:
  /// What happens to folders of processes that were killed.
  enum class OfTheDead {
    keep,
    /// The next one of this prefix removes them: for copies, of which nobody misses any.
    remove
  };

  /// Its name is `prefix` and six letters or digits; where those of the dead go, "held-" before
  /// them. Throws std::filesystem::filesystem_error.
  explicit TemporaryFolder(const std::filesystem::path& prefix,
                           OfTheDead of_the_dead = OfTheDead::keep);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

  /// For a process that a signal is about to end: removes all that it has. No thread can make or
  /// remove one after that: it waits for the end.
  static void remove_all_at_end();

 private:
  std::filesystem::path path_;
  /// Holds the lock that tells others that somebody lives who uses it; -1 without.
  int held_ = -1;
};

}  // namespace stillmap
