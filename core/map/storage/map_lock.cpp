#include "core/map/storage/map_lock.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <random>
#include <sstream>
#include <string>

#include "core/map/storage/map_database.hpp"
#include "core/process/host_name.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

/// Of a host name, a process and a token at most; a larger file of that name is no lock.
constexpr off_t max_lock_bytes = 511;

struct Holder {
  std::string host;
  pid_t pid = 0;
};

/// As written in the lock file; without pid where nothing is.
Holder holder_in(int descriptor) {
  std::array<char, max_lock_bytes + 1> text{};
  const ssize_t bytes = ::pread(descriptor, text.data(), text.size() - 1, 0);
  Holder holder;
  if (bytes > 0) std::istringstream(text.data()) >> holder.host >> holder.pid;
  return holder;
}

/// Where the file system has no locks: only a process of this machine is known to be dead.
bool may_live(const Holder& holder) {
  if (holder.pid <= 0) return false;
  if (holder.host != host_name()) return true;
  return holder.pid != ::getpid() && (::kill(holder.pid, 0) == 0 || errno == EPERM);
}

MapFileInUseError held_by(const fs::path& map_file, const Holder& holder) {
  const std::string who = holder.pid == 0 ? "another process"
                                          : "process " + std::to_string(holder.pid) +
                                                " on the machine '" + holder.host + "'";
  return {map_file, "is in use by " + who + ", which writes its map there; stop it, or name " +
                        "another file"};
}

MapFileError not_lockable(const fs::path& map_file, const char* why) {
  return {map_file,
          std::string("cannot be locked (") + why + "); its folder must exist and be writable"};
}

MapFileError not_a_lock(const fs::path& map_file, const fs::path& lock_file) {
  return {map_file, "cannot be locked: " + lock_file.string() +
                        " is something else than a lock; move that, or name another file"};
}

/// Of this lock and no other one.
std::string new_token() {
  std::random_device entropy;
  std::ostringstream token;
  token << std::hex << entropy() << entropy();
  return token.str();
}

/// Whether the file of that name is locked, and says what this lock has written: then it is this
/// one, on a file system whose inode numbers change.
bool is_own_under_name(const fs::path& lock_file, const std::string& written) {
  const int descriptor = ::open(lock_file.c_str(), O_RDWR | O_CLOEXEC);
  if (descriptor < 0) return false;
  // One that is not locked was copied there, and another process could take it.
  const bool is_locked = ::flock(descriptor, LOCK_EX | LOCK_NB) != 0;
  std::string text(written.size() + 1, '\0');
  const ssize_t bytes = ::pread(descriptor, text.data(), text.size(), 0);
  ::close(descriptor);
  if (!is_locked || bytes != static_cast<ssize_t>(written.size())) return false;
  text.resize(written.size());
  return text == written;
}

/// Whether the open file is the one of that name.
bool has_name(int descriptor, const fs::path& name, struct stat& opened) {
  struct stat named {};
  return ::fstat(descriptor, &opened) == 0 && ::stat(name.c_str(), &named) == 0 &&
         opened.st_dev == named.st_dev && opened.st_ino == named.st_ino;
}

/// Opens and locks it; -1 when it was removed meanwhile, by a holder that ended.
int try_lock(const fs::path& lock_file, const fs::path& map_file) {
  const int descriptor = ::open(lock_file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (descriptor < 0) throw not_lockable(map_file, std::strerror(errno));
  const bool is_locked = ::flock(descriptor, LOCK_EX | LOCK_NB) == 0;
  const bool has_no_locks = !is_locked && errno != EWOULDBLOCK;
  const Holder holder = holder_in(descriptor);
  if (!is_locked && !(has_no_locks && !may_live(holder))) {
    ::close(descriptor);
    throw held_by(map_file, holder);
  }
  struct stat opened {};
  const bool is_named = has_name(descriptor, lock_file, opened);
  if (is_named && opened.st_size <= max_lock_bytes) return descriptor;
  ::close(descriptor);
  if (is_named) throw not_a_lock(map_file, lock_file);
  return -1;
}

}  // namespace

// Of the file that a link leads to: two names of one map have one lock.
MapLock::MapLock(const fs::path& map_file)
    : lock_file_(beside(real_file(map_file), ".lock")),
      holder_(host_name() + " " + std::to_string(::getpid()) + " " + new_token() + "\n") {
  while (descriptor_ < 0) descriptor_ = try_lock(lock_file_, map_file);
  const bool is_named = ::ftruncate(descriptor_, 0) == 0 &&
                        ::pwrite(descriptor_, holder_.data(), holder_.size(), 0) ==
                            static_cast<ssize_t>(holder_.size());
  if (is_named) return;
  const std::string why = std::strerror(errno);
  std::error_code ignored;
  fs::remove(lock_file_, ignored);
  ::close(descriptor_);
  throw not_lockable(map_file, why.c_str());
}

bool MapLock::is_held() const {
  struct stat opened {};
  return has_name(descriptor_, lock_file_, opened) || is_own_under_name(lock_file_, holder_);
}

MapLock::~MapLock() {
  std::error_code ignored;
  // Another process may have made one there where this one was removed.
  if (is_held()) fs::remove(lock_file_, ignored);
  ::close(descriptor_);
}

}  // namespace stillmap
