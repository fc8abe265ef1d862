#include "core/map/storage/read_lease.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <string>

namespace stillmap {

namespace {

FileState state_of(const struct stat& facts) {
  return {facts.st_dev, facts.st_ino, facts.st_size,
          facts.st_mtim.tv_sec * 1'000'000'000 + facts.st_mtim.tv_nsec};
}

}  // namespace

std::optional<FileState> FileState::of(const std::filesystem::path& file) {
  std::error_code ignored;
  return of(file, ignored);
}

std::optional<FileState> FileState::of(const std::filesystem::path& file, std::error_code& fault) {
  fault.clear();
  struct stat facts {};
  if (::stat(file.c_str(), &facts) == 0) return state_of(facts);
  if (errno != ENOENT && errno != ENOTDIR) fault.assign(errno, std::generic_category());
  return std::nullopt;
}

std::optional<FileState> FileState::of(int descriptor, std::error_code& fault) {
  fault.clear();
  struct stat facts {};
  if (::fstat(descriptor, &facts) == 0) return state_of(facts);
  fault.assign(errno, std::generic_category());
  return std::nullopt;
}

std::optional<ReadLease> ReadLease::take(const std::filesystem::path& file) {
  ReadLease lease(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (lease.descriptor_ == no_descriptor) return std::nullopt;
  // Who wants to write is announced by a signal, which by default would end the process; this one
  // is ignored.
  if (::fcntl(lease.descriptor_, F_SETSIG, SIGURG) != 0 ||
      ::fcntl(lease.descriptor_, F_SETLEASE, F_RDLCK) != 0) {
    return std::nullopt;
  }
  const auto state = FileState::of("/proc/self/fd/" + std::to_string(lease.descriptor_));
  if (!state) return std::nullopt;
  lease.state_ = *state;
  return lease;
}

ReadLease::~ReadLease() {
  if (descriptor_ == no_descriptor) return;
  // Closing would do, but not where another thread has forked meanwhile.
  ::fcntl(descriptor_, F_SETLEASE, F_UNLCK);
  ::close(descriptor_);
}

bool ReadLease::is_unbroken(const std::filesystem::path& file) const {
  return ::fcntl(descriptor_, F_GETLEASE) == F_RDLCK && FileState::of(file) == state_;
}

}  // namespace stillmap
