#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

namespace stillmap {

/// Which file has a name, and what changes when it is written to.
struct FileState {
  /// Nothing where there is no such file, and where it cannot be looked at.
  [[nodiscard]] static std::optional<FileState> of(const std::filesystem::path& file);
  /// The same, with `fault` for a file that may be there and cannot be looked at.
  [[nodiscard]] static std::optional<FileState> of(const std::filesystem::path& file,
                                                   std::error_code& fault);
  /// Of an open file, as it is now.
  [[nodiscard]] static std::optional<FileState> of(int descriptor, std::error_code& fault);

  std::uint64_t device = 0;
  std::uint64_t number = 0;
  std::int64_t bytes = 0;
  std::int64_t modified_ns = 0;
  friend bool operator==(const FileState&, const FileState&) = default;
};

/// A file that no process of this machine has open for writing, and that none can: whoever tries
/// waits for the end of the lease, for at most the system's lease-break-time (45 s). Linux gives it
/// to the file's owner and to root.
class ReadLease {
 public:
  /// Nothing where a program has the file open for writing, where it is another user's, or on a
  /// file system without leases.
  [[nodiscard]] static std::optional<ReadLease> take(const std::filesystem::path& file);
  ~ReadLease();
  ReadLease(ReadLease&& other) noexcept
      : descriptor_(std::exchange(other.descriptor_, no_descriptor)), state_(other.state_) {}
  ReadLease(const ReadLease&) = delete;
  ReadLease& operator=(const ReadLease&) = delete;
  ReadLease& operator=(ReadLease&&) = delete;

  /// When it was taken.
  [[nodiscard]] const FileState& state() const { return state_; }
  /// Whether it is certain that nobody has written since: nobody waits to, and the file of this
  /// name is still as it was.
  [[nodiscard]] bool is_unbroken(const std::filesystem::path& file) const;

 private:
  static constexpr int no_descriptor = -1;

  explicit ReadLease(int descriptor) : descriptor_(descriptor) {}

  int descriptor_;
  FileState state_;
};

}  // namespace stillmap
