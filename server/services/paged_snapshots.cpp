#include "server/services/paged_snapshots.hpp"

#include <algorithm>

namespace stillmap::server {
namespace {

/// Of a view apart from its tiles.
std::size_t table_bytes(const MapSnapshot& view) {
  constexpr std::size_t bytes_a_piece = 64;
  return bytes_a_piece * (1 + 4 * view.tiles.size() / TileTable::max_piece_tiles);
}

/// What `view` holds alone beside `newer`.
std::size_t own_bytes(const MapSnapshot& view, const MapSnapshot& newer) {
  std::size_t bytes = table_bytes(view);
  TileTable::for_each_difference(view.tiles, newer.tiles, [&](const auto& old, const auto&) {
    if (old) bytes += sizeof(Tile) + old->voxels.memory_bytes();
  });
  return bytes;
}

}  // namespace

PagedSnapshots::Snapshot PagedSnapshots::find(const MapVersion& map) const {
  const auto found = std::ranges::find_if(sessions_, [&](const Session& entry) {
    return entry.view->map_id == map.map_id && entry.view->version == map.version;
  });
  return found == sessions_.end() ? nullptr : found->view;
}

void PagedSnapshots::keep(const Snapshot& view, Clock::time_point now) {
  if (const auto known = session_of(view); known != sessions_.end()) {
    known->asked = now;
    known->until = now + max_page_interval;
    return;
  }
  sessions_.push_back({view, now, now + max_page_interval});
  if (sessions_.size() > 1) weigh(sessions_.end() - 2);
  while (sessions_.size() > 1 && bytes() > max_bytes_) {
    erase(std::ranges::min_element(sessions_.begin(), sessions_.end() - 1, {}, &Session::asked));
  }
}

void PagedSnapshots::end(const Snapshot& view, Clock::time_point now) {
  const auto known = session_of(view);
  if (known != sessions_.end()) known->until = now + last_page_grace;
}

void PagedSnapshots::drop_expired(Clock::time_point now) {
  const auto is_expired = [&](const Session& entry) { return now > entry.until; };
  for (auto expired = std::ranges::find_if(sessions_, is_expired); expired != sessions_.end();
       expired = std::ranges::find_if(sessions_, is_expired)) {
    erase(expired);
  }
}

std::size_t PagedSnapshots::bytes() const {
  std::size_t sum = 0;
  for (const Session& session : sessions_) sum += session.bytes;
  return sum;
}

PagedSnapshots::Sessions::iterator PagedSnapshots::session_of(const Snapshot& view) {
  return std::ranges::find(sessions_, view, &Session::view);
}

void PagedSnapshots::erase(Sessions::iterator session) {
  const auto next = sessions_.erase(session);
  if (next != sessions_.begin()) weigh(next - 1);
}

void PagedSnapshots::weigh(Sessions::iterator session) {
  const auto newer = session + 1;
  session->bytes = newer == sessions_.end() ? 0 : own_bytes(*session->view, *newer->view);
}

}  // namespace stillmap::server
