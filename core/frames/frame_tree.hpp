#pragma once

#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace stillmap {

/// p_parent = T_parent_child * p_child.
struct FrameTransform {
  std::string parent;
  std::string child;
  Eigen::Isometry3d T_parent_child = Eigen::Isometry3d::Identity();
};

/// Fixed transforms between named frames, as a robot publishes them on /tf_static. A leading '/' of
/// a name does not count.
class FrameTree {
 public:
  /// Replaces what was known of the child. False, and nothing changes, for a transform that is not
  /// finite or longer than any robot, a frame without a name, one that would be its own ancestor,
  /// or more frames than any robot has.
  bool set(const FrameTransform& transform);

  /// T_target_source; nothing when the two do not hang together.
  [[nodiscard]] std::optional<Eigen::Isometry3d> find(const std::string& target,
                                                      const std::string& source) const;

  /// All frames, in alphabetical order.
  [[nodiscard]] std::vector<std::string> frames() const;

 private:
  static constexpr std::size_t max_frames = 10'000;
  static constexpr double max_length_m = 1000.0;

  struct Link {
    std::string parent;
    Eigen::Isometry3d T_parent_child;
  };
  struct Root {
    std::string frame;
    Eigen::Isometry3d T_root_frame = Eigen::Isometry3d::Identity();
  };
  [[nodiscard]] Root root_of(const std::string& frame) const;

  std::map<std::string, Link> link_of_child_;
};

}  // namespace stillmap
