// Follows the robot and asks for the map round it: what a planner does, in 30 lines.
#include <chrono>
#include <cstdio>
#include <mutex>
#include <thread>

#include "clients/library/client.hpp"
#include "idl/dds/ros_domain.hpp"

int main() try {
  stillmap::ClientOptions options;  // server "stillmap"
  options.dds.domain_id = stillmap::dds::ros_domain_id();
  stillmap::Client client(options);
  client.wait_for_server(std::chrono::seconds(10));

  std::mutex mutex;
  stillmap::StampedPose newest;
  const auto poses = client.subscribe_odometry([&](const stillmap::OdometryUpdate& update) {
    const std::scoped_lock lock(mutex);
    newest = update.pose;
  });

  for (int second = 0; second < 10; ++second) {
    std::this_thread::sleep_for(std::chrono::seconds(1));
    stillmap::MapQuery query;
    {
      const std::scoped_lock lock(mutex);
      const Eigen::Vector3d robot_map = newest.T_map_lidar.translation();
      query.region = stillmap::SphereRegion{.centre_map = robot_map, .radius_m = 25.0};
    }
    const auto answer = client.get_whole_static_map(query);
    std::printf("map version %lu: %zu voxels within 25 m\n", answer.map_version,
                answer.voxels.size());
  }
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
