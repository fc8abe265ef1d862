#include "server/localization/initial_pose_receiver.hpp"

#include <spdlog/spdlog.h>

#include <utility>

#include "core/lidar/angle_units.hpp"
#include "idl/conversions/localization.hpp"
#include "idl/interface/topics.hpp"
#include "server/monitoring/shown_name.hpp"

namespace stillmap::server {

using geometry_msgs::msg::PoseWithCovarianceStamped;

InitialPoseReceiver::InitialPoseReceiver(dds::Participant& participant,
                                         const std::string& ros_topic, std::string map_frame,
                                         PlaceFinder& finder, Statistics& statistics)
    : map_frame_(std::move(map_frame)),
      finder_(finder),
      statistics_(statistics),
      unreadable_(ros_topic, "initial_pose_unreadable", statistics),
      reader_(participant, dds::initial_pose_topic(ros_topic).dds_name,
              dds::initial_pose_topic(ros_topic).reader),
      worker_("initial_pose", std::chrono::seconds(0),
              [this, message = PoseWithCovarianceStamped()](const std::stop_token& stop) mutable {
                const bool came = reader_.take(message, stop, std::chrono::seconds(1));
                unreadable_.report(reader_);
                if (came) take(message);
              }) {}

void InitialPoseReceiver::take(const PoseWithCovarianceStamped& message) {
  const wire::InitialPose initial = wire::from_message(message);
  if (!initial.guess) return refuse(initial.fault);
  if (initial.frame != map_frame_) {
    return refuse("it is in the frame '" + shown_name(initial.frame) +
                  "' (header.frame_id), and the map's is '" + map_frame_ +
                  "'; set it as the fixed frame of RViz2");
  }
  const Eigen::Vector3d p = initial.guess->T_map_base.translation();
  spdlog::info(
      "a pose was given: looking for the robot within {:.1f} m of {:.2f} {:.2f}, turned by "
      "up to {:.0f} degrees",
      initial.guess->radius_m, p.x(), p.y(), initial.guess->max_turn_rad * deg_per_rad);
  statistics_.count("initial_poses");
  finder_.look_near(*initial.guess);
}

void InitialPoseReceiver::refuse(const std::string& why) {
  statistics_.count("initial_poses_refused");
  throttled_log_.warn("initial_pose", "the pose that was given is refused: " + why);
}

}  // namespace stillmap::server
