#include "server/services/get_static_map.hpp"

#include <algorithm>

namespace stillmap {
namespace {

// Clients that page through the map at the same time. Views share what did not change.
constexpr std::size_t most_paged_views = 16;
// Larger pages take too long on a slow network; a client that wants more gets more pages.
constexpr std::uint32_t largest_page_bytes = 8'000'000;

}  // namespace

stillmap_msgs::srv::GetStaticMap_Response GetStaticMap::operator()(
    const stillmap_msgs::srv::GetStaticMap_Request& request) {
  using Response = stillmap_msgs::srv::GetStaticMap_Response;
  return answer<Response>(context_, request, [&](const MapView&, Response& response) {
    auto [query, fault] = wire::from_request(request);
    if (!query) throw std::invalid_argument(fault);
    query->max_bytes = std::min(query->max_bytes, largest_page_bytes);
    const MapState state = state_for(*query);
    const MapQueryResult result =
        query_map(*state.view, *query, state.history.get(), context_.tiles);
    if (!result.continuation.empty()) keep(state.view);
    response = wire::to_response(result);
  });
}

MapState GetStaticMap::state_for(const MapQuery& query) const {
  const auto version = continuation_version(query.continuation);
  const auto is_it = [&](const auto& view) { return version && view->version == *version; };
  const auto kept = std::ranges::find_if(paged_views_, is_it);
  return kept == paged_views_.end() ? context_.board.state() : MapState{*kept, nullptr};
}

void GetStaticMap::keep(const std::shared_ptr<const MapView>& view) {
  std::erase(paged_views_, view);
  paged_views_.push_front(view);
  if (paged_views_.size() > most_paged_views) paged_views_.pop_back();
}

}  // namespace stillmap
