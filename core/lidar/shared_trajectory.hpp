#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <vector>

#include "core/lidar/indexed_iterator.hpp"
#include "core/lidar/trajectory.hpp"

namespace stillmap {

/// A trajectory in pieces that copies share: a copy costs a pointer for some hundred poses, and
/// poses are in memory once, however many copies there are. Sorted by stamp where poses are added
/// so.
class SharedTrajectory {
 public:
  using const_iterator = IndexedIterator<SharedTrajectory>;
  using value_type = StampedPose;
  static constexpr std::size_t piece_poses = 256;

  SharedTrajectory() = default;
  SharedTrajectory(std::initializer_list<StampedPose> poses);
  // Implicit: a trajectory is one, in other memory.
  SharedTrajectory(const Trajectory& poses);

  void push_back(const StampedPose& pose);
  /// Keeps the first `count` poses.
  void truncate(std::size_t count);

  [[nodiscard]] std::size_t size() const { return pieces_.size() * piece_poses + tail_.size(); }
  [[nodiscard]] bool empty() const { return size() == 0; }
  [[nodiscard]] const StampedPose& operator[](std::size_t position) const;
  [[nodiscard]] const StampedPose& front() const { return (*this)[0]; }
  [[nodiscard]] const StampedPose& back() const { return (*this)[size() - 1]; }
  [[nodiscard]] const_iterator begin() const { return {this, 0}; }
  [[nodiscard]] const_iterator end() const { return {this, size()}; }
  /// Position of the first pose whose stamp is not less.
  [[nodiscard]] std::size_t lower_bound(std::int64_t stamp_ns) const;

  /// Number of equal poses at the beginning of both; pieces that both share are not looked at.
  [[nodiscard]] static std::size_t common_poses(const SharedTrajectory& a,
                                                const SharedTrajectory& b);
  [[nodiscard]] Trajectory to_vector() const;

 private:
  using Piece = std::shared_ptr<const std::vector<StampedPose>>;

  /// Of `piece_poses` each.
  std::vector<Piece> pieces_;
  Trajectory tail_;
};

}  // namespace stillmap
