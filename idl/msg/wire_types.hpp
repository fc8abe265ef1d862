#pragma once

// Declares the generated types. For their fields, include the generated header ("sensor_msgs.h").

namespace sensor_msgs::msg {
class Imu;
class NavSatFix;
class PointCloud2;
}  // namespace sensor_msgs::msg
namespace std_msgs::msg {
class Header;
}
namespace geometry_msgs::msg {
class Pose;
class PoseWithCovarianceStamped;
}  // namespace geometry_msgs::msg
namespace nav_msgs::msg {
class OccupancyGrid;
class Odometry;
class Path;
}  // namespace nav_msgs::msg
namespace octomap_msgs::msg {
class Octomap;
}
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
class SubmapList;
class Voxels;
}  // namespace stillmap_msgs::msg
