#pragma once

#include <filesystem>
#include <optional>
#include <utility>

namespace stillmap {

/// A file that nobody has open for writing, and that nobody can: whoever tries waits for the end
/// of the lease, for at most the system's lease-break-time (45 s). Linux gives it to the file's
/// owner and to root.
class ReadLease {
 public:
  /// Nothing where a program has the file open for writing, where it is another user's, or on a
  /// file system without leases.
  [[nodiscard]] static std::optional<ReadLease> take(const std::filesystem::path& file);
  ~ReadLease();
  ReadLease(ReadLease&& other) noexcept
      : descriptor_(std::exchange(other.descriptor_, no_descriptor)) {}
  ReadLease(const ReadLease&) = delete;
  ReadLease& operator=(const ReadLease&) = delete;
  ReadLease& operator=(ReadLease&&) = delete;

  /// Whether it is certain that nobody has written since: nobody waits to, and the file still has
  /// this name.
  [[nodiscard]] bool is_unbroken(const std::filesystem::path& file) const;

 private:
  static constexpr int no_descriptor = -1;

  explicit ReadLease(int descriptor) : descriptor_(descriptor) {}

  int descriptor_;
};

}  // namespace stillmap
