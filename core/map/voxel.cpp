#include "core/map/voxel.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

std::uint16_t steps_of(float weight) {
  return static_cast<std::uint16_t>(std::lround(weight / ClassEvidence::weight_step));
}

const ClassEvidence::Vote& strongest_of(
    const std::array<ClassEvidence::Vote, ClassEvidence::candidates>& votes) {
  return *std::ranges::max_element(votes, [](const auto& a, const auto& b) {
    return a.weight != b.weight ? a.weight < b.weight : a.label > b.label;
  });
}

}  // namespace

void ClassEvidence::set_label(std::size_t i, SemanticClass label) {
  const int shift = class_bits * static_cast<int>(i);
  bits_.classes = static_cast<std::uint16_t>((bits_.classes & ~(class_mask << shift)) |
                                             static_cast<int>(label) << shift);
}

void ClassEvidence::add_steps(SemanticClass added, std::uint32_t steps) {
  std::size_t vote = 0;
  while (vote < candidates && label(vote) != added) ++vote;
  if (vote == candidates) {
    // Space-saving algorithm: a new class inherits the weight of the one that it replaces, so that
    // a recurring class is not shut out by earlier ones.
    vote =
        static_cast<std::size_t>(std::ranges::min_element(bits_.weights) - bits_.weights.begin());
    set_label(vote, added);
  }
  bits_.weights[vote] = static_cast<std::uint16_t>(bits_.weights[vote] + steps);
}

void ClassEvidence::add(SemanticClass added, float weight) {
  const std::uint32_t steps = steps_of_vote(weight);
  if (added == SemanticClass::unlabeled || steps == 0) return;
  add_steps(added, steps);
  if (total() > max_steps) scale_down();
}

bool ClassEvidence::add_at_once(SemanticClass added, std::uint32_t steps) {
  if (added == SemanticClass::unlabeled || steps == 0) return true;
  if (total() + steps > max_steps) return false;
  add_steps(added, steps);
  return true;
}

void ClassEvidence::scale_down() {
  const std::uint32_t all = total();
  if (all <= max_steps) return;
  const float scale = static_cast<float>(max_steps) / static_cast<float>(all);
  for (std::uint16_t& kept : bits_.weights) {
    kept = static_cast<std::uint16_t>(static_cast<float>(kept) * scale + 0.5F);
  }
}

std::array<ClassEvidence::Vote, ClassEvidence::candidates> ClassEvidence::votes() const {
  std::array<Vote, candidates> votes;
  for (std::size_t i = 0; i < candidates; ++i) {
    votes.at(i) = {label(i), static_cast<float>(bits_.weights.at(i)) * weight_step};
  }
  return votes;
}

ClassEvidence ClassEvidence::of(const std::array<Vote, candidates>& votes) {
  ClassEvidence evidence;
  const Vote& best = strongest_of(votes);
  std::size_t winner = 0;
  for (std::size_t i = 0; i < candidates; ++i) {
    const Vote& vote = votes.at(i);
    evidence.set_label(i, vote.label);
    const int least = vote.weight > 0.0F ? 1 : 0;
    evidence.bits_.weights.at(i) = static_cast<std::uint16_t>(
        std::max<int>(least, steps_of(std::min(vote.weight, max_total))));
    if (&vote == &best) winner = i;
  }
  evidence.scale_down();
  // Rounding may have made another one as strong.
  if (best.weight > 0.0F && evidence.strongest() != winner) {
    evidence.bits_.weights.at(winner) =
        static_cast<std::uint16_t>(evidence.bits_.weights.at(evidence.strongest()) + 1);
  }
  return evidence;
}

}  // namespace stillmap
