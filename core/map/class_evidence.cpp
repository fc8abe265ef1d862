#include <algorithm>
#include <cmath>

#include "core/map/tile.hpp"

namespace stillmap {
namespace {

float total_weight(const ClassEvidence& evidence) {
  float total = 0.0F;
  for (const auto& vote : evidence.votes) total += vote.weight;
  return total;
}

/// The strongest vote; of equals that of the lower class, so that history does not decide.
const ClassEvidence::Vote& strongest(const ClassEvidence& evidence) {
  return *std::ranges::max_element(evidence.votes, [](const auto& a, const auto& b) {
    return a.weight != b.weight ? a.weight < b.weight : a.label > b.label;
  });
}

}  // namespace

void ClassEvidence::add(SemanticClass label, float weight) {
  if (label == SemanticClass::unlabeled || !(weight > 0.0F)) return;
  const auto known = std::ranges::find(votes, label, &Vote::label);
  Vote& vote = known != votes.end() ? *known : *std::ranges::min_element(votes, {}, &Vote::weight);
  // Space-saving: a newcomer inherits the weight of the one it drives out, so that a class that
  // keeps coming is never shut out by classes that came first.
  vote.label = label;
  vote.weight += std::min(weight, 1.0F);

  const float total = total_weight(*this);
  if (total <= max_total) return;
  for (Vote& kept : votes) kept.weight *= max_total / total;
}

SemanticClass ClassEvidence::winner() const {
  const Vote& best = strongest(*this);
  return best.weight > 0.0F ? best.label : SemanticClass::unlabeled;
}

float ClassEvidence::share() const {
  const float total = total_weight(*this);
  return total > 0.0F ? strongest(*this).weight / total : 0.0F;
}

}  // namespace stillmap
