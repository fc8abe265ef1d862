#include "core/process/temporary_folder.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <mutex>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

namespace stillmap {
namespace {

namespace fs = std::filesystem;

struct FoldersOfProcess {
  std::mutex mutex;
  std::set<fs::path> paths;
};

/// -1, and errno says why, where it cannot be.
int open_folder(const fs::path& folder) {
  int opened = -1;
  do {
    opened = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  } while (opened < 0 && errno == EINTR);
  return opened;
}

/// A lock ends with its process however that ends, and is one for all containers of a machine,
/// whose processes' numbers are not. False where another process has it, or the file system knows
/// no locks of folders.
bool lock(int opened, int how) {
  int result = -1;
  do {
    result = ::flock(opened, how);
  } while (result != 0 && errno == EINTR);
  return result == 0;
}

/// Whether the folder that was opened is the one that the name leads to.
bool is_still(int opened, const fs::path& folder) {
  struct stat known {};
  struct stat there {};
  return ::fstat(opened, &known) == 0 && ::lstat(folder.c_str(), &there) == 0 &&
         known.st_dev == there.st_dev && known.st_ino == there.st_ino;
}

bool is_own(int opened) {
  struct stat known {};
  return ::fstat(opened, &known) == 0 && known.st_uid == ::geteuid();
}

/// Those of other users stay.
void remove_those_of_the_dead(const fs::path& prefix) {
  const std::string name = prefix.filename().string();
  std::error_code fault;
  std::vector<fs::path> found;
  for (fs::directory_iterator one(prefix.parent_path(), fault), end; !fault && one != end;
       one.increment(fault)) {
    if (one->path().filename().string().starts_with(name)) found.push_back(one->path());
  }
  for (const fs::path& folder : found) {
    const int opened = open_folder(folder);
    if (opened < 0) continue;
    if (is_own(opened) && lock(opened, LOCK_EX | LOCK_NB)) fs::remove_all(folder, fault);
    ::close(opened);
  }
}

fs::path make_folder(const fs::path& prefix) {
  std::string name = prefix.string() + "XXXXXX";
  if (::mkdtemp(name.data()) == nullptr) {
    throw fs::filesystem_error("cannot make a folder", name,
                               std::error_code(errno, std::generic_category()));
  }
  return name;
}

struct HeldFolder {
  fs::path path;
  /// -1 where the file system knows no locks: nobody can take it for one of the dead there.
  int held = -1;
};

HeldFolder make_held_folder(const fs::path& prefix) {
  while (true) {
    fs::path folder = make_folder(prefix);
    const int opened = open_folder(folder);
    if (opened < 0) {
      const std::error_code fault(errno, std::generic_category());
      // Before it has its lock, another process can take it for one of the dead.
      if (fault == std::errc::no_such_file_or_directory) continue;
      // Nor would one that is never locked stay.
      std::error_code ignored;
      fs::remove(folder, ignored);
      throw fs::filesystem_error("cannot hold a folder", folder, fault);
    }
    const bool is_locked = lock(opened, LOCK_EX);
    const bool is_there = is_still(opened, folder);
    if (!is_locked || !is_there) ::close(opened);
    if (is_there) return {std::move(folder), is_locked ? opened : -1};
  }
}

/// Never destroyed: a signal may come while the program ends.
FoldersOfProcess& folders_of_process() {
  static auto& folders = *new FoldersOfProcess;
  return folders;
}

}  // namespace

TemporaryFolder::TemporaryFolder(const fs::path& prefix, OfTheDead of_the_dead) {
  fs::path full_prefix = fs::absolute(prefix);
  FoldersOfProcess& folders = folders_of_process();
  const std::scoped_lock turn(folders.mutex);
  if (of_the_dead == OfTheDead::keep) {
    path_ = make_folder(full_prefix);
  } else {
    full_prefix += "held-";
    remove_those_of_the_dead(full_prefix);
    HeldFolder made = make_held_folder(full_prefix);
    path_ = std::move(made.path);
    held_ = made.held;
  }
  folders.paths.insert(path_);
}

TemporaryFolder::~TemporaryFolder() {
  FoldersOfProcess& folders = folders_of_process();
  const std::scoped_lock turn(folders.mutex);
  std::error_code ignored;
  fs::remove_all(path_, ignored);
  folders.paths.erase(path_);
  if (held_ >= 0) ::close(held_);
}

void TemporaryFolder::remove_all_at_end() {
  FoldersOfProcess& folders = folders_of_process();
  folders.mutex.lock();
  for (const fs::path& path : folders.paths) {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
}

}  // namespace stillmap
