#include "idl/conversions/occupancy.hpp"

#include <algorithm>

#include "idl/conversions/header.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::wire {
namespace {

using stillmap_msgs::msg::Coordinates;
using stillmap_msgs::srv::QueryOccupancy_Request;
using stillmap_msgs::srv::QueryOccupancy_Response;

namespace point_codes = stillmap_msgs::msg::OccupancyAtPoint_Constants;
namespace end_codes = stillmap_msgs::msg::OccupancyAlongRay_Constants;
static_assert(static_cast<std::uint8_t>(Occupancy::unknown) == point_codes::UNKNOWN &&
              static_cast<std::uint8_t>(Occupancy::free) == point_codes::FREE &&
              static_cast<std::uint8_t>(Occupancy::occupied) == point_codes::OCCUPIED);
static_assert(end_codes::UNKNOWN == point_codes::UNKNOWN && end_codes::FREE == point_codes::FREE &&
              end_codes::OCCUPIED == point_codes::OCCUPIED);

Coordinates to_wire(const Eigen::Vector3d& value) {
  Coordinates message;
  message.x(value.x());
  message.y(value.y());
  message.z(value.z());
  return message;
}

Eigen::Vector3d from_wire(const Coordinates& message) {
  return {message.x(), message.y(), message.z()};
}

stillmap_msgs::msg::OccupancyBox to_wire(const Eigen::AlignedBox3d& box_map) {
  stillmap_msgs::msg::OccupancyBox message;
  message.min(to_wire(box_map.min()));
  message.max(to_wire(box_map.max()));
  return message;
}

stillmap_msgs::msg::OccupancyRay to_wire(const RayQuery& ray) {
  stillmap_msgs::msg::OccupancyRay message;
  message.origin(to_wire(ray.origin_map));
  message.direction(to_wire(ray.direction_map));
  message.max_range_m(ray.max_range_m);
  message.ignore_unknown(ray.ignore_unknown);
  return message;
}

RayQuery from_wire(const stillmap_msgs::msg::OccupancyRay& message) {
  return {.origin_map = from_wire(message.origin()),
          .direction_map = from_wire(message.direction()),
          .max_range_m = message.max_range_m(),
          .ignore_unknown = message.ignore_unknown()};
}

stillmap_msgs::msg::OccupancyAtPoint to_wire(const PointOccupancy& point) {
  stillmap_msgs::msg::OccupancyAtPoint message;
  message.occupancy(static_cast<std::uint8_t>(point.occupancy));
  message.probability(point.probability);
  message.fault(point.fault);
  return message;
}

stillmap_msgs::msg::OccupancyInBox to_wire(const BoxOccupancy& box) {
  stillmap_msgs::msg::OccupancyInBox message;
  message.occupied(box.occupied);
  message.free(box.free);
  message.unknown(box.unknown);
  for (const Eigen::Vector3f& voxel_map : box.occupied_map) {
    message.x().push_back(voxel_map.x());
    message.y().push_back(voxel_map.y());
    message.z().push_back(voxel_map.z());
  }
  message.fault(box.fault);
  return message;
}

BoxOccupancy from_wire(const stillmap_msgs::msg::OccupancyInBox& message) {
  BoxOccupancy box{.occupied = message.occupied(),
                   .free = message.free(),
                   .unknown = message.unknown(),
                   .occupied_map = {},
                   .fault = message.fault()};
  for (std::size_t i = 0; i < message.x().size(); ++i) {
    box.occupied_map.emplace_back(message.x()[i], message.y()[i], message.z()[i]);
  }
  return box;
}

stillmap_msgs::msg::OccupancyAlongRay to_wire(const RayOccupancy& ray) {
  stillmap_msgs::msg::OccupancyAlongRay message;
  message.end(static_cast<std::uint8_t>(ray.end));
  message.end_point(to_wire(ray.end_map));
  message.length_m(ray.length_m);
  message.fault(ray.fault);
  return message;
}

bool is_known(std::uint8_t occupancy) {
  return occupancy <= static_cast<std::uint8_t>(Occupancy::occupied);
}

bool makes_sense(const QueryOccupancy_Response& response) {
  return std::ranges::all_of(response.points(),
                             [](const auto& point) { return is_known(point.occupancy()); }) &&
         std::ranges::all_of(response.rays(),
                             [](const auto& ray) { return is_known(ray.end()); }) &&
         std::ranges::all_of(response.boxes(), [](const auto& box) {
           return box.y().size() == box.x().size() && box.z().size() == box.x().size();
         });
}

}  // namespace

QueryOccupancy_Request to_request(const OccupancyQuery& query) {
  QueryOccupancy_Request request;
  request.format_version(dds::wire_format_version);
  for (const auto& p_map : query.points_map) request.points().push_back(to_wire(p_map));
  for (const auto& box_map : query.boxes_map) request.boxes().push_back(to_wire(box_map));
  for (const RayQuery& ray : query.rays) request.rays().push_back(to_wire(ray));
  request.max_voxels(query.max_voxels);
  return request;
}

OccupancyQuery from_request(const QueryOccupancy_Request& request) {
  OccupancyQuery query;
  for (const auto& point : request.points()) query.points_map.push_back(from_wire(point));
  for (const auto& box : request.boxes()) {
    // Unchanged: a box with min above max is answered with a fault.
    Eigen::AlignedBox3d& box_map = query.boxes_map.emplace_back();
    box_map.min() = from_wire(box.min());
    box_map.max() = from_wire(box.max());
  }
  for (const auto& ray : request.rays()) query.rays.push_back(from_wire(ray));
  query.max_voxels = request.max_voxels();
  return query;
}

void write_answers(const OccupancyAnswers& answers, QueryOccupancy_Response& response) {
  response.resolution_m(answers.resolution_m);
  for (const PointOccupancy& point : answers.points) response.points().push_back(to_wire(point));
  for (const BoxOccupancy& box : answers.boxes) response.boxes().push_back(to_wire(box));
  for (const RayOccupancy& ray : answers.rays) response.rays().push_back(to_wire(ray));
}

std::optional<OccupancyAnswers> from_response(const QueryOccupancy_Response& response) {
  if (!makes_sense(response)) return std::nullopt;
  OccupancyAnswers answers{
      .resolution_m = response.resolution_m(), .points = {}, .boxes = {}, .rays = {}};
  for (const auto& point : response.points()) {
    answers.points.push_back({.occupancy = static_cast<Occupancy>(point.occupancy()),
                              .probability = point.probability(),
                              .fault = point.fault()});
  }
  for (const auto& box : response.boxes()) answers.boxes.push_back(from_wire(box));
  for (const auto& ray : response.rays()) {
    answers.rays.push_back({.end = static_cast<Occupancy>(ray.end()),
                            .end_map = from_wire(ray.end_point()),
                            .length_m = ray.length_m(),
                            .fault = ray.fault()});
  }
  return answers;
}

octomap_msgs::msg::Octomap to_octomap(const OctomapData& data, std::int64_t stamp_ns,
                                      const std::string& map_frame) {
  octomap_msgs::msg::Octomap message;
  message.header(to_header(stamp_ns, map_frame));
  message.binary(data.encoding == OctomapEncoding::binary);
  message.id(OctomapData::tree_id);
  message.resolution(data.resolution_m);
  message.data().assign(data.bytes.begin(), data.bytes.end());
  return message;
}

std::optional<OctomapData> from_octomap(const octomap_msgs::msg::Octomap& message) {
  if (message.id() != OctomapData::tree_id || !(message.resolution() > 0.0)) return std::nullopt;
  return OctomapData{.encoding = message.binary() ? OctomapEncoding::binary : OctomapEncoding::full,
                     .resolution_m = message.resolution(),
                     .bytes = {message.data().begin(), message.data().end()}};
}

}  // namespace stillmap::wire
