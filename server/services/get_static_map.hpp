#pragma once

#include <deque>
#include <memory>

#include "server/services/service_context.hpp"

namespace stillmap {

/// A region of the static map, in pages. All pages of an answer show the map as it was at the
/// first: the views of the last unfinished answers are kept.
class GetStaticMap {
 public:
  explicit GetStaticMap(const ServiceContext& context) : context_(context) {}

  [[nodiscard]] stillmap_msgs::srv::GetStaticMap_Response operator()(
      const stillmap_msgs::srv::GetStaticMap_Request& request);

 private:
  /// A page after the first needs no history.
  [[nodiscard]] MapState state_for(const MapQuery& query) const;
  void keep(const std::shared_ptr<const MapView>& view);

  const ServiceContext& context_;
  // Most recently used first.
  std::deque<std::shared_ptr<const MapView>> paged_views_;
};

}  // namespace stillmap
