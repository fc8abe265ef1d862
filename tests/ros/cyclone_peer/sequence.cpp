#include <cmath>
#include <cstring>
#include <map>
#include <set>

#include "tests/ros/cyclone_peer/commands.hpp"
#include "tests/ros/cyclone_peer/endpoints.hpp"
#include "tests/ros/cyclone_peer/lidar.hpp"
#include "tests/ros/cyclone_peer/report.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::peer {
namespace {

using namespace std::chrono_literals;
using Cloud = sensor_msgs_msg_dds__PointCloud2_;
using Odometry = nav_msgs_msg_dds__Odometry_;
using Transforms = tf2_msgs_msg_dds__TFMessage_;
using Stamp = builtin_interfaces_msg_dds__Time_;

constexpr auto scan_period = 100ms;
constexpr auto discovery_timeout = 60s * test::slowdown;

struct Position {
  double x = 0.0, y = 0.0, z = 0.0;
  friend bool operator==(const Position&, const Position&) = default;
};

std::int64_t nanoseconds(const Stamp& stamp) {
  return stamp.sec * std::int64_t{1'000'000'000} + stamp.nanosec;
}

/// What came of poses.
struct Poses {
  std::map<std::int64_t, Position> by_stamp;
  std::string frame, child_frame;

  [[nodiscard]] double length_m() const {
    double length = 0.0;
    const Position* last = nullptr;
    for (const auto& [stamp, position] : by_stamp) {
      if (last)
        length += std::hypot(position.x - last->x, position.y - last->y, position.z - last->z);
      last = &position;
    }
    return length;
  }

  void print(const std::string& topic) const {
    Line(topic)
        .add("samples", by_stamp.size())
        .add("frame_id", frame)
        .add("child_frame_id", child_frame)
        .add("driven_m", length_m());
  }
};

void add(Poses& poses, const Odometry& odometry) {
  const auto& position = odometry.pose.pose.position;
  poses.by_stamp[nanoseconds(odometry.header.stamp)] = {position.x, position.y, position.z};
  poses.frame = odometry.header.frame_id;
  poses.child_frame = odometry.child_frame_id;
}

void add(Poses& poses, const Transforms& message) {
  for (const auto& transform : elements(message.transforms)) {
    const auto& position = transform.transform.translation;
    poses.by_stamp[nanoseconds(transform.header.stamp)] = {position.x, position.y, position.z};
    poses.frame = transform.header.frame_id;
    poses.child_frame = transform.child_frame_id;
  }
}

/// What came of labelled scans.
struct Scans {
  int samples = 0;
  std::uint32_t points = 0;
  std::string fields;
  std::set<std::uint32_t> colours;

  void print(const std::string& topic) const {
    Line(topic)
        .add("samples", samples)
        .add("points", points)
        .add("fields", fields)
        .add("colours", colours.size());
  }
};

void add(Scans& scans, const Cloud& cloud) {
  ++scans.samples;
  scans.points = cloud.width * cloud.height;
  scans.fields.clear();
  for (const auto& field : elements(cloud.fields)) {
    if (!scans.fields.empty()) scans.fields += ',';
    scans.fields += field.name;
    if (std::string(field.name) != "rgb") continue;
    for (std::size_t at = field.offset; at + 4 <= cloud.data._length; at += cloud.point_step) {
      std::uint32_t colour = 0;
      std::memcpy(&colour, cloud.data._buffer + at, sizeof colour);
      scans.colours.insert(colour);
    }
  }
}

/// What the server sends while it maps, taken as rviz2 and tf2_ros ask for it.
class Listener {
 public:
  Listener(const Participant& participant, const std::string& server)
      : prefix_("rt/" + server + "/"),
        odometry_(participant, prefix_ + "odometry", {.depth = 1000}),
        tf_(participant, "rt/tf", {.depth = 100}),
        scan_(participant, prefix_ + "scan", {.depth = 5}) {}

  [[nodiscard]] bool is_matched() const {
    return odometry_.is_matched() && tf_.is_matched() && scan_.is_matched();
  }

  void take() {
    odometry_.take([this](const Odometry& sample) { add(from_odometry_, sample); });
    tf_.take([this](const Transforms& sample) { add(from_tf_, sample); });
    scan_.take([this](const Cloud& sample) { add(scans_, sample); });
  }

  [[nodiscard]] bool has_poses(std::size_t count) const {
    return from_odometry_.by_stamp.size() >= count && from_tf_.by_stamp.size() >= count;
  }

  void print() const {
    from_odometry_.print(prefix_ + "odometry");
    from_tf_.print("rt/tf");
    Line("tf").add("is_odometry", from_tf_.by_stamp == from_odometry_.by_stamp);
    scans_.print(prefix_ + "scan");
  }

 private:
  std::string prefix_;
  Reader<Odometry> odometry_;
  Reader<Transforms> tf_;
  Reader<Cloud> scan_;
  Poses from_odometry_, from_tf_;
  Scans scans_;
};

void publish_all(Lidar& lidar, Listener& listener) {
  auto next = std::chrono::steady_clock::now();
  for (std::size_t scan = 0; scan < lidar.scans(); ++scan) {
    lidar.publish(scan);
    next += scan_period;
    while (std::chrono::steady_clock::now() < next) {
      listener.take();
      std::this_thread::sleep_for(5ms);
    }
  }
}

}  // namespace

int play_sequence(const ServerAddress& address, const std::filesystem::path& recording) {
  const Participant participant(address.domain_id);
  Lidar lidar(participant, recording);
  Listener listener(participant, address.server);
  if (!wait_until([&] { return lidar.is_matched() && listener.is_matched(); }, discovery_timeout)) {
    throw std::runtime_error("no server found");
  }
  publish_all(lidar, listener);
  const auto is_complete = [&] {
    listener.take();
    return listener.has_poses(lidar.scans());
  };
  const bool has_all = wait_until(is_complete, discovery_timeout);
  Line("rt/points").add("published", lidar.scans());
  listener.print();
  return has_all ? 0 : 1;
}

}  // namespace stillmap::peer
