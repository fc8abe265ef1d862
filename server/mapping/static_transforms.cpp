#include "server/mapping/static_transforms.hpp"

#include "idl/conversions/pose.hpp"
#include "server/monitoring/shown_name.hpp"

namespace stillmap::server {
namespace {

// A robot of many links has hundreds; a log line shows some.
constexpr std::size_t max_frames_shown = 20;

}  // namespace

StaticTransforms::StaticTransforms(dds::Participant& participant, const dds::Topics& topics,
                                   Statistics& statistics)
    : statistics_(statistics),
      unreadable_("tf_static", "tf_static_unreadable", statistics),
      reader_(participant, topics.tf_static.dds_name, topics.tf_static.reader),
      worker_(
          "tf_static", std::chrono::seconds(0),
          [this, message = tf2_msgs::msg::TFMessage()](const std::stop_token& stop) mutable {
            eprosima::fastdds::dds::SampleInfo info;
            const bool came = reader_.take(message, info, stop, std::chrono::seconds(1));
            unreadable_.report(reader_);
            // Our own are of the map, and tell nothing of the robot.
            if (came && info.sample_identity.writer_guid().guidPrefix != reader_.guid().guidPrefix)
              take(message);
          }) {}

void StaticTransforms::take(const tf2_msgs::msg::TFMessage& message) {
  const std::vector<FrameTransform> transforms = wire::from_tf(message);
  std::size_t unusable = message.transforms().size() - transforms.size();
  {
    const std::scoped_lock lock(mutex_);
    for (const FrameTransform& transform : transforms) unusable += tree_.set(transform) ? 0 : 1;
    changed_.notify_all();
  }
  if (unusable == 0) return;
  statistics_.count("tf_static_unusable");
  throttled_log_.warn("tf_static", "a message on /tf_static has " + std::to_string(unusable) +
                                       " transforms that cannot be used: not finite, longer "
                                       "than a robot, without names, or of a frame to its own "
                                       "ancestor");
}

std::optional<Eigen::Isometry3d> StaticTransforms::find(const std::string& target,
                                                        const std::string& source) const {
  const std::scoped_lock lock(mutex_);
  return tree_.find(target, source);
}

std::optional<Eigen::Isometry3d> StaticTransforms::wait_for(
    const std::string& target, const std::string& source,
    std::chrono::duration<double> timeout) const {
  std::unique_lock lock(mutex_);
  std::optional<Eigen::Isometry3d> found;
  changed_.wait_for(lock, timeout, [&] {
    found = tree_.find(target, source);
    return found.has_value();
  });
  return found;
}

std::string StaticTransforms::known_frames() const {
  const std::scoped_lock lock(mutex_);
  const std::vector<std::string> frames = tree_.frames();
  std::string text = frames.empty() ? "none" : "";
  for (std::size_t i = 0; i < frames.size() && i < max_frames_shown; ++i) {
    text += (i > 0 ? ", " : "") + shown_name(frames[i]);
  }
  return frames.size() > max_frames_shown ? text + ", ..." : text;
}

}  // namespace stillmap::server
