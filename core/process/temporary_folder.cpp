#include "core/process/temporary_folder.hpp"

#include <cerrno>
#include <cstdlib>
#include <mutex>
#include <set>
#include <string>
#include <system_error>

namespace stillmap {
namespace {

namespace fs = std::filesystem;

struct FoldersOfProcess {
  std::mutex mutex;
  std::set<fs::path> paths;
};

/// Never destroyed: a signal may come while the program ends.
FoldersOfProcess& folders_of_process() {
  static auto& folders = *new FoldersOfProcess;
  return folders;
}

}  // namespace

TemporaryFolder::TemporaryFolder(const fs::path& prefix) {
  std::string name = fs::absolute(prefix).string() + "XXXXXX";
  FoldersOfProcess& folders = folders_of_process();
  const std::scoped_lock lock(folders.mutex);
  if (::mkdtemp(name.data()) == nullptr) {
    throw fs::filesystem_error("cannot make a folder", name,
                               std::error_code(errno, std::generic_category()));
  }
  path_ = name;
  folders.paths.insert(path_);
}

TemporaryFolder::~TemporaryFolder() {
  FoldersOfProcess& folders = folders_of_process();
  const std::scoped_lock lock(folders.mutex);
  std::error_code ignored;
  fs::remove_all(path_, ignored);
  folders.paths.erase(path_);
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
