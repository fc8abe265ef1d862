#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <vector>

#include "core/lidar/trajectory.hpp"

namespace stillmap {

/// A trajectory in pieces that copies share: a copy costs a pointer for some hundred poses, and
/// poses are in memory once, however many copies there are. Sorted by stamp where poses are added
/// so.
class SharedTrajectory {
 public:
  class Iterator;
  using const_iterator = Iterator;
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
  [[nodiscard]] Iterator begin() const;
  [[nodiscard]] Iterator end() const;
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

class SharedTrajectory::Iterator {
 public:
  using iterator_category = std::random_access_iterator_tag;
  using value_type = StampedPose;
  using difference_type = std::ptrdiff_t;
  using pointer = const StampedPose*;
  using reference = const StampedPose&;

  Iterator() = default;
  Iterator(const SharedTrajectory* poses, std::size_t position)
      : poses_(poses), position_(static_cast<difference_type>(position)) {}
  [[nodiscard]] reference operator*() const { return (*this)[0]; }
  [[nodiscard]] pointer operator->() const { return &**this; }
  [[nodiscard]] reference operator[](difference_type n) const {
    return (*poses_)[static_cast<std::size_t>(position_ + n)];
  }
  Iterator& operator+=(difference_type n) {
    position_ += n;
    return *this;
  }
  Iterator& operator-=(difference_type n) { return *this += -n; }
  Iterator& operator++() { return *this += 1; }
  Iterator& operator--() { return *this -= 1; }
  Iterator operator++(int) {
    const Iterator before = *this;
    ++*this;
    return before;
  }
  Iterator operator--(int) {
    const Iterator before = *this;
    --*this;
    return before;
  }
  friend Iterator operator+(Iterator it, difference_type n) { return it += n; }
  friend Iterator operator+(difference_type n, Iterator it) { return it += n; }
  friend Iterator operator-(Iterator it, difference_type n) { return it -= n; }
  friend difference_type operator-(const Iterator& a, const Iterator& b) {
    return a.position_ - b.position_;
  }
  friend bool operator==(const Iterator& a, const Iterator& b) {
    return a.position_ == b.position_;
  }
  friend auto operator<=>(const Iterator& a, const Iterator& b) {
    return a.position_ <=> b.position_;
  }

 private:
  const SharedTrajectory* poses_ = nullptr;
  difference_type position_ = 0;
};

inline SharedTrajectory::Iterator SharedTrajectory::begin() const { return {this, 0}; }
inline SharedTrajectory::Iterator SharedTrajectory::end() const { return {this, size()}; }

}  // namespace stillmap
