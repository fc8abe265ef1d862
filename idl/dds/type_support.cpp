#include "idl/dds/type_support.hpp"

#include "idl/dds/bounded_type_support.hpp"
#include "idl/dds/dynamic_type.hpp"
#include "nav_msgsPubSubTypes.h"
#include "octomap_msgsPubSubTypes.h"
#include "rmw_dds_commonPubSubTypes.h"
#include "rmw_dds_common_ironPubSubTypes.h"
#include "sensor_msgsPubSubTypes.h"
#include "stillmap_msgsPubSubTypes.h"
#include "stillmap_occupancyPubSubTypes.h"
#include "tf2_msgsPubSubTypes.h"
#include "tile_indexPubSubTypes.h"

namespace stillmap::dds {
namespace {

using eprosima::fastdds::dds::TypeSupport;

}  // namespace

template <>
TypeSupport type_support<sensor_msgs::msg::PointCloud2>() {
  return make_bounded_type_support<sensor_msgs::msg::PointCloud2PubSubType>();
}
template <>
TypeSupport type_support<nav_msgs::msg::Odometry>() {
  return make_bounded_type_support<nav_msgs::msg::OdometryPubSubType>();
}
template <>
TypeSupport type_support<nav_msgs::msg::Path>() {
  return make_bounded_type_support<nav_msgs::msg::PathPubSubType>();
}
template <>
TypeSupport type_support<tf2_msgs::msg::TFMessage>() {
  return make_bounded_type_support<tf2_msgs::msg::TFMessagePubSubType>();
}
template <>
TypeSupport type_support<rmw_dds_common::msg::ParticipantEntitiesInfo>() {
  return make_bounded_type_support<rmw_dds_common::msg::ParticipantEntitiesInfoPubSubType>();
}
template <>
TypeSupport type_support<rmw_dds_common_iron::msg::ParticipantEntitiesInfo>() {
  TypeSupport type =
      make_bounded_type_support<rmw_dds_common_iron::msg::ParticipantEntitiesInfoPubSubType>();
  // Two layouts of one ROS 2 type: on the wire both have its name.
  type->setName("rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_");
  return type;
}
template <>
TypeSupport type_support<stillmap_msgs::msg::TileInfo>() {
  TypeSupport type = make_bounded_type_support<stillmap_msgs::msg::TileInfoPubSubType>();
  register_tile_info_type(type);
  return type;
}
template <>
TypeSupport type_support<stillmap_msgs::msg::MapTile>() {
  return make_bounded_type_support<stillmap_msgs::msg::MapTilePubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::msg::Status>() {
  return make_bounded_type_support<stillmap_msgs::msg::StatusPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::GetStaticMap_Request>() {
  return make_bounded_type_support<stillmap_msgs::srv::GetStaticMap_RequestPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::GetStaticMap_Response>() {
  return make_bounded_type_support<stillmap_msgs::srv::GetStaticMap_ResponsePubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::GetTileVersions_Request>() {
  return make_bounded_type_support<stillmap_msgs::srv::GetTileVersions_RequestPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::GetTileVersions_Response>() {
  return make_bounded_type_support<stillmap_msgs::srv::GetTileVersions_ResponsePubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::GetTiles_Request>() {
  return make_bounded_type_support<stillmap_msgs::srv::GetTiles_RequestPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::GetTiles_Response>() {
  return make_bounded_type_support<stillmap_msgs::srv::GetTiles_ResponsePubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::GetStatus_Request>() {
  return make_bounded_type_support<stillmap_msgs::srv::GetStatus_RequestPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::GetStatus_Response>() {
  return make_bounded_type_support<stillmap_msgs::srv::GetStatus_ResponsePubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::SaveMap_Request>() {
  return make_bounded_type_support<stillmap_msgs::srv::SaveMap_RequestPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::SaveMap_Response>() {
  return make_bounded_type_support<stillmap_msgs::srv::SaveMap_ResponsePubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::LoadMap_Request>() {
  return make_bounded_type_support<stillmap_msgs::srv::LoadMap_RequestPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::LoadMap_Response>() {
  return make_bounded_type_support<stillmap_msgs::srv::LoadMap_ResponsePubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::Reset_Request>() {
  return make_bounded_type_support<stillmap_msgs::srv::Reset_RequestPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::Reset_Response>() {
  return make_bounded_type_support<stillmap_msgs::srv::Reset_ResponsePubSubType>();
}
template <>
TypeSupport type_support<octomap_msgs::msg::Octomap>() {
  return make_bounded_type_support<octomap_msgs::msg::OctomapPubSubType>();
}
template <>
TypeSupport type_support<octomap_msgs::srv::GetOctomap_Request>() {
  return make_bounded_type_support<octomap_msgs::srv::GetOctomap_RequestPubSubType>();
}
template <>
TypeSupport type_support<octomap_msgs::srv::GetOctomap_Response>() {
  return make_bounded_type_support<octomap_msgs::srv::GetOctomap_ResponsePubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::QueryOccupancy_Request>() {
  return make_bounded_type_support<stillmap_msgs::srv::QueryOccupancy_RequestPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::QueryOccupancy_Response>() {
  return make_bounded_type_support<stillmap_msgs::srv::QueryOccupancy_ResponsePubSubType>();
}

}  // namespace stillmap::dds
