#include "server/services/get_static_map.hpp"

#include <algorithm>
#include <utility>

namespace stillmap::server {
namespace {

// Larger pages take too long on a slow network; a client that wants more gets more pages.
constexpr std::uint32_t max_page_bytes = 8'000'000;

}  // namespace

stillmap_msgs::srv::GetStaticMap_Response GetStaticMap::operator()(
    const stillmap_msgs::srv::GetStaticMap_Request& request) {
  using Response = stillmap_msgs::srv::GetStaticMap_Response;
  return answer<Response>(context_, request, [&](const MapSnapshot&, Response& response) {
    auto [query, fault] = wire::from_request(request);
    if (!query) throw std::invalid_argument(fault);
    query->max_bytes = std::min(query->max_bytes, max_page_bytes);
    const MapState state = state_for(*query);
    const MapQueryResult result =
        query_map(*state.view, *query, state.history.get(), context_.tiles);
    update_session(result, state.view);
    response = wire::to_response(result);
  });
}

MapState GetStaticMap::state_for(const MapQuery& query) const {
  const auto version = continuation_version(query.continuation);
  auto view = version ? paged_snapshots_.find(*version) : nullptr;
  return view ? MapState{std::move(view), nullptr} : context_.latest_map.state();
}

void GetStaticMap::update_session(const MapQueryResult& result,
                                  const PagedSnapshots::Snapshot& view) {
  const auto now = PagedSnapshots::Clock::now();
  if (result.status == QueryStatus::ok) {
    const bool is_last = result.continuation.empty();
    is_last ? paged_snapshots_.end(view, now) : paged_snapshots_.keep(view, now);
  }
  paged_snapshots_.drop_expired(now);
}

}  // namespace stillmap::server
