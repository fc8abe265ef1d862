#include "idl/dds/shared_memory_segments.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <ctime>
#include <system_error>

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;

// A file beside the segment, which the living process holds locked: "_el" by its owner, "_sl" by
// those who use it.
bool is_locked(const fs::path& lock_file) {
  // Whatever somebody else put there under this name: without waiting for it.
  const int descriptor = ::open(lock_file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW);
  // What cannot be looked at may be alive.
  if (descriptor < 0) return errno != ENOENT;
  const bool was_free = ::flock(descriptor, LOCK_EX | LOCK_NB) == 0;
  ::close(descriptor);
  return !was_free;
}

bool is_segment_name(const std::string& name) {
  return name.starts_with("fastrtps_") && !name.ends_with("_el") && !name.ends_with("_sl");
}

bool is_port_name(const std::string& name) { return name.starts_with("fastrtps_port"); }

fs::path beside(const fs::path& file, const std::string& ending) { return file.string() + ending; }

bool is_of_the_dead(const fs::path& segment) {
  return !is_locked(beside(segment, "_el")) && !is_locked(beside(segment, "_sl"));
}

std::chrono::seconds age_of(const struct stat& facts) {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  // A file may be newer than now: the clock was set back since.
  return std::chrono::seconds(std::max<std::time_t>(now - facts.st_mtim.tv_sec, 0));
}

void remove_segment(const fs::path& folder, const std::string& name) {
  const fs::path file = folder / name;
  std::error_code ignored;
  for (const fs::path& part :
       {file, beside(file, "_el"), beside(file, "_sl"), folder / ("sem." + name + "_mutex")}) {
    fs::remove(part, ignored);
  }
}

/// The segments that were made so long ago at least. The locks of others are not tried, for who
/// takes one at that moment would find it taken: he may be making a younger segment, or coming to
/// have the port of somebody dead.
std::vector<SharedMemorySegment> segments_of_age(const fs::path& folder,
                                                 std::chrono::seconds min_age,
                                                 StaleSegments which) {
  std::vector<SharedMemorySegment> segments;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    struct stat facts {};
    if (!is_segment_name(name) || ::stat(entry.path().c_str(), &facts) != 0) continue;
    if (which == StaleSegments::without_ports && is_port_name(name)) continue;
    const std::chrono::seconds age = age_of(facts);
    if (age < min_age) continue;
    segments.push_back({.name = name,
                        .bytes = static_cast<std::uint64_t>(facts.st_size),
                        .owner = facts.st_uid,
                        .age = age,
                        .is_stale = is_of_the_dead(entry.path())});
  }
  return segments;
}

}  // namespace

std::vector<SharedMemorySegment> shared_memory_segments(const fs::path& folder) {
  return segments_of_age(folder, std::chrono::seconds(0), StaleSegments::all);
}

int remove_stale_segments(const fs::path& folder, std::chrono::seconds min_age,
                          StaleSegments which) {
  int removed = 0;
  for (const SharedMemorySegment& segment : segments_of_age(folder, min_age, which)) {
    if (!segment.is_stale) continue;
    remove_segment(folder, segment.name);
    if (!fs::exists(folder / segment.name)) ++removed;
  }
  return removed;
}

}  // namespace stillmap::dds
