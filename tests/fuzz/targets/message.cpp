// A number that says which message, then what comes over DDS: what the server reads beside scans
// and requests, and all that a client reads.

#include <type_traits>
#include <utility>
#include <variant>

#include "idl/conversions/gnss.hpp"
#include "idl/conversions/imu.hpp"
#include "idl/conversions/localization.hpp"
#include "idl/conversions/map_query.hpp"
#include "idl/conversions/occupancy.hpp"
#include "idl/conversions/path_query.hpp"
#include "idl/conversions/pose.hpp"
#include "idl/conversions/removed_voxels.hpp"
#include "idl/conversions/status.hpp"
#include "idl/conversions/submaps.hpp"
#include "idl/conversions/tile.hpp"
#include "idl/conversions/traversability.hpp"
#include "idl/dds/ros_nodes.hpp"
#include "idl/interface/services.hpp"
#include "idl/interface/topics.hpp"
#include "initial_pose.h"
#include "rmw_dds_common.h"
#include "rmw_dds_common_iron.h"
#include "submaps.h"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/cdr.hpp"
#include "tests/fuzz/invariant.hpp"
#include "tests/fuzz/street_map.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace message_inputs {
namespace {

using namespace stillmap_msgs::srv;

template <typename Message, typename Read>
void read_as(Bytes bytes, const Read& read) {
  if (const auto message = from_cdr<Message>(bytes)) read(*message);
}

template <typename Response>
void read_response(Bytes bytes) {
  read_as<Response>(bytes, [](const Response& response) {
    if constexpr (requires { wire::from_response(response); })
      static_cast<void>(wire::from_response(response));
  });
}

/// A number that says which service, then its reply.
void read_reply(Bytes bytes) {
  ByteSource source(bytes);
  std::size_t service = source.byte();
  dds::for_each_service([&]<typename Spec>(const Spec&) {
    if (service-- == 0) read_response<typename Spec::Reply>(source.rest());
  });
}

void read_odometry(Bytes bytes) {
  read_as<nav_msgs::msg::Odometry>(bytes, [](const auto& message) {
    const auto odometry = wire::from_odometry(message);
    require(!odometry || odometry->pose.T_map_lidar.matrix().allFinite(), "a pose is finite");
  });
}

void read_path(Bytes bytes) {
  read_as<nav_msgs::msg::Path>(
      bytes, [](const auto& message) { static_cast<void>(wire::from_path(message)); });
}

void read_tile(Bytes bytes) {
  read_as<stillmap_msgs::msg::MapTile>(bytes, [](const auto& message) {
    const auto tile = wire::from_wire(message);
    require(!tile || tile->voxels.size() == message.voxels().x().size(), "voxels are all there");
  });
}

void read_tile_info(Bytes bytes) {
  read_as<stillmap_msgs::msg::TileInfo>(
      bytes, [](const auto& message) { static_cast<void>(wire::from_wire(message)); });
}

void read_status(Bytes bytes) {
  read_as<stillmap_msgs::msg::Status>(
      bytes, [](const auto& message) { static_cast<void>(wire::from_wire(message)); });
}

void read_tf(Bytes bytes) {
  read_as<tf2_msgs::msg::TFMessage>(bytes, [](const auto& message) {
    FrameTree tree;
    for (const FrameTransform& transform : wire::from_tf(message)) {
      static_cast<void>(tree.set(transform));
      const auto T = tree.find(transform.parent, transform.child);
      require(!T || !T->matrix().hasNaN(), "a chain of transforms is a number");
    }
  });
}

void read_imu(Bytes bytes) {
  read_as<sensor_msgs::msg::Imu>(bytes, [](const auto& message) {
    const auto sample = wire::from_imu(message);
    require(!sample || sample->angular_velocity_imu.allFinite(), "a rate of turn is finite");
  });
}

void read_gnss(Bytes bytes) {
  read_as<sensor_msgs::msg::NavSatFix>(bytes, [](const auto& message) {
    const wire::ReceivedFix received = wire::from_nav_sat_fix(message);
    require(!received.fix || fault_of(*received.fix).empty(), "a fix can be used");
  });
}

/// What anybody with RViz2 may say.
void read_initial_pose(Bytes bytes) {
  read_as<geometry_msgs::msg::PoseWithCovarianceStamped>(bytes, [](const auto& message) {
    const wire::InitialPose initial = wire::from_message(message);
    require(initial.guess.has_value() == initial.fault.empty(), "a pose, or what is wrong with it");
    if (!initial.guess) return;
    require(initial.guess->T_map_base.matrix().allFinite(), "a pose is finite");
    require(initial.guess->radius_m > 0.0 && initial.guess->radius_m <= 50.0,
            "a pose is looked for near it");
  });
}

void read_submaps(Bytes bytes) {
  read_as<stillmap_msgs::msg::SubmapList>(bytes, [](const auto& message) {
    const auto submaps = wire::from_wire(message);
    if (!submaps) return;
    for (const SubmapList::Entry& entry : submaps->list.submaps)
      require(entry.T_map_submap.matrix().allFinite(), "a pose is finite");
    for (const SubmapList::Loop& loop : submaps->list.loops)
      require(loop.to < submaps->list.submaps.size(), "a loop joins submaps");
  });
}

/// What any ROS 2 process of the domain announces.
void read_ros_nodes(Bytes bytes) {
  for (const std::string& name : dds::ros_node_names(bytes_of(bytes))) {
    require(name.find('/') != std::string::npos, "a node's name has its namespace");
  }
}

constexpr std::array<void (*)(Bytes), 19> readers = {
    read_odometry,
    read_path,
    read_tile,
    read_tile_info,
    read_status,
    read_response<GetStaticMap_Response>,
    read_response<GetTraversableArea_Response>,
    read_response<CheckPath_Response>,
    read_response<NearestTraversable_Response>,
    read_response<QueryOccupancy_Response>,
    read_response<GetRemoved_Response>,
    read_tf,
    read_reply,
    read_imu,
    read_ros_nodes,
    read_response<Localize_Response>,
    read_initial_pose,
    read_gnss,
    read_submaps,
};

void run(Bytes bytes) {
  ByteSource source(bytes);
  const std::size_t kind = source.byte() % readers.size();
  readers.at(kind)(source.rest());
}

RemovedVoxel removed_voxel() {
  return {Eigen::Vector3f(1, 2, 3), SemanticClass::car, RemovalReason::semi_static, 99};
}

/// Two, and a loop between them.
SubmapsOfMap two_submaps() {
  SubmapsOfMap submaps{.map_id = 7, .frame = "map", .child_frame = "base_link", .list = {}};
  submaps.list.submaps.resize(2);
  submaps.list.loops.push_back({.from = 0, .to = 1});
  return submaps;
}

template <typename Info>
std::string announcement_of_a_node() {
  using Nodes = std::remove_cvref_t<decltype(std::declval<Info&>().node_entities_info_seq())>;
  typename Nodes::value_type node;
  node.node_namespace("/robot");
  node.node_name("rviz2");
  Info info;
  info.node_entities_info_seq().push_back(node);
  return to_cdr(info);
}

std::vector<Seed> seeds() {
  const MapSnapshot view = small_street().view;
  const dds::MapIdentity identity = wire::identity_of(view);
  const StampedPose pose{1'500'000'000, Eigen::Isometry3d::Identity()};
  MapQuery query;
  query.max_bytes = 250;
  GetRemoved_Response removed;
  wire::write_removed({removed_voxel()}, removed);
  QueryOccupancy_Response occupancy;
  wire::write_answers({0.2, {PointOccupancy{}}, {BoxOccupancy{}}, {RayOccupancy{}}}, occupancy);
  Localize_Response localized;
  wire::write_answer({}, localized);
  geometry_msgs::msg::PoseWithCovarianceStamped initial_pose;
  initial_pose.header().frame_id("map");
  initial_pose.pose().pose().orientation().w(1.0);
  Tile tile = *view.tiles.front();
  tile.voxels = tile.voxels.first(4);
  dds::ServerStatus status;
  status.counters.push_back({"scans_mapped", "", 3});
  return {
      {"odometry", with_choice(0, to_cdr(wire::to_odometry(
                                      pose, Eigen::Matrix<double, 6, 6>::Identity(), "map", "l")))},
      {"tf", with_choice(11, to_cdr(wire::to_tf(1, {{"base_link", "mast", pose.T_map_lidar},
                                                    {"mast", "lidar", pose.T_map_lidar}})))},
      {"path", with_choice(1, to_cdr(wire::to_path({pose, pose}, "map")))},
      {"tile", with_choice(2, to_cdr(wire::to_wire(tile, identity)))},
      {"tile_info", with_choice(3, to_cdr(wire::to_wire(tile.info, identity)))},
      {"status", with_choice(4, to_cdr(wire::to_wire(status)))},
      {"static_map", with_choice(5, to_cdr(wire::to_response(query_map(view, query))))},
      {"area", with_choice(6, to_cdr(wire::to_response(TraversabilityAnswer{})))},
      {"path_check", with_choice(7, to_cdr(wire::to_response(PathCheck{}, 7)))},
      {"nearest", with_choice(8, to_cdr(wire::to_response(NearestTraversable{}, 7)))},
      {"occupancy", with_choice(9, to_cdr(occupancy))},
      {"removed", with_choice(10, to_cdr(removed))},
      {"imu", with_choice(13, to_cdr(wire::to_imu({.stamp_ns = 7}, "imu")))},
      {"gnss", with_choice(17, to_cdr(wire::to_nav_sat_fix({.latitude_deg = 49.0}, "gnss")))},
      {"submaps", with_choice(18, to_cdr(wire::to_wire(two_submaps())))},
      {"localize", with_choice(15, to_cdr(localized))},
      {"initial_pose", with_choice(16, to_cdr(initial_pose))},
      {"ros_nodes",
       with_choice(14, announcement_of_a_node<rmw_dds_common::msg::ParticipantEntitiesInfo>())},
      {"ros_nodes_iron",
       with_choice(14,
                   announcement_of_a_node<rmw_dds_common_iron::msg::ParticipantEntitiesInfo>())},
  };
}

}  // namespace
}  // namespace message_inputs

const Target message_target{"message", message_inputs::run, message_inputs::seeds};

}  // namespace stillmap::fuzz
