#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <vector>

#include "tests/ros/cyclone_peer/commands.hpp"
#include "tests/ros/cyclone_peer/endpoints.hpp"
#include "tests/ros/cyclone_peer/report.hpp"

namespace stillmap::peer {
namespace {

using namespace std::chrono_literals;
using Cloud = sensor_msgs_msg_dds__PointCloud2_;
using Odometry = nav_msgs_msg_dds__Odometry_;
using Transforms = tf2_msgs_msg_dds__TFMessage_;
using Field = sensor_msgs_msg_dds__PointField_;
using Stamp = builtin_interfaces_msg_dds__Time_;

constexpr auto scan_period = 100ms;
constexpr auto patience = 60s;
constexpr std::size_t recorded_point_bytes = 16;
constexpr std::size_t label_bytes = 4;

std::vector<std::uint8_t> content(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw std::runtime_error("cannot read " + file.string());
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// x y z intensity of the recording, then its label, for each point.
std::vector<std::uint8_t> with_labels(const std::vector<std::uint8_t>& points,
                                      const std::vector<std::uint8_t>& labels) {
  const std::size_t count = points.size() / recorded_point_bytes;
  if (labels.size() != count * label_bytes) throw std::runtime_error("labels do not fit the scan");
  std::vector<std::uint8_t> data;
  data.reserve(points.size() + labels.size());
  for (std::size_t i = 0; i < count; ++i) {
    const auto* const point = points.data() + i * recorded_point_bytes;
    const auto* const label = labels.data() + i * label_bytes;
    data.insert(data.end(), point, point + recorded_point_bytes);
    data.insert(data.end(), label, label + label_bytes);
  }
  return data;
}

/// Publishes scans as a lidar driver of ROS 2 does.
class Lidar {
 public:
  Lidar(const Participant& participant, const std::filesystem::path& recording)
      : recording_(recording), writer_(participant, "rt/points", {.depth = 1, .keep_all = true}) {
    for (const auto& entry : std::filesystem::directory_iterator(recording / "velodyne")) {
      names_.push_back(entry.path().stem());
    }
    std::ranges::sort(names_);
  }

  [[nodiscard]] std::size_t scans() const { return names_.size(); }
  [[nodiscard]] bool is_matched() const { return writer_.is_matched(); }

  void publish(std::size_t scan) {
    std::filesystem::path points = recording_ / "velodyne" / names_[scan];
    std::filesystem::path labels = recording_ / "labels" / names_[scan];
    auto data = with_labels(content(points += ".bin"), content(labels += ".label"));
    std::array<std::string, 5> names = {"x", "y", "z", "intensity", "label"};
    std::array<Field, 5> fields{};
    for (std::uint32_t i = 0; i < fields.size(); ++i) {
      constexpr std::uint8_t float32 = 7;
      constexpr std::uint8_t uint32 = 6;
      fields[i] = {.name = names[i].data(),
                   .offset = 4 * i,
                   .datatype = i < 4 ? float32 : uint32,
                   .count = 1};
    }
    Cloud cloud{};
    std::string frame = "velodyne";
    const auto stamp_ms = static_cast<std::int32_t>(100 * scan);
    cloud.header.stamp = {.sec = 1'700'000'000 + stamp_ms / 1000,
                          .nanosec = static_cast<std::uint32_t>(stamp_ms % 1000) * 1'000'000U};
    cloud.header.frame_id = frame.data();
    cloud.height = 1;
    cloud.point_step = recorded_point_bytes + label_bytes;
    cloud.row_step = static_cast<std::uint32_t>(data.size());
    cloud.width = cloud.row_step / cloud.point_step;
    cloud.is_dense = true;
    lend(cloud.fields, fields);
    lend(cloud.data, data);
    writer_.write(cloud);
  }

 private:
  std::filesystem::path recording_;
  std::vector<std::filesystem::path> names_;
  Writer<Cloud> writer_;
};

struct Place3 {
  double x = 0.0, y = 0.0, z = 0.0;
  friend bool operator==(const Place3&, const Place3&) = default;
};

std::int64_t nanoseconds(const Stamp& stamp) {
  return stamp.sec * std::int64_t{1'000'000'000} + stamp.nanosec;
}

/// What came of poses.
struct Poses {
  std::map<std::int64_t, Place3> by_stamp;
  std::string frame, child_frame;

  [[nodiscard]] double length_m() const {
    double length = 0.0;
    const Place3* last = nullptr;
    for (const auto& [stamp, place] : by_stamp) {
      if (last) length += std::hypot(place.x - last->x, place.y - last->y, place.z - last->z);
      last = &place;
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
  const auto& place = odometry.pose.pose.position;
  poses.by_stamp[nanoseconds(odometry.header.stamp)] = {place.x, place.y, place.z};
  poses.frame = odometry.header.frame_id;
  poses.child_frame = odometry.child_frame_id;
}

void add(Poses& poses, const Transforms& message) {
  for (const auto& transform : elements(message.transforms)) {
    const auto& place = transform.transform.translation;
    poses.by_stamp[nanoseconds(transform.header.stamp)] = {place.x, place.y, place.z};
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
    scans.fields += (scans.fields.empty() ? "" : ",") + std::string(field.name);
    if (std::string(field.name) != "rgb") continue;
    for (std::size_t at = field.offset; at + 4 <= cloud.data._length; at += cloud.point_step) {
      std::uint32_t colour = 0;
      std::memcpy(&colour, cloud.data._buffer + at, sizeof colour);
      scans.colours.insert(colour);
    }
  }
}

}  // namespace

int drive(const Place& place, const std::filesystem::path& recording) {
  const Participant participant(place.domain_id);
  Lidar lidar(participant, recording);
  // As rviz2 and tf2_ros ask for them.
  Reader<Odometry> odometry(participant, "rt/" + place.server + "/odometry", {.depth = 1000});
  Reader<Transforms> tf(participant, "rt/tf", {.depth = 100});
  Reader<Cloud> scan(participant, "rt/" + place.server + "/scan", {.depth = 5});
  Poses from_odometry, from_tf;
  Scans scans;
  const auto take = [&] {
    odometry.take([&](const Odometry& sample) { add(from_odometry, sample); });
    tf.take([&](const Transforms& sample) { add(from_tf, sample); });
    scan.take([&](const Cloud& sample) { add(scans, sample); });
  };
  const bool is_found = wait_until(
      [&] {
        return lidar.is_matched() && odometry.is_matched() && tf.is_matched() && scan.is_matched();
      },
      patience);
  if (!is_found) throw std::runtime_error("no server found");
  auto next = std::chrono::steady_clock::now();
  for (std::size_t i = 0; i < lidar.scans(); ++i) {
    lidar.publish(i);
    next += scan_period;
    while (std::chrono::steady_clock::now() < next) {
      take();
      std::this_thread::sleep_for(5ms);
    }
  }
  const bool is_complete = wait_until(
      [&] {
        take();
        return from_odometry.by_stamp.size() >= lidar.scans() &&
               from_tf.by_stamp.size() >= lidar.scans();
      },
      patience);
  Line("rt/points").add("published", lidar.scans());
  from_odometry.print("rt/" + place.server + "/odometry");
  from_tf.print("rt/tf");
  Line("tf").add("is_odometry", from_tf.by_stamp == from_odometry.by_stamp);
  scans.print("rt/" + place.server + "/scan");
  return is_complete ? 0 : 1;
}

}  // namespace stillmap::peer
