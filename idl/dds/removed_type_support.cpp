#include "idl/dds/bounded_type_support.hpp"
#include "idl/dds/type_support.hpp"
#include "removed_voxelsPubSubTypes.h"

namespace stillmap::dds {
namespace {

using eprosima::fastdds::dds::TypeSupport;

}  // namespace

template <>
TypeSupport type_support<stillmap_msgs::srv::GetRemoved_Request>() {
  return make_bounded_type_support<stillmap_msgs::srv::GetRemoved_RequestPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::GetRemoved_Response>() {
  return make_bounded_type_support<stillmap_msgs::srv::GetRemoved_ResponsePubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::RestoreRemoved_Request>() {
  return make_bounded_type_support<stillmap_msgs::srv::RestoreRemoved_RequestPubSubType>();
}
template <>
TypeSupport type_support<stillmap_msgs::srv::RestoreRemoved_Response>() {
  return make_bounded_type_support<stillmap_msgs::srv::RestoreRemoved_ResponsePubSubType>();
}

}  // namespace stillmap::dds
