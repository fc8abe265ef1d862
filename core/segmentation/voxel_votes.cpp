#include "core/segmentation/voxel_votes.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <sstream>
#include <vector>

namespace stillmap {
namespace {

/// A voxel's number: x, y and z from the highest bit down, so that the three voxels of a column
/// follow each other, and the columns around all voxels are met in ascending order, too.
using VoxelNumber = std::uint64_t;
constexpr unsigned z_bits = 12;
constexpr unsigned horizontal_bits = 13;
constexpr unsigned voxel_bits = 2 * horizontal_bits + z_bits;

constexpr VoxelNumber y_step = VoxelNumber{1} << z_bits;
constexpr VoxelNumber x_step = y_step << horizontal_bits;

/// A voxel and a point in it, in one word that can be sorted.
using VoxelAndPoint = std::uint64_t;
constexpr unsigned point_bits = 64 - voxel_bits;
constexpr std::uint64_t point_mask = (std::uint64_t{1} << point_bits) - 1;

/// Sets `number`; false where the voxel, or one around it, would have none.
bool find_voxel(const Eigen::Vector3f& scaled, VoxelNumber& number) {
  const auto coordinate = [](float value, unsigned bits, VoxelNumber& found) {
    const auto half = static_cast<float>(1U << (bits - 1));
    const float cell = std::floor(value) + half;
    if (!(cell >= 1.0F && cell <= 2.0F * half - 2.0F)) return false;
    found = static_cast<VoxelNumber>(cell);
    return true;
  };
  VoxelNumber x = 0;
  VoxelNumber y = 0;
  VoxelNumber z = 0;
  if (!(coordinate(scaled.x(), horizontal_bits, x) && coordinate(scaled.y(), horizontal_bits, y) &&
        coordinate(scaled.z(), z_bits, z)))
    return false;
  number = x * x_step + y * y_step + z;
  return true;
}

/// By the voxel's number, points of one voxel in their order: least significant digits first.
void sort_by_voxel(std::vector<VoxelAndPoint>& words) {
  constexpr unsigned digit_bits = 10;
  constexpr std::size_t digits = std::size_t{1} << digit_bits;
  std::vector<VoxelAndPoint> sorted(words.size());
  for (unsigned shift = point_bits; shift < 64; shift += digit_bits) {
    const auto digit = [shift](VoxelAndPoint word) { return (word >> shift) & (digits - 1); };
    std::array<std::size_t, digits> place{};
    for (const VoxelAndPoint word : words) ++place[digit(word)];
    std::exclusive_scan(place.begin(), place.end(), place.begin(), std::size_t{0});
    for (const VoxelAndPoint word : words) sorted[place[digit(word)]++] = word;
    words.swap(sorted);
  }
}

/// What turns metres into voxels.
Eigen::Array3f voxels_per_m(double edge_m, double height_m) {
  const auto per_edge = static_cast<float>(1.0 / edge_m);
  return {per_edge, per_edge, static_cast<float>(1.0 / height_m)};
}

/// Every point that has a class and a voxel, with that, in the order of the points.
std::vector<VoxelAndPoint> find_voters(std::span<const Eigen::Vector3f> points_lidar,
                                       const Eigen::Array3f& scale, const PointLabels& labels) {
  std::vector<VoxelAndPoint> voters;
  voters.reserve(points_lidar.size());
  for (std::size_t i = 0; i < points_lidar.size(); ++i) {
    VoxelNumber number = 0;
    if (labels.classes[i] != SemanticClass::unlabeled &&
        find_voxel((points_lidar[i].array() * scale).matrix(), number)) {
      voters.push_back(number << point_bits | i);
    }
  }
  return voters;
}

using VotesOfClasses = std::array<float, semantic_class_count>;

VotesOfClasses equal_weights() {
  VotesOfClasses weights;
  weights.fill(1.0F);
  return weights;
}

struct Tally {
  std::uint8_t label;
  float votes;
};

/// The voxels in which points voted, in ascending order of their numbers.
class VotingVoxels {
 public:
  VotingVoxels(const std::vector<VoxelAndPoint>& voters, const PointLabels& labels,
               const VotesOfClasses& weights) {
    VotesOfClasses votes{};
    for (std::size_t begin = 0; begin < voters.size();) {
      const VoxelNumber number = voters[begin] >> point_bits;
      begin_voxel(number, begin);
      std::uint32_t seen = 0;
      for (; begin < voters.size() && voters[begin] >> point_bits == number; ++begin) {
        const std::size_t point = voters[begin] & point_mask;
        const auto label = static_cast<std::size_t>(labels.classes[point]);
        votes[label] += labels.confidence[point];
        seen |= 1U << label;
      }
      for (; seen != 0; seen &= seen - 1) {
        const auto label = static_cast<std::uint8_t>(std::countr_zero(seen));
        tallies_.push_back({label, weights[label] * votes[label]});
        votes[label] = 0.0F;
      }
    }
    first_voter_.push_back(static_cast<std::uint32_t>(voters.size()));
    first_tally_.push_back(static_cast<std::uint32_t>(tallies_.size()));
  }

  [[nodiscard]] std::span<const VoxelNumber> numbers() const { return numbers_; }
  [[nodiscard]] std::size_t first_voter(std::size_t voxel) const { return first_voter_[voxel]; }
  [[nodiscard]] std::size_t voters(std::size_t voxel) const {
    return first_voter_[voxel + 1] - first_voter_[voxel];
  }
  /// Of each class that somebody voted for.
  [[nodiscard]] std::span<const Tally> tallies(std::size_t voxel) const {
    return std::span(tallies_).subspan(first_tally_[voxel],
                                       first_tally_[voxel + 1] - first_tally_[voxel]);
  }

 private:
  void begin_voxel(VoxelNumber number, std::size_t voter) {
    numbers_.push_back(number);
    first_voter_.push_back(static_cast<std::uint32_t>(voter));
    first_tally_.push_back(static_cast<std::uint32_t>(tallies_.size()));
  }

  std::vector<VoxelNumber> numbers_;
  /// Of each voxel, and their ends.
  std::vector<std::uint32_t> first_voter_, first_tally_;
  std::vector<Tally> tallies_;
};
static_assert(semantic_class_count <= 32, "of the bits of VotingVoxels' set of classes");

/// The weighted votes in a voxel and its neighbours.
struct VotesAround {
  VotesOfClasses of_class{};
  float all = 0.0F;
  float voters = 0.0F;

  void add(const VotingVoxels& voxels, std::size_t voxel, float weight) {
    for (const Tally& tally : voxels.tallies(voxel)) {
      of_class[tally.label] += weight * tally.votes;
      all += weight * tally.votes;
    }
    voters += weight * static_cast<float>(voxels.voters(voxel));
  }
};

/// Goes through voxels in ascending order, and through their columns and the four beside each.
class Neighbourhoods {
 public:
  Neighbourhoods(const VotingVoxels& voxels, std::size_t first, double neighbour_weight)
      : voxels_(voxels), weight_(static_cast<float>(neighbour_weight)) {
    const auto numbers = voxels.numbers();
    for (std::size_t k = 0; k < column_starts_.size(); ++k) {
      places_[k] = static_cast<std::size_t>(
          std::ranges::lower_bound(numbers, numbers[first] - column_starts_[k]) - numbers.begin());
    }
  }

  /// `voxel` is not before the one of the last call.
  VotesAround around(std::size_t voxel) {
    const auto numbers = voxels_.numbers();
    VotesAround votes;
    for (std::size_t k = 0; k < column_starts_.size(); ++k) {
      const VoxelNumber lowest = numbers[voxel] - column_starts_[k];
      std::size_t& place = places_[k];
      while (place < numbers.size() && numbers[place] < lowest) ++place;
      for (std::size_t other = place; other < numbers.size() && numbers[other] <= lowest + 2;
           ++other) {
        votes.add(voxels_, other, other == voxel ? 1.0F : weight_);
      }
    }
    return votes;
  }

 private:
  /// From the lowest of the three voxels of a column to the voxel in the middle of all; wraps.
  static constexpr std::array<VoxelNumber, 5> column_starts_{x_step + 1, y_step + 1, 1, 1 - y_step,
                                                             1 - x_step};

  const VotingVoxels& voxels_;
  float weight_;
  std::array<std::size_t, column_starts_.size()> places_{};
};

void decide(const VotesAround& votes, double own_weight, std::size_t point, PointLabels& labels) {
  const auto most = std::ranges::max_element(votes.of_class);
  const auto own = static_cast<std::size_t>(labels.classes[point]);
  const float own_votes =
      votes.of_class[own] + static_cast<float>(own_weight) * labels.confidence[point] * votes.all;
  if (!(*most > own_votes)) return;
  labels.classes[point] = static_cast<SemanticClass>(most - votes.of_class.begin());
  labels.confidence[point] = *most / votes.voters;
}

constexpr std::array small_things{SemanticClass::bicycle, SemanticClass::motorcycle,
                                  SemanticClass::person, SemanticClass::bicyclist,
                                  SemanticClass::motorcyclist};

/// Of each class: its weight, and the confidence that leaves no doubt.
struct SecondVote {
  VotesOfClasses weights = equal_weights();
  VotesOfClasses sure_from;

  explicit SecondVote(const UnsureVoteConfig& config) {
    sure_from.fill(static_cast<float>(config.unsure_below));
    for (const SemanticClass thing : small_things) {
      weights[static_cast<std::size_t>(thing)] = static_cast<float>(config.small_weight);
      sure_from[static_cast<std::size_t>(thing)] = static_cast<float>(config.unsure_small_below);
    }
  }

  [[nodiscard]] bool is_unsure(const PointLabels& labels, std::size_t point) const {
    return labels.confidence[point] < sure_from[static_cast<std::size_t>(labels.classes[point])];
  }

  void decide(const VotesAround& votes, std::size_t point, PointLabels& labels) const {
    const auto most = std::ranges::max_element(votes.of_class);
    if (!(*most > votes.of_class[static_cast<std::size_t>(labels.classes[point])])) return;
    const auto winner = static_cast<std::size_t>(most - votes.of_class.begin());
    labels.classes[point] = static_cast<SemanticClass>(winner);
    labels.confidence[point] = *most / weights[winner] / votes.voters;
  }
};

/// Columns of voxels near which somebody is unsure. Columns 256 edges apart share a mark: a
/// needless one costs time only.
class MarkedColumns {
 public:
  void mark_around(VoxelNumber number) {
    for (const VoxelNumber step : {VoxelNumber{0}, x_step, -x_step, y_step, -y_step})
      marks_[place(number + step)] = true;
  }
  [[nodiscard]] bool has(VoxelNumber number) const { return marks_[place(number)]; }

 private:
  static constexpr VoxelNumber wrap = 256;
  static std::size_t place(VoxelNumber number) {
    return number / x_step % wrap * wrap + number / y_step % wrap;
  }

  std::vector<bool> marks_ = std::vector<bool>(wrap * wrap);
};

/// Leaves those who can vote for an unsure point: sorting all takes most of the time.
void keep_around_unsure(std::vector<VoxelAndPoint>& voters, const SecondVote& second,
                        const PointLabels& labels) {
  MarkedColumns columns;
  for (const VoxelAndPoint voter : voters) {
    if (second.is_unsure(labels, voter & point_mask)) columns.mark_around(voter >> point_bits);
  }
  std::erase_if(voters, [&](VoxelAndPoint voter) { return !columns.has(voter >> point_bits); });
}

std::string not_above_zero(const char* name, double value) {
  if (value > 0.0 && std::isfinite(value)) return {};
  std::ostringstream fault;
  fault << name << " = " << value << "; must be above 0\n";
  return fault.str();
}

std::string no_share(const char* name, double value) {
  if (value >= 0.0 && value <= 1.0) return {};
  std::ostringstream fault;
  fault << name << " = " << value << "; must be 0..1\n";
  return fault.str();
}

}  // namespace

std::string VoxelVoteConfig::faults() const {
  return not_above_zero("edge_m", edge_m) + not_above_zero("height_m", height_m) +
         no_share("neighbour_weight", neighbour_weight) + no_share("own_weight", own_weight);
}

std::string UnsureVoteConfig::faults() const {
  return not_above_zero("edge_m", edge_m) + not_above_zero("height_m", height_m) +
         not_above_zero("small_weight", small_weight) +
         no_share("neighbour_weight", neighbour_weight) + no_share("unsure_below", unsure_below) +
         no_share("unsure_small_below", unsure_small_below);
}

void vote_in_voxels(std::span<const Eigen::Vector3f> points_lidar, const VoxelVoteConfig& config,
                    PointLabels& labels) {
  assert(config.faults().empty());
  assert(labels.classes.size() == points_lidar.size());
  if (points_lidar.size() > point_mask) return;
  std::vector<VoxelAndPoint> voters =
      find_voters(points_lidar, voxels_per_m(config.edge_m, config.height_m), labels);
  sort_by_voxel(voters);
  const VotingVoxels voxels(voters, labels, equal_weights());
  const tbb::blocked_range<std::size_t> all(0, voxels.numbers().size(), 2048);
  tbb::parallel_for(all, [&](const auto& some) {
    Neighbourhoods neighbourhoods(voxels, some.begin(), config.neighbour_weight);
    for (std::size_t voxel = some.begin(); voxel < some.end(); ++voxel) {
      const VotesAround votes = neighbourhoods.around(voxel);
      const std::size_t end = voxels.first_voter(voxel + 1);
      for (std::size_t voter = voxels.first_voter(voxel); voter < end; ++voter) {
        decide(votes, config.own_weight, voters[voter] & point_mask, labels);
      }
    }
  });
}

void vote_where_unsure(std::span<const Eigen::Vector3f> points_lidar,
                       const UnsureVoteConfig& config, PointLabels& labels) {
  assert(config.faults().empty());
  assert(labels.classes.size() == points_lidar.size());
  if (points_lidar.size() > point_mask) return;
  const SecondVote second(config);
  std::vector<VoxelAndPoint> voters =
      find_voters(points_lidar, voxels_per_m(config.edge_m, config.height_m), labels);
  keep_around_unsure(voters, second, labels);
  sort_by_voxel(voters);
  const VotingVoxels voxels(voters, labels, second.weights);
  const tbb::blocked_range<std::size_t> all(0, voxels.numbers().size(), 2048);
  tbb::parallel_for(all, [&](const auto& some) {
    Neighbourhoods neighbourhoods(voxels, some.begin(), config.neighbour_weight);
    std::vector<std::size_t> unsure;
    for (std::size_t voxel = some.begin(); voxel < some.end(); ++voxel) {
      unsure.clear();
      for (std::size_t k = voxels.first_voter(voxel); k < voxels.first_voter(voxel + 1); ++k) {
        const std::size_t point = voters[k] & point_mask;
        if (second.is_unsure(labels, point)) unsure.push_back(point);
      }
      if (unsure.empty()) continue;
      const VotesAround votes = neighbourhoods.around(voxel);
      for (const std::size_t point : unsure) second.decide(votes, point, labels);
    }
  });
}

}  // namespace stillmap
