#pragma once

#include "idl/dds/service_server.hpp"
#include "idl/interface/topics.hpp"
#include "server/services/get_static_map.hpp"
#include "server/services/service_context.hpp"
#include "stillmap_msgs.h"
#include "traversable_area.h"

namespace stillmap {

/// Everything that can be asked of the server, each service on its own thread, so that a large
/// answer keeps nobody else waiting.
class ServiceDesk {
 public:
  ServiceDesk(Participant& participant, const Services& names, ServiceContext context);

 private:
  ServiceContext context_;
  GetStaticMap static_map_;
  ServiceServer<stillmap_msgs::srv::GetStaticMap_Request, stillmap_msgs::srv::GetStaticMap_Response>
      get_static_map_;
  ServiceServer<stillmap_msgs::srv::GetTileVersions_Request,
                stillmap_msgs::srv::GetTileVersions_Response>
      get_tile_versions_;
  ServiceServer<stillmap_msgs::srv::GetTiles_Request, stillmap_msgs::srv::GetTiles_Response>
      get_tiles_;
  ServiceServer<stillmap_msgs::srv::GetStatus_Request, stillmap_msgs::srv::GetStatus_Response>
      get_status_;
  ServiceServer<stillmap_msgs::srv::SaveMap_Request, stillmap_msgs::srv::SaveMap_Response>
      save_map_;
  ServiceServer<stillmap_msgs::srv::LoadMap_Request, stillmap_msgs::srv::LoadMap_Response>
      load_map_;
  ServiceServer<stillmap_msgs::srv::Reset_Request, stillmap_msgs::srv::Reset_Response> reset_;
  ServiceServer<stillmap_msgs::srv::GetTraversableArea_Request,
                stillmap_msgs::srv::GetTraversableArea_Response>
      get_traversable_area_;
  ServiceServer<stillmap_msgs::srv::CheckPath_Request, stillmap_msgs::srv::CheckPath_Response>
      check_path_;
  ServiceServer<stillmap_msgs::srv::NearestTraversable_Request,
                stillmap_msgs::srv::NearestTraversable_Response>
      nearest_traversable_;
  ServiceServer<nav_msgs::srv::GetMap_Request, nav_msgs::srv::GetMap_Response> get_map_;
};

}  // namespace stillmap
