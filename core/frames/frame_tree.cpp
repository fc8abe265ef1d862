#include "core/frames/frame_tree.hpp"

#include <set>

namespace stillmap {
namespace {

std::string without_slash(const std::string& frame) {
  return frame.starts_with('/') ? frame.substr(1) : frame;
}

}  // namespace

bool FrameTree::set(const FrameTransform& transform) {
  const std::string above = without_slash(transform.parent);
  const std::string below = without_slash(transform.child);
  const Eigen::Isometry3d& T = transform.T_parent_child;
  const bool is_usable = T.matrix().allFinite() && T.translation().norm() <= max_length_m;
  if (above.empty() || below.empty() || !is_usable) return false;
  for (auto frame = above;;) {
    if (frame == below) return false;
    const auto link = link_of_child_.find(frame);
    if (link == link_of_child_.end()) break;
    frame = link->second.parent;
  }
  if (link_of_child_.size() >= max_frames && !link_of_child_.contains(below)) return false;
  link_of_child_.insert_or_assign(below, Link{above, transform.T_parent_child});
  return true;
}

FrameTree::Root FrameTree::root_of(const std::string& frame) const {
  Root root{.frame = frame};
  for (auto link = link_of_child_.find(frame); link != link_of_child_.end();
       link = link_of_child_.find(root.frame)) {
    root.T_root_frame = link->second.T_parent_child * root.T_root_frame;
    root.frame = link->second.parent;
  }
  return root;
}

std::optional<Eigen::Isometry3d> FrameTree::find(const std::string& target,
                                                 const std::string& source) const {
  const Root of_target = root_of(without_slash(target));
  const Root of_source = root_of(without_slash(source));
  if (of_target.frame != of_source.frame) return std::nullopt;
  return of_target.T_root_frame.inverse() * of_source.T_root_frame;
}

std::vector<std::string> FrameTree::frames() const {
  std::set<std::string> names;
  for (const auto& [child, link] : link_of_child_) {
    names.insert(child);
    names.insert(link.parent);
  }
  return {names.begin(), names.end()};
}

}  // namespace stillmap
