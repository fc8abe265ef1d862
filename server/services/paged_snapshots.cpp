#include "server/services/paged_snapshots.hpp"

#include <algorithm>

namespace stillmap::server {

PagedSnapshots::Snapshot PagedSnapshots::find(std::uint64_t version) const {
  const auto found = std::ranges::find_if(
      sessions_, [&](const Session& entry) { return entry.view->version == version; });
  return found == sessions_.end() ? nullptr : found->view;
}

void PagedSnapshots::keep(const Snapshot& view, Clock::time_point now) {
  if (const auto entry = entry_of(view); entry != sessions_.end()) sessions_.erase(entry);
  sessions_.push_front({view, now + max_page_interval});
  if (sessions_.size() > max_snapshots) sessions_.pop_back();
}

void PagedSnapshots::end(const Snapshot& view, Clock::time_point now) {
  const auto entry = entry_of(view);
  if (entry != sessions_.end()) entry->until = now + last_page_grace;
}

void PagedSnapshots::drop_expired(Clock::time_point now) {
  std::erase_if(sessions_, [&](const Session& entry) { return now > entry.until; });
}

std::list<PagedSnapshots::Session>::iterator PagedSnapshots::entry_of(const Snapshot& view) {
  return std::ranges::find(sessions_, view, &Session::view);
}

}  // namespace stillmap::server
