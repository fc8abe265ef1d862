#include "server/services/paged_views.hpp"

#include <algorithm>

namespace stillmap {

PagedViews::View PagedViews::find(std::uint64_t version) const {
  const auto found = std::ranges::find_if(
      under_way_, [&](const UnderWay& entry) { return entry.view->version == version; });
  return found == under_way_.end() ? nullptr : found->view;
}

void PagedViews::begin(const View& view, Clock::time_point now) {
  auto entry = entry_of(view);
  if (entry == under_way_.end()) entry = under_way_.insert(under_way_.begin(), {view, 0, now});
  ++entry->answers;
  go_on(view, now);
}

void PagedViews::go_on(const View& view, Clock::time_point now) {
  const auto entry = entry_of(view);
  // It was given up, but is the newest view all the same.
  if (entry == under_way_.end()) return begin(view, now);
  entry->last_asked = now;
  under_way_.splice(under_way_.begin(), under_way_, entry);
  if (under_way_.size() > most_views) under_way_.pop_back();
}

void PagedViews::end(const View& view) {
  const auto entry = entry_of(view);
  if (entry != under_way_.end() && --entry->answers <= 0) under_way_.erase(entry);
}

void PagedViews::forget_abandoned(Clock::time_point now) {
  std::erase_if(under_way_,
                [&](const UnderWay& entry) { return now - entry.last_asked > longest_pause; });
}

std::list<PagedViews::UnderWay>::iterator PagedViews::entry_of(const View& view) {
  return std::ranges::find(under_way_, view, &UnderWay::view);
}

}  // namespace stillmap
