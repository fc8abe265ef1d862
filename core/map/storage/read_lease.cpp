#include "core/map/storage/read_lease.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>

namespace stillmap {

std::optional<ReadLease> ReadLease::take(const std::filesystem::path& file) {
  ReadLease lease(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (lease.descriptor_ == no_descriptor) return std::nullopt;
  // Who wants to write is announced by a signal, which by default would end the process; this one
  // is ignored.
  if (::fcntl(lease.descriptor_, F_SETSIG, SIGURG) != 0 ||
      ::fcntl(lease.descriptor_, F_SETLEASE, F_RDLCK) != 0) {
    return std::nullopt;
  }
  return lease;
}

ReadLease::~ReadLease() {
  // Closing gives it back.
  if (descriptor_ != no_descriptor) ::close(descriptor_);
}

bool ReadLease::is_unbroken(const std::filesystem::path& file) const {
  struct stat held {};
  struct stat named {};
  return ::fcntl(descriptor_, F_GETLEASE) == F_RDLCK && ::fstat(descriptor_, &held) == 0 &&
         ::stat(file.c_str(), &named) == 0 && held.st_dev == named.st_dev &&
         held.st_ino == named.st_ino;
}

}  // namespace stillmap
