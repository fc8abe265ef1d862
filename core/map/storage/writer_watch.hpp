#pragma once

#include <filesystem>

namespace stillmap {

/// Tells of processes that had a file open for writing and have closed it, this one's included.
/// Where the system cannot tell (another machine's, on a network file system), nobody has.
class WriterWatch {
 public:
  /// Of the file that has this name now.
  explicit WriterWatch(const std::filesystem::path& file);
  ~WriterWatch();
  WriterWatch(const WriterWatch&) = delete;
  WriterWatch& operator=(const WriterWatch&) = delete;

  /// Whether one has since the last call.
  [[nodiscard]] bool has_one_closed();

 private:
  int descriptor_;
};

}  // namespace stillmap
