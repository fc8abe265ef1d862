#include "core/lidar/shared_trajectory.hpp"

#include <algorithm>

namespace stillmap {

SharedTrajectory::SharedTrajectory(std::initializer_list<StampedPose> poses) {
  for (const StampedPose& pose : poses) push_back(pose);
}

SharedTrajectory::SharedTrajectory(const Trajectory& poses) {
  for (const StampedPose& pose : poses) push_back(pose);
}

void SharedTrajectory::push_back(const StampedPose& pose) {
  tail_.push_back(pose);
  if (tail_.size() < piece_poses) return;
  pieces_.push_back(std::make_shared<const Trajectory>(tail_));
  tail_.clear();
}

void SharedTrajectory::truncate(std::size_t count) {
  if (count >= size()) return;
  const std::size_t whole = count / piece_poses;
  if (whole < pieces_.size()) {
    tail_ = *pieces_[whole];
    pieces_.resize(whole);
  }
  tail_.resize(count - whole * piece_poses);
}

const StampedPose& SharedTrajectory::operator[](std::size_t position) const {
  const std::size_t piece = position / piece_poses;
  return piece < pieces_.size() ? (*pieces_[piece])[position % piece_poses]
                                : tail_[position - pieces_.size() * piece_poses];
}

std::size_t SharedTrajectory::lower_bound(std::int64_t stamp_ns) const {
  return static_cast<std::size_t>(
      std::ranges::lower_bound(*this, stamp_ns, {}, &StampedPose::stamp_ns) - begin());
}

std::size_t SharedTrajectory::common_poses(const SharedTrajectory& a, const SharedTrajectory& b) {
  const auto is_same = [](const StampedPose& p, const StampedPose& q) {
    return p.stamp_ns == q.stamp_ns && p.T_map_lidar.matrix() == q.T_map_lidar.matrix();
  };
  std::size_t piece = 0;
  const std::size_t pieces = std::min(a.pieces_.size(), b.pieces_.size());
  while (piece < pieces && a.pieces_[piece] == b.pieces_[piece]) ++piece;
  std::size_t common = piece * piece_poses;
  const std::size_t size = std::min(a.size(), b.size());
  while (common < size && is_same(a[common], b[common])) ++common;
  return common;
}

Trajectory SharedTrajectory::to_vector() const { return {begin(), end()}; }

}  // namespace stillmap
