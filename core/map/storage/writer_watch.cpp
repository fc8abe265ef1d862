#include "core/map/storage/writer_watch.hpp"

#include <sys/inotify.h>
#include <unistd.h>

#include <array>
#include <cstddef>

namespace stillmap {

WriterWatch::WriterWatch(const std::filesystem::path& file)
    : descriptor_(::inotify_init1(IN_NONBLOCK | IN_CLOEXEC)) {
  if (descriptor_ >= 0) ::inotify_add_watch(descriptor_, file.c_str(), IN_CLOSE_WRITE);
}

WriterWatch::~WriterWatch() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

bool WriterWatch::has_one_closed() {
  if (descriptor_ < 0) return false;
  bool has_closed = false;
  alignas(inotify_event) std::array<std::byte, 4096> events{};
  for (ssize_t bytes = 1; bytes > 0;) {
    bytes = ::read(descriptor_, events.data(), events.size());
    for (ssize_t at = 0; at < bytes;) {
      const auto* const event = reinterpret_cast<const inotify_event*>(events.data() + at);
      // Also where there were more than the system keeps.
      has_closed |= (event->mask & (IN_CLOSE_WRITE | IN_Q_OVERFLOW)) != 0;
      at += static_cast<ssize_t>(sizeof(inotify_event) + event->len);
    }
  }
  return has_closed;
}

}  // namespace stillmap
