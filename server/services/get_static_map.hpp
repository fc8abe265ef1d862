#pragma once

#include "server/services/paged_snapshots.hpp"
#include "server/services/service_context.hpp"

namespace stillmap::server {

/// A region of the static map, in pages. All pages of an answer show the map as it was at the
/// first.
class GetStaticMap {
 public:
  explicit GetStaticMap(const ServiceContext& context) : context_(context) {}

  [[nodiscard]] stillmap_msgs::srv::GetStaticMap_Response operator()(
      const stillmap_msgs::srv::GetStaticMap_Request& request);

  /// To be called now and then when nobody asks.
  void drop_expired() { paged_snapshots_.drop_expired(PagedSnapshots::Clock::now()); }

 private:
  /// A page after the first needs no history.
  [[nodiscard]] MapState state_for(const MapQuery& query) const;
  void update_session(const MapQueryResult& result, const PagedSnapshots::Snapshot& view);

  const ServiceContext& context_;
  PagedSnapshots paged_snapshots_;
};

}  // namespace stillmap::server
