#include "core/segmentation/drive_votes.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace stillmap {
namespace {

/// Votes are whole numbers, so that those of a scan can be taken back and leave nothing behind. So
/// much is the vote of a point of confidence 1.
constexpr float full_vote = 1023.0F;

using CellSteps = std::array<std::array<int, 3>, 6>;
constexpr CellSteps beside{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};

std::uint64_t key_at(const Eigen::Array3d& cell) {
  return packed_index(static_cast<std::int64_t>(cell.x()), static_cast<std::int64_t>(cell.y()),
                      static_cast<std::int64_t>(cell.z()));
}

}  // namespace

std::string DriveVoteConfig::faults() const {
  std::string faults;
  const auto demand = [&faults](bool is_met, const char* fault) {
    if (!is_met) faults += fault;
  };
  demand(edge_m > 0.0 && std::isfinite(edge_m), "edge_m must be above 0\n");
  demand(height_m > 0.0 && std::isfinite(height_m), "height_m must be above 0\n");
  demand(neighbour_weight >= 0.0 && neighbour_weight <= 1.0, "neighbour_weight must be 0..1\n");
  return faults;
}

DriveVotes::DriveVotes(const DriveVoteConfig& config) : config_(config) {
  if (const std::string faults = config.faults(); !faults.empty())
    throw std::invalid_argument(faults);
}

void DriveVotes::add(std::span<const Eigen::Vector3f> points_lidar, PointLabels labels,
                     const std::optional<Eigen::Isometry3d>& T_map_lidar) {
  assert(labels.empty() || labels.classes.size() == points_lidar.size());
  if (!T_map_lidar) {
    finish();
    done_.push_back(std::move(labels));
    return;
  }
  const Eigen::Array3d per_m(1.0 / config_.edge_m, 1.0 / config_.edge_m, 1.0 / config_.height_m);
  VotingScan scan{.labels = std::move(labels), .votes_for = {}, .weights = {}, .voxels = {}};
  scan.votes_for = scan.labels.classes;
  scan.weights.resize(scan.votes_for.size());
  scan.voxels.resize(scan.votes_for.size(), none);
  std::uint64_t last_key = 0;
  std::uint32_t last_voxel = none;
  for (std::size_t i = 0; i < scan.votes_for.size(); ++i) {
    if (scan.votes_for[i] == SemanticClass::unlabeled || !points_lidar[i].allFinite()) continue;
    const Eigen::Vector3d point_map = *T_map_lidar * points_lidar[i].cast<double>();
    const std::uint64_t key = key_at((point_map.array() * per_m).floor());
    if (last_voxel == none || key != last_key) last_voxel = voxel_at(last_key = key);
    const float confidence = std::clamp(scan.labels.confidence[i], 0.0F, 1.0F);
    scan.voxels[i] = last_voxel;
    scan.weights[i] = static_cast<std::uint16_t>(std::lround(full_vote * confidence * confidence));
    Voxel& voxel = voxels_[last_voxel];
    ++voxel.points;
    voxel.votes[static_cast<std::size_t>(scan.votes_for[i])] += scan.weights[i];
  }
  window_.push_back(std::move(scan));
  if (window_.size() > next_ + config_.scans_each_way) decide_next();
}

void DriveVotes::finish() {
  while (next_ < window_.size()) decide_next();
  window_.clear();
  next_ = 0;
  voxels_by_key_.clear();
  voxels_.clear();
  free_.clear();
}

std::optional<PointLabels> DriveVotes::take() {
  if (done_.empty()) return std::nullopt;
  PointLabels oldest = std::move(done_.front());
  done_.pop_front();
  return oldest;
}

std::uint32_t DriveVotes::voxel_at(std::uint64_t key) {
  const auto [entry, is_new] = voxels_by_key_.try_emplace(key, 0U);
  if (!is_new) return entry->second;
  if (free_.empty()) {
    free_.push_back(static_cast<std::uint32_t>(voxels_.size()));
    voxels_.emplace_back();
  }
  entry.value() = free_.back();
  free_.pop_back();
  voxels_[entry->second] = Voxel{};
  voxels_[entry->second].key = key;
  return entry->second;
}

void DriveVotes::remove_oldest() {
  const VotingScan& scan = window_.front();
  for (std::size_t i = 0; i < scan.voxels.size(); ++i) {
    if (scan.voxels[i] == none) continue;
    Voxel& voxel = voxels_[scan.voxels[i]];
    voxel.votes[static_cast<std::size_t>(scan.votes_for[i])] -= scan.weights[i];
    if (--voxel.points > 0) continue;
    voxels_by_key_.erase(voxel.key);
    free_.push_back(scan.voxels[i]);
  }
  window_.pop_front();
}

void DriveVotes::decide_next() {
  if (next_ > config_.scans_each_way) {
    remove_oldest();
    --next_;
  }
  VotingScan& scan = window_[next_++];
  ++decided_scans_;
  PointLabels labels = std::move(scan.labels);
  // Where no other one votes, it has voted in voxels of its own before.
  const auto votes = [](const VotingScan& other) { return !other.voxels.empty(); };
  if (std::ranges::count_if(window_, votes) < 2) {
    done_.push_back(std::move(labels));
    return;
  }
  for (std::size_t i = 0; i < scan.voxels.size(); ++i) {
    if (scan.voxels[i] == none) continue;
    Voxel& voxel = voxels_[scan.voxels[i]];
    if (voxel.decided_for != decided_scans_) decide(voxel);
    if ((voxel.winners >> static_cast<unsigned>(labels.classes[i]) & 1U) != 0) continue;
    labels.classes[i] = static_cast<SemanticClass>(std::countr_zero(voxel.winners));
    labels.confidence[i] = voxel.share;
  }
  done_.push_back(std::move(labels));
}

void DriveVotes::decide(Voxel& voxel) const {
  std::array<float, semantic_class_count> votes{};
  const auto count = [&votes](const Voxel& other, float weight) {
    for (std::size_t k = 0; k < votes.size(); ++k)
      votes[k] += weight * static_cast<float>(other.votes[k]);
  };
  count(voxel, 1.0F);
  const auto [x, y, z] = unpacked_index(voxel.key);
  for (const auto& [right, ahead, up] : beside) {
    const auto other = voxels_by_key_.find(packed_index(x + right, y + ahead, z + up));
    if (other != voxels_by_key_.end())
      count(voxels_[other->second], static_cast<float>(config_.neighbour_weight));
  }
  float all = 0.0F, most = 0.0F;
  for (std::size_t k = 1; k < votes.size(); ++k) {
    all += votes[k];
    most = std::max(most, votes[k]);
  }
  voxel.decided_for = decided_scans_;
  voxel.winners = 0;
  for (std::size_t k = 1; k < votes.size(); ++k) voxel.winners |= (votes[k] == most ? 1U : 0U) << k;
  voxel.share = all > 0.0F ? most / all : 0.0F;
}

}  // namespace stillmap
