#pragma once

// Declares the generated types. For their fields, include the generated header ("sensor_msgs.h").

namespace sensor_msgs::msg {
class PointCloud2;
}
namespace std_msgs::msg {
class Header;
}
namespace geometry_msgs::msg {
class Pose;
}
namespace nav_msgs::msg {
class OccupancyGrid;
class Odometry;
class Path;
}  // namespace nav_msgs::msg
namespace nav_msgs::srv {
class GetMap_Request;
class GetMap_Response;
}  // namespace nav_msgs::srv
namespace octomap_msgs {
namespace msg {
class Octomap;
}
namespace srv {
class GetOctomap_Request;
class GetOctomap_Response;
}  // namespace srv
}  // namespace octomap_msgs
namespace rmw_dds_common_iron::msg {
class ParticipantEntitiesInfo;
}
namespace tf2_msgs::msg {
class TFMessage;
}
namespace stillmap_msgs::msg {
class TileInfo;
class Region;
class TileChange;
class MapTile;
class MapIdentity;
class Status;
class Voxels;
}  // namespace stillmap_msgs::msg
namespace stillmap_msgs::srv {
class GetStaticMap_Request;
class GetStaticMap_Response;
class GetTileVersions_Request;
class GetTileVersions_Response;
class GetTiles_Request;
class GetTiles_Response;
class GetStatus_Request;
class GetStatus_Response;
class SaveMap_Request;
class SaveMap_Response;
class LoadMap_Request;
class LoadMap_Response;
class Reset_Request;
class Reset_Response;
class GetRemoved_Request;
class GetRemoved_Response;
class RestoreRemoved_Request;
class RestoreRemoved_Response;
class QueryOccupancy_Request;
class QueryOccupancy_Response;
class GetTraversableArea_Request;
class GetTraversableArea_Response;
class CheckPath_Request;
class CheckPath_Response;
class NearestTraversable_Request;
class NearestTraversable_Response;
}  // namespace stillmap_msgs::srv
