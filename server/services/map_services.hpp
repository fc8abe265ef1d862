#pragma once

#include "idl/dds/service_server.hpp"
#include "idl/interface/topics.hpp"
#include "server/services/get_static_map.hpp"
#include "server/services/service_context.hpp"
#include "stillmap_msgs.h"
#include "traversable_area.h"

namespace stillmap::server {

/// Everything that can be asked of the server, each service on its own thread, so that a large
/// answer keeps nobody else waiting.
class MapServices {
 public:
  MapServices(dds::Participant& participant, const dds::Services& names, ServiceContext context);

 private:
  ServiceContext context_;
  GetStaticMap static_map_;
  dds::ServiceServer<stillmap_msgs::srv::GetStaticMap_Request,
                     stillmap_msgs::srv::GetStaticMap_Response>
      get_static_map_;
  dds::ServiceServer<stillmap_msgs::srv::GetTileVersions_Request,
                     stillmap_msgs::srv::GetTileVersions_Response>
      get_tile_versions_;
  dds::ServiceServer<stillmap_msgs::srv::GetTiles_Request, stillmap_msgs::srv::GetTiles_Response>
      get_tiles_;
  dds::ServiceServer<stillmap_msgs::srv::GetStatus_Request, stillmap_msgs::srv::GetStatus_Response>
      get_status_;
  dds::ServiceServer<stillmap_msgs::srv::SaveMap_Request, stillmap_msgs::srv::SaveMap_Response>
      save_map_;
  dds::ServiceServer<stillmap_msgs::srv::LoadMap_Request, stillmap_msgs::srv::LoadMap_Response>
      load_map_;
  dds::ServiceServer<stillmap_msgs::srv::Reset_Request, stillmap_msgs::srv::Reset_Response> reset_;
  dds::ServiceServer<stillmap_msgs::srv::GetTraversableArea_Request,
                     stillmap_msgs::srv::GetTraversableArea_Response>
      get_traversable_area_;
  dds::ServiceServer<stillmap_msgs::srv::CheckPath_Request, stillmap_msgs::srv::CheckPath_Response>
      check_path_;
  dds::ServiceServer<stillmap_msgs::srv::NearestTraversable_Request,
                     stillmap_msgs::srv::NearestTraversable_Response>
      nearest_traversable_;
  dds::ServiceServer<nav_msgs::srv::GetMap_Request, nav_msgs::srv::GetMap_Response> get_map_;
};

}  // namespace stillmap::server
