#include "server/services/paged_snapshots.hpp"

#include <algorithm>

namespace stillmap {

PagedViews::View PagedViews::find(std::uint64_t version) const {
  const auto found = std::ranges::find_if(
      under_way_, [&](const UnderWay& entry) { return entry.view->version == version; });
  return found == under_way_.end() ? nullptr : found->view;
}

void PagedViews::keep(const View& view, Clock::time_point now) {
  if (const auto entry = entry_of(view); entry != under_way_.end()) under_way_.erase(entry);
  under_way_.push_front({view, now + longest_pause});
  if (under_way_.size() > most_views) under_way_.pop_back();
}

void PagedViews::end(const View& view, Clock::time_point now) {
  const auto entry = entry_of(view);
  if (entry != under_way_.end()) entry->until = now + last_page_repeats;
}

void PagedViews::forget_abandoned(Clock::time_point now) {
  std::erase_if(under_way_, [&](const UnderWay& entry) { return now > entry.until; });
}

std::list<PagedViews::UnderWay>::iterator PagedViews::entry_of(const View& view) {
  return std::ranges::find(under_way_, view, &UnderWay::view);
}

}  // namespace stillmap
