#include "idl/dds/bounded_type_support.hpp"
#include "idl/dds/type_support.hpp"
#include "nav_msgsPubSubTypes.h"
#include "traversable_areaPubSubTypes.h"

namespace stillmap::dds {
namespace {

using eprosima::fastdds::dds::TypeSupport;

}  // namespace

template <>
TypeSupport type_support<nav_msgs::msg::OccupancyGrid>() {
  return make_bounded_type_support<nav_msgs::msg::OccupancyGridPubSubType>();
}
template <>
TypeSupport type_support<nav_msgs::srv::GetMap_Request>() {
  return make_bounded_type_support<nav_msgs::srv::GetMap_RequestPubSubType>();
}
template <>
TypeSupport type_support<nav_msgs::srv::GetMap_Response>() {
  return make_bounded_type_support<nav_msgs::srv::GetMap_ResponsePubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::GetTraversableArea_Request>() {
  return make_bounded_type_support<stillmap_msgs::srv::GetTraversableArea_RequestPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::GetTraversableArea_Response>() {
  return make_bounded_type_support<stillmap_msgs::srv::GetTraversableArea_ResponsePubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::CheckPath_Request>() {
  return make_bounded_type_support<stillmap_msgs::srv::CheckPath_RequestPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::CheckPath_Response>() {
  return make_bounded_type_support<stillmap_msgs::srv::CheckPath_ResponsePubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::NearestTraversable_Request>() {
  return make_bounded_type_support<stillmap_msgs::srv::NearestTraversable_RequestPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::NearestTraversable_Response>() {
  return make_bounded_type_support<stillmap_msgs::srv::NearestTraversable_ResponsePubSubType>();
}

}  // namespace stillmap::dds
